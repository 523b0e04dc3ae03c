#![no_main]
antumbra_fuzz::reader!(text: t, antumbra_io::vs3::read(t, Default::default()));
