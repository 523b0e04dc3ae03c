//! Random scenes on a lattice, and the laws their light obeys.
//!
//! Coordinates are multiples of 1/2, 1/4 or 1/8, so that touching, crossing, coplanar,
//! aligned and duplicate surfaces are the rule. A scene is the function of its number:
//! one that fails is named by it and can be had again.

use crate::motion::Motion;
use crate::random::SplitMix;
use crate::scenes::{Facing, add, add_box, add_horizontal, add_room, empty, material, unoccluded};
use antumbra::scene::SurfaceInput;
use antumbra::values::{self, Place};
use antumbra::{Control, Evaluator, ExactLight, Scene, SceneInput, Scratch};
use glam::{DVec3, Vec3Swizzles as _, dvec3};

/// A surface's name and a point of it, file units.
pub type Spot = (String, DVec3);

/// A scene and points on its surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct LatticeScene {
    /// Surfaces `lamp…` emit 1; all others are grey.
    pub input: SceneInput,
    /// Inner points of surfaces, off the lattice but multiples of 2⁻³¹, so that they can
    /// be moved by a million lattice steps without rounding.
    pub spots: Vec<Spot>,
    /// Whether the room is closed and holds boxes only, apart from each other or
    /// touching: then a point sees fronts alone.
    pub is_closed: bool,
}

/// The scene of a number: under one or two lamps over a floor, or in a room, up to five
/// boxes, triangles, parallelograms, plates with a hole and L-shapes.
#[must_use]
pub fn lattice_scene(number: u64) -> LatticeScene {
    let mut random = SplitMix::new(number.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ 0x5eed);
    let mut dice = Dice {
        q: [2.0, 4.0, 8.0][(random.bits() % 3) as usize],
        random: &mut random,
    };
    let mut input = empty();
    let is_closed = dice.one_in(4);
    if is_closed {
        closed_room(&mut input, &mut dice);
    } else {
        open_scene(&mut input, &mut dice);
    }
    let spots = spots(&input, &mut random);
    LatticeScene {
        input,
        spots,
        is_closed,
    }
}

/// The scene of a number, plain, rotated or with its coordinates a few ulps apart.
#[must_use]
pub fn varied_scene(number: u64) -> SceneInput {
    let plain = lattice_scene(number).input;
    match number % 3 {
        0 => plain,
        1 => Motion::rotation(dvec3(0.3, 0.5, 0.8), 0.7).scene(&plain),
        _ => ulps_apart(&plain, 4, &mut SplitMix::new(number)),
    }
}

/// The same scene with every coordinate of every surface moved by up to `ulps` units in
/// the last place of 4.
#[must_use]
pub fn ulps_apart(input: &SceneInput, ulps: i32, random: &mut SplitMix) -> SceneInput {
    let mut moved = input.clone();
    let n = 2 * u64::from(ulps.unsigned_abs()) + 1;
    let mut step = || ((random.bits() % n) as f64 - f64::from(ulps)) * 4.0 * f64::EPSILON;
    for surface in &mut moved.surfaces {
        for p in surface
            .vertices
            .iter_mut()
            .chain(surface.holes.iter_mut().flatten())
        {
            *p += dvec3(step(), step(), step());
        }
    }
    moved
}

/// Picks on the lattice of `1 / q`.
struct Dice<'r> {
    q: f64,
    random: &'r mut SplitMix,
}

impl Dice<'_> {
    fn below(&mut self, n: u64) -> u64 {
        self.random.bits() % n
    }

    fn one_in(&mut self, n: u64) -> bool {
        self.below(n) == 0
    }

    /// A multiple of `1 / q` in `low ..= high`, both multiples of 1/2.
    fn step(&mut self, low: f64, high: f64) -> f64 {
        let n = ((high - low) * self.q) as u64 + 1;
        low + self.below(n) as f64 / self.q
    }

    fn point(&mut self, low: DVec3, high: DVec3) -> DVec3 {
        dvec3(
            self.step(low.x, high.x),
            self.step(low.y, high.y),
            self.step(low.z, high.z),
        )
    }

    fn size(&mut self) -> DVec3 {
        DVec3::splat(1.0 / self.q) + self.point(DVec3::ZERO, DVec3::splat(0.5))
    }
}

fn open_scene(input: &mut SceneInput, dice: &mut Dice<'_>) {
    let floor = ([-2.0, 2.0], [-2.0, 2.0], 0.0);
    add_horizontal(input, "floor", "grey", floor, Facing::Up);
    let n_lamps = 1 + dice.below(2);
    for k in 0..n_lamps {
        let name = format!("lamp-{k}");
        let low = dvec3([-1.5, 0.5][k as usize], -0.5, 2.0);
        let a = dice.point(low, low + dvec3(0.5, 0.5, 1.0));
        let (u, v) = (dice.size().with_y(0.0), dice.size().with_x(0.0).with_z(0.0));
        let rise = match dice.below(3) {
            0 => DVec3::Z * u.z,
            _ => DVec3::ZERO,
        };
        let u = u.with_z(0.0) + rise;
        match dice.below(4) {
            0 => add(input, &name, "lamp", &[a, a + v, a + u]),
            _ => add(input, &name, "lamp", &[a, a + v, a + u + v, a + u]),
        }
    }
    let n = 1 + dice.below(4);
    for k in 0..n {
        occluder(input, &format!("part-{k}"), dice);
    }
    if dice.one_in(6) {
        let twin = input.surfaces.last().cloned();
        input.surfaces.extend(twin.map(|s| SurfaceInput {
            name: "twin".to_owned(),
            ..s
        }));
    }
}

fn occluder(input: &mut SceneInput, name: &str, dice: &mut Dice<'_>) {
    let (low, high) = (dvec3(-1.5, -1.5, 0.0), dvec3(1.5, 1.5, 2.0));
    let a = dice.point(low, high);
    match dice.below(10) {
        0..=4 => {
            let size = dice.size();
            add_box(input, name, "grey", a, a + size);
        }
        5 | 6 => {
            let (b, c) = (dice.point(low, high), dice.point(low, high));
            if (b - a).cross(c - a).length() > 0.0 {
                add(input, name, "grey", &[a, b, c]);
            }
        }
        7 => {
            let (u, v) = (dice.point(-high, high), dice.point(-high, high));
            if u.cross(v).length() > 0.0 {
                add(input, name, "grey", &[a, a + u, a + u + v, a + v]);
            }
        }
        8 => {
            let (u, v) = (DVec3::X * (4.0 / dice.q), DVec3::Y * (4.0 / dice.q));
            let at = |s: f64, t: f64| a + u * s + v * t;
            add(
                input,
                name,
                "grey",
                &[at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)],
            );
            let hole = vec![at(0.25, 0.25), at(0.25, 0.5), at(0.75, 0.5), at(0.75, 0.25)];
            if let Some(plate) = input.surfaces.last_mut() {
                plate.holes = vec![hole];
            }
        }
        _ => {
            let one = 1.0 / dice.q;
            let up = [DVec3::X, DVec3::Y, DVec3::Z][dice.below(3) as usize];
            let (u, v) = (up.zxy() * one, up.yzx() * one);
            let at = |s: f64, t: f64| a + u * s + v * t;
            let l = [
                at(0.0, 0.0),
                at(3.0, 0.0),
                at(3.0, 1.0),
                at(1.0, 1.0),
                at(1.0, 2.0),
                at(0.0, 2.0),
            ];
            add(input, name, "grey", &l);
        }
    }
}

/// A room whose ceiling has a lamp in it or below it, with up to three boxes on a grid
/// of cells, so that they touch each other and the walls but never overlap.
fn closed_room(input: &mut SceneInput, dice: &mut Dice<'_>) {
    add_room(
        input,
        "room",
        "grey",
        dvec3(-2.0, -2.0, 0.0),
        dvec3(2.0, 2.0, 3.0),
    );
    let (x, y) = (dice.step(-1.5, 0.5), dice.step(-1.5, 0.5));
    let z = [3.0, 2.5][dice.below(2) as usize];
    let size = dice.size();
    if z < 3.0 {
        // A solid lamp: only its lower side emits.
        let (min, max) = (dvec3(x, y, z), dvec3(x + size.x, y + size.y, 3.0));
        add_box(input, "lamp-box", "grey", min, max);
        for s in &mut input.surfaces {
            if s.name == "lamp-box.z0" {
                s.material = "lamp".to_owned();
                s.name = "lamp-0".to_owned();
            }
        }
    } else {
        // Its light is not hidden by the ceiling in its own plane.
        let sides = ([x, x + size.x], [y, y + size.y], z);
        add_horizontal(input, "lamp-0", "lamp", sides, Facing::Down);
    }
    let n = 1 + dice.below(3);
    let mut taken = Vec::new();
    for k in 0..n {
        let cell = [dice.below(4), dice.below(4), dice.below(2)];
        if taken.contains(&cell) {
            continue;
        }
        taken.push(cell);
        let corner = DVec3::from_array(cell.map(|c| c as f64)) - dvec3(2.0, 2.0, 0.0);
        // Filled to its borders, or flush with some of them.
        let [lo, hi]: [DVec3; 2] =
            std::array::from_fn(|_| dice.point(DVec3::ZERO, DVec3::splat(0.5)));
        let full = dice.below(8);
        let lo = DVec3::from_array(std::array::from_fn(|i| {
            if full >> i & 1 == 1 { 0.0 } else { lo[i] * 0.5 }
        }));
        let hi = DVec3::from_array(std::array::from_fn(|i| {
            if full >> i & 1 == 1 {
                1.0
            } else {
                1.0 - hi[i] * 0.5
            }
        }));
        add_box(input, &format!("box-{k}"), "grey", corner + lo, corner + hi);
    }
}

/// Three points on each of up to four surfaces, the floor first.
fn spots(input: &SceneInput, random: &mut SplitMix) -> Vec<Spot> {
    let mut spots = Vec::new();
    for k in 0..4 {
        let pick = match k {
            0 => 0,
            _ => (random.bits() % input.surfaces.len() as u64) as usize,
        };
        let surface = &input.surfaces[pick];
        if !surface.holes.is_empty() || surface.vertices.len() > 4 {
            continue;
        }
        for _ in 0..3 {
            let v = &surface.vertices;
            let second = v.len() == 4 && random.bits() & 1 == 1;
            let (b, c) = if second { (v[2], v[3]) } else { (v[1], v[2]) };
            let weight = |random: &mut SplitMix| {
                let part = 1u64 << 28;
                (1 + random.bits() % (part - 1)) as f64 / part as f64
            };
            let (mut s, mut t) = (weight(random), weight(random));
            if s + t > 1.0 {
                (s, t) = (1.0 - s, 1.0 - t);
            }
            spots.push((surface.name.clone(), v[0] + (b - v[0]) * s + (c - v[0]) * t));
        }
    }
    spots
}

/// A law that did not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Broken {
    /// Which.
    pub law: &'static str,
    /// Where, with the values.
    pub what: String,
}

/// Checks all laws of exact direct light at the scene's spots; `Ok(None)` if the scene
/// is refused (two emitters may overlap).
///
/// Differences are allowed up to 1e-9 of the largest value without occluders.
///
/// # Errors
///
/// The first law that does not hold.
pub fn laws(case: &LatticeScene, number: u64) -> Result<Option<usize>, Broken> {
    let LatticeScene { input, spots, .. } = case;
    let Some(plain) = values(input, spots) else {
        return Ok(None);
    };
    let names: Vec<&str> = spots.iter().map(|(name, _)| name.as_str()).collect();
    let bare = values(&unoccluded(input, &names), spots).unwrap_or_default();
    let bare = bare.iter().map(|v| v.unwrap_or(0.0));
    let peak = bare.clone().fold(1e-3, f64::max);
    for ((spot, e), most) in spots.iter().zip(&plain).zip(bare) {
        let e = e.unwrap_or(0.0);
        if !(e >= 0.0 && e <= most + 1e-12) {
            return Err(Broken {
                law: "0 <= E <= E without occluders",
                what: format!("{spot:?}: {e} of {most}"),
            });
        }
    }
    let allowed = 1e-9 * peak;
    let mut n = 1;
    let mut same = |law: &'static str, input: &SceneInput, at: &[Spot]| {
        n += 1;
        let Some(other) = values(input, at) else {
            return Err(Broken {
                law,
                what: "the changed scene is refused".to_owned(),
            });
        };
        for ((spot, a), b) in spots.iter().zip(&plain).zip(&other) {
            // A point whose surface was split may fall between the parts.
            let (Some(a), Some(b)) = (a, b) else { continue };
            if (a - b).abs() > allowed {
                return Err(Broken {
                    law,
                    what: format!(
                        "{spot:?}: {a} and {b}, {:.1e} of the peak",
                        (a - b).abs() / peak
                    ),
                });
            }
        }
        Ok(())
    };
    let mut random = SplitMix::new(!number);
    let moved = |motion: &Motion| {
        let at: Vec<Spot> = spots
            .iter()
            .map(|(s, p)| (s.clone(), motion.point(*p)))
            .collect();
        (motion.scene(input), at)
    };
    let rotation = Motion {
        rotation: random.rotation(),
        ..Motion::IDENTITY
    };
    for (law, motion) in [
        ("rotation", rotation),
        ("a millionth of the size", Motion::scaling(1e-6)),
        ("a million times the size", Motion::scaling(1e6)),
        ("offset", Motion::translation(dvec3(1e6, -1e6, 5e5))),
        ("mirror", Motion::mirror()),
    ] {
        let (scene, at) = moved(&motion);
        same(law, &scene, &at)?;
    }
    let mut other = input.clone();
    other.surfaces.reverse();
    let n_surfaces = other.surfaces.len();
    other
        .surfaces
        .rotate_left(random.bits() as usize % n_surfaces);
    for surface in &mut other.surfaces {
        let n = surface.vertices.len();
        surface.vertices.rotate_left(random.bits() as usize % n);
    }
    same("order of surfaces and corners", &other, spots)?;
    same("surfaces in pieces", &in_pieces(input), spots)?;
    let mut other = input.clone();
    let below = [dvec3(-1.0, -1.0, -9.0), dvec3(1.0, 0.5, -8.0)];
    add_box(&mut other, "unseen", "grey", below[0], below[1]);
    same("a box that nothing can see", &other, spots)?;
    same(
        "a few ulps apart",
        &ulps_apart(input, 4, &mut random),
        spots,
    )?;
    let mut other = input.clone();
    let twin = other
        .surfaces
        .iter()
        .rev()
        .find(|s| s.material == "grey")
        .cloned();
    other.surfaces.extend(twin.map(|s| SurfaceInput {
        name: "again".to_owned(),
        ..s
    }));
    same("a surface twice", &other, spots)?;
    linear(input, spots, &plain, allowed)?;
    if case.is_closed {
        closed(input, spots)?;
    }
    Ok(Some(n))
}

/// Light of two lamps is the sum of each one's.
fn linear(
    input: &SceneInput,
    spots: &[Spot],
    plain: &[Option<f64>],
    allowed: f64,
) -> Result<(), Broken> {
    let alone = |first: f64, second: f64| {
        let mut scene = input.clone();
        scene.materials.push(material("first", 0.0, first));
        scene.materials.push(material("second", 0.0, second));
        for s in &mut scene.surfaces {
            match s.name.as_str() {
                "lamp-0" => s.material = "first".to_owned(),
                "lamp-1" => s.material = "second".to_owned(),
                _ => {}
            }
        }
        values(&scene, spots).unwrap_or_default()
    };
    let (first, second) = (alone(0.125, 0.0), alone(0.0, 3.0));
    for (((spot, e), a), b) in spots.iter().zip(plain).zip(&first).zip(&second) {
        let (Some(e), Some(a), Some(b)) = (e, a, b) else {
            continue;
        };
        let sum = 8.0 * a + b / 3.0;
        if (e - sum).abs() > allowed {
            return Err(Broken {
                law: "linear in exitance",
                what: format!("{spot:?}: {e} and {sum}"),
            });
        }
    }
    Ok(())
}

/// In a closed room in which everything emits 1, each point that is not covered
/// receives 1.
fn closed(input: &SceneInput, spots: &[Spot]) -> Result<(), Broken> {
    let mut bright = input.clone();
    // The lamp in the ceiling's plane would count twice.
    bright
        .surfaces
        .retain(|s| !(s.name == "lamp-0" && s.vertices[0].z == 3.0));
    for material in &mut bright.materials {
        material.exitance = vec![1.0];
    }
    let Some(all) = values(&bright, spots) else {
        return Ok(());
    };
    for (spot, e) in spots.iter().zip(all) {
        let Some(e) = e else { continue };
        if !is_covered(input, spot) && (e - 1.0).abs() > 1e-12 {
            return Err(Broken {
                law: "closure",
                what: format!("{spot:?}: {e}"),
            });
        }
    }
    Ok(())
}

/// Whether the point lies on a box that is not its own surface's, or on a wall.
fn is_covered(input: &SceneInput, (name, point): &Spot) -> bool {
    let solid = |name: &str| name.split('.').next().unwrap_or_default().to_owned();
    let own = match name.as_str() {
        "lamp-0" => "lamp-box".to_owned(),
        other => solid(other),
    };
    let mut boxes: Vec<(String, DVec3, DVec3)> = Vec::new();
    for s in input.surfaces.iter().filter(|s| s.name.contains("box")) {
        let of = solid(&s.name);
        for &p in &s.vertices {
            match boxes.iter_mut().find(|(name, ..)| *name == of) {
                Some((_, low, high)) => (*low, *high) = (low.min(p), high.max(p)),
                None => boxes.push((of.clone(), p, p)),
            }
        }
    }
    let walls = [dvec3(-2.0, -2.0, 0.0), dvec3(2.0, 2.0, 3.0)];
    let on_wall = point.cmpeq(walls[0]).any() || point.cmpeq(walls[1]).any();
    (own != "room" && on_wall)
        || boxes.iter().any(|(of, low, high)| {
            *of != own && point.cmpge(*low).all() && point.cmple(*high).all()
        })
}

/// Every triangle is cut through the middle of a side, every convex quadrilateral along
/// a diagonal.
fn in_pieces(input: &SceneInput) -> SceneInput {
    let mut cut = input.clone();
    cut.surfaces = Vec::new();
    for s in &input.surfaces {
        let mut part = |suffix: &str, corners: &[DVec3]| {
            cut.surfaces.push(SurfaceInput {
                name: format!("{}{suffix}", s.name),
                vertices: corners.to_vec(),
                ..s.clone()
            });
        };
        match (s.vertices.as_slice(), s.holes.is_empty()) {
            (&[a, b, c], true) => {
                let middle = (a + b) * 0.5;
                part("/0", &[a, middle, c]);
                part("/1", &[middle, b, c]);
            }
            (&[a, b, c, d], true) => {
                part("/0", &[a, b, c]);
                part("/1", &[a, c, d]);
            }
            _ => cut.surfaces.push(s.clone()),
        }
    }
    cut
}

/// Exact direct light at spots; `None` where the point is on no such surface (or part
/// of it). `None` for all if the scene is refused.
#[must_use]
pub fn values(input: &SceneInput, spots: &[Spot]) -> Option<Vec<Option<f64>>> {
    let scene = Scene::build(input).ok()?.scene;
    let evaluator = Evaluator::new(&scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let mut scratch = Scratch::default();
    Some(
        spots
            .iter()
            .map(|(name, point)| {
                let place: Option<Place> = [name.clone(), format!("{name}/0"), format!("{name}/1")]
                    .iter()
                    .find_map(|name| values::place(&scene, name, *point).ok());
                place.map(|place| values::exact(&light, &place, &mut scratch)[0])
            })
            .collect(),
    )
}
