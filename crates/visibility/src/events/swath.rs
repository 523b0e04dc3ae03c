//! Swaths: one-parameter families of lines that touch the features of an event.
//!
//! # Source
//!
//! A line is spanned by two points in homogeneous coordinates, each linear in the
//! parameter t: a pencil if one of them stands still (VE), else one family of
//! lines of a quadric (EEE). The Plücker coordinates are polynomials of degree two
//! at most, so is whatever is asked of the line: by which side it passes an edge,
//! where it meets a plane (Teller 1992; Drettakis & Fiume 1994).

use crate::events::roots::Quadratic;
use glam::{DVec3, DVec4};

/// A point in homogeneous coordinates, linear in t: its values at 0 and 1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MovingPoint(pub(crate) [DVec4; 2]);

impl MovingPoint {
    /// A point that stands still.
    pub(crate) fn fixed(x: DVec3) -> Self {
        Self([x.extend(1.0); 2])
    }

    /// A point that runs from `a` to `b`.
    pub(crate) fn along(a: DVec3, b: DVec3) -> Self {
        Self([a.extend(1.0), b.extend(1.0)])
    }

    /// The point `weights[0]·a + weights[1]·b`, both weights linear in t (values
    /// at 0 and at 1): between the ends while both have one sign.
    pub(crate) fn between(a: DVec3, b: DVec3, weights: [[f64; 2]; 2]) -> Self {
        let at = |k: usize| a.extend(1.0) * weights[0][k] + b.extend(1.0) * weights[1][k];
        Self([at(0), at(1)])
    }

    pub(crate) fn at(&self, t: f64) -> DVec4 {
        self.0[0] * (1.0 - t) + self.0[1] * t
    }

    /// A plane's form on the point, linear in t: values at 0 and 1.
    pub(crate) fn form(&self, plane: DVec4) -> [f64; 2] {
        self.0.map(|p| plane.dot(p))
    }
}

/// A family of lines through two moving points.
#[derive(Clone, Debug)]
pub(crate) struct Swath {
    pub(crate) q: MovingPoint,
    pub(crate) r: MovingPoint,
    /// Plücker coordinates (direction, moment) as polynomials in t.
    direction: [DVec3; 3],
    moment: [DVec3; 3],
}

impl Swath {
    pub(crate) fn new(q: MovingPoint, r: MovingPoint) -> Self {
        let ([q0, q1], [r0, r1]) = (q.0, r.0);
        let (dq, dr) = (q1 - q0, r1 - r0);
        let direction = |p: DVec4, s: DVec4| s.truncate() * p.w - p.truncate() * s.w;
        let moment = |p: DVec4, s: DVec4| p.truncate().cross(s.truncate());
        Self {
            q,
            r,
            direction: [
                direction(q0, r0),
                direction(q0, dr) + direction(dq, r0),
                direction(dq, dr),
            ],
            moment: [
                moment(q0, r0),
                moment(q0, dr) + moment(dq, r0),
                moment(dq, dr),
            ],
        }
    }

    /// By which side the line passes the edge from `a` to `b`.
    pub(crate) fn side(&self, a: DVec3, b: DVec3) -> Quadratic {
        let (along, moment) = (b - a, a.cross(b));
        Quadratic(std::array::from_fn(|k| {
            self.direction[k].dot(moment) + self.moment[k].dot(along)
        }))
    }

    /// Where the line at t meets a plane, in homogeneous coordinates.
    pub(crate) fn hit(&self, plane: DVec4, t: f64) -> DVec4 {
        self.blossom(plane, t, t)
    }

    /// The blossom of [`Swath::hit`]: its values at (t₀,t₀), (t₀,t₁), (t₁,t₁) are
    /// the Bézier control points of the curve over t₀..t₁.
    pub(crate) fn blossom(&self, plane: DVec4, s: f64, t: f64) -> DVec4 {
        let (qs, qt) = (self.q.at(s), self.q.at(t));
        let (rs, rt) = (self.r.at(s), self.r.at(t));
        ((qt * plane.dot(rs) + qs * plane.dot(rt)) - (rt * plane.dot(qs) + rs * plane.dot(qt)))
            * 0.5
    }

    /// The form of `plane` where the line meets `on`, up to the weight there.
    pub(crate) fn form_at_hit(&self, plane: DVec4, on: DVec4) -> Quadratic {
        let (q, r) = (&self.q, &self.r);
        Quadratic::product(r.form(on), q.form(plane))
            .minus(Quadratic::product(q.form(on), r.form(plane)))
    }

    /// The weight of the hit with a plane.
    pub(crate) fn weight_at_hit(&self, on: DVec4) -> Quadratic {
        self.form_at_hit(DVec4::W, on)
    }
}

/// A point of homogeneous coordinates, if it is finite.
pub(crate) fn finite(x: DVec4) -> Option<DVec3> {
    let point = x.truncate() / x.w;
    point.is_finite().then_some(point)
}

/// `det(a−p, b−p, c−p)`.
pub(crate) fn orientation(p: DVec3, a: DVec3, b: DVec3, c: DVec3) -> f64 {
    (a - p).cross(b - p).dot(c - p)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn sides_are_determinants_and_hits_lie_on_both() {
        let q = MovingPoint::along(dvec3(0.1, 0.2, 1.0), dvec3(0.9, 0.3, 1.3));
        let r = MovingPoint::between(
            dvec3(0.0, 0.0, 2.0),
            dvec3(1.0, 0.5, 2.5),
            [[0.7, 0.2], [0.1, 1.1]],
        );
        let swath = Swath::new(q, r);
        let (a, b) = (dvec3(0.3, -1.0, 0.4), dvec3(-0.2, 1.0, 0.1));
        let floor = DVec4::new(0.0, 0.0, 1.0, 0.0);
        for t in [0.0, 0.3, 1.0] {
            let [c0, c1, c2] = swath.side(a, b).0;
            let side = c0 + t * (c1 + t * c2);
            let (p, s) = (q.at(t), r.at(t));
            let det = glam::DMat4::from_cols(p, s, a.extend(1.0), b.extend(1.0)).determinant();
            assert!((side.abs() - det.abs()).abs() < 1e-14);
            let x = swath.hit(floor, t);
            assert!(floor.dot(x).abs() < 1e-15);
            let x = x.truncate() / x.w;
            let d = s.truncate() / s.w - p.truncate();
            assert!((x - p.truncate()).cross(d).length() < 1e-13);
        }
    }
}
