//! What once went wrong, found by fuzzing or by users, named after its phenomenon
//! (`fixtures/regressions`): meshed with all run-time checks, and compared with exact light.

use antumbra_tests::cases::{build, fixture, fixtures, json_files};
use antumbra_tests::check_points::compare;
use antumbra_tests::motion::Motion;
use rayon::prelude::*;

#[test]
fn what_went_wrong_once_goes_right() {
    let files = json_files(&fixtures().join("regressions"));
    assert!(!files.is_empty());
    let wrong: Vec<String> = files
        .par_iter()
        .filter_map(|path| path.file_stem())
        .flat_map_iter(|stem| {
            let name = format!("regressions/{}", stem.to_string_lossy());
            let scene = fixture(&name);
            [Motion::IDENTITY, Motion::skew()]
                .into_iter()
                .flat_map(|motion| {
                    compare(&name, &build(&motion.scene(&scene)), 1e-2, 100_000, 1_000).wrong
                })
                .collect::<Vec<_>>()
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
