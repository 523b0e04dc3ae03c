#![no_main]
antumbra_fuzz::reader!(bytes: b, antumbra_fuzz::readers::read_gltf(b));
