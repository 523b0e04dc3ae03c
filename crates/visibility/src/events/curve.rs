//! Critical curves: segments, and arcs of conics.

use crate::events::{Event, EventKind};
use antumbra_scene::{EdgeId, FaceId, VertexId};
use glam::DVec3;

/// The parameters at which [`CriticalCurve::jumps`] are known.
pub const JUMP_PLACES: [f64; 7] = [0.01, 0.12, 0.3, 0.5, 0.7, 0.88, 0.99];

/// A curve on a receiver across which a derivative of irradiance jumps.
#[derive(Clone, Debug, PartialEq)]
pub struct CriticalCurve {
    /// What generates it.
    pub event: Event,
    /// The emitter; `None` for contacts of occluders, which cut off any light.
    pub emitter: Option<FaceId>,
    /// Where it runs, scene units.
    pub shape: Shape,
    /// The lines at its ends.
    pub ends: [CurveEnd; 2],
    /// The jump of the first derivative that jumps across it ([`crate::jump_at`]),
    /// at the parameters [`JUMP_PLACES`]; 0 for contacts, which are not measured.
    pub jumps: [f64; JUMP_PLACES.len()],
}

impl CriticalCurve {
    /// Its kind.
    #[must_use]
    pub fn kind(&self) -> EventKind {
        self.event.kind()
    }

    /// The largest of [`CriticalCurve::jumps`] on the part between two parameters,
    /// the nearest places outside included.
    #[must_use]
    pub fn largest_jump(&self, from: f64, to: f64) -> f64 {
        let (from, to) = (from.min(to), from.max(to));
        let first = JUMP_PLACES.iter().rposition(|&t| t <= from).unwrap_or(0);
        let last = JUMP_PLACES
            .iter()
            .position(|&t| t >= to)
            .unwrap_or(JUMP_PLACES.len() - 1);
        self.jumps[first..=last].iter().copied().fold(0.0, f64::max)
    }
}

/// What line a critical curve ends with. Curves that end with the same line end at
/// the same point, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum CurveEnd {
    /// The line through two vertices, ascending.
    Vertices([VertexId; 2]),
    /// The line through a vertex and two edges, ascending.
    VertexEdges(VertexId, [EdgeId; 2]),
    /// Any other: four edges, the border of the receiver, a plane.
    Other,
}

/// Where a critical curve runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A straight segment between two points.
    Segment([DVec3; 2]),
    /// An arc of a conic: a rational quadratic Bézier curve with these control
    /// points; the outer ones have the weight 1.
    Arc {
        /// Control points.
        points: [DVec3; 3],
        /// Weight of the middle one, positive.
        weight: f64,
    },
}

/// Halvings after which an arc is taken for its chords.
const MOST_HALVINGS: u32 = 12;

impl Shape {
    /// Its ends.
    #[must_use]
    pub fn ends(&self) -> [DVec3; 2] {
        match *self {
            Self::Segment(ends) => ends,
            Self::Arc { points, .. } => [points[0], points[2]],
        }
    }

    /// The point at a parameter from 0 to 1.
    #[must_use]
    pub fn at(&self, t: f64) -> DVec3 {
        match *self {
            Self::Segment([a, b]) => a + (b - a) * t,
            Self::Arc { points, weight } => {
                let s = 1.0 - t;
                let w = [s * s, 2.0 * s * t * weight, t * t];
                (points[0] * w[0] + points[1] * w[1] + points[2] * w[2]) / (w[0] + w[1] + w[2])
            }
        }
    }

    /// Greatest distance from its chord.
    ///
    /// # Source
    ///
    /// At the shoulder point of a conic in standard form: the distance of the
    /// middle control point times w/(1+w) (Farin, *NURBS*, 1999).
    #[must_use]
    pub fn sagitta(&self) -> f64 {
        match *self {
            Self::Segment(_) => 0.0,
            Self::Arc { points, weight } => {
                let chord = (points[2] - points[0]).normalize_or_zero();
                let off = points[1] - points[0];
                (off - chord * off.dot(chord)).length() * weight / (1.0 + weight)
            }
        }
    }

    /// A polyline that is nowhere farther from the curve than `tolerance`.
    #[must_use]
    pub fn polyline(&self, tolerance: f64) -> Vec<DVec3> {
        let mut points = vec![self.ends()[0]];
        self.flatten(tolerance, MOST_HALVINGS, &mut points);
        points
    }

    fn flatten(&self, tolerance: f64, depth: u32, out: &mut Vec<DVec3>) {
        match *self {
            Self::Arc { points, weight } if depth > 0 && self.sagitta() > tolerance => {
                let [p, c, q] = points;
                let (a, b) = (
                    (p + c * weight) / (1.0 + weight),
                    (q + c * weight) / (1.0 + weight),
                );
                let middle = (a + b) / 2.0;
                let weight = ((1.0 + weight) / 2.0).sqrt();
                for points in [[p, a, middle], [middle, b, q]] {
                    Self::Arc { points, weight }.flatten(tolerance, depth - 1, out);
                }
            }
            _ => out.push(self.ends()[1]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn a_quarter_of_a_circle_is_flattened_to_the_tolerance() {
        let arc = Shape::Arc {
            points: [
                dvec3(1.0, 0.0, 0.0),
                dvec3(1.0, 1.0, 0.0),
                dvec3(0.0, 1.0, 0.0),
            ],
            weight: 0.5f64.sqrt(),
        };
        assert!((arc.sagitta() - (1.0 - 0.5f64.sqrt())).abs() < 1e-15);
        let line = arc.polyline(1e-4);
        for pair in line.windows(2) {
            assert!((pair[0].length() - 1.0).abs() < 1e-14);
            assert!(((pair[0] + pair[1]) / 2.0).length() > 1.0 - 1e-4);
        }
        assert!(line.len() < 130);
    }
}
