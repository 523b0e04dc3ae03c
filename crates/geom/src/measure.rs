//! Distances to segments, and boxes around points.

use glam::{DVec2, DVec3};

/// The distance of a point from a segment in a chart; from its end if both ends are one.
#[must_use]
pub fn distance_to_segment(ends: [DVec2; 2], point: DVec2) -> f64 {
    // A coordinate that is zero changes no bit.
    distance_to_segment_in_space(ends.map(|end| end.extend(0.0)), point.extend(0.0))
}

/// The same in space.
#[must_use]
pub fn distance_to_segment_in_space(ends: [DVec3; 2], point: DVec3) -> f64 {
    nearest_on_segment(ends, point).distance(point)
}

/// The point of a segment that is nearest to another point.
#[must_use]
pub fn nearest_on_segment([a, b]: [DVec3; 2], point: DVec3) -> DVec3 {
    let along = b - a;
    let length_sq = along.length_squared().max(f64::MIN_POSITIVE);
    let at = (along.dot(point - a) / length_sq).clamp(0.0, 1.0);
    a + along * at
}

/// The smallest box around points in a chart: its lowest and its highest corner.
///
/// Without points the lowest corner is +∞ and the highest −∞.
#[must_use]
pub fn bounding_box(points: impl IntoIterator<Item = DVec2>) -> [DVec2; 2] {
    points
        .into_iter()
        .fold([DVec2::INFINITY, DVec2::NEG_INFINITY], |[min, max], p| {
            [min.min(p), max.max(p)]
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{dvec2, dvec3};

    #[test]
    fn distance_is_to_the_foot_or_to_the_nearer_end() {
        let ends = [dvec2(1.0, 1.0), dvec2(5.0, 1.0)];
        for (point, expected) in [
            (dvec2(2.0, 4.0), 3.0),
            (dvec2(3.0, 1.0), 0.0),
            (dvec2(-2.0, 5.0), 5.0),
            (dvec2(8.0, -3.0), 5.0),
        ] {
            assert_eq!(distance_to_segment(ends, point), expected, "{point}");
        }
    }

    #[test]
    fn segment_without_length_is_a_point() {
        let a = dvec2(1.0, 2.0);
        assert_eq!(distance_to_segment([a, a], dvec2(4.0, 6.0)), 5.0);
        assert_eq!(distance_to_segment([a, a], a), 0.0);
    }

    #[test]
    fn distance_in_space_knows_all_three_axes() {
        let ends = [dvec3(0.0, 0.0, 1.0), dvec3(0.0, 0.0, 3.0)];
        let distance = |point| distance_to_segment_in_space(ends, point);
        assert_eq!(distance(dvec3(3.0, 4.0, 2.0)), 5.0);
        assert_eq!(distance(dvec3(0.0, 3.0, 7.0)), 5.0);
    }

    #[test]
    fn box_touches_the_outermost_points() {
        let points = [dvec2(1.0, -2.0), dvec2(-3.0, 0.5), dvec2(0.0, 4.0)];
        assert_eq!(bounding_box(points), [dvec2(-3.0, -2.0), dvec2(1.0, 4.0)]);
        let [min, max] = bounding_box([]);
        assert!(min.x > max.x && min.y > max.y);
    }
}
