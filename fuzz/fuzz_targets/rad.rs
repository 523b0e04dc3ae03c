#![no_main]
antumbra_fuzz::reader!(text: t, antumbra_fuzz::readers::read_rad(t));
