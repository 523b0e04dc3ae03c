//! Welding on request: corners of a file that were meant to be one, and miss each other
//! by more than rounding.
//!
//! It happens before a scene is built, so that everything is checked afterwards: a wall
//! whose corners leave its plane is split or refused like any other.

use crate::build::crooked;
use crate::corners::{Mover, Welded, extent, shortest_edge};
use crate::input::SceneInput;
use crate::problem::{Problem, Severity, named};

/// Corners that are nearer than this, relative to the extent, and not one, are told of.
///
/// Files with seven digits miss by 3e-6 (`real/energyplus-lshaped`); gaps that are meant,
/// such as a lamp 1 mm under the ceiling of a room (1.2e-4), are ten times larger.
const SUSPICIOUS: f64 = 1e-5;

impl SceneInput {
    /// Makes one of corners that are no farther from each other than `length` (file
    /// units): each takes the place of the first one in the file that is near, and keeps
    /// its own if none is. None moves by more than `length`, for there are no chains.
    ///
    /// What was moved is added to the notes.
    ///
    /// # Errors
    ///
    /// If an edge is not longer than that: its surface and its length.
    pub fn weld(&mut self, length: f64) -> Result<Welded, Box<Problem>> {
        if let Some((surface, [p, q])) = shortest_edge(self)
            && p.distance(q) <= length
        {
            let found = p.distance(q);
            let unit = self.length_unit.symbol();
            return Err(Box::new(Problem {
                severity: Severity::Error,
                kind: "weld-too-large",
                names: vec![surface.name.clone()],
                found: Some(length),
                allowed: Some(found),
                message: format!(
                    "surface '{}': its edge from {p} to {q} is {found:e} {unit} long, and corners up to {length:e} {unit} apart are to be welded (less than the shortest edge is allowed)",
                    surface.name
                ),
            }));
        }
        let welded = join(self, length);
        if welded.n_moved > 0 {
            self.notes.push(format!(
                "welded: {} corners of {} moved, by at most {:.2e} {}",
                welded.n_moved,
                named(&welded.surfaces),
                welded.farthest,
                self.length_unit.symbol()
            ));
        }
        Ok(welded)
    }

    /// Do corners miss each other by so little that they were probably meant to be one?
    /// A warning that says by how much, and with which length [`weld`](Self::weld) would
    /// join them.
    #[must_use]
    pub fn corner_gaps(&self) -> Option<Problem> {
        let suspicious = SUSPICIOUS * extent(self);
        let shortest = shortest_edge(self).map_or(0.0, |(_, [p, q])| p.distance(q));
        // Not those that are joined without being asked for.
        let mended = crooked::mended(self).map(|mended| mended.input);
        let mut corners = mended.unwrap_or_else(|| self.clone());
        let gaps = join(&mut corners, suspicious.min(0.5 * shortest));
        let wanted = round_up(gaps.farthest);
        if gaps.n_moved == 0 || wanted >= shortest {
            return None;
        }
        let unit = self.length_unit.symbol();
        Some(Problem {
            severity: Severity::Warning,
            kind: "corner-gaps",
            message: format!(
                "{} corners miss their neighbours by up to {:.2e} {unit}: welding with {wanted:e} {unit} would join them",
                gaps.n_moved, gaps.farthest
            ),
            names: gaps.surfaces,
            found: Some(gaps.farthest),
            allowed: None,
        })
    }
}

/// The next of 1, 2 and 5 times a power of ten that is larger by a tenth or more.
fn round_up(x: f64) -> f64 {
    let wanted = 1.1 * x;
    let power = wanted.log10().floor() as i32;
    [1, 2, 5, 10]
        .into_iter()
        .filter_map(|digit| format!("{digit}e{power}").parse().ok())
        .find(|&candidate: &f64| candidate >= wanted)
        .unwrap_or(wanted)
}

/// Moves corners to the first within a length.
fn join(input: &mut SceneInput, length: f64) -> Welded {
    let mut mover = Mover::new(extent(input), length);
    for surface in &mut input.surfaces {
        mover.surface(surface, true);
    }
    mover.welded
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::SurfaceInput;
    use glam::{DVec3, dvec3};

    fn triangle(name: &str, corners: [DVec3; 3]) -> SurfaceInput {
        SurfaceInput {
            name: name.to_owned(),
            material: "m".to_owned(),
            vertices: corners.to_vec(),
            holes: Vec::new(),
        }
    }

    /// Two triangles with a common edge, up to a gap, which is wider at one end.
    fn two(gap: f64) -> SceneInput {
        SceneInput {
            surfaces: vec![
                triangle("a", [DVec3::ZERO, DVec3::X, DVec3::Y]),
                triangle(
                    "b",
                    [
                        dvec3(1.0, gap, 0.0),
                        dvec3(1.0, 1.0, 0.0),
                        dvec3(0.0, 1.0, 0.5 * gap),
                    ],
                ),
            ],
            ..SceneInput::default()
        }
    }

    #[test]
    fn corners_take_the_place_of_the_first_and_move_no_farther_than_asked_for() {
        let mut input = two(1e-5);
        let welded = input.weld(2e-5).expect("shorter than all edges");
        assert_eq!((welded.n_moved, welded.farthest), (2, 1e-5));
        assert_eq!(input.surfaces[1].vertices[0], DVec3::X);
        assert_eq!(input.surfaces[1].vertices[2], DVec3::Y);
        assert!(input.notes[0].contains("2 corners of 'b' moved, by at most 1.00e-5 m"));

        let mut input = two(1e-5);
        let welded = input.weld(0.7e-5).expect("shorter than all edges");
        assert_eq!(welded.n_moved, 1, "the other is too far");
        for (before, after) in two(1e-5).surfaces.iter().zip(&input.surfaces) {
            for (p, q) in before.vertices.iter().zip(&after.vertices) {
                assert!(p.distance(*q) <= 0.7e-5);
            }
        }
    }

    #[test]
    fn chains_do_not_grow() {
        let step = |k: f64| dvec3(k, 0.0, 0.0);
        let mut input = SceneInput {
            surfaces: (0..5)
                .map(|k| {
                    let name = format!("s{k}");
                    triangle(
                        &name,
                        [step(0.75 * f64::from(k)), DVec3::Y * 9.0, DVec3::Z * 9.0],
                    )
                })
                .collect(),
            ..SceneInput::default()
        };
        input.weld(1.0).expect("shorter than all edges");
        let places: Vec<f64> = input.surfaces.iter().map(|s| s.vertices[0].x).collect();
        assert_eq!(places, [0.0, 0.0, 1.5, 1.5, 3.0]);
    }

    #[test]
    fn no_edge_may_be_as_short_as_the_length() {
        let mut input = two(1e-5);
        input.surfaces[1].vertices[1] = dvec3(1.0, 0.01, 0.0);
        let before = input.clone();
        let problem = input.weld(0.02).expect_err("an edge of 0.01");
        assert_eq!(problem.names, ["b"]);
        assert!(
            problem.message.contains("its edge from"),
            "{}",
            problem.message
        );
        assert_eq!(input, before);
    }

    #[test]
    fn gaps_of_rounding_size_are_told_with_the_length_that_joins_them() {
        let gaps = two(4e-6).corner_gaps().expect("a gap");
        assert!(gaps.message.contains("2 corners"), "{}", gaps.message);
        assert!(
            gaps.message.contains("welding with 5e-6 m"),
            "{}",
            gaps.message
        );
        assert!(two(0.0).corner_gaps().is_none());
        assert!(two(1e-3).corner_gaps().is_none());
        let mut joined = two(4e-6);
        joined.weld(5e-6).expect("shorter than all edges");
        assert!(joined.corner_gaps().is_none());
    }
}
