#![no_main]
antumbra_fuzz::reader!(bytes: b, antumbra_io::stl::read(b, Default::default()));
