//! A visible fragment is dealt out to the elements it shows: to the coarsest ones that are
//! good enough for what the point gets from it.

use super::basis::{N, RULE, phi};
use super::forest::Forest;
use antumbra_geom::DVec3;
use antumbra_scene::Aabb;
use antumbra_visibility::contour_sum;
use smallvec::SmallVec;

/// Corners of a convex polygon, relative to the point.
type Polygon = SmallVec<[DVec3; 12]>;

/// The share of an element in what a point sees.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portion {
    pub(crate) element: u32,
    /// Of its nodes; they add up to the form factor of what is seen of it.
    pub(crate) weights: [f64; N],
}

/// What dealing asks of links.
///
/// An element is good enough if what it misses, and what the rule misses, is less than
/// `each`: form factors of all add up to 1 at most, so that a point errs by no more. Or if it
/// is seen so little that the point's irradiance changes by less than `link`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Demands {
    /// Relative to the peak.
    pub(crate) each: f64,
    /// Relative to the peak.
    pub(crate) link: f64,
    /// Whole elements that miss more than this are to be divided.
    pub(crate) divide: f64,
}

impl Demands {
    /// Is an error too large for something that is seen with this form factor?
    fn are_missed_by(&self, error: f64, factor: f64) -> bool {
        error > self.each && factor * error > self.link
    }
}

/// Deals fragments out for one point.
pub(crate) struct Dealer<'a> {
    pub(crate) forest: &'a Forest,
    pub(crate) point: DVec3,
    pub(crate) normal: DVec3,
    pub(crate) demands: Demands,
    pub(crate) portions: &'a mut Vec<Portion>,
    /// Whole elements that are too coarse for this point.
    pub(crate) too_coarse: &'a mut Vec<u32>,
}

/// Elements seen up to this share are seen whole.
const WHOLE: f64 = 1.0 - 1e-9;

/// Shares below this are rounding.
const NOTHING: f64 = 1e-13;

/// The rule of seven points misses about this times the fourth power of size over distance.
const RULE_ERROR: f64 = 0.05;

/// Parts are divided for the rule no more often than this.
const DEEPEST: u32 = 30;

/// A fragment of which less than this share is found in elements lies beside them all: it
/// goes to the nearest.
const FOUND: f64 = 0.5;

impl Dealer<'_> {
    /// Deals out a fragment of a side (corners in space) with its form factor.
    pub(crate) fn deal(&mut self, side: usize, fragment: &[DVec3], factor: f64) {
        let start = self.portions.len();
        let polygon: Polygon = fragment.iter().map(|&p| p - self.point).collect();
        let forest = self.forest;
        let bounds = Aabb::of(fragment.iter().copied());
        let roots = &forest.sides[side].roots;
        if roots.len() <= FEW_ROOTS {
            for root in roots.clone() {
                self.inside(root, &polygon);
            }
        } else {
            let mut found: SmallVec<[u32; 32]> = SmallVec::new();
            forest.roots_in(side, &bounds, |root| found.push(root));
            found.sort_unstable();
            for root in found {
                self.inside(root, &polygon);
            }
        }
        let dealt: f64 = self.portions[start..].iter().map(Portion::factor).sum();
        if dealt > FOUND * factor {
            // What rounding lost along the edges of elements.
            for portion in &mut self.portions[start..] {
                portion.weights = portion.weights.map(|w| w * factor / dealt);
            }
        } else {
            self.portions.truncate(start);
            let middle = fragment.iter().sum::<DVec3>() / fragment.len().max(1) as f64;
            self.deal_at(side, middle, factor);
        }
    }

    /// Gives all of a factor to one place of a side, or the element nearest to it.
    pub(crate) fn deal_at(&mut self, side: usize, place: DVec3, factor: f64) {
        let forest = self.forest;
        let root = forest.root_at(side, place).or_else(|| {
            let outside = |e: u32| {
                let at = forest.elements[e as usize].barycentric(place);
                -at.into_iter().fold(f64::INFINITY, f64::min)
            };
            let roots = forest.sides[side].roots.clone();
            roots.min_by(|&a, &b| outside(a).total_cmp(&outside(b)))
        });
        if let Some(element) = root {
            let of = &forest.elements[element as usize];
            let at = inside_of(of.barycentric(place));
            let weights = phi(at).map(|w| w * factor);
            self.portions.push(Portion { element, weights });
        }
    }

    /// Deals out what is inside of an element.
    fn inside(&mut self, e: u32, polygon: &Polygon) {
        let element = &self.forest.elements[e as usize];
        let outward = self.forest.sides[element.side as usize].normal;
        let mut part = polygon.clone();
        for k in 0..3 {
            let a = element.corners[k] - self.point;
            let b = element.corners[(k + 1) % 3] - self.point;
            let inward = outward.cross(b - a);
            part = clip(&part, inward, inward.dot(a));
            if part.len() < 3 {
                return;
            }
        }
        let share = area(&part) / element.area;
        if share > WHOLE {
            let whole = element.corners.map(|p| p - self.point);
            self.part(e, &whole.into_iter().collect(), true);
        } else if share > NOTHING {
            self.part(e, &part, false);
        }
    }

    /// A part of an element, or all of it.
    fn part(&mut self, e: u32, part: &Polygon, is_whole: bool) {
        let forest = self.forest;
        let factor = contour_sum(part, self.normal);
        if factor <= 0.0 {
            return;
        }
        let of = e as usize;
        let ratio = nearness(part);
        let rule = forest.largest[of] * (RULE_ERROR * ratio * ratio).min(0.5);
        // What a polynomial misses is orthogonal to it: seen whole from afar, it cancels.
        let cancels = if is_whole {
            (0.5 * ratio).min(1.0)
        } else {
            1.0
        };
        let missed = forest.missed[of] * cancels;
        let element = &forest.elements[of];
        let is_too_coarse =
            self.demands.are_missed_by(rule, factor) || self.demands.are_missed_by(missed, factor);
        if element.is_divided() && is_too_coarse {
            for quarter in element.quarters..element.quarters + 4 {
                if is_whole {
                    let corners = forest.elements[quarter as usize].corners;
                    self.part(
                        quarter,
                        &corners.map(|p| p - self.point).into_iter().collect(),
                        true,
                    );
                } else {
                    self.inside(quarter, part);
                }
            }
            return;
        }
        if !element.is_divided() && factor * missed > self.demands.divide {
            self.too_coarse.push(e);
        }
        let mut weights = [0.0; N];
        // A fan around the corner nearest to the point: where the element touches the
        // point, other fans have triangles that span half of the sky.
        let n = part.len();
        let by_distance = |&i: &usize, &j: &usize| {
            let squared = |k: usize| part[k].length_squared();
            squared(i).total_cmp(&squared(j))
        };
        let apex = (0..n).min_by(by_distance).unwrap_or(0);
        for k in 1..n - 1 {
            let triangle = [part[apex], part[(apex + k) % n], part[(apex + k + 1) % n]];
            let factor = match n {
                3 => factor,
                _ => contour_sum(&triangle, self.normal),
            };
            self.integrate(e, triangle, factor, 0, &mut weights);
        }
        self.portions.push(Portion {
            element: e,
            weights,
        });
    }

    /// Adds the weights of a triangle of an element; they add up to its factor.
    fn integrate(
        &mut self,
        e: u32,
        [a, b, c]: [DVec3; 3],
        factor: f64,
        depth: u32,
        weights: &mut [f64; N],
    ) {
        if factor <= 0.0 {
            return;
        }
        let element = &self.forest.elements[e as usize];
        let ratio = nearness(&[a, b, c]);
        let size = longest_sq(&[a, b, c]).sqrt();
        // The rule misses no more than what values vary by over the part.
        let varies = (size / element.longest).min(1.0);
        let rule = (RULE_ERROR * ratio * ratio).min(0.5) * varies;
        let missed = self.forest.largest[e as usize] * rule;
        if depth < DEEPEST && self.demands.are_missed_by(missed, factor) {
            let (ab, bc, ca) = ((a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0);
            for part in [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]] {
                let factor = contour_sum(&part, self.normal);
                self.integrate(e, part, factor, depth + 1, weights);
            }
            return;
        }
        let facing = self.forest.sides[element.side as usize].normal;
        let (mut sum, mut of_nodes) = (0.0, [0.0; N]);
        for (at, weight) in RULE {
            let y = a * at[0] + b * at[1] + c * at[2];
            let r_sq = y.length_squared();
            let kernel = weight * self.normal.dot(y) * -facing.dot(y) / (r_sq * r_sq);
            if kernel > 0.0 {
                sum += kernel;
                let phi = phi(element.barycentric(y + self.point));
                for (of_node, phi) in of_nodes.iter_mut().zip(phi) {
                    *of_node += kernel * phi;
                }
            }
        }
        if sum <= 0.0 {
            sum = 1.0;
            of_nodes = phi(inside_of(
                element.barycentric((a + b + c) / 3.0 + self.point),
            ));
        }
        for (weight, of_node) in weights.iter_mut().zip(of_nodes) {
            *weight += of_node * factor / sum;
        }
    }
}

impl Portion {
    /// Form factor of what is seen of the element.
    pub(crate) fn factor(&self) -> f64 {
        self.weights.iter().sum()
    }
}

/// Sides with no more roots than this need no search for them.
const FEW_ROOTS: usize = 4;

/// The nearest coordinates inside of the triangle, about.
fn inside_of(at: [f64; 3]) -> [f64; 3] {
    let at = at.map(|l| l.max(0.0));
    let sum: f64 = at.iter().sum();
    at.map(|l| l / sum)
}

/// Squared size over squared distance of a polygon around the point.
fn nearness(corners: &[DVec3]) -> f64 {
    let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
    longest_sq(corners) / middle.length_squared()
}

/// The largest squared distance between two corners.
fn longest_sq(corners: &[DVec3]) -> f64 {
    let mut longest = 0.0f64;
    for (i, p) in corners.iter().enumerate() {
        for q in &corners[..i] {
            longest = longest.max((*p - *q).length_squared());
        }
    }
    longest
}

fn area(polygon: &Polygon) -> f64 {
    let mut sum = DVec3::ZERO;
    for k in 1..polygon.len() - 1 {
        sum += (polygon[k] - polygon[0]).cross(polygon[k + 1] - polygon[0]);
    }
    0.5 * sum.length()
}

/// The part of a convex polygon where `normal · x ≥ offset`.
fn clip(polygon: &Polygon, normal: DVec3, offset: f64) -> Polygon {
    let mut part = Polygon::new();
    let n = polygon.len();
    for i in 0..n {
        let (p, q) = (polygon[i], polygon[(i + 1) % n]);
        let (a, b) = (normal.dot(p) - offset, normal.dot(q) - offset);
        if a >= 0.0 {
            part.push(p);
        }
        if (a >= 0.0) != (b >= 0.0) {
            part.push(p + (q - p) * (a / (a - b)));
        }
    }
    part
}
