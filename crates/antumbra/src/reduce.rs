//! Shrinking a scene that fails to the smallest one that still does.
//!
//! # Source
//!
//! Delta debugging (Zeller & Hildebrandt 2002), in the order that pays for polygons:
//! surfaces, loops, corners, materials, then numbers. Every step that is kept makes the
//! scene smaller in one of these respects and larger in none before it, so it ends.

use antumbra_geom::Stop;
use antumbra_scene::{LengthUnit, MaterialInput, Quantity, SceneInput};
use glam::DVec3;

/// The size of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Surfaces.
    pub surfaces: usize,
    /// Corners of all outlines and holes.
    pub corners: usize,
    /// Materials.
    pub materials: usize,
    /// Digits of all coordinates, signs and points included.
    pub digits: usize,
}

impl Size {
    /// The size of a scene.
    #[must_use]
    pub fn of(scene: &SceneInput) -> Self {
        let numbers = || scene.surfaces.iter().flat_map(loops).flatten();
        Self {
            surfaces: scene.surfaces.len(),
            corners: numbers().count(),
            materials: scene.materials.len(),
            digits: numbers()
                .flat_map(|p| p.to_array())
                .map(|x| format!("{x}").len())
                .sum(),
        }
    }
}

fn loops(surface: &antumbra_scene::SurfaceInput) -> impl Iterator<Item = &Vec<DVec3>> {
    std::iter::once(&surface.vertices).chain(&surface.holes)
}

/// What came out.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// The smallest scene found that fails.
    pub scene: SceneInput,
    /// Scenes that were tried.
    pub tries: u64,
    /// Nothing more can be removed from it alone: no surface, loop or corner. False if
    /// the search was stopped.
    pub is_minimal: bool,
}

/// Shrinks a scene as long as it fails; `None` if it does not fail in the first place.
///
/// * `fails` — is the failure still there? The same answer for the same scene, or the
///   result is not the same either.
/// * `progress` — told of every smaller scene that fails, after this many tries.
/// * `stop` — ends the search with the smallest scene so far.
pub fn reduce(
    scene: &SceneInput,
    fails: &mut dyn FnMut(&SceneInput) -> bool,
    progress: &mut dyn FnMut(&SceneInput, u64),
    stop: Stop<'_>,
) -> Option<Reduced> {
    let mut search = Search {
        best: SceneInput {
            // What a reader had to say of another file.
            notes: Vec::new(),
            ..scene.clone()
        },
        fails,
        progress,
        tries: 1,
        stop,
    };
    if !(search.fails)(&search.best) {
        return None;
    }
    while search.round() {}
    Some(Reduced {
        tries: search.tries,
        is_minimal: !stop.is_wanted(),
        scene: search.best,
    })
}

struct Search<'a> {
    best: SceneInput,
    fails: &'a mut dyn FnMut(&SceneInput) -> bool,
    progress: &'a mut dyn FnMut(&SceneInput, u64),
    tries: u64,
    stop: Stop<'a>,
}

impl Search<'_> {
    /// Tries everything once; has anything become smaller?
    fn round(&mut self) -> bool {
        let mut is_smaller = self.surfaces();
        is_smaller |= self.holes();
        is_smaller |= self.corners();
        is_smaller |= self.materials();
        is_smaller |= self.units();
        is_smaller |= self.numbers();
        is_smaller && !self.stop.is_wanted()
    }

    /// Keeps a scene if it fails too.
    fn keep(&mut self, candidate: SceneInput) -> bool {
        if self.stop.is_wanted() || candidate == self.best {
            return false;
        }
        self.tries += 1;
        // A try that was cut short by a stop has no answer.
        if !(self.fails)(&candidate) || self.stop.is_wanted() {
            return false;
        }
        self.best = candidate;
        (self.progress)(&self.best, self.tries);
        true
    }

    /// Removes runs of things, halves first, single ones last, until none of them can go.
    fn remove(
        &mut self,
        count: impl Fn(&SceneInput) -> usize,
        least: usize,
        without: impl Fn(&SceneInput, usize, usize) -> SceneInput,
    ) -> bool {
        let mut any = false;
        let mut run = count(&self.best).div_ceil(2);
        while run > 0 {
            let mut removed = false;
            let mut from = 0;
            while from < count(&self.best) {
                let to = (from + run).min(count(&self.best));
                if count(&self.best) - (to - from) >= least
                    && self.keep(without(&self.best, from, to))
                {
                    removed = true;
                } else {
                    from = to;
                }
                if self.stop.is_wanted() {
                    return any | removed;
                }
            }
            any |= removed;
            // Single ones again: with some gone, others may be of no use either.
            run = match run {
                1 if removed => 1,
                1 => 0,
                run => run.div_ceil(2),
            };
        }
        any
    }

    fn surfaces(&mut self) -> bool {
        self.remove(
            |s| s.surfaces.len(),
            1,
            |s, from, to| {
                let mut s = s.clone();
                s.surfaces.drain(from..to);
                s
            },
        )
    }

    fn holes(&mut self) -> bool {
        let mut any = false;
        for k in 0..self.best.surfaces.len() {
            any |= self.remove(
                |s| s.surfaces[k].holes.len(),
                0,
                |s, from, to| {
                    let mut s = s.clone();
                    s.surfaces[k].holes.drain(from..to);
                    s
                },
            );
        }
        any
    }

    fn corners(&mut self) -> bool {
        let mut any = false;
        for k in 0..self.best.surfaces.len() {
            for l in 0..=self.best.surfaces[k].holes.len() {
                any |= self.remove(
                    |s| loops(&s.surfaces[k]).nth(l).map_or(0, Vec::len),
                    3,
                    |s, from, to| {
                        let mut s = s.clone();
                        let surface = &mut s.surfaces[k];
                        match l {
                            0 => surface.vertices.drain(from..to),
                            l => surface.holes[l - 1].drain(from..to),
                        };
                        s
                    },
                );
            }
        }
        any
    }

    fn materials(&mut self) -> bool {
        let mut any = false;
        // Those of no surface, all at once if they have nothing to do with it.
        let mut used = self.best.clone();
        used.materials
            .retain(|m| self.best.surfaces.iter().any(|s| s.material == m.name));
        any |= self.keep(used);
        any |= self.remove(
            |s| s.materials.len(),
            1,
            |s, from, to| {
                let mut s = s.clone();
                s.materials.drain(from..to);
                s
            },
        );
        // One band for all.
        let first = |values: &Vec<f64>| values.first().copied().into_iter().collect();
        let mut one_band = self.best.clone();
        for material in &mut one_band.materials {
            material.reflectance = first(&material.reflectance);
            material.exitance = first(&material.exitance);
        }
        any |= self.keep(one_band);
        // One material for two, the earlier one.
        let mut k = 1;
        while k < self.best.materials.len() {
            let merged = (0..k).any(|j| {
                let mut s = self.best.clone();
                let gone = s.materials.remove(k).name;
                let stays = s.materials[j].name.clone();
                for surface in s.surfaces.iter_mut().filter(|s| s.material == gone) {
                    surface.material.clone_from(&stays);
                }
                self.keep(s)
            });
            any |= merged;
            k += usize::from(!merged);
        }
        let plain: [fn(&mut MaterialInput); 3] = [
            |m| m.two_sided = false,
            |m| m.reflectance = vec![0.0; m.reflectance.len()],
            |m| {
                for x in m.exitance.iter_mut().filter(|x| **x != 0.0) {
                    *x = 1.0;
                }
            },
        ];
        for k in 0..self.best.materials.len() {
            for change in plain {
                let mut s = self.best.clone();
                change(&mut s.materials[k]);
                any |= self.keep(s);
            }
        }
        any
    }

    fn units(&mut self) -> bool {
        let mut s = self.best.clone();
        (s.length_unit, s.quantity) = (LengthUnit::Metre, Quantity::Radiometric);
        self.keep(s)
    }

    /// Coordinates with fewer digits, then nearer to zero. Equal ones stay equal, so that
    /// what meets or lies in one plane goes on doing so.
    fn numbers(&mut self) -> bool {
        let mut any = self.on_a_grid();
        for axis in 0..3 {
            any |= self.moved_to_origin(axis);
            let mut at = 0;
            // Nearest to zero first: they are the ones others are measured from.
            while let Some(&old) = values(&self.best, axis).get(at) {
                any |= simpler(old)
                    .into_iter()
                    .any(|new| self.keep(replaced(&self.best, axis, old, new)));
                at += 1;
                if self.stop.is_wanted() {
                    return any;
                }
            }
        }
        any
    }

    /// Moves all by the value nearest to zero, so that it is zero.
    fn moved_to_origin(&mut self, axis: usize) -> bool {
        let Some(&nearest) = values(&self.best, axis).first() else {
            return false;
        };
        let mut s = self.best.clone();
        for p in corners_mut(&mut s) {
            p[axis] -= nearest;
        }
        nearest != 0.0 && Size::of(&s).digits < Size::of(&self.best).digits && self.keep(s)
    }

    /// All coordinates on the coarsest grid that will do: tried from 1 to a 4096th of the
    /// largest, halving.
    fn on_a_grid(&mut self) -> bool {
        let largest = (0..3)
            .flat_map(|axis| values(&self.best, axis))
            .fold(0.0f64, |most, x| most.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite()) {
            return false;
        }
        let before = Size::of(&self.best);
        let top = largest.log2().ceil() as i32;
        (0..=12).any(|k| {
            let grid = f64::from(top - k).exp2();
            let mut s = self.best.clone();
            for p in corners_mut(&mut s) {
                // Without the sign of a zero.
                *p = (*p / grid).round() * grid + DVec3::ZERO;
            }
            Size::of(&s).digits < before.digits && self.keep(s)
        })
    }
}

/// The different values on an axis, nearest to zero first.
fn values(scene: &SceneInput, axis: usize) -> Vec<f64> {
    let mut values: Vec<f64> = scene
        .surfaces
        .iter()
        .flat_map(loops)
        .flatten()
        .map(|p| p[axis])
        .collect();
    values.sort_by(|a, b| a.abs().total_cmp(&b.abs()).then(a.total_cmp(b)));
    values.dedup_by(|a, b| a.to_bits() == b.to_bits());
    values
}

/// A scene in which one value on an axis is another, wherever it stands.
fn replaced(scene: &SceneInput, axis: usize, old: f64, new: f64) -> SceneInput {
    let mut scene = scene.clone();
    for p in corners_mut(&mut scene) {
        if p[axis].to_bits() == old.to_bits() {
            p[axis] = new;
        }
    }
    scene
}

fn corners_mut(scene: &mut SceneInput) -> impl Iterator<Item = &mut DVec3> {
    scene.surfaces.iter_mut().flat_map(|s| {
        let holes = s.holes.iter_mut().flatten();
        s.vertices.iter_mut().chain(holes)
    })
}

/// How simple a number is: by its digits, then by its distance from zero.
fn complexity(x: f64) -> (usize, f64) {
    (format!("{x}").len(), x.abs())
}

/// Simpler numbers near one, the simplest first.
fn simpler(x: f64) -> Vec<f64> {
    if !x.is_finite() {
        return vec![0.0];
    }
    let mut found = vec![0.0, x.trunc(), x / 2.0, x - x.signum()];
    for k in 0..12 {
        let (binary, decimal) = (f64::from(k).exp2(), 10f64.powi(k));
        found.push((x * binary).round() / binary);
        found.push((x * decimal).round() / decimal);
    }
    let simple = |y: f64| {
        complexity(y).0 < complexity(x).0
            || (complexity(y).0 == complexity(x).0 && y.abs() < x.abs())
    };
    found.retain(|&y| y.is_finite() && simple(y));
    found.iter_mut().for_each(|y| *y += 0.0);
    found.sort_by(|a, b| {
        let ((n, a), (m, b)) = (complexity(*a), complexity(*b));
        n.cmp(&m).then(a.total_cmp(&b))
    });
    found.dedup_by(|a, b| a.to_bits() == b.to_bits());
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_scene::SurfaceInput;
    use glam::dvec3;

    fn surface(name: &str, material: &str, vertices: &[[f64; 3]]) -> SurfaceInput {
        SurfaceInput {
            name: name.to_owned(),
            material: material.to_owned(),
            vertices: vertices.iter().map(|&p| DVec3::from_array(p)).collect(),
            holes: Vec::new(),
        }
    }

    fn material(name: &str, reflectance: &[f64], exitance: &[f64]) -> MaterialInput {
        MaterialInput {
            name: name.to_owned(),
            reflectance: reflectance.to_vec(),
            exitance: exitance.to_vec(),
            two_sided: true,
        }
    }

    /// Thirty quadrilaterals with a hole each, on materials of three bands.
    fn many() -> SceneInput {
        let surfaces = (0..30)
            .map(|k| {
                let x = f64::from(k) * 1.234_567;
                let mut s = surface(
                    &format!("s{k}"),
                    if k % 2 == 0 { "even" } else { "odd" },
                    &[
                        [x, 0.1, 0.3],
                        [x + 1.1, 0.1, 0.3],
                        [x + 1.1, 0.9, 0.3],
                        [x, 0.9, 0.3],
                        [x - 0.1, 0.5, 0.3],
                    ],
                );
                s.holes = vec![vec![
                    dvec3(x + 0.2, 0.2, 0.3),
                    dvec3(x + 0.4, 0.2, 0.3),
                    dvec3(x + 0.2, 0.4, 0.3),
                ]];
                s
            })
            .collect();
        SceneInput {
            length_unit: LengthUnit::Foot,
            quantity: Quantity::Photometric,
            materials: vec![
                material("even", &[0.1, 0.2, 0.3], &[0.0]),
                material("odd", &[0.5], &[1.5, 2.5, 0.0]),
                material("unused", &[0.5], &[0.0]),
            ],
            surfaces,
            triangulate: false,
            notes: vec!["from elsewhere".to_owned()],
        }
    }

    fn run(scene: &SceneInput, mut fails: impl FnMut(&SceneInput) -> bool) -> Option<Reduced> {
        reduce(scene, &mut fails, &mut |_, _| {}, Stop::NEVER)
    }

    #[test]
    fn two_surfaces_that_fail_together_are_what_remains_of_thirty() {
        let fails = |s: &SceneInput| {
            let has = |name: &str| s.surfaces.iter().any(|x| x.name == name);
            has("s7") && has("s22")
        };
        let reduced = run(&many(), fails).expect("it fails");
        let names: Vec<&str> = reduced.scene.surfaces.iter().map(|s| &*s.name).collect();
        assert_eq!(names, ["s7", "s22"]);
        assert!(reduced.is_minimal);
        for s in &reduced.scene.surfaces {
            assert_eq!((s.vertices.len(), s.holes.len()), (3, 0));
            assert!(s.vertices.iter().all(|&p| p == DVec3::ZERO), "{s:?}");
        }
        assert_eq!(reduced.scene.materials.len(), 1);
        assert_eq!(reduced.scene.materials[0].reflectance, [0.0]);
        assert!(!reduced.scene.materials[0].two_sided);
        assert_eq!(reduced.scene.length_unit, LengthUnit::Metre);
        assert!(reduced.scene.notes.is_empty());
    }

    #[test]
    fn what_the_failure_needs_of_corners_holes_and_materials_stays() {
        let fails = |s: &SceneInput| {
            s.surfaces.iter().any(|x| {
                let lamp = s.materials.iter().find(|m| m.name == x.material);
                x.vertices.len() >= 4
                    && x.holes.len() == 1
                    && lamp.is_some_and(|m| m.exitance.iter().any(|&e| e > 0.0))
            })
        };
        let reduced = run(&many(), fails).expect("it fails");
        assert_eq!(
            Size::of(&reduced.scene),
            Size {
                surfaces: 1,
                corners: 7,
                materials: 1,
                digits: 21,
            }
        );
        assert_eq!(reduced.scene.materials[0].exitance, [1.0]);
    }

    #[test]
    fn a_coordinate_becomes_the_simplest_number_that_fails() {
        let scene = SceneInput {
            surfaces: vec![surface(
                "s",
                "m",
                &[[0.123_456, 0.7, 3.0], [1.0, 0.7, 3.0], [0.3, 2.0, 3.0]],
            )],
            ..SceneInput::default()
        };
        // An eighth to nine tenths apart, and well above the plane z = 0.
        let fails = |s: &SceneInput| {
            s.surfaces.iter().any(|s| {
                let [a, b] = [s.vertices[0], s.vertices[1]];
                (0.125..=0.9).contains(&(b.x - a.x)) && a.z > 2.5
            })
        };
        let reduced = run(&scene, fails).expect("it fails");
        let first = &reduced.scene.surfaces[0].vertices;
        assert_eq!((first[0].z, first[0].y), (3.0, 0.0));
        assert!(Size::of(&reduced.scene).digits <= 9 + 2, "{first:?}");
    }

    #[test]
    fn nothing_can_be_removed_from_the_result() {
        // Needs three of the surfaces s0 to s9, whichever.
        let fails = |s: &SceneInput| {
            let n = s.surfaces.iter().filter(|x| x.name.len() == 2).count();
            n >= 3
        };
        let reduced = run(&many(), fails).expect("it fails");
        assert_eq!(reduced.scene.surfaces.len(), 3);
        for k in 0..3 {
            let mut less = reduced.scene.clone();
            less.surfaces.remove(k);
            assert!(!fails(&less));
        }
    }

    #[test]
    fn a_scene_that_does_not_fail_is_none_to_reduce() {
        assert!(run(&many(), |_| false).is_none());
    }

    #[test]
    fn a_stop_keeps_the_smallest_so_far_and_equal_runs_are_equal() {
        let is_wanted = std::sync::atomic::AtomicBool::new(false);
        let asked = || is_wanted.load(std::sync::atomic::Ordering::Relaxed);
        let mut n = 0;
        let stopped = reduce(
            &many(),
            &mut |s| {
                n += 1;
                is_wanted.store(n >= 6, std::sync::atomic::Ordering::Relaxed);
                s.surfaces.iter().any(|x| x.name == "s7")
            },
            &mut |_, _| {},
            Stop::new(&asked),
        )
        .expect("it fails");
        assert!(!stopped.is_minimal);
        assert!(stopped.scene.surfaces.len() < 30);
        assert!(stopped.scene.surfaces.iter().any(|x| x.name == "s7"));

        let fails = |s: &SceneInput| s.surfaces.iter().any(|x| x.name == "s7");
        let [a, b] = [run(&many(), fails), run(&many(), fails)].map(|r| r.expect("it fails"));
        assert_eq!((a.scene, a.tries), (b.scene, b.tries));
    }
}
