//! Laws of the arrangement, on sets of curves that are made to break it.
//!
//! The sets are the same in every run;
//! `ARRANGEMENT_SEED=2 ARRANGEMENT_CASES=100000 cargo test -p antumbra-mesh --test properties`
//! looks further. A set that fails is printed reduced, as curves for a test.
#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use antumbra_geom::Control;
use std::panic::catch_unwind;

use antumbra_mesh::{Arrangement, ArrangementOptions, MeshError, TaggedCurve, TriMesh, arrange};
use common::Rng;
use common::adversary::{Case, case, reduced};

fn asked(name: &str, otherwise: u64) -> u64 {
    let asked = std::env::var(name).ok();
    asked.and_then(|n| n.parse().ok()).unwrap_or(otherwise)
}

#[test]
fn adversarial_sets_keep_all_laws() {
    let seed = asked("ARRANGEMENT_SEED", 1);
    for i in 0..asked("ARRANGEMENT_CASES", 300) {
        let mut rng = Rng::new(seed.wrapping_mul(1_000_003).wrapping_add(i));
        let case = case(&mut rng);
        let options = options(&mut rng);
        let fault = |curves: &[TaggedCurve]| -> Option<String> {
            let all = catch_unwind(|| laws(curves, &case, &options, Rng::new(i)));
            all.unwrap_or_else(|_| Err("a panic".into())).err()
        };
        if let Some(first) = fault(&case.curves) {
            // The same law, so that a set does not turn into another failure.
            let law = first.split(':').next().unwrap_or_default();
            let still = |c: &[TaggedCurve]| fault(c).is_some_and(|e| e.starts_with(law));
            let small = reduced(&case.curves, still);
            let name = &case.name;
            panic!("set {i} of seed {seed}: {name}\n{options:?}\n{first}\n{small:?}");
        }
    }
}

/// Mostly those of the program, else coarse ones, where ties and collapses are frequent.
fn options(rng: &mut Rng) -> ArrangementOptions {
    let default = ArrangementOptions::default();
    if rng.below(3) > 0 {
        return default;
    }
    ArrangementOptions {
        bits: 8 + rng.below(24) as u32,
        sub_bits: rng.below(18) as u32,
        cluster: [0.0, 1.0, 4.0, 16.0][rng.below(4)],
        weld: [2.0, 4.0, 16.0][rng.below(3)],
        ..default
    }
}

fn laws(
    curves: &[TaggedCurve],
    case: &Case,
    options: &ArrangementOptions,
    mut rng: Rng,
) -> Result<(), String> {
    let first = arrange(curves, options, &Control::NEVER).unwrap_or_default();
    first.check(curves).map_err(|e| format!("check: {e}"))?;
    order_makes_no_difference(curves, &first, options, &mut rng)?;
    scale_makes_no_difference(curves, &first, options, &mut rng)?;
    again(&first, curves, options)?;
    // Without a part of its border it bounds something else.
    if curves.starts_with(&case.curves[..case.n_rings]) {
        mesh(curves, &first, case, &mut rng)?;
    }
    Ok(())
}

/// Shuffled curves, half of them from their other end.
fn order_makes_no_difference(
    curves: &[TaggedCurve],
    first: &Arrangement,
    options: &ArrangementOptions,
    rng: &mut Rng,
) -> Result<(), String> {
    let order = rng.shuffled(curves.len());
    let shuffled: Vec<TaggedCurve> = order
        .iter()
        .map(|&i| {
            let mut c = curves[i].clone();
            if rng.below(2) == 0 {
                c.points.reverse();
            }
            c
        })
        .collect();
    let second = arrange(&shuffled, options, &Control::NEVER).unwrap_or_default();
    let edges = |a: &Arrangement, id: &dyn Fn(u32) -> u32| -> Vec<([u32; 2], Vec<u32>, bool)> {
        let named = a.edges.iter().map(|e| {
            let mut ids: Vec<u32> = a.sets.get(e.curves).iter().map(|&c| id(c)).collect();
            ids.sort_unstable();
            (e.ends, ids, e.separates)
        });
        named.collect()
    };
    let bits = |a: &Arrangement| -> Vec<[u64; 2]> {
        let vertices = a.vertices.iter();
        vertices.map(|p| p.to_array().map(f64::to_bits)).collect()
    };
    let differs = first.pixels != second.pixels
        || bits(first) != bits(&second)
        || first.report != second.report
        || edges(first, &|c| c) != edges(&second, &|c| order[c as usize] as u32);
    if differs {
        return Err("order: the order of curves or of their points makes a difference".into());
    }
    Ok(())
}

fn scale_makes_no_difference(
    curves: &[TaggedCurve],
    first: &Arrangement,
    options: &ArrangementOptions,
    rng: &mut Rng,
) -> Result<(), String> {
    let scale = 2.0_f64.powi(rng.below(81) as i32 - 40);
    let mut scaled = curves.to_vec();
    for p in scaled.iter_mut().flat_map(|c| &mut c.points) {
        *p *= scale;
    }
    let second = arrange(&scaled, options, &Control::NEVER).unwrap_or_default();
    if first.pixels != second.pixels || first.edges != second.edges {
        return Err(format!("scale: times {scale} makes a difference"));
    }
    if first.report.n_edges > 0 && first.pixel * scale != second.pixel {
        return Err(format!("scale: times {scale} has other pixels"));
    }
    Ok(())
}

/// The edges as curves keep all promises again. They need not stay as they are: an
/// edge may pass a vertex nearer than a pixel, and is then led through it.
fn again(
    first: &Arrangement,
    curves: &[TaggedCurve],
    options: &ArrangementOptions,
) -> Result<(), String> {
    let edges: Vec<TaggedCurve> = first
        .edges
        .iter()
        .map(|e| TaggedCurve {
            points: e.ends.map(|v| first.vertices[v as usize]).to_vec(),
            order: (first.sets.get(e.curves).iter())
                .map(|&c| curves[c as usize].order)
                .min()
                .unwrap(),
        })
        .collect();
    let second = arrange(&edges, options, &Control::NEVER).unwrap_or_default();
    second.check(&edges).map_err(|e| format!("again: {e}"))
}

fn mesh(
    curves: &[TaggedCurve],
    arrangement: &Arrangement,
    case: &Case,
    rng: &mut Rng,
) -> Result<(), String> {
    // Welded corners, and an edge of a needle on another.
    let allowed = case.perimeter * (arrangement.tolerance + 1.0) * arrangement.pixel;
    let mut mesh = match TriMesh::new(arrangement, curves) {
        Ok(mesh) => mesh,
        Err(MeshError::NoArea { .. }) if case.area <= allowed => return Ok(()),
        Err(e) => return Err(format!("triangulation: {e}")),
    };
    mesh.check_against(arrangement)
        .map_err(|e| format!("mesh: {e}"))?;
    let error = (mesh.total_area() - case.area).abs();
    if error > allowed {
        return Err(format!("area: {error:e} of {} is wrong", case.area));
    }
    for _ in 0..2 {
        let n = mesh.triangles.len();
        let marked: Vec<u32> = (0..1 + n / 8).map(|_| rng.below(n) as u32).collect();
        mesh.bisect(&marked);
    }
    mesh.check_against(arrangement)
        .map_err(|e| format!("bisection: {e}"))
}
