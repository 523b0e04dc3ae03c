#![no_main]
antumbra_fuzz::reader!(text: t, antumbra_io::scene_file::read(t));
