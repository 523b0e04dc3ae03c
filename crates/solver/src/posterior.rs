//! Steps after meshing: node relocation, splitting, degree elevation.
//!
//! Each is tried on every receiver, measured at check points, and taken back where it
//! does not lower the error.

use crate::direct::DirectMeshes;
use crate::field::posterior::Measure;
use crate::field::{Field, Light};
use antumbra_geom::{Control, Stop};
use rayon::prelude::*;

/// A step after meshing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AfterStep {
    /// Nodes move to where elements err most (r-refinement).
    Relocate,
    /// The elements that err most are split (h-refinement).
    Split,
    /// The degree of the elements rises by one (p-refinement).
    Elevate,
    /// Every element is split into four of half its size (uniform h-refinement).
    Halve,
}

impl AfterStep {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Relocate, Self::Split, Self::Elevate, Self::Halve];

    /// Its name on the command line.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Relocate => "relocate",
            Self::Split => "split",
            Self::Elevate => "elevate",
            Self::Halve => "halve",
        }
    }

    /// The step with this key.
    #[must_use]
    pub fn from_key(key: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|s| s.key() == key)
    }
}

/// What a step did.
#[derive(Clone, Debug, PartialEq)]
pub struct Improvement {
    /// The step.
    pub step: AfterStep,
    /// Receivers that are better now.
    pub n_improved: usize,
    /// Receivers on which it was taken back, for it did not lower the measured error.
    pub n_taken_back: usize,
    /// The largest measured error before and after, relative to the peak.
    pub max_error: [f64; 2],
    /// The root mean square of the elements' measured errors over the area, before and
    /// after.
    pub rms_error: [f64; 2],
    /// Why nothing changed, if so.
    pub reason: Option<&'static str>,
}

/// What came of a step on a receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// Nothing to be done there.
    Untouched,
    Improved,
    TakenBack,
    Stopped,
}

/// Parts of the way to where nodes belong that are tried, one after the other.
const DAMPINGS: [f64; 3] = [0.7, 0.35, 0.15];

/// A step has to lower the root mean square to this share of what it was.
const WORTH: f64 = 0.99;

/// Elements that err more than this share of the largest error are split.
const LARGE_ERROR: f64 = 0.4;

/// Memory that an element and what is kept to take a step back take, about.
const BYTES_PER_ELEMENT: u64 = 1500;

/// Meshes with fewer elements are changed without asking for room.
const MANY: usize = 4096;

/// So often nodes move.
const SWEEPS: usize = 3;

impl DirectMeshes {
    /// Carries out a step on every receiver where it lowers the measured error; on none if
    /// there would be too many elements, or no room for them.
    pub fn improve(
        &mut self,
        step: AfterStep,
        light: &dyn Light,
        most_elements: usize,
        control: &Control<'_>,
    ) -> Improvement {
        let stop = control.stop;
        let (scale, allowed) = (self.scale.per_band(), self.allowed());
        // Errors before and after are measured at the same kinds of points.
        for field in &mut self.fields {
            field.verify(light, &allowed, stop);
        }
        let before = self.measure(&scale, &allowed);
        let growth = match step {
            AfterStep::Halve => 4,
            AfterStep::Split | AfterStep::Elevate => 2,
            AfterStep::Relocate => 1,
        };
        let wanted = growth * self.n_elements();
        let more = (wanted as u64) * BYTES_PER_ELEMENT;
        let is_too_much = match step {
            AfterStep::Relocate => false,
            _ => wanted > most_elements || (wanted > MANY && !(control.has_room)(more)),
        };
        if is_too_much {
            return Improvement {
                step,
                n_improved: 0,
                n_taken_back: 0,
                max_error: [before.max; 2],
                rms_error: [before.rms(); 2],
                reason: Some("there is no room for so many elements"),
            };
        }
        let outcomes: Vec<Outcome> = self
            .fields
            .par_iter_mut()
            .map(|field| {
                if field.is_dark || field.nodes.is_empty() {
                    return Outcome::Untouched;
                }
                let try_step = Try {
                    light,
                    scale: &scale,
                    allowed: &allowed,
                    largest: before.max,
                    stop,
                };
                try_step.on(field, step)
            })
            .collect();
        self.gather_peak();
        let after = self.measure(&scale, &allowed);
        if outcomes.contains(&Outcome::Stopped) {
            self.set_stopped();
        }
        let count = |wanted: Outcome| outcomes.iter().filter(|&&o| o == wanted).count();
        let (n_improved, n_taken_back) = (count(Outcome::Improved), count(Outcome::TakenBack));
        let reason = if n_improved > 0 {
            None
        } else if count(Outcome::Stopped) > 0 {
            Some("it was stopped")
        } else if n_taken_back > 0 {
            Some("it did not lower the measured error on any receiver")
        } else {
            Some(match step {
                AfterStep::Relocate => "no node is free to move, or no element errs",
                AfterStep::Split => "no element errs that can be split",
                AfterStep::Elevate => "the degree is the highest already",
                AfterStep::Halve => "there are no elements in the light",
            })
        };
        Improvement {
            step,
            n_improved,
            n_taken_back,
            max_error: [before.max, after.max],
            rms_error: [before.rms(), after.rms()],
            reason,
        }
    }

    fn measure(&self, scale: &[f64], allowed: &[f64]) -> Measure {
        self.fields
            .iter()
            .map(|f| f.measure(scale, allowed))
            .fold(Measure::default(), Measure::and)
    }
}

/// What a try on one receiver needs to know.
struct Try<'a> {
    light: &'a dyn Light,
    scale: &'a [f64],
    allowed: &'a [f64],
    /// The largest error of all receivers.
    largest: f64,
    stop: Stop<'a>,
}

impl Try<'_> {
    fn on(&self, field: &mut Field, step: AfterStep) -> Outcome {
        match step {
            AfterStep::Relocate => {
                let mut outcome = Outcome::Untouched;
                for _ in 0..SWEEPS {
                    let of_sweep = DAMPINGS
                        .into_iter()
                        .map(|damping| self.attempt(field, |f| self.relocate(f, damping)))
                        .find(|o| *o != Outcome::TakenBack)
                        .unwrap_or(Outcome::TakenBack);
                    if of_sweep != Outcome::Improved {
                        return if outcome == Outcome::Improved {
                            outcome
                        } else {
                            of_sweep
                        };
                    }
                    outcome = of_sweep;
                }
                outcome
            }
            AfterStep::Split => self.attempt(field, |f| {
                let levels: Vec<u8> = (0..f.mesh.triangles.len())
                    .map(|t| {
                        let is_large = f.relative_error(t, self.scale) > LARGE_ERROR * self.largest;
                        u8::from(is_large && !f.is_at_resolution(t, self.allowed))
                    })
                    .collect();
                let marked: Vec<u32> = (0..levels.len() as u32)
                    .filter(|&t| levels[t as usize] > 0)
                    .collect();
                if marked.is_empty() {
                    return false;
                }
                f.bisect(&marked);
                true
            }),
            AfterStep::Elevate => self.attempt(field, Field::elevate),
            AfterStep::Halve => self.attempt(field, Field::halve),
        }
    }

    /// Moves nodes, and those back around which the error rose: it is known only then.
    fn relocate(&self, field: &mut Field, damping: f64) -> bool {
        let (places, squares) = (field.mesh.vertices.clone(), field.squares(self.scale));
        if field.relocate(damping, self.scale, self.allowed) == 0 {
            return false;
        }
        if field.evaluate_anew(self.light, self.allowed, self.stop) {
            field.put_back(&places, &squares, self.scale);
        }
        true
    }

    /// Changes a field, and takes that back if it is no better.
    fn attempt(&self, field: &mut Field, change: impl FnOnce(&mut Field) -> bool) -> Outcome {
        let measured = field.measure(self.scale, self.allowed);
        let before = field.before();
        if !change(field) {
            return Outcome::Untouched;
        }
        if !field.evaluate_anew(self.light, self.allowed, self.stop) {
            field.go_back(before);
            return Outcome::Stopped;
        }
        let after = field.measure(self.scale, self.allowed);
        let is_better = after.square < WORTH * WORTH * measured.square
            && after.max <= measured.max.max(0.5 * self.largest);
        if is_better {
            Outcome::Improved
        } else {
            field.go_back(before);
            Outcome::TakenBack
        }
    }
}
