//! Curves are arranged and triangulated; both keep all their promises, and the order
//! of the curves makes no difference.
#![no_main]

use antumbra_geom::Control;
use antumbra_fuzz::{Choices, adversary};
use antumbra_mesh::{MeshError, TriMesh, arrange};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let (curves, options) = adversary::curves(&mut Choices::new(bytes));
    let arrangement = arrange(&curves, &options, &Control::NEVER).unwrap_or_default();
    arrangement
        .check(&curves)
        .unwrap_or_else(|e| panic!("{e}\n{options:?}\n{curves:?}"));

    let mut others = curves.clone();
    others.reverse();
    for curve in others.iter_mut().step_by(2) {
        curve.points.reverse();
    }
    let other = arrange(&others, &options, &Control::NEVER).unwrap_or_default();
    assert_eq!(arrangement.pixels, other.pixels, "{options:?}\n{curves:?}");
    assert_eq!(arrangement.report, other.report, "{options:?}\n{curves:?}");

    match TriMesh::new(&arrangement, &curves) {
        Ok(mut mesh) => {
            let all: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
            for step in ["triangulated", "bisected"] {
                mesh.check_against(&arrangement)
                    .unwrap_or_else(|e| panic!("{step}: {e}\n{options:?}\n{curves:?}"));
                mesh.bisect(&all);
            }
        }
        // A sliver in coarse pixels, or a hole that is all there is.
        Err(MeshError::NoArea { .. }) => {}
        Err(e) => panic!("{e}\n{options:?}\n{curves:?}"),
    }
});
