//! A polygon without the polygons that lie in it.
//!
//! Window and wall of a View3D file lie in one plane, one over the other. Both
//! would receive the same light, so the wall gets a hole where the window is, or
//! a notch where the door stands on its border.
//!
//! Corners that mean one point are welded, edges are cut where corners lie on
//! them, and from then on the border is combinatorial: an edge that is run
//! through both ways is none.

use antumbra_geom::{Chart, newell_normal, point_in_polygon, segments_cross, signed_area};
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// Points closer than this part of the base's size are one; View3D's own measure
/// for this test is 1e-6 of the window's.
const WELD: f64 = 1e-6;
/// A cut may lie this part of its size off the plane, as in View3D.
const FLAT: f64 = 1e-5;

/// What is left of a polygon: one connected piece.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Region {
    /// In the direction of the base.
    pub(crate) outline: Vec<DVec3>,
    /// Against it.
    pub(crate) holes: Vec<Vec<DVec3>>,
}

/// Why a cut does not fit: which, and how.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Misfit {
    /// Off the base's plane, by this length.
    OffPlane(usize, f64),
    /// Its front is not on the side of the base's.
    Turned(usize),
    /// Partly or wholly outside the base.
    Outside(usize),
    /// Two cuts lie over one another.
    Overlap(usize, usize),
}

/// `base` without `cuts`, each a simple loop counter-clockwise seen from the
/// base's front; they may touch the border and one another.
///
/// Returns the pieces that are left, none if the cuts cover all of it. A base
/// without an area is returned as it is, for the check of the scene to see.
///
/// # Errors
///
/// [`Misfit`] for the first cut that is not in the base.
pub(crate) fn subtract(base: &[DVec3], cuts: &[&[DVec3]]) -> Result<Vec<Region>, Misfit> {
    let normal = newell_normal(base).normalize_or_zero();
    if normal == DVec3::ZERO || !normal.is_finite() {
        let outline = base.to_vec();
        let holes = Vec::new();
        return Ok(vec![Region { outline, holes }]);
    }
    let chart = Chart::new(base[0], normal);
    let size = extent(base);
    let mut plan = Plan {
        chart,
        tolerance: WELD * size,
        positions: Vec::new(),
        points: Vec::new(),
    };
    let base_loop = plan.add(base);
    let mut cut_loops = Vec::with_capacity(cuts.len());
    for (i, cut) in cuts.iter().enumerate() {
        let off = cut
            .iter()
            .map(|&p| chart.height(p).abs())
            .fold(0.0, f64::max);
        if off > FLAT * extent(cut) {
            return Err(Misfit::OffPlane(i, off));
        }
        if newell_normal(cut).dot(normal) < 0.0 {
            return Err(Misfit::Turned(i));
        }
        cut_loops.push(plan.add(cut));
    }
    let base_loop = plan.cut_at_corners(&base_loop);
    let cut_loops: Vec<Vec<usize>> = cut_loops.iter().map(|c| plan.cut_at_corners(c)).collect();
    plan.check(&base_loop, &cut_loops)?;

    let mut border: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    let mut run = |a: usize, b: usize| match border.get_mut(&(b, a)) {
        Some(n) if *n > 1 => *n -= 1,
        Some(_) => {
            border.remove(&(b, a));
        }
        None => *border.entry((a, b)).or_default() += 1,
    };
    for (a, b) in edges(&base_loop) {
        run(a, b);
    }
    for (a, b) in cut_loops.iter().flat_map(|cut| edges(cut)) {
        run(b, a);
    }
    Ok(plan.regions(plan.loops(border)))
}

fn extent(corners: &[DVec3]) -> f64 {
    let low = corners.iter().copied().reduce(DVec3::min);
    let high = corners.iter().copied().reduce(DVec3::max);
    low.zip(high)
        .map_or(0.0, |(low, high)| (high - low).length())
}

fn edges(corners: &[usize]) -> impl Iterator<Item = (usize, usize)> + '_ {
    let n = corners.len();
    (0..n).map(move |i| (corners[i], corners[(i + 1) % n]))
}

/// The corners of base and cuts, welded.
struct Plan {
    chart: Chart,
    tolerance: f64,
    positions: Vec<DVec3>,
    /// The same in the chart.
    points: Vec<DVec2>,
}

impl Plan {
    fn add(&mut self, corners: &[DVec3]) -> Vec<usize> {
        let mut ids: Vec<usize> = Vec::with_capacity(corners.len());
        for &position in corners {
            let point = self.chart.to_chart(position);
            let known = self
                .points
                .iter()
                .position(|p| p.distance(point) <= self.tolerance);
            let id = known.unwrap_or_else(|| {
                self.positions.push(position);
                self.points.push(point);
                self.points.len() - 1
            });
            ids.push(id);
        }
        ids.dedup();
        if ids.len() > 1 && ids.first() == ids.last() {
            ids.pop();
        }
        ids
    }

    /// Distance of a point from an edge, and where along it, from 0 to 1.
    fn distance_and_place(&self, point: DVec2, (a, b): (usize, usize)) -> (f64, f64) {
        let (a, b) = (self.points[a], self.points[b]);
        let along = b - a;
        let t = ((point - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        (point.distance(a + t * along), t)
    }

    /// The loop with the corners of all others that lie on it.
    fn cut_at_corners(&self, corners: &[usize]) -> Vec<usize> {
        let mut cut = Vec::with_capacity(corners.len());
        for (a, b) in edges(corners) {
            let mut on: Vec<(f64, usize)> = (0..self.points.len())
                .filter(|&p| p != a && p != b)
                .filter_map(|p| {
                    let (distance, t) = self.distance_and_place(self.points[p], (a, b));
                    (distance <= self.tolerance).then_some((t, p))
                })
                .collect();
            on.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
            cut.push(a);
            cut.extend(on.into_iter().map(|(_, p)| p));
        }
        cut
    }

    fn is_inside(&self, point: DVec2, corners: &[usize]) -> bool {
        let outline: Vec<DVec2> = corners.iter().map(|&p| self.points[p]).collect();
        point_in_polygon(point, [outline.as_slice()])
    }

    fn is_on_border(&self, point: DVec2, corners: &[usize]) -> bool {
        edges(corners).any(|edge| self.distance_and_place(point, edge).0 <= self.tolerance)
    }

    fn check(&self, base: &[usize], cuts: &[Vec<usize>]) -> Result<(), Misfit> {
        let middle = |(a, b): (usize, usize)| (self.points[a] + self.points[b]) / 2.0;
        let crossing = |x: &[usize], y: &[usize]| {
            edges(x).any(|(a, b)| {
                edges(y).any(|(c, d)| {
                    let is_apart = a != c && a != d && b != c && b != d;
                    let [a, b, c, d] = [a, b, c, d].map(|p| self.points[p]);
                    is_apart && segments_cross(a, b, c, d)
                })
            })
        };
        for (i, cut) in cuts.iter().enumerate() {
            let mut probes = cut
                .iter()
                .map(|&p| self.points[p])
                .chain(edges(cut).map(middle));
            let is_in = probes.all(|p| self.is_inside(p, base) || self.is_on_border(p, base));
            if !is_in || crossing(cut, base) {
                return Err(Misfit::Outside(i));
            }
        }
        for (j, second) in cuts.iter().enumerate() {
            for (i, first) in cuts[..j].iter().enumerate() {
                let within = |x: &[usize], y: &[usize]| {
                    edges(x)
                        .map(middle)
                        .any(|p| self.is_inside(p, y) && !self.is_on_border(p, y))
                };
                let shares_side = edges(second).any(|e| edges(first).any(|f| e == f));
                if shares_side
                    || crossing(first, second)
                    || within(first, second)
                    || within(second, first)
                {
                    return Err(Misfit::Overlap(i, j));
                }
            }
        }
        Ok(())
    }

    /// The closed loops of a border, each of them turning left wherever there is
    /// a choice: pieces that touch in a corner come apart there.
    fn loops(&self, mut border: BTreeMap<(usize, usize), usize>) -> Vec<Vec<usize>> {
        let mut loops = Vec::new();
        while let Some((&(start, second), _)) = border.first_key_value() {
            let mut corners = vec![start];
            let (mut from, mut at) = (start, second);
            take(&mut border, (start, second));
            while at != start {
                corners.push(at);
                let back = self.points[from] - self.points[at];
                let next = border
                    .range((at, 0)..=(at, usize::MAX))
                    .map(|(&(_, to), _)| {
                        let ahead = self.points[to] - self.points[at];
                        // Clockwise from where we came; straight back comes last.
                        let turn = ahead.angle_to(back);
                        let turn = if turn <= 0.0 {
                            turn + std::f64::consts::TAU
                        } else {
                            turn
                        };
                        (turn, to)
                    })
                    .min_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
                // The border is a sum of closed loops, so there is a way on.
                let Some((_, to)) = next else { break };
                take(&mut border, (at, to));
                (from, at) = (at, to);
            }
            loops.push(corners);
        }
        loops
    }

    fn regions(&self, loops: Vec<Vec<usize>>) -> Vec<Region> {
        let in_space = |corners: &[usize]| {
            corners
                .iter()
                .map(|&p| self.positions[p])
                .collect::<Vec<_>>()
        };
        let area = |corners: &[usize]| {
            signed_area(&corners.iter().map(|&p| self.points[p]).collect::<Vec<_>>())
        };
        let smallest = self.tolerance * self.tolerance;
        let (outlines, holes): (Vec<_>, Vec<_>) = loops
            .into_iter()
            .filter(|corners| area(corners).abs() > smallest)
            .partition(|corners| area(corners) > 0.0);
        outlines
            .iter()
            .map(|outline| Region {
                outline: in_space(outline),
                holes: holes
                    .iter()
                    .filter(|hole| {
                        let middle = (self.points[hole[0]] + self.points[hole[1]]) / 2.0;
                        self.is_inside(middle, outline)
                    })
                    .map(|hole| in_space(hole))
                    .collect(),
            })
            .collect()
    }
}

/// Takes one run out of a border.
fn take(border: &mut BTreeMap<(usize, usize), usize>, edge: (usize, usize)) {
    if let Some(n) = border.get_mut(&edge) {
        *n -= 1;
        if *n == 0 {
            border.remove(&edge);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_geom::polygon_area;
    use glam::dvec3;

    /// A rectangle in the plane that is spanned by x and a slope in y and z.
    fn rectangle([x0, y0, x1, y1]: [f64; 4]) -> Vec<DVec3> {
        [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
            .map(|(x, y)| dvec3(x, 0.6 * y, 0.8 * y))
            .to_vec()
    }

    fn left(cuts: &[[f64; 4]]) -> Result<Vec<Region>, Misfit> {
        let cuts: Vec<Vec<DVec3>> = cuts.iter().copied().map(rectangle).collect();
        let cuts: Vec<&[DVec3]> = cuts.iter().map(Vec::as_slice).collect();
        subtract(&rectangle([0.0, 0.0, 6.0, 3.0]), &cuts)
    }

    fn area(regions: &[Region]) -> f64 {
        regions
            .iter()
            .map(|r| {
                polygon_area(&r.outline) - r.holes.iter().map(|h| polygon_area(h)).sum::<f64>()
            })
            .sum()
    }

    #[test]
    fn window_is_a_hole_and_door_a_notch() {
        let regions = left(&[[3.0, 1.0, 5.0, 2.0], [1.0, 0.0, 2.0, 2.0]]).unwrap();
        assert_eq!(regions.len(), 1);
        assert_eq!((regions[0].outline.len(), regions[0].holes.len()), (8, 1));
        assert!((area(&regions) - 14.0).abs() < 1e-12);
    }

    #[test]
    fn door_from_floor_to_ceiling_leaves_two_pieces() {
        let regions = left(&[[1.0, 0.0, 2.0, 3.0]]).unwrap();
        assert_eq!(regions.len(), 2);
        assert!((area(&regions) - 15.0).abs() < 1e-12);
    }

    #[test]
    fn neighbours_are_one_hole_and_cover_all_together() {
        let regions = left(&[[1.0, 1.0, 2.0, 2.0], [2.0, 1.0, 3.0, 1.5]]).unwrap();
        assert_eq!((regions.len(), regions[0].holes.len()), (1, 1));
        assert!((area(&regions) - 16.5).abs() < 1e-12);
        assert_eq!(
            left(&[[0.0, 0.0, 2.0, 3.0], [2.0, 0.0, 6.0, 3.0]]).unwrap(),
            []
        );
    }

    #[test]
    fn cuts_that_touch_in_a_corner_keep_their_area() {
        let regions = left(&[[1.0, 1.0, 2.0, 2.0], [2.0, 2.0, 3.0, 3.0]]).unwrap();
        assert!((area(&regions) - 16.0).abs() < 1e-12, "{regions:?}");
        // They leave a piece between them and the border.
        let regions = left(&[[0.0, 1.0, 1.0, 3.0], [1.0, 0.0, 6.0, 1.0]]).unwrap();
        assert_eq!(regions.len(), 2);
        assert!((area(&regions) - 11.0).abs() < 1e-12);
    }

    #[test]
    fn misfits_are_told_apart() {
        assert_eq!(left(&[[5.0, 1.0, 7.0, 2.0]]), Err(Misfit::Outside(0)));
        assert_eq!(left(&[[7.0, 1.0, 8.0, 2.0]]), Err(Misfit::Outside(0)));
        let over = Err(Misfit::Overlap(0, 1));
        assert_eq!(left(&[[1.0, 1.0, 3.0, 2.0], [2.0, 1.5, 4.0, 2.5]]), over);
        assert_eq!(left(&[[1.0, 1.0, 4.0, 2.0], [2.0, 1.2, 3.0, 1.8]]), over);
        assert_eq!(left(&[[1.0, 1.0, 4.0, 2.0], [1.0, 1.0, 4.0, 2.0]]), over);
        let base = rectangle([0.0, 0.0, 6.0, 3.0]);
        let mut cut = rectangle([1.0, 1.0, 2.0, 2.0]);
        cut.reverse();
        assert_eq!(subtract(&base, &[&cut]), Err(Misfit::Turned(0)));
        for p in &mut cut {
            p.z += 0.25;
        }
        let misfit = subtract(&base, &[&cut]).unwrap_err();
        assert!(matches!(misfit, Misfit::OffPlane(0, off) if (off - 0.15).abs() < 1e-12));
    }
}
