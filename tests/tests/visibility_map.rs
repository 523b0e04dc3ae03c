//! Visibility maps: parts and sky are the whole hemisphere, and emitters have the factors
//! that the exact evaluation finds one by one.

use antumbra::scene::FaceId;
use antumbra::visibility::{
    Approach, MapScratch, MapTotals, Place, Shape, Source, contour_sum, critical_curves,
};
use antumbra::{Control, Evaluator, EventKind, EventKinds, Scene, SceneInput, Scratch};
use antumbra_tests::cases::{build, fixture, fixtures, json_files};
use antumbra_tests::random::SplitMix;
use antumbra_tests::scenes::{Facing, add_horizontal, empty};
use glam::DVec3;
use rayon::prelude::*;

/// Folders of fixtures whose scenes can be built.
const FOLDERS: [&str; 10] = [
    "alignment",
    "basic",
    "contact",
    "covered",
    "door",
    "eee",
    "hard",
    "penetration",
    "real",
    "regressions",
];

/// Scenes of those fixtures, by name. What is refused is none of ours.
fn scenes() -> Vec<(String, Scene)> {
    let of_folder = |folder: &&str| {
        let files = json_files(&fixtures().join(folder));
        let folder = (*folder).to_owned();
        files.into_iter().map(move |file| {
            let stem = file.file_stem().expect("a file").to_string_lossy();
            format!("{folder}/{stem}")
        })
    };
    let names = FOLDERS.iter().flat_map(of_folder);
    let built = names.filter_map(|name| {
        let scene = Scene::build(&fixture(&name)).ok()?.scene;
        Some((name, scene))
    });
    let scenes: Vec<_> = built.collect();
    assert!(scenes.len() > 80, "only {} fixtures", scenes.len());
    scenes
}

/// A point of a face's front that is not covered, inside of a piece.
fn point_on_a_face(scene: &Scene, random: &mut SplitMix) -> (FaceId, DVec3) {
    loop {
        let piece = &scene.pieces[pick(scene.pieces.len(), random)];
        if scene.face(piece.face).is_covered || piece.n_faces > 1 {
            continue;
        }
        let k = 1 + pick(piece.vertices.len() - 2, random);
        let [a, b, c] = [0, k, k + 1].map(|i| scene.position(piece.vertices[i]));
        let (s, t) = (random.unit(), random.unit());
        let (s, t) = if s + t > 1.0 {
            (1.0 - s, 1.0 - t)
        } else {
            (s, t)
        };
        return (piece.face, a + (b - a) * s + (c - a) * t);
    }
}

fn pick(n: usize, random: &mut SplitMix) -> usize {
    (random.unit() * n as f64) as usize
}

fn place_on(scene: &Scene, face: FaceId, point: DVec3) -> Place {
    let face = scene.face(face);
    Place {
        point,
        normal: face.normal,
        plane: Some(face.plane),
        approach: None,
    }
}

/// Four pixels of the arrangement on a face, as the engine takes it.
fn contact_radius(scene: &Scene, face: FaceId) -> f64 {
    let corners = scene.loops_in_chart(face, &scene.chart(face));
    let all = || corners.iter().flatten();
    let (min, max) = all().fold((*all().next().expect("corners"), corners[0][0]), |b, &c| {
        (b.0.min(c), b.1.max(c))
    });
    4.0 * (max - min).max_element() / f64::from(1u32 << 28)
}

/// Places on the borders and contacts of a scene, with their approaches.
fn places_at_contacts(evaluator: &Evaluator<'_>, random: &mut SplitMix, n: usize) -> Vec<Place> {
    let scene = evaluator.scene();
    let mut places = Vec::new();
    while places.len() < n {
        let (face, inside) = point_on_a_face(scene, random);
        let radius = contact_radius(scene, face);
        let outline = scene.positions(&scene.face(face).outline);
        let i = pick(outline.len(), random);
        let (a, b) = (outline[i], outline[(i + 1) % outline.len()]);
        let point = a + (b - a) * random.unit();
        let toward = scene.face(face).normal.cross(b - a).normalize_or_zero();
        let toward = if random.unit() < 0.5 {
            toward
        } else {
            (inside - point).normalize_or_zero()
        };
        places.push(Place {
            approach: Some(Approach { toward, radius }),
            ..place_on(scene, face, point)
        });
    }
    let only = EventKinds::NONE.with(EventKind::Contact);
    for face in scene.face_ids().take(40) {
        let radius = contact_radius(scene, face);
        let curves = critical_curves(evaluator, face, only, radius, &Control::NEVER)
            .expect("nothing stops it");
        for curve in curves.curves.iter().take(6) {
            let Shape::Segment(ends) = curve.shape else {
                continue;
            };
            let point = ends[0].lerp(ends[1], random.unit());
            let across = scene.face(face).normal.cross(ends[1] - ends[0]);
            for toward in [across, -across].map(DVec3::normalize_or_zero) {
                places.push(Place {
                    approach: Some(Approach { toward, radius }),
                    ..place_on(scene, face, point)
                });
            }
        }
    }
    places
}

/// What one map gives: the factor of each emitter, the sum of all, the totals.
fn look(
    evaluator: &Evaluator<'_>,
    place: &Place,
    scratch: &mut MapScratch,
) -> (Vec<f64>, f64, MapTotals) {
    let emitters: Vec<FaceId> = evaluator.emitters().collect();
    let mut factors = vec![0.0; emitters.len()];
    let mut sum = 0.0;
    let totals = evaluator.visible_faces(place, 0.0, scratch, |part| {
        sum += part.factor;
        if part.shows_front
            && let Ok(emitter) = emitters.binary_search(&part.face)
        {
            factors[emitter] += part.factor;
        }
    });
    (factors, sum + totals.sky + totals.slits, totals)
}

/// The factor of each emitter by exact evaluations, one after the other.
fn one_by_one(evaluator: &Evaluator<'_>, place: &Place, scratch: &mut Scratch) -> Vec<f64> {
    let scene = evaluator.scene();
    let of_face = |emitter: FaceId| {
        let range = scene.face(emitter).pieces.clone();
        let pieces = scene.pieces[range.start as usize..range.end as usize].iter();
        let own = pieces.filter(|piece| piece.n_faces == 1);
        let source = Source {
            pieces: own.map(|piece| scene.positions(&piece.vertices)).collect(),
            ..Source::of(scene, emitter)
        };
        evaluator.see(place, &source, None, scratch).factor
    };
    evaluator.emitters().map(of_face).collect()
}

/// How far the factor of an emitter may be from that of one evaluation: there, the point
/// settles on what touches it and may hide this emitter, within the radius, and what touches
/// it is seen half a radius behind; the map settles on all at once and takes the limit.
fn allowed(scene: &Scene, emitter: FaceId, place: &Place) -> f64 {
    let plane = scene.planes[scene.face(emitter).plane.index()];
    let radius = place.approach.map_or(0.0, |a| a.radius);
    let height = plane.distance(place.point).abs();
    // A step of the radius turns an emitter as near as that by any angle.
    1e-13 + radius * (2.0 / height.max(1e-30)).clamp(2.0, 1e3)
}

/// Laws of the map at some places: parts and sky are 1, and emitters have their factors.
fn laws_hold(name: &str, evaluator: &Evaluator<'_>, places: &[Place]) {
    let (mut scratch, mut one) = (MapScratch::default(), Scratch::default());
    for place in places {
        let (factors, sum, totals) = look(evaluator, place, &mut scratch);
        assert!(
            (sum - 1.0).abs() <= 1e-12,
            "{name}: parts and sky are 1 + {:.1e} at {place:?}",
            sum - 1.0
        );
        assert_eq!(totals.n_ended, 0, "exact maps end no cone");
        let exact = one_by_one(evaluator, place, &mut one);
        let pairs = factors.iter().zip(&exact);
        for (emitter, (found, exact)) in evaluator.emitters().zip(pairs) {
            let allowed = allowed(evaluator.scene(), emitter, place);
            assert!(
                (found - exact).abs() <= allowed,
                "{name}: {found} and not {exact}, {:.1e} more than allowed, at {place:?}",
                (found - exact).abs() - allowed
            );
        }
    }
}

fn laws_hold_at(n: usize) {
    scenes().par_iter().for_each(|(name, scene)| {
        let evaluator = Evaluator::new(scene);
        let mut random = SplitMix::new(14);
        let on_faces: Vec<Place> = (0..n)
            .map(|_| {
                let (face, point) = point_on_a_face(scene, &mut random);
                place_on(scene, face, point)
            })
            .collect();
        laws_hold(name, &evaluator, &on_faces);
        let bounds = scene.bounds();
        let free: Vec<Place> = (0..n)
            .map(|_| Place {
                point: random.in_box(bounds.min, bounds.max),
                normal: random.rotation() * DVec3::Z,
                plane: None,
                approach: None,
            })
            .collect();
        laws_hold(name, &evaluator, &free);
        let contacts = places_at_contacts(&evaluator, &mut random, n);
        laws_hold(name, &evaluator, &contacts);
    });
}

#[test]
fn parts_and_sky_are_one_and_emitters_have_their_factors() {
    laws_hold_at(25);
}

#[test]
#[ignore = "10,000 points of every fixture: a minute in a release build"]
fn parts_and_sky_are_one_and_emitters_have_their_factors_at_many_points() {
    laws_hold_at(10_000);
}

/// What a free sensor at the origin sees above: the names of surfaces, whether their front
/// or their back, whether of a back's own face, and the factor.
fn seen_from_origin(input: &SceneInput) -> Vec<(String, bool, bool, f64)> {
    let scene = build(input);
    let evaluator = Evaluator::new(&scene);
    let place = Place {
        point: scene.frame.to_scene(DVec3::ZERO),
        normal: DVec3::Z,
        plane: None,
        approach: None,
    };
    let mut seen: Vec<(String, bool, bool, f64)> = Vec::new();
    evaluator.visible_faces(&place, 0.0, &mut MapScratch::default(), |part| {
        let name = &scene.surface_of(part.face).name;
        let is_back = scene.face(part.face).is_back;
        match seen.iter_mut().find(|s| s.0 == *name) {
            Some(known) => {
                assert_eq!((known.1, known.2), (part.shows_front, is_back));
                known.3 += part.factor;
            }
            None => seen.push((name.clone(), part.shows_front, is_back, part.factor)),
        }
    });
    seen.sort_by(|a, b| a.0.cmp(&b.0));
    seen
}

const SQUARE: ([f64; 2], [f64; 2], f64) = ([-1.0, 1.0], [-1.0, 1.0], 1.0);

#[test]
fn one_sided_faces_show_their_back_and_two_sided_ones_have_a_face_there() {
    let mut scene = empty();
    add_horizontal(&mut scene, "plate", "grey", SQUARE, Facing::Up);
    let seen = seen_from_origin(&scene);
    assert!(matches!(seen[..], [(_, false, false, f)] if (f - 0.553_963_6).abs() < 1e-3));
    scene.materials[0].two_sided = true;
    let seen = seen_from_origin(&scene);
    assert!(matches!(seen[..], [(_, true, true, _)]));
}

#[test]
fn emitters_are_seen_where_they_overlap_others_in_their_plane() {
    let mut scene = empty();
    add_horizontal(&mut scene, "ceiling", "grey", SQUARE, Facing::Down);
    add_horizontal(&mut scene, "above", "grey", SQUARE, Facing::Up);
    let lamp = ([-0.5, 0.25], [-0.5, 0.75], 1.0);
    add_horizontal(&mut scene, "panel", "lamp", lamp, Facing::Down);
    let seen = seen_from_origin(&scene);
    let names: Vec<&str> = seen.iter().map(|s| s.0.as_str()).collect();
    assert_eq!(
        names,
        ["ceiling", "panel"],
        "and nothing of the floor above"
    );
    let mut alone = empty();
    add_horizontal(&mut alone, "panel", "lamp", lamp, Facing::Down);
    let whole = seen_from_origin(&alone)[0].3;
    assert!((seen[1].3 - whole).abs() < 1e-15);
}

#[test]
fn facets_of_a_wall_have_the_factors_that_they_have_alone() {
    let corner = |k: u32| -1.0 + 2.0 * f64::from(k) / 6.0;
    let mut tiled = empty();
    for k in 0..36 {
        let (i, j) = (k % 6, k / 6);
        let sides = ([corner(i), corner(i + 1)], [corner(j), corner(j + 1)], 1.0);
        add_horizontal(&mut tiled, &format!("{k:02}"), "grey", sides, Facing::Down);
    }
    let seen = seen_from_origin(&tiled);
    assert_eq!(seen.len(), 36);
    for (k, seen) in seen.iter().enumerate() {
        let mut alone = empty();
        alone.surfaces.push(tiled.surfaces[k].clone());
        assert!((seen.3 - seen_from_origin(&alone)[0].3).abs() < 1e-15);
    }
}

#[test]
fn ended_cones_move_no_more_than_their_weight() {
    for (name, scene) in scenes() {
        let evaluator = Evaluator::new(&scene);
        let mut random = SplitMix::new(15);
        let mut scratch = MapScratch::default();
        for _ in 0..10 {
            let (face, point) = point_on_a_face(&scene, &mut random);
            let place = place_on(&scene, face, point);
            let mut of_face = vec![0.0; scene.faces.len()];
            let exact = evaluator.visible_faces(&place, 0.0, &mut scratch, |part| {
                of_face[part.face.index()] += part.factor;
            });
            let mut moved: Vec<f64> = of_face.iter().map(|f| -f).collect();
            let (mut n_ended, mut sum) = (0, 0.0);
            let ended = evaluator.visible_faces(&place, 1e-3, &mut scratch, |part| {
                moved[part.face.index()] += part.factor;
                n_ended += u64::from(part.is_ended);
                sum += part.factor;
                assert!(
                    !part.is_ended || part.factor < 1e-3,
                    "{name}: a large cone ended"
                );
            });
            assert!(
                (sum + ended.sky - 1.0).abs() <= 1e-12,
                "{name}: a part is lost"
            );
            assert!(n_ended <= ended.n_ended && ended.n_cones <= exact.n_cones);
            let moved: f64 = moved.iter().map(|m| m.abs()).sum();
            assert!(
                moved + (ended.sky - exact.sky).abs() <= 2.0 * ended.ended + 1e-12,
                "{name}: {moved:e} moved, {:e} ended at {place:?}",
                ended.ended
            );
        }
    }
}

#[test]
fn fragments_lie_in_their_face_and_have_its_factor() {
    for (name, scene) in scenes() {
        let evaluator = Evaluator::new(&scene);
        let mut random = SplitMix::new(16);
        let mut scratch = MapScratch::default();
        for _ in 0..10 {
            let (face, point) = point_on_a_face(&scene, &mut random);
            let place = place_on(&scene, face, point);
            evaluator.visible_faces(&place, 0.0, &mut scratch, |part| {
                let plane = scene.planes[scene.face(part.face).plane.index()];
                let reach = 1e-9 * scene.extent;
                for &corner in part.fragment {
                    assert!(
                        plane.distance(corner).abs() <= reach,
                        "{name}: off its plane"
                    );
                }
                let seen: Vec<DVec3> = part.fragment.iter().map(|&c| c - point).collect();
                let factor = contour_sum(&seen, place.normal);
                // A plane that all but holds the point is met where its rounding says.
                let rounding = 1e-15 / plane.distance(point).abs();
                assert!(
                    (factor - part.factor).abs() <= 1e-10 + rounding,
                    "{name}: {factor} of the fragment, {} of the part",
                    part.factor
                );
            });
        }
    }
}
