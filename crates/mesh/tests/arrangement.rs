//! What an arrangement promises, on curves that are hard for floating point.
#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use antumbra_geom::Control;
use std::time::Instant;

use antumbra_mesh::{
    Arrangement, ArrangementOptions, MeshError, Order, TaggedCurve, TriMesh, arrange,
};
use common::{FAMILIES, Rng, curve, family, moved, outline, segment, square};
use glam::{DVec2, dvec2};

fn arranged(curves: &[TaggedCurve]) -> Arrangement {
    let arrangement =
        arrange(curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default();
    arrangement.check(curves).unwrap();
    arrangement
}

/// Arranges and triangulates, and checks both.
fn meshed(curves: &[TaggedCurve]) -> (Arrangement, TriMesh) {
    let arrangement = arranged(curves);
    let mesh = TriMesh::new(&arrangement, curves).unwrap();
    mesh.check_against(&arrangement).unwrap();
    (arrangement, mesh)
}

/// Edges by the coordinates of their ends, with curve ids mapped.
fn edges_by_ids(a: &Arrangement, map: impl Fn(u32) -> u32) -> Vec<([u32; 2], Vec<u32>, bool)> {
    let mapped = a.edges.iter().map(|e| {
        let mut ids: Vec<u32> = a.sets.get(e.curves).iter().map(|&c| map(c)).collect();
        ids.sort_unstable();
        (e.ends, ids, e.separates)
    });
    mapped.collect()
}

fn assert_order_makes_no_difference(curves: &[TaggedCurve], rng: &mut Rng) {
    let first = arranged(curves);
    let order = rng.shuffled(curves.len());
    let shuffled: Vec<TaggedCurve> = order
        .iter()
        .map(|&i| {
            let mut c = curves[i].clone();
            if i % 2 == 0 {
                c.points.reverse();
            }
            c
        })
        .collect();
    let second = arranged(&shuffled);
    assert_eq!(first.pixels, second.pixels);
    assert_eq!(first.vertices, second.vertices);
    assert_eq!(first.report, second.report);
    assert_eq!(
        edges_by_ids(&first, |c| c),
        edges_by_ids(&second, |c| order[c as usize] as u32)
    );
}

#[test]
fn every_family_is_noded_covered_and_fills_its_receiver() {
    let mut rng = Rng::new(1);
    for name in FAMILIES {
        for noise in [
            0.0, 1e-16, 1e-15, 1e-12, 1e-10, 1e-9, 3e-9, 1e-8, 3e-8, 1e-6, 1e-4,
        ] {
            for n in [3, 7, 40] {
                let curves = family(name, n, noise, &mut rng);
                let (_, mesh) = meshed(&curves);
                let error = (mesh.total_area() - 4.0).abs();
                // Points on the border keep their coordinates, pixels are 2^-27.
                assert!(error < 1e-7, "{name} {noise} {n}: area is wrong by {error}");
            }
        }
    }
}

#[test]
fn the_order_of_curves_makes_no_difference() {
    let mut rng = Rng::new(2);
    for name in FAMILIES {
        for noise in [0.0, 1e-15, 1e-9, 1e-8, 1e-5] {
            let curves = family(name, 25, noise, &mut rng);
            assert_order_makes_no_difference(&curves, &mut rng);
        }
    }
}

#[test]
fn coarse_pixels_and_ties_keep_all_promises() {
    let mut rng = Rng::new(3);
    for round in 0..300 {
        let bits = 8 + round % 5;
        let options = ArrangementOptions {
            bits,
            sub_bits: round % 7,
            ..Default::default()
        };
        let mut curves = vec![square(1.0)];
        // Ends on halves of pixels.
        let k = 1 << bits;
        let mut at = || (rng.below(2 * k + 1) as f64 - k as f64) / k as f64;
        for _ in 0..30 {
            curves.push(segment(dvec2(at(), at()), dvec2(at(), at())));
        }
        let arrangement = arrange(&curves, &options, &Control::NEVER).unwrap_or_default();
        arrangement.check(&curves).unwrap();
        let mesh = TriMesh::new(&arrangement, &curves).unwrap();
        mesh.check().unwrap();
        assert!((mesh.total_area() - 4.0).abs() < 64.0 * arrangement.pixel);
    }
}

/// Inputs on which splitting constraints in floating point panics, hangs or errs.
#[test]
fn crossings_that_break_floating_point_do_not_break_the_arrangement() {
    let cases: [&[[f64; 4]]; 5] = [
        &[
            [
                0.6437484733172719,
                -0.6328016783866734,
                0.9234466769990822,
                -0.5243170487971849,
            ],
            [
                0.811567395526358,
                -0.5677109006329804,
                0.7030827659368695,
                -0.28801269695116993,
            ],
            [
                0.840496630083555,
                -0.6422970882814631,
                0.7320120004940665,
                -0.36259888459965267,
            ],
            [
                0.7516430446177655,
                -0.48608922378277,
                0.840496630083555,
                -0.6422970882814631,
            ],
        ],
        &[
            [3., 7., 4., 1.],
            [4., 3., 5., 1.],
            [0., 2., 4., 0.],
            [3., 0., 5., 2.],
        ],
        &[
            [2., 7., 4., 0.],
            [5., 2., 0., 6.],
            [4., 0., 2., 7.],
            [6., 1., 1., 0.],
        ],
        &[
            [
                0.6664409952125787,
                0.46791059305041116,
                0.5450767807341373,
                0.2689436869760866,
            ],
            [
                0.3068551828765756,
                0.6988393617635574,
                0.7955078452183472,
                0.15906020757870998,
            ],
            [
                0.5866778441830834,
                0.3604352551604536,
                0.30685518287657554,
                0.6988393617635574,
            ],
            [
                0.6664409952125788,
                0.46791059305041116,
                0.5450767807341373,
                0.2689436869760866,
            ],
            [
                0.5004370257195868,
                0.46760142690845374,
                0.47478809586067083,
                0.39578693664512005,
            ],
            [
                0.5450767807341372,
                0.2689436869760866,
                0.3641567714167617,
                0.9117067012752326,
            ],
            [
                0.30685518287657554,
                0.6988393617635574,
                0.9562995536355307,
                0.38345221575020605,
            ],
        ],
        &[
            [98., 67., 27., 61.],
            [46., 72., 8., 78.],
            [61., 59., 8., 34.],
            [64., 31., 36., 80.],
            [19., 33., 35., 89.],
        ],
    ];
    for (case, half) in cases.iter().zip([1.0, 8.0, 8.0, 1.0, 100.0]) {
        let segments = case
            .iter()
            .map(|s| segment(dvec2(s[0], s[1]), dvec2(s[2], s[3])));
        let curves: Vec<TaggedCurve> = [square(half)].into_iter().chain(segments).collect();
        let (_, mesh) = meshed(&curves);
        assert!((mesh.total_area() - 4.0 * half * half).abs() < 1e-7 * half * half);
        assert_order_makes_no_difference(&curves, &mut Rng::new(4));
    }
}

/// Segments as reported to spade (MIT or Apache-2.0) for panics of
/// `add_constraint_and_split`, and those of its own tests for it.
/// Those of issues 124 and 130 are not published with coordinates we could find.
#[test]
fn segments_that_made_spade_panic_are_arranged() {
    const E: f64 = 18.69314193725586;
    const F: f64 = 19.589109420776367;
    const G: f64 = 19.507659912109375;
    const H: f64 = 20.40362548828125;
    const I: f64 = 17.878625869750977;
    const J: f64 = 18.774595260620117;
    const K: f64 = 20.322175979614258;
    const L: f64 = 21.218143463134766;
    const M: f64 = 15.435077667236328;
    const N: f64 = 16.331045150756836;
    let segments: [(&str, &[[f64; 4]]); 5] = [
        (
            "issue 107",
            &[
                [
                    0.9296344883099084,
                    0.03071359966930065,
                    0.26031306872107085,
                    0.34491289915959455,
                ],
                [
                    0.7384289920396423,
                    0.4981747664368982,
                    0.06543525273452533,
                    0.34139896206401854,
                ],
                [
                    0.9535295221136963,
                    0.9114305148801416,
                    0.8306091165247367,
                    0.08959389670590667,
                ],
                [
                    0.9081582053528728,
                    0.4974568601123005,
                    0.5138795569454557,
                    0.3186272217036502,
                ],
            ],
        ),
        (
            "issue 109",
            &[
                [17.064112, -17.96008, 16.249594, -17.145563],
                [-25.290726, -24.435482, -5.6608872, -24.435482],
                [17.878626, -18.774595, 15.435078, -16.331045],
                [16.331045, -21.951208, -3.29879, -24.435482],
            ],
        ),
        ("issue 111", &[[E, F, E, H], [G, H, I, J], [K, L, M, N]]),
        (
            "issue 113",
            &[
                [7.9910984, -59.344463, 15.484455, -48.762936],
                [15.484455, -48.762936, -11.673287, -28.37192],
                [-11.673287, -28.37192, -16.214716, -43.81278],
                [-16.214716, -43.81278, -3.657666, -51.41967],
                [-3.657666, -51.41967, 7.9910984, -59.344463],
                [7.4022045, -51.355137, -13.92232, -36.01863],
            ],
        ),
        (
            "issue 116",
            &[[M, N, K, L], [E, F, G, H], [G, L, G, H], [I, J, G, H]],
        ),
    ];
    // Points of polylines, which found what issue 115 is about.
    let polylines: [&[[f64; 2]]; 6] = [
        &[
            [1.0, 1.0],
            [63.137257, 87.04635],
            [1.0, 37.488983],
            [59.171143, 97.93353],
            [68.78571, 71.541046],
        ],
        &[
            [12.645211, 67.07809],
            [49.93318, 15.726259],
            [22.433575, 53.597496],
            [6.3033395, 32.111538],
            [89.09958, 1.0720834],
        ],
        &[
            [32.944817, 13.24526],
            [91.99222, 22.252642],
            [12.645211, 67.07809],
            [49.93318, 15.726259],
            [22.433575, 53.597496],
            [6.3033395, 32.111538],
            [89.09958, 1.0720834],
        ],
        &[
            [43.44877, 78.04408],
            [15.193367, 1.0],
            [1.0, 1.0],
            [1.0, 1.0],
            [41.485252, 91.78975],
            [49.090862, 1.0],
            [43.498154, 81.00147],
            [1.0, 1.0],
            [23.288902, 97.52936],
            [75.59119, 42.91933],
            [25.808325, 97.32154],
        ],
        &[
            [17.315233, 1.0],
            [36.59658, 1.0],
            [1.0, 62.270954],
            [1.0, 1.0],
            [38.64656, 24.732662],
        ],
        &[
            [57.128956, 53.16448],
            [78.60271, 71.51385],
            [94.13138, 1.0],
            [1.0, 1.0],
            [65.829636, 82.399826],
            [84.53016, 25.01849],
            [1.0, 1.0],
            [52.712097, 98.32006],
            [77.15014, 51.253986],
            [94.362755, 59.469707],
            [44.423584, 69.76751],
            [1.0, 1.0],
            [72.84374, 64.58434],
            [27.416088, 88.37326],
        ],
    ];
    let cases = segments.iter().map(|(name, segments)| {
        let lines = segments.iter();
        let lines = lines.map(|s| segment(dvec2(s[0], s[1]), dvec2(s[2], s[3])));
        (*name, lines.collect::<Vec<TaggedCurve>>())
    });
    let lines = polylines.iter().map(|points| {
        let points: Vec<DVec2> = points.iter().map(|&p| p.into()).collect();
        ("polyline", vec![curve(&points, Order::D1)])
    });
    for (name, lines) in cases.chain(lines) {
        // Also with coordinates of single precision, as most were reported.
        let mut rounded = lines.clone();
        for p in rounded.iter_mut().flat_map(|c| &mut c.points) {
            *p = p.as_vec2().as_dvec2();
        }
        for lines in [lines, rounded] {
            let curves: Vec<TaggedCurve> = [square(128.0)].into_iter().chain(lines).collect();
            let (_, mesh) = meshed(&curves);
            let error = (mesh.total_area() - 256.0 * 256.0).abs();
            assert!(error < 1e-3, "{name}: {error}");
            assert_order_makes_no_difference(&curves, &mut Rng::new(4));
        }
    }
}

/// Lines between lattice points in many directions: most crossings are of several lines.
fn box_grid(n: i32) -> Vec<TaggedCurve> {
    let mut curves = vec![outline(&[
        dvec2(-4.0, -4.0),
        dvec2(4.0, -4.0),
        dvec2(4.0, 4.0),
        dvec2(-4.0, 4.0),
    ])];
    let step = 4.0 / f64::from(n);
    let at = |x: i32, y: i32| dvec2(f64::from(x), f64::from(y)) * step - 2.0;
    for (x, y) in (0..=n).flat_map(|x| (0..=n).map(move |y| (x, y))) {
        for (dx, dy) in [
            (1, 0),
            (0, 1),
            (1, 1),
            (1, -1),
            (2, 1),
            (1, 2),
            (3, -1),
            (1, -3),
        ] {
            curves.push(segment(at(x, y), at(x + dx, y + dy)));
        }
    }
    curves
}

#[test]
fn box_grids_have_the_same_topology_turned_and_far_away() {
    for n in [2, 4, 8] {
        let curves = box_grid(n);
        let expected = arranged(&curves).report;
        for (angle, offset) in [
            (0.7, 0.0),
            (0.1, 0.0),
            (1.234, 0.0),
            (0.0, 1e6),
            (0.7, 1e3),
            (0.7, 1e6),
        ] {
            let report = arranged(&moved(&curves, angle, DVec2::splat(offset))).report;
            assert_eq!(
                (report.n_vertices, report.n_edges, report.n_pieces),
                (expected.n_vertices, expected.n_edges, expected.n_pieces),
                "{n} boxes turned by {angle}, moved by {offset}"
            );
        }
    }
}

#[test]
fn scaling_by_powers_of_two_changes_nothing() {
    let curves = family("rotated lattice", 60, 1e-12, &mut Rng::new(5));
    let expected = arranged(&curves);
    for scale in [2.0_f64.powi(-60), 0.125, 2.0_f64.powi(40)] {
        let scaled: Vec<TaggedCurve> = curves
            .iter()
            .map(|c| {
                curve(
                    &c.points.iter().map(|&p| p * scale).collect::<Vec<_>>(),
                    c.order,
                )
            })
            .collect();
        let arrangement = arranged(&scaled);
        assert_eq!(arrangement.pixels, expected.pixels);
        assert_eq!(arrangement.edges, expected.edges);
    }
}

#[test]
fn l_shaped_receiver_keeps_exactly_its_area() {
    let mut rng = Rng::new(6);
    let corners =
        [(0., 0.), (3., 0.), (3., 1.), (1., 1.), (1., 2.), (0., 2.)].map(|(x, y)| dvec2(x, y));
    let mut curves = vec![outline(&corners)];
    // Lines on its corners, along its sides, and across.
    curves.push(segment(dvec2(-1e-8, 1.0), dvec2(3.0 + 1e-8, 1.0)));
    curves.push(segment(dvec2(1.0, 2.0), dvec2(1.0, 0.0)));
    for _ in 0..20 {
        curves.push(segment(rng.point() * 3.0, rng.point() * 3.0));
    }
    let (_, mesh) = meshed(&curves);
    assert!((mesh.total_area() - 4.0).abs() < 1e-7);

    let alone = meshed(&curves[..3]).1;
    assert_eq!(alone.total_area(), 4.0);
}

#[test]
fn holed_receiver_keeps_exactly_its_area() {
    let hole = [(1., 1.), (1., 2.), (2., 2.), (2., 1.)].map(|(x, y)| dvec2(x, y));
    let corners = [(0., 0.), (4., 0.), (4., 4.), (0., 4.)].map(|(x, y)| dvec2(x, y));
    let mut curves = vec![outline(&corners), outline(&hole)];
    curves.push(segment(dvec2(-0.1, 1.5), dvec2(4.1, 1.5)));
    curves.push(segment(dvec2(1.5, 2.0), dvec2(3.0, 2.0)));
    let (_, mesh) = meshed(&curves);
    assert_eq!(mesh.total_area(), 15.0);

    // As one outline with a bridge to the hole, which borders pass twice.
    let keyhole: Vec<DVec2> = [0, 1, 2, 3]
        .map(|i| corners[i])
        .into_iter()
        .chain([corners[0], hole[0], hole[1], hole[2], hole[3], hole[0]])
        .collect();
    let curves = [outline(&keyhole)];
    let (_, mesh) = meshed(&curves);
    assert_eq!(mesh.total_area(), 15.0);
}

#[test]
fn thousands_of_collinear_segments_are_one_line() {
    // Half of them coincide, the others overlap on another stretch of the line.
    let mut rng = Rng::new(7);
    let (a, b) = (dvec2(-0.9, -0.37), dvec2(0.83, 0.71));
    let mut curves = vec![square(1.0)];
    for i in 0..10_000 {
        let (s, t) = if i % 2 == 0 {
            (0.0, 0.4)
        } else {
            let s = 0.4 + 0.58 * rng.signed().abs();
            (s, s + 0.02 * rng.signed().abs())
        };
        curves.push(segment(a.lerp(b, s), a.lerp(b, t)));
    }
    let start = Instant::now();
    let arrangement =
        arrange(&curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default();
    assert!(
        start.elapsed().as_secs_f64() < 2.0,
        "took {:?}",
        start.elapsed()
    );
    arrangement.check(&curves).unwrap();
    assert!(arrangement.report.n_lines <= 6, "{:?}", arrangement.report);
    assert!(arrangement.report.n_edges < 11_000);
    let sets = arrangement
        .edges
        .iter()
        .map(|e| arrangement.sets.get(e.curves).len());
    assert!(sets.sum::<usize>() < 3_000_000);
    let mesh = TriMesh::new(&arrangement, &curves).unwrap();
    mesh.check().unwrap();
}

#[test]
fn ends_on_another_curve_are_vertices_of_it() {
    let mut rng = Rng::new(8);
    for _ in 0..200 {
        let (a, b) = (rng.point(), rng.point());
        let t = 0.1 + 0.8 * rng.signed().abs();
        let on = a.lerp(b, t);
        let curves = [square(1.0), segment(a, b), segment(on, dvec2(3.0, 3.0))];
        let arrangement = arranged(&curves);
        // The end is one vertex, with both curves.
        let v = arrangement.vertices.iter().position(|&p| p == on).unwrap() as u32;
        let at_v: Vec<u32> = arrangement
            .edges
            .iter()
            .filter(|e| e.ends.contains(&v))
            .flat_map(|e| arrangement.sets.get(e.curves))
            .copied()
            .collect();
        assert!(at_v.contains(&1) && at_v.contains(&2), "{at_v:?}");
    }
}

#[test]
fn the_border_does_not_move_for_curves_beside_it() {
    let mut curves = vec![square(1.0)];
    for k in 0..8 {
        let y = 1.0 + (f64::from(k) - 4.0) * 2e-9;
        curves.push(segment(dvec2(-0.7, y), dvec2(0.1 * f64::from(k), y + 3e-9)));
    }
    let (arrangement, mesh) = meshed(&curves);
    assert!((mesh.total_area() - 4.0).abs() < 1e-15);
    assert_eq!(arrangement.report.n_lines, 4);
    assert!(
        arrangement
            .vertices
            .iter()
            .all(|p| p.abs().max_element() == 1.0)
    );
}

/// Corner 1 of the border is welded to corner 0, and corner 2 is nearer to it.
#[test]
fn a_curve_from_a_welded_corner_of_the_border_starts_where_that_went() {
    let pixel = 2.0_f64.powi(-28);
    let corners = [0.0, 3.0 * pixel, 5.0 * pixel, 1.0].map(|x| dvec2(x, 0.0));
    let border = [corners.as_slice(), &[dvec2(1.0, 1.0), dvec2(0.0, 1.0)]].concat();
    let curves = [outline(&border), segment(corners[1], dvec2(0.5, 0.5))];
    let (arrangement, _) = meshed(&curves);
    assert_eq!(arrangement.pixel, pixel);
    let at = |p: DVec2| arrangement.vertices.iter().position(|&v| v == p).unwrap() as u32;
    let ends = [at(corners[0]), at(dvec2(0.5, 0.5))];
    let edge = arrangement.edges.iter().find(|e| e.ends == ends).unwrap();
    assert_eq!(arrangement.sets.get(edge.curves), [1]);
}

#[test]
fn points_keep_their_coordinates() {
    let (a, b) = (dvec2(0.1, 0.2), dvec2(-0.3, 1.0 / 3.0));
    let arrangement = arranged(&[square(1.0), segment(a, b)]);
    assert!(arrangement.vertices.contains(&a) && arrangement.vertices.contains(&b));
}

#[test]
fn edges_know_all_their_curves_and_the_strongest_order() {
    let (a, b) = (dvec2(-0.5, 0.0), dvec2(0.5, 0.0));
    let curves = [
        square(1.0),
        curve(&[a, b], Order::D2),
        curve(&[b, a], Order::D0),
    ];
    let (_, mesh) = meshed(&curves);
    let [i, j] = [a, b].map(|p| mesh.vertices.iter().position(|&v| v == p).unwrap() as u32);
    let set = mesh.edge_curves(j, i).unwrap();
    assert_eq!(mesh.sets().get(set), [1, 2]);
    assert_eq!(mesh.edge_order(i, j), Some(Order::D0));
}

#[test]
fn degenerate_curves_are_counted_and_left_out() {
    let p = dvec2(0.25, 0.25);
    let curves = [
        square(1.0),
        curve(&[], Order::D0),
        curve(&[p], Order::D0),
        curve(&[p, p, p], Order::D0),
        curve(&[p, p + 1e-9], Order::D0),
        curve(&[p, dvec2(f64::NAN, 0.0)], Order::D0),
        curve(&[p, dvec2(f64::INFINITY, 0.0)], Order::D0),
        curve(&[p, dvec2(1e300, 0.0)], Order::D0),
        curve(&[p, p, -p, -p], Order::D0),
    ];
    let arrangement = arranged(&curves);
    assert_eq!(
        (arrangement.report.n_curves, arrangement.report.n_skipped),
        (9, 7)
    );
    assert!(TriMesh::new(&arrangement, &curves).is_ok());

    for nothing in [
        vec![],
        vec![curve(&[p, p], Order::D0)],
        vec![segment(p, -p)],
    ] {
        let arrangement = arranged(&nothing);
        let error = TriMesh::new(&arrangement, &nothing).unwrap_err();
        assert_eq!(
            error,
            MeshError::NoArea {
                n_edges: arrangement.edges.len()
            }
        );
    }
}

#[test]
fn too_many_edges_make_pixels_coarser() {
    let curves = family("random", 60, 0.0, &mut Rng::new(9));
    let options = ArrangementOptions {
        max_links: 1000,
        ..Default::default()
    };
    let arrangement = arrange(&curves, &options, &Control::NEVER).unwrap_or_default();
    assert!(arrangement.report.n_coarsened > 0);
    arrangement.check(&curves).unwrap();
}

#[test]
#[ignore = "prints times"]
#[allow(clippy::print_stderr, reason = "that is what it is for")]
fn times() {
    for n in [100, 1000] {
        let curves = family("random", n, 0.0, &mut Rng::new(10));
        let start = Instant::now();
        let arrangement =
            arrange(&curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default();
        let arranged = start.elapsed();
        let mesh = TriMesh::new(&arrangement, &curves).unwrap();
        eprintln!(
            "{n}: {arranged:?}, mesh {:?}, {:?}, {} triangles",
            start.elapsed() - arranged,
            arrangement.report,
            mesh.triangles.len()
        );
    }
}

#[test]
fn many_random_sets_keep_all_promises() {
    for seed in 2000..2040 {
        let mut rng = Rng::new(seed);
        for name in FAMILIES {
            let noise = [0.0, 10.0_f64.powf(-10.0 + 6.0 * rng.signed())][rng.below(2)];
            let n = 2 + rng.below(40);
            let curves = family(name, n, noise, &mut rng);
            let turned = moved(&curves, rng.signed(), rng.point() * 100.0);
            for curves in [curves, turned] {
                let bits = 8 + rng.below(24) as u32;
                let sub_bits = rng.below(18) as u32;
                let options = ArrangementOptions {
                    bits,
                    sub_bits,
                    ..Default::default()
                };
                let arrangement = arrange(&curves, &options, &Control::NEVER).unwrap_or_default();
                arrangement
                    .check(&curves)
                    .unwrap_or_else(|e| panic!("{seed} {name} {n} {noise} {options:?}: {e}"));
                let mesh = TriMesh::new(&arrangement, &curves).unwrap();
                mesh.check()
                    .unwrap_or_else(|e| panic!("{seed} {name} {n} {noise} {options:?}: {e}"));
                assert!((mesh.total_area() - 4.0).abs() < 64.0 * arrangement.pixel);
                assert_order_makes_no_difference(&curves, &mut rng);
            }
        }
    }
}
