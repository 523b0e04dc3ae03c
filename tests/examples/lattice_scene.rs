//! Prints the scene of a number as `tests/tests/lattice.rs` meshes it.
//!
//! ```sh
//! cargo run -p antumbra-tests --example lattice_scene -- 27 > scene-27.json
//! ```

use antumbra::io::scene_file;
use antumbra_tests::lattice::varied_scene;

#[expect(clippy::print_stdout, reason = "the scene is printed")]
fn main() {
    let number = std::env::args().nth(1).and_then(|n| n.parse().ok());
    println!("{}", scene_file::write(&varied_scene(number.unwrap_or(0))));
}
