//! Convex cells of a surface, cut along the curves where an integrand is not smooth.

use glam::{DVec2, DVec3};

/// A convex polygon in chart coordinates, counter-clockwise.
pub(crate) type Cell = Vec<DVec2>;

/// The part of a loop where `height` is not negative: a closed loop again, possibly
/// with edges along the cut that run forth and back.
///
/// A contour integral over the clipped loops is that over the clipped polygon, also
/// for concave polygons and for holes.
///
/// # Source
///
/// Sutherland & Hodgman 1974.
pub(crate) fn clip(corners: &[DVec3], height: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(corners.len() + 2);
    for (i, &p) in corners.iter().enumerate() {
        let q = corners[(i + 1) % corners.len()];
        let (hp, hq) = (height(p), height(q));
        if hp >= 0.0 {
            kept.push(p);
        }
        if (hp < 0.0) != (hq < 0.0) && hp != 0.0 && hq != 0.0 {
            kept.push(p + (q - p) * (hp / (hp - hq)));
        }
    }
    kept
}

/// Cuts the cells that a segment runs through, each along the segment's line.
///
/// * `tolerance` — parts of cells narrower than this are not cut off.
///
/// Cells may afterwards have neighbours that are cut differently: an integral does
/// not mind.
pub(crate) fn cut(cells: &mut Vec<Cell>, [a, b]: [DVec2; 2], tolerance: f64) {
    let length = a.distance(b);
    if length <= tolerance {
        return;
    }
    let along = (b - a) / length;
    for k in 0..cells.len() {
        let heights: Vec<f64> = cells[k].iter().map(|&x| along.perp_dot(x - a)).collect();
        let (lo, hi) = heights
            .iter()
            .fold((0.0f64, 0.0f64), |(lo, hi), &h| (lo.min(h), hi.max(h)));
        if hi <= tolerance || lo >= -tolerance {
            continue;
        }
        let (mut left, mut right) = (Cell::new(), Cell::new());
        // Where the segment's line enters and leaves the cell.
        let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
        let n = heights.len();
        for i in 0..n {
            let j = (i + 1) % n;
            let (p, q) = (cells[k][i], cells[k][j]);
            let (hp, hq) = (heights[i], heights[j]);
            if hp >= 0.0 {
                left.push(p);
            }
            if hp <= 0.0 {
                right.push(p);
            }
            let crossing = if hp == 0.0 {
                p
            } else if (hp < 0.0) == (hq < 0.0) || hq == 0.0 {
                continue;
            } else {
                let crossing = p + (q - p) * (hp / (hp - hq));
                left.push(crossing);
                right.push(crossing);
                crossing
            };
            let s = along.dot(crossing - a);
            (from, to) = (from.min(s), to.max(s));
        }
        if from.max(0.0) + tolerance < to.min(length) && left.len() > 2 && right.len() > 2 {
            cells[k] = left;
            cells.push(right);
        }
    }
}

/// The triangles of a convex polygon.
pub(crate) fn triangles(cell: &[DVec2]) -> Vec<[DVec2; 3]> {
    match *cell {
        [a, b, c] => vec![[a, b, c]],
        [a, b, c, d] if a.distance_squared(c) <= b.distance_squared(d) => {
            vec![[a, b, c], [a, c, d]]
        }
        [a, b, c, d] => vec![[a, b, d], [b, c, d]],
        _ if cell.len() < 3 => Vec::new(),
        _ => {
            let middle = cell.iter().sum::<DVec2>() / cell.len() as f64;
            let next = |i: usize| cell[(i + 1) % cell.len()];
            (0..cell.len())
                .map(|i| [middle, cell[i], next(i)])
                .collect()
        }
    }
}

/// The area of a triangle.
pub(crate) fn area([a, b, c]: [DVec2; 3]) -> f64 {
    0.5 * (b - a).perp_dot(c - a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec2;

    fn total(cells: &[Cell]) -> f64 {
        cells.iter().flat_map(|c| triangles(c)).map(area).sum()
    }

    #[test]
    fn cuts_keep_the_area_and_only_meet_cells_on_the_segment() {
        let square = |x: f64| {
            vec![
                dvec2(x, 0.0),
                dvec2(x + 1.0, 0.0),
                dvec2(x + 1.0, 1.0),
                dvec2(x, 1.0),
            ]
        };
        let mut cells = vec![square(0.0), square(1.0), square(2.0)];
        cut(&mut cells, [dvec2(0.2, 0.3), dvec2(1.4, 0.6)], 1e-12);
        assert_eq!(cells.len(), 5, "the third square is not met");
        assert!((total(&cells) - 3.0).abs() < 1e-15);
        cut(&mut cells, [dvec2(0.0, 0.0), dvec2(1.0, 0.0)], 1e-12);
        assert_eq!(cells.len(), 5, "a border is no cut");
    }

    #[test]
    fn a_concave_loop_is_clipped_with_its_area() {
        let z = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        // A U: the cut leaves its two arms.
        let u = [
            z(0.0, 0.0),
            z(3.0, 0.0),
            z(3.0, 2.0),
            z(2.0, 2.0),
            z(2.0, 1.0),
            z(1.0, 1.0),
            z(1.0, 2.0),
            z(0.0, 2.0),
        ];
        let arms = clip(&u, |x| x.y - 1.5);
        let n = arms.len();
        let doubled: f64 = (0..n).map(|i| arms[i].cross(arms[(i + 1) % n]).z).sum();
        assert!((doubled / 2.0 - 1.0).abs() < 1e-15);
    }
}
