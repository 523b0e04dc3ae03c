//! The visible structure of a point: which features of the scene bound the parts
//! of the emitters that it sees. (The combinatorics of its backprojection.)
//!
//! A second opinion by brute force that shares no code with the engine: every
//! candidate for an apparent vertex (a vertex of the emitter or of an occluder, a
//! crossing of two edges) is looked at in turn. Around its direction every convex
//! piece of an occluder hides nothing, everything, or a sector. If what remains of
//! the emitter is neither nothing nor everything nor one half, an apparent vertex
//! is there.
//!
//! Two points of a receiver with different structures have a critical curve
//! between them.
//!
//! All decisions are signs of determinants of three unit vectors, good to a few
//! 1e-16; the smallest one is the margin. Incidences that hold from everywhere (a
//! corner on an edge, two edges in one line) are found beforehand: they are never
//! asked for, and cost no margin.

mod fan;
mod picture;
mod stage;

pub use stage::{Corner, Rim};

use antumbra::Scene;
use antumbra::scene::{FaceId, PlaneId};
use fan::Fan;
use glam::{DVec3, dvec3};
use picture::Rectangle;
use stage::{Convex, Passing, Side, Stage};

/// The apparent vertices of the visible parts of all emitters, ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Structure(Vec<ApparentVertex>);

/// A vertex of the visible part of an emitter, as seen from a point.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ApparentVertex {
    /// The emitter.
    pub emitter: FaceId,
    /// What is seen there.
    pub site: Site,
    /// The rims that bound the visible part there: two, or four where two parts
    /// meet. A plate that turns its other side has the same rims, visible on
    /// their other sides.
    pub bounds: Vec<Bound>,
}

/// The features of an apparent vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Site {
    /// A vertex of the emitter.
    EmitterVertex(Corner),
    /// A vertex of an occluder, in front of the emitter.
    OccluderVertex(Corner),
    /// An occluder's edge crosses one of the emitter.
    EmitterCrossing {
        /// Of the emitter.
        emitter: Rim,
        /// Of the occluder.
        occluder: Rim,
    },
    /// Two edges of occluders cross in front of the emitter.
    OccluderCrossing([Rim; 2]),
}

/// A rim and the side of it on which the emitter is visible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Bound {
    /// The rim.
    pub rim: Rim,
    /// Along the line of the rim, which has the same direction for all points.
    pub visible: Hand,
}

/// A side of a directed line, as seen from a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Hand {
    /// To the left of it.
    Left,
    /// To the right of it.
    Right,
}

/// The kind of an apparent vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// [`Site::EmitterVertex`].
    EmitterVertex,
    /// [`Site::OccluderVertex`].
    OccluderVertex,
    /// [`Site::EmitterCrossing`].
    EmitterCrossing,
    /// [`Site::OccluderCrossing`].
    OccluderCrossing,
}

impl Kind {
    /// All kinds, in the order of reports.
    pub const ALL: [Self; 4] = [
        Self::EmitterVertex,
        Self::OccluderVertex,
        Self::EmitterCrossing,
        Self::OccluderCrossing,
    ];
}

impl Site {
    /// Its kind.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::EmitterVertex(_) => Kind::EmitterVertex,
            Self::OccluderVertex(_) => Kind::OccluderVertex,
            Self::EmitterCrossing { .. } => Kind::EmitterCrossing,
            Self::OccluderCrossing(_) => Kind::OccluderCrossing,
        }
    }
}

impl Structure {
    /// The apparent vertices, ascending.
    #[must_use]
    pub fn vertices(&self) -> &[ApparentVertex] {
        &self.0
    }

    /// Is nothing of any emitter visible?
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The apparent vertices that only one of the two has, ascending.
    #[must_use]
    pub fn difference<'a>(&'a self, other: &'a Self) -> Vec<&'a ApparentVertex> {
        let lacks = |s: &Self, v: &ApparentVertex| s.0.binary_search(v).is_err();
        let here = self.0.iter().filter(|v| lacks(other, v));
        let there = other.0.iter().filter(|v| lacks(self, v));
        let mut all: Vec<&ApparentVertex> = here.chain(there).collect();
        all.sort();
        all
    }
}

/// What a point sees, and how surely.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// The structure.
    pub structure: Structure,
    /// The smallest determinant of unit vectors that a decision was taken by: an
    /// angle in radians, times the sines of the angles that the features subtend.
    /// Near 0, the point may lie on a critical curve.
    pub margin: f64,
}

/// The structures of all points on the receivers of a scene.
#[derive(Clone, Debug)]
pub struct Structures<'s> {
    scene: &'s Scene,
    stages: Vec<Stage>,
}

impl<'s> Structures<'s> {
    /// Prepares all emitters of a scene.
    #[must_use]
    pub fn new(scene: &'s Scene) -> Self {
        let stages = scene.emitters().map(|e| Stage::new(scene, e)).collect();
        Self { scene, stages }
    }

    /// The structure of a point on a receiver, scene units.
    ///
    /// Of what is on the horizon nothing is told: light from there counts for
    /// nothing. So a crossing may come and go at the horizon without an event.
    ///
    /// # Panics
    ///
    /// If more than 31 lines meet in a corner.
    #[must_use]
    pub fn at(&self, receiver: FaceId, point: DVec3) -> Seen {
        let mut margin = f64::INFINITY;
        let mut vertices = Vec::new();
        let plane = self.scene.face(receiver).plane;
        for stage in &self.stages {
            let lamp = self.scene.face(stage.emitter);
            let height = lamp.normal.dot(point - stage.emitter_pieces[0].point);
            if lamp.plane == plane {
                continue;
            }
            margin = margin.min(height.abs());
            if height > 0.0 {
                let mut eye = Eye::new(self.scene, stage, receiver, point);
                eye.look();
                margin = margin.min(eye.margin);
                vertices.append(&mut eye.found);
            }
        }
        vertices.sort();
        vertices.dedup();
        Seen {
            structure: Structure(vertices),
            margin,
        }
    }
}

/// Bounding rectangles are larger than what they bound by this part of the
/// emitter's size: so that rounding excludes nothing, and near misses show in the
/// margin.
const BEYOND: f64 = 1e-6;

/// What a convex piece does around a direction.
enum Around {
    Nothing,
    Everything,
    Sectors(u64),
}

/// One emitter as seen from one point.
///
/// Directions have coordinates in which the emitter is at a constant positive z;
/// x and y are those of its chart. `(x/z, y/z)` is the picture plane.
struct Eye<'a> {
    stage: &'a Stage,
    /// Unit directions of the stage's points.
    directions: Vec<DVec3>,
    /// Heights of the stage's points over the receiver; 0 on it.
    heights: Vec<f64>,
    /// Normals of the planes through the eye and the stage's lines.
    normals: Vec<DVec3>,
    /// The receiver's normal.
    up: DVec3,
    /// Of the emitter's image, a little larger.
    frame: Rectangle,
    /// By how much rectangles are larger than what they bound.
    beyond: f64,
    /// The occluders that may be in the way, with the sign of the side from which
    /// they are seen.
    occluders: Vec<(&'a Convex, f64, Rectangle)>,
    margin: f64,
    found: Vec<ApparentVertex>,
}

impl<'a> Eye<'a> {
    fn new(scene: &Scene, stage: &'a Stage, receiver: FaceId, point: DVec3) -> Self {
        let chart = scene.chart(stage.emitter);
        let face = scene.face(receiver);
        let of = |v: DVec3| dvec3(chart.u.dot(v), chart.v.dot(v), -chart.normal.dot(v));
        let directions: Vec<DVec3> = stage
            .points
            .iter()
            .map(|&p| of(p - point).normalize_or_zero())
            .collect();
        let origin = scene.position(face.outline[0]);
        let tolerance = scene.plane_tolerance();
        let height = |p: &DVec3| {
            let h = face.normal.dot(*p - origin);
            if h.abs() <= tolerance { 0.0 } else { h }
        };
        let normals = stage
            .lines
            .iter()
            .map(|line| {
                let [from, to] = line.map(|c| directions[c as usize]);
                from.cross(to)
            })
            .collect();
        let mut eye = Self {
            heights: stage.points.iter().map(height).collect(),
            directions,
            normals,
            up: of(face.normal),
            frame: Rectangle::EMPTY,
            beyond: 0.0,
            occluders: Vec::new(),
            margin: f64::INFINITY,
            found: Vec::new(),
            stage,
        };
        let image = |eye: &Self, piece: &Convex| {
            let sides = piece.borders.iter().map(|b| eye.image(b.side));
            sides.fold(Rectangle::EMPTY, Rectangle::with)
        };
        let emitter = stage
            .emitter_pieces
            .iter()
            .map(|p| image(&eye, p))
            .fold(Rectangle::EMPTY, Rectangle::with);
        eye.beyond = (emitter.max - emitter.min).max_element() * BEYOND;
        eye.frame = emitter.grown(eye.beyond);
        for piece in &stage.occluders {
            if !eye.is_over(piece, face.plane) {
                continue;
            }
            let rectangle = image(&eye, piece).grown(eye.beyond);
            if !rectangle.meets(&eye.frame) {
                continue;
            }
            let distance = piece.normal.dot(point - piece.point);
            eye.margin = eye.margin.min(distance.abs());
            eye.occluders.push((piece, distance.signum(), rectangle));
        }
        eye
    }

    /// Is a piece above the receiver's horizon, at least in part?
    fn is_over(&self, piece: &Convex, receiver: PlaneId) -> bool {
        let is_over = |c: &u32| self.heights[*c as usize] > 0.0;
        piece.plane != receiver && piece.corners.iter().any(is_over)
    }

    fn image(&self, side: u32) -> Rectangle {
        let [a, b] = self.stage.sides[side as usize].ends;
        Rectangle::of_segment(self.directions[a as usize], self.directions[b as usize])
    }

    /// Finds all apparent vertices.
    fn look(&mut self) {
        let stage = self.stage;
        let outline = self.outline();
        let emitter: Vec<(u32, Rectangle)> = (0..stage.sides.len() as u32)
            .filter(|&s| stage.sides[s as usize].is_of_emitter)
            .map(|s| (s, self.image(s).common(&self.frame)))
            .collect();

        let mut is_candidate = stage.is_of_emitter.clone();
        for &(s, _) in &outline {
            for c in stage.sides[s as usize].ends {
                is_candidate[c as usize] = true;
            }
        }
        for (c, corner) in stage.corners.iter().enumerate() {
            let is_touch = matches!(corner, Corner::Touch(_));
            if (is_candidate[c] || is_touch) && self.is_in_frame(self.directions[c]) {
                self.corner(c);
            }
        }
        for (i, &(s, image)) in outline.iter().enumerate() {
            for &(t, other) in emitter.iter().chain(&outline[i + 1..]) {
                if image.meets(&other) {
                    self.crossing(t, s);
                }
            }
        }
    }

    fn is_in_frame(&self, direction: DVec3) -> bool {
        direction.z > 0.0 && self.frame.holds(direction.truncate() / direction.z)
    }

    /// The occluders' sides in front of the emitter with all their pieces on one
    /// side; with their images there.
    fn outline(&mut self) -> Vec<(u32, Rectangle)> {
        let stage = self.stage;
        // Where the inside of every piece in the frame lies.
        let mut insides: Vec<[bool; 2]> = vec![[false; 2]; stage.sides.len()];
        for (piece, facing, _) in &self.occluders {
            for border in &piece.borders {
                let is_left = border.sign * facing > 0.0;
                insides[border.side as usize][usize::from(is_left)] = true;
            }
        }
        let is_outline = |s: &u32| {
            let side: &Side = &stage.sides[*s as usize];
            let is_over = side.ends.iter().any(|&c| self.heights[c as usize] > 0.0);
            let [right, left] = insides[*s as usize];
            side.rim.is_some() && !side.is_of_emitter && is_over && left != right
        };
        (0..stage.sides.len() as u32)
            .filter(is_outline)
            .map(|s| (s, self.image(s).grown(self.beyond)))
            .filter(|(_, image)| image.meets(&self.frame))
            .map(|(s, image)| (s, image.common(&self.frame)))
            .collect()
    }

    fn corner(&mut self, c: usize) {
        if self.heights[c] <= 0.0 {
            return;
        }
        let stage = self.stage;
        let name = stage.corners[c];
        let site = if stage.is_of_emitter[c] {
            Site::EmitterVertex(name)
        } else {
            Site::OccluderVertex(name)
        };
        self.consider(site, self.directions[c], &stage.lines_at[c]);
    }

    /// Two sides, the first of them perhaps the emitter's.
    fn crossing(&mut self, s: u32, t: u32) {
        let stage = self.stage;
        let (one, other) = (&stage.sides[s as usize], &stage.sides[t as usize]);
        let (l, m) = (one.line as usize, other.line as usize);
        if l == m || stage.meets[l].binary_search(&other.line).is_ok() {
            return;
        }
        let [a, b] = one.ends.map(|c| self.directions[c as usize]);
        let [c, d] = other.ends.map(|c| self.directions[c as usize]);
        let (n, o) = (self.normals[l], self.normals[m]);
        let (c_side, d_side) = (n.dot(c), n.dot(d));
        let (a_side, b_side) = (o.dot(a), o.dot(b));
        // Both ends on one side: that decides, if it is sure.
        let miss = |p: f64, q: f64| {
            if p * q > 0.0 {
                p.abs().min(q.abs())
            } else {
                0.0
            }
        };
        let missed = miss(a_side, b_side).max(miss(c_side, d_side));
        if missed > 0.0 {
            self.margin = self.margin.min(missed);
            return;
        }
        let on_one = a * b_side.abs() + b * a_side.abs();
        let on_other = c * d_side.abs() + d * c_side.abs();
        if on_one.z <= 0.0 || on_other.z <= 0.0 {
            return; // One behind the eye.
        }
        let ends = [a_side, b_side, c_side, d_side];
        let sure = ends.iter().fold(f64::INFINITY, |m, x| m.min(x.abs()));
        let direction = n.cross(o);
        let direction = direction * direction.z.signum();
        if !self.is_in_frame(direction) {
            return;
        }
        let height = self.up.dot(direction);
        self.margin = self.margin.min(sure).min(height.abs());
        if height <= 0.0 {
            return;
        }
        let (Some(p), Some(q)) = (one.rim, other.rim) else {
            return;
        };
        let site = if one.is_of_emitter {
            Site::EmitterCrossing {
                emitter: p,
                occluder: q,
            }
        } else {
            Site::OccluderCrossing([p.min(q), p.max(q)])
        };
        let passing = |line: u32, rim: Rim| Passing {
            line,
            ahead: Some(rim),
            behind: Some(rim),
        };
        let lines = [passing(one.line, p), passing(other.line, q)];
        self.consider(site, direction, &lines);
    }

    /// Is there an apparent vertex in a direction, where these lines pass?
    fn consider(&mut self, site: Site, direction: DVec3, lines: &[Passing]) {
        let fan = Fan::new(&self.normals, lines);
        let mut visible = 0;
        for piece in &self.stage.emitter_pieces {
            visible |= match self.around(piece, 1.0, direction, &fan) {
                Around::Nothing => 0,
                Around::Everything => fan.all(),
                Around::Sectors(some) => some,
            };
        }
        if visible == 0 {
            return;
        }
        let at = direction.truncate() / direction.z;
        for i in 0..self.occluders.len() {
            let (piece, facing, image) = self.occluders[i];
            if !image.holds(at) {
                continue;
            }
            match self.around(piece, facing, direction, &fan) {
                Around::Nothing => {}
                Around::Everything => return,
                Around::Sectors(some) => visible &= !some,
            }
            if visible == 0 {
                return;
            }
        }
        self.margin = self.margin.min(fan.smallest_angle);
        if fan.is_straight(visible) {
            return;
        }
        self.found.push(ApparentVertex {
            emitter: self.stage.emitter,
            site,
            bounds: fan.bounds(visible),
        });
    }

    fn around(&mut self, piece: &Convex, facing: f64, direction: DVec3, fan: &Fan<'_>) -> Around {
        let mut sectors = fan.all();
        let mut is_on_border = false;
        let mut least = f64::INFINITY;
        for border in &piece.borders {
            let sign = border.sign * facing;
            if let Some(half) = fan.half(border.line, sign) {
                sectors &= half;
                is_on_border = true;
            } else {
                let inside = self.normals[border.line as usize].dot(direction) * sign;
                least = least.min(inside);
            }
        }
        self.margin = self.margin.min(least.abs());
        if least < 0.0 {
            Around::Nothing
        } else if is_on_border {
            Around::Sectors(sectors)
        } else {
            Around::Everything
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cases::build;
    use crate::scenes::{Facing, add, add_box, add_horizontal, empty, only_face};
    use antumbra::SceneInput;

    /// A floor, and a lamp of one metre three metres above it.
    fn lit() -> SceneInput {
        let mut scene = empty();
        let floor = ([-2.0, 2.0], [-2.0, 2.0], 0.0);
        add_horizontal(&mut scene, "floor", "grey", floor, Facing::Up);
        let lamp = ([-0.5, 0.5], [-0.5, 0.5], 3.0);
        add_horizontal(&mut scene, "lamp", "lamp", lamp, Facing::Down);
        scene
    }

    fn seen(scene: &SceneInput, x: f64, y: f64) -> Seen {
        let scene = build(scene);
        let point = scene.frame.to_scene(dvec3(x, y, 0.0));
        Structures::new(&scene).at(only_face(&scene, "floor"), point)
    }

    /// How many apparent vertices of each kind.
    fn counts(scene: &SceneInput, x: f64, y: f64) -> [usize; 4] {
        let seen = seen(scene, x, y);
        assert!(seen.margin > 1e-8, "margin {:e}", seen.margin);
        let vertices = seen.structure.vertices();
        Kind::ALL.map(|kind| vertices.iter().filter(|v| v.site.kind() == kind).count())
    }

    fn triangle(scene: &mut SceneInput, name: &str, corners: [[f64; 3]; 3]) {
        add(scene, name, "grey", &corners.map(DVec3::from_array));
    }

    #[test]
    fn one_triangle_shows_its_corners_and_its_crossings_with_the_lamp() {
        let mut scene = lit();
        triangle(
            &mut scene,
            "t",
            [[-0.1, -0.1, 1.5], [0.1, -0.12, 1.6], [0.02, 0.1, 1.4]],
        );
        assert_eq!(counts(&scene, 0.0, 0.0), [4, 3, 0, 0]);
        // Seen over the border x = ½ of the lamp, with one corner inside.
        assert_eq!(counts(&scene, -0.53, 0.03), [4, 1, 2, 0]);
        // In front of a corner of the lamp.
        assert_eq!(counts(&scene, -0.5, -0.5), [3, 1, 2, 0]);
        // Beside the shadow.
        assert_eq!(counts(&scene, 1.7, 0.1), [4, 0, 0, 0]);
    }

    #[test]
    fn plate_on_edge_has_another_structure_on_its_other_side() {
        let mut scene = lit();
        triangle(
            &mut scene,
            "t",
            [[-0.1, 0.0, 1.5], [0.1, 0.0, 1.5], [0.0, 0.0, 1.7]],
        );
        let (here, there) = (seen(&scene, 0.01, 0.05), seen(&scene, 0.01, -0.05));
        assert_eq!(here.structure.vertices().len(), 7);
        assert_eq!(here.structure.difference(&there.structure).len(), 6);
    }

    #[test]
    fn two_triangles_that_overlap_show_where_they_cross() {
        let mut scene = lit();
        triangle(
            &mut scene,
            "lower",
            [[-0.15, -0.05, 1.0], [0.1, -0.06, 1.0], [0.0, 0.1, 1.1]],
        );
        triangle(
            &mut scene,
            "upper",
            [[-0.12, 0.1, 1.9], [0.02, -0.3, 2.0], [0.2, 0.12, 2.1]],
        );
        // A star of six points.
        assert_eq!(counts(&scene, 0.0, 0.0), [4, 6, 0, 6]);
        // One hides behind the other.
        let mut scene = lit();
        let large = [[-0.3, -0.3, 1.0], [0.3, -0.3, 1.0], [0.0, 0.3, 1.0]];
        triangle(&mut scene, "large", large);
        triangle(
            &mut scene,
            "small",
            [[-0.1, -0.1, 2.0], [0.1, -0.1, 2.0], [0.0, 0.1, 2.0]],
        );
        let both = seen(&scene, 0.01, 0.02);
        scene.surfaces.pop();
        assert_eq!(both.structure, seen(&scene, 0.01, 0.02).structure);
    }

    #[test]
    fn box_shows_the_corners_of_its_outline() {
        let mut scene = lit();
        add_box(
            &mut scene,
            "box",
            "grey",
            dvec3(-0.1, -0.1, 1.5),
            dvec3(0.1, 0.1, 1.7),
        );
        // From below only its bottom, from aside two faces or three.
        assert_eq!(counts(&scene, 0.01, 0.02), [4, 4, 0, 0]);
        assert_eq!(counts(&scene, 0.27, 0.02), [4, 6, 0, 0]);
        assert_eq!(counts(&scene, 0.27, 0.23), [4, 6, 0, 0]);
    }

    #[test]
    fn stacked_boxes_with_flush_sides_have_no_vertex_where_they_touch() {
        let mut scene = lit();
        let (half, top) = (0.1, 1.7);
        add_box(
            &mut scene,
            "lower",
            "grey",
            dvec3(-half, -half, 1.5),
            dvec3(half, half, 1.6),
        );
        add_box(
            &mut scene,
            "upper",
            "grey",
            dvec3(-half, -half, 1.6),
            dvec3(half, half, top),
        );
        assert_eq!(counts(&scene, 0.27, 0.23), [4, 6, 0, 0]);
    }

    #[test]
    fn leg_flush_with_a_top_shows_the_corner_between_them() {
        let mut scene = lit();
        add_box(
            &mut scene,
            "top",
            "grey",
            dvec3(-0.1, -0.1, 1.6),
            dvec3(0.1, 0.1, 1.7),
        );
        // A leg flush with the side y = 0.1, seen from below the other side.
        add_box(
            &mut scene,
            "leg",
            "grey",
            dvec3(-0.02, 0.06, 1.4),
            dvec3(0.02, 0.1, 1.6),
        );
        // The outline of the top, two lower corners of the leg, and the two places
        // where its outline meets the top's edge: at its own corner, and where a
        // lower edge of it passes behind.
        assert_eq!(counts(&scene, 0.2, -0.15), [4, 6 + 2 + 1, 0, 1]);
    }

    #[test]
    fn wall_through_the_lamp_hides_nothing_behind_its_plane() {
        let mut scene = lit();
        add(
            &mut scene,
            "wall",
            "grey",
            &[
                dvec3(0.1, -0.2, 2.5),
                dvec3(0.1, 0.2, 2.5),
                dvec3(0.1, 0.2, 3.5),
                dvec3(0.1, -0.2, 3.5),
            ],
        );
        let mut short = scene.clone();
        for corner in &mut short.surfaces[2].vertices[2..] {
            corner.z = 3.0;
        }
        for (x, y) in [(0.5, 0.03), (-0.7, 0.4), (0.11, -0.02)] {
            assert_eq!(counts(&scene, x, y), counts(&short, x, y));
            assert_eq!(counts(&scene, x, y), [4, 4, 0, 0]);
        }
    }
}
