//! From which side nodes on borders and contacts are approached.
//!
//! Across a contact irradiance jumps, and beyond the border there is none: a node there has
//! the limit from the side of its element. What counts is where the lines are, and not
//! which edges of the mesh run along them: an element thinner than the distance within
//! which features touch lies beside the line with all of its nodes, and a node of it that
//! looked across the line would see what is beyond. So would one that looks almost along
//! a line; directions of approach therefore keep off lines.

use antumbra_geom::{DVec2, distance_to_segment};
use antumbra_mesh::{Grid, Order, TriMesh};
use smallvec::SmallVec;

/// The sine of the smallest angle between a line and the direction in which a node beside
/// it looks, where an element is slimmer.
///
/// Walls of a room are off their right angles by less.
const LEAST_ANGLE: f64 = 1e-3;

/// Lines that meet at a smaller angle (its sine) leave no room between them: slopes that
/// small count as along.
const NARROWEST: f64 = 1e-6;

/// Lines that meet at a smaller angle (its sine) are one line that bends, if it goes on to
/// both sides of a node.
const STRAIGHT: f64 = 1e-2;

/// Lines are known to have a direction, and elements to have a side, if they are longer
/// than so many times the distance within which features touch.
const SHORT: f64 = 4.0;

/// The borders and contacts of a receiver.
#[derive(Clone, Debug)]
pub(super) struct OneSided {
    /// Straight pieces; the receiver lies to the left of those of its border.
    lines: Vec<[DVec2; 2]>,
    /// The first ones are of the border.
    n_border: usize,
    grid: Grid,
    /// Within it a line is touched.
    radius: f64,
}

/// From where a node's value is the limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NodeSide {
    /// Irradiance is continuous there.
    Both,
    /// Inside a corner of the border without contact.
    Border(DVec2),
    /// Left of a contact or border, in its direction with a positive component along
    /// a fixed reference; with the unit vector that points away from the line.
    Left(DVec2),
    /// Right of it.
    Right(DVec2),
    /// From a direction: at ends and crossings of contacts.
    Corner(DVec2),
}

impl NodeSide {
    /// The unit direction towards the side.
    pub(super) fn toward(self) -> Option<DVec2> {
        match self {
            Self::Both => None,
            Self::Border(d) | Self::Left(d) | Self::Right(d) | Self::Corner(d) => Some(d),
        }
    }

    /// What tells nodes at one position apart.
    pub(super) fn key(self) -> [u64; 2] {
        match self {
            Self::Both => [0, 0],
            Self::Border(_) => [1, 0],
            Self::Left(_) => [2, 0],
            Self::Right(_) => [3, 0],
            Self::Corner(d) => [d.x.to_bits(), d.y.to_bits()],
        }
    }

    /// Beside a line, on the side to which `across` points.
    ///
    /// Beside a line the limit is the same for all directions; straight away from it it has
    /// most digits, whatever the shape of the element.
    fn beside(line: DVec2, across: DVec2) -> Self {
        // The same side for both directions of the line, whatever their rounding:
        // lines perpendicular to this direction are not to be expected.
        let reference = DVec2::new(0.812_347, 0.583_173);
        let line = if line.dot(reference) < 0.0 {
            -line
        } else {
            line
        };
        let left = line.perp();
        if left.dot(across) > 0.0 {
            Self::Left(left)
        } else {
            Self::Right(-left)
        }
    }
}

/// A line near a node, as seen from an element there.
struct Near {
    is_border: bool,
    /// Unit vector along it.
    along: DVec2,
    /// Unit vector across it, to the side of the element.
    across: DVec2,
    /// How far the element extends to that side, or all of it is inside.
    extent: f64,
    length: f64,
    /// Distance of the node.
    distance: f64,
    /// Does it go on along its direction, and against it?
    goes_on: [bool; 2],
}

impl Near {
    /// A short piece has none of its own, as at a jog of a sloppily drawn outline.
    fn has_direction(&self) -> bool {
        self.goes_on != [false; 2]
    }
}

impl OneSided {
    /// * `border` — loops that repeat their first point, the receiver to their left.
    /// * `contacts` — polylines.
    pub(super) fn new(border: &[Vec<DVec2>], contacts: &[Vec<DVec2>], radius: f64) -> Self {
        let pieces = |of: &[Vec<DVec2>]| -> Vec<[DVec2; 2]> {
            let all = of.iter().flat_map(|points| points.windows(2));
            all.map(|p| [p[0], p[1]])
                .filter(|[a, b]| a.distance(*b) > 0.0)
                .collect()
        };
        let mut lines = pieces(border);
        let n_border = lines.len();
        lines.extend(pieces(contacts));
        let grid = Grid::of_segments(&lines, SHORT * radius);
        Self {
            lines,
            n_border,
            grid,
            radius,
        }
    }

    /// From where the node of an element is approached.
    ///
    /// * `corners` — of the element, counter-clockwise.
    pub(super) fn side(&self, at: DVec2, corners: [DVec2; 3]) -> NodeSide {
        let near: SmallVec<[Near; 4]> = self
            .grid
            .items(self.grid.cell_of(at))
            .iter()
            .filter_map(|&i| self.near(i as usize, at, corners))
            .collect();
        if near.iter().all(|line| line.distance > self.radius) {
            return NodeSide::Both;
        }
        let Some(longest) = near
            .iter()
            .reduce(|x, y| if y.length > x.length { y } else { x })
        else {
            return NodeSide::Both;
        };
        if let Some(across) = self.beside_one_line(&near, longest.along) {
            return NodeSide::beside(longest.along, across);
        }
        let toward = self.corner_direction(&near, at, corners);
        if near.iter().all(|line| line.is_border) {
            NodeSide::Border(toward)
        } else {
            NodeSide::Corner(toward)
        }
    }

    /// A line as seen from a node, if it is near.
    fn near(&self, i: usize, at: DVec2, corners: [DVec2; 3]) -> Option<Near> {
        let [a, b] = self.lines[i];
        let distance = distance_to_segment([a, b], at);
        // Where a line ends within this distance, what it goes on as is within it too.
        if distance > SHORT * self.radius {
            return None;
        }
        let length = a.distance(b);
        let along = (b - a) / length;
        let left = along.perp();
        let heights = corners.map(|c| left.dot(c - a));
        let farthest = heights
            .into_iter()
            .reduce(|x, y| if y.abs() > x.abs() { y } else { x })?;
        let is_border = i < self.n_border;
        let side = if is_border { 1.0 } else { farthest.signum() };
        let reach = SHORT * self.radius;
        Some(Near {
            is_border,
            along,
            across: left * side,
            extent: farthest.abs(),
            length,
            distance,
            goes_on: [along.dot(b - at) > reach, along.dot(at - a) > reach],
        })
    }

    /// Across the one line that all of these are, if they are; towards the element.
    fn beside_one_line(&self, near: &[Near], along: DVec2) -> Option<DVec2> {
        let mut goes_on = [false; 2];
        for line in near {
            let is_along = along.dot(line.along) >= 0.0;
            for (k, &goes) in line.goes_on.iter().enumerate() {
                goes_on[if is_along { k } else { 1 - k }] |= goes;
            }
            if line.has_direction() && along.perp_dot(line.along).abs() > STRAIGHT {
                return None;
            }
        }
        if goes_on != [true; 2] {
            return None;
        }
        let long = || near.iter().filter(|line| line.has_direction());
        // The border first, if it is touched: it has one side only.
        let is_touched = |line: &Near| line.is_border && line.distance <= self.radius;
        let first = long().min_by(|a, b| {
            (is_touched(b).cmp(&is_touched(a))).then(a.distance.total_cmp(&b.distance))
        })?;
        // An element between two lines that are more than touching distance apart
        // elsewhere: the node is where they part.
        let is_between = long().any(|line| {
            let is_wide = line.is_border || line.extent > SHORT * self.radius;
            is_wide && line.across.dot(first.across) < 0.0
        });
        (!is_between || first.extent <= self.radius).then_some(first.across)
    }

    /// The direction from a corner, or from an end, into an element; off all lines.
    fn corner_direction(&self, near: &[Near], at: DVec2, corners: [DVec2; 3]) -> DVec2 {
        let [a, b, c] = corners;
        let longest = (b - a).length().max((c - b).length()).max((a - c).length());
        let from_border = || {
            let borders = near
                .iter()
                .filter(|line| line.is_border && line.has_direction());
            borders.map(|line| line.across).sum::<DVec2>()
        };
        let mut toward = (a + b + c) / 3.0 - at;
        if longest <= 2.0 * SHORT * self.radius
            && let Some(inside) = from_border().try_normalize()
        {
            // Too small to tell what is inside.
            return inside;
        }
        toward = toward.normalize_or_zero();
        let arms: SmallVec<[(DVec2, DVec2); 8]> = near
            .iter()
            .flat_map(|line| {
                let ends = [line.along, -line.along];
                let goes_on = line.goes_on;
                (0..2)
                    .filter(move |&k| goes_on[k])
                    .map(move |k| (ends[k], line.across))
            })
            .collect();
        let nearest = arms
            .iter()
            .max_by(|x, y| toward.dot(x.0).total_cmp(&toward.dot(y.0)));
        let Some(&(arm, across)) = nearest else {
            return toward;
        };
        if toward.dot(arm) <= 0.0 || toward.dot(across) >= LEAST_ANGLE {
            return toward;
        }
        // No nearer to the next line on that side than to this one.
        let room = arms
            .iter()
            .filter(|(other, _)| other.dot(across) > NARROWEST && other.dot(arm) > 0.0)
            .map(|(other, _)| other.dot(across))
            .fold(f64::INFINITY, f64::min);
        (arm + across * LEAST_ANGLE.min(room / 2.0)).normalize_or_zero()
    }
}

/// Where irradiance has no single value, sorted by u: at ends, bends and crossings of
/// contacts, and where corners of others touch.
pub(super) fn singular_points(
    mesh: &TriMesh,
    orders: &[Order],
    radius: f64,
    touched: &[DVec2],
) -> Vec<DVec2> {
    // Vertex, the other end of an edge there, and whether something touches along it.
    let mut ends: Vec<(u32, u32, bool)> = Vec::new();
    for triangle in &mesh.triangles {
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            let Some(set) = mesh.edge_curves(a, b) else {
                continue;
            };
            let curves = mesh.sets().get(set);
            let has = |order: Order| curves.iter().any(|&id| orders[id as usize] == order);
            let is_contact = has(Order::D0);
            if is_contact || has(Order::Boundary) {
                ends.push((a, b, is_contact));
                ends.push((b, a, is_contact));
            }
        }
    }
    ends.sort_unstable();
    ends.dedup();
    let mut points: Vec<DVec2> = ends
        .chunk_by(|x, y| x.0 == y.0)
        .filter(|group| group.iter().any(|e| e.2))
        .filter(|group| {
            let at = mesh.vertices[group[0].0 as usize];
            let arms = |contacts_only: bool| -> SmallVec<[DVec2; 4]> {
                let arms = group.iter().filter(|e| e.2 || !contacts_only);
                arms.map(|e| mesh.vertices[e.1 as usize] - at).collect()
            };
            // A contact that ends within touching distance of a border that goes on ends
            // all the same: the edge that touches leans, and leaves the receiver there.
            !runs_straight_through(&arms(false), radius) || !goes_both_ways(&arms(true))
        })
        .map(|group| mesh.vertices[group[0].0 as usize])
        .collect();
    points.extend_from_slice(touched);
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points
}

/// Do edges at a vertex lie on one line that goes on to both sides of it? More than two
/// are those of lines that are one to touching distance.
fn runs_straight_through(arms: &[DVec2], radius: f64) -> bool {
    let slack = if arms.len() > 2 { radius } else { 0.0 };
    let longest = arms.iter().copied().reduce(|a, b| {
        if b.length_squared() > a.length_squared() {
            b
        } else {
            a
        }
    });
    let Some(along) = longest.and_then(DVec2::try_normalize) else {
        return false;
    };
    let is_straight = |arm: &DVec2| along.perp_dot(*arm).abs() <= (1e-6 * arm.length()).max(slack);
    let goes_back = arms.iter().any(|arm| along.dot(*arm) < 0.0);
    goes_back && arms.iter().all(is_straight)
}

/// Are there edges to both sides of a vertex?
fn goes_both_ways(arms: &[DVec2]) -> bool {
    arms.iter().any(|arm| arms[0].dot(*arm) < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec2;

    const RADIUS: f64 = 1e-6;

    fn unit_square() -> Vec<DVec2> {
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.0)]
            .map(|(x, y)| dvec2(x, y))
            .to_vec()
    }

    fn toward(sides: &OneSided, at: DVec2, corners: [DVec2; 3]) -> DVec2 {
        sides.side(at, corners).toward().expect("a side")
    }

    #[test]
    fn node_inside_has_no_side() {
        let sides = OneSided::new(&[unit_square()], &[], RADIUS);
        let corners = [dvec2(0.5, 0.5), dvec2(0.6, 0.5), dvec2(0.5, 0.6)];
        assert_eq!(sides.side(corners[0], corners), NodeSide::Both);
    }

    #[test]
    fn all_nodes_of_a_sliver_at_the_border_look_inside() {
        let sides = OneSided::new(&[unit_square()], &[], RADIUS);
        let thin = RADIUS / 2.0;
        let corners = [dvec2(0.2, 0.0), dvec2(0.8, 0.0), dvec2(0.5, thin)];
        for at in corners {
            assert_eq!(toward(&sides, at, corners), DVec2::Y);
        }
        // The element beyond shares its node.
        let beyond = [dvec2(0.5, thin), dvec2(0.8, 0.0), dvec2(0.5, 0.5)];
        assert_eq!(
            sides.side(corners[2], corners),
            sides.side(corners[2], beyond)
        );
    }

    #[test]
    fn jogs_of_a_border_do_not_decide() {
        for step in [1e-7, -1e-7] {
            let border: Vec<DVec2> = [
                (0.0, 0.0),
                (0.5, 0.0),
                (0.5, step),
                (1.0, step),
                (1.0, 1.0),
                (0.0, 1.0),
                (0.0, 0.0),
            ]
            .map(|(x, y)| dvec2(x, y))
            .to_vec();
            let sides = OneSided::new(&[border], &[], RADIUS);
            for at in [dvec2(0.5, step), dvec2(0.5, 0.0)] {
                let corners = [at, dvec2(1.0, step), dvec2(0.5, 0.5)];
                assert_eq!(toward(&sides, at, corners), DVec2::Y, "{at}");
            }
        }
    }

    #[test]
    fn short_ends_of_contacts_in_the_middle_of_a_line_do_not_decide() {
        // Two plates, thinner than the radius, end to end.
        let x = |x: f64, y: f64| dvec2(x, 0.5 + y * 1e-7);
        let left = vec![x(0.1, 0.0), x(0.5, 0.0), x(0.5, 1.0), x(0.1, 1.0)];
        let right = vec![x(0.9, 1.0), x(0.5, 1.0), x(0.5, 0.0), x(0.9, 0.0)];
        let sides = OneSided::new(&[unit_square()], &[left, right], RADIUS);
        let above = [x(0.5, 1.0), x(0.7, 1.0), dvec2(0.5, 0.8)];
        assert_eq!(toward(&sides, above[0], above), DVec2::Y);
    }

    #[test]
    fn corner_that_points_inwards_is_looked_away_from() {
        // The square without its lower left quarter.
        let border: Vec<DVec2> = [
            (0.5, 0.0),
            (1.0, 0.0),
            (1.0, 1.0),
            (0.0, 1.0),
            (0.0, 0.5),
            (0.5, 0.5),
            (0.5, 0.0),
        ]
        .map(|(x, y)| dvec2(x, y))
        .to_vec();
        let sides = OneSided::new(&[border], &[], RADIUS);
        let at = dvec2(0.5, 0.5);
        for corners in [
            [at, dvec2(0.5, 0.1), dvec2(0.5 + 1e-8, 0.1)],
            [at, dvec2(0.9, 0.5), dvec2(0.9, 0.6)],
            [at, dvec2(0.1, 0.5 + 1e-8), dvec2(0.1, 0.5)],
        ] {
            let d = toward(&sides, at, corners);
            assert!(d.x >= 0.9 * LEAST_ANGLE || d.y >= 0.9 * LEAST_ANGLE, "{d}");
        }
    }

    #[test]
    fn slim_elements_at_a_corner_look_off_its_sides() {
        let sides = OneSided::new(&[unit_square()], &[], RADIUS);
        for [b, c] in [
            [dvec2(0.5, 0.0), dvec2(0.5, 1e-7)],
            [dvec2(1e-7, 0.5), dvec2(0.0, 0.5)],
            [dvec2(1e-7, 0.0), dvec2(0.0, 1e-7)],
        ] {
            let d = toward(&sides, DVec2::ZERO, [DVec2::ZERO, b, c]);
            assert!(d.min_element() >= 0.9 * LEAST_ANGLE, "{d}");
        }
    }

    #[test]
    fn sides_of_a_contact_are_two_and_its_end_has_directions() {
        let contact = vec![dvec2(0.25, 0.5), dvec2(0.75, 0.5)];
        let sides = OneSided::new(&[unit_square()], &[contact], RADIUS);
        let above = [dvec2(0.4, 0.5), dvec2(0.6, 0.5), dvec2(0.5, 0.6)];
        let below = [dvec2(0.6, 0.5), dvec2(0.4, 0.5), dvec2(0.5, 0.4)];
        assert_eq!(toward(&sides, above[0], above), DVec2::Y);
        assert_eq!(toward(&sides, above[0], below), -DVec2::Y);
        let end = dvec2(0.25, 0.5);
        let ahead = [end, dvec2(0.1, 0.45), dvec2(0.1, 0.52)];
        let d = toward(&sides, end, ahead);
        assert!(d.x < -0.9 && matches!(sides.side(end, ahead), NodeSide::Corner(_)));
        // Beside the contact, and slim: off it, on its side.
        let slim = [end, dvec2(0.5, 0.5), dvec2(0.5, 0.5 + 1e-9)];
        let d = toward(&sides, end, slim);
        assert!(d.x > 0.9 && d.y >= 0.9 * LEAST_ANGLE, "{d}");
    }

    #[test]
    fn wedge_between_border_and_contact_is_looked_into() {
        // A wall that stands a ten-thousandth off the right angle.
        let contact = vec![DVec2::ZERO, dvec2(1.0, 1e-4)];
        let sides = OneSided::new(&[unit_square()], &[contact], RADIUS);
        let within = [DVec2::ZERO, dvec2(0.9, 0.0), dvec2(0.9, 0.9e-4)];
        let d = toward(&sides, DVec2::ZERO, within);
        assert!(d.y > 0.0 && d.y < 1e-4 * d.x, "{d}");
        let beyond = [DVec2::ZERO, dvec2(0.9, 0.9e-4), dvec2(0.5, 0.5)];
        let d = toward(&sides, DVec2::ZERO, beyond);
        assert!(d.y > 1e-4 * d.x, "{d}");
    }
}
