//! Coplanar neighbours joined while they are convex together.
//!
//! A wall that was cut into facets hides as one: a row of facets is joined first, then the
//! rows. Corners in the middle of joined sides are kept until all is done, for other rows
//! meet there.

use antumbra_scene::{Scene, VertexId};
use glam::DVec3;
use std::collections::HashMap;

/// Convex polygons joined to one.
#[derive(Clone, Debug)]
pub(super) struct Joined {
    /// The pieces it is made of, ascending.
    pub(super) pieces: Vec<u32>,
    /// Counter-clockwise seen from the fronts of the pieces; none straight.
    pub(super) corners: Vec<DVec3>,
}

/// Joins pieces of one plane that face the same way.
pub(super) fn join(scene: &Scene, pieces: &[u32]) -> Vec<Joined> {
    let mut joiner = Joiner::new(scene, pieces);
    while joiner.join_all_once() {}
    joiner.finish()
}

/// An outline and the pieces in it.
#[derive(Clone, Debug)]
struct Outline {
    corners: Vec<VertexId>,
    pieces: Vec<u32>,
}

struct Joiner<'s> {
    scene: &'s Scene,
    normal: DVec3,
    /// `None` where an outline became a part of another.
    outlines: Vec<Option<Outline>>,
    /// What each outline became a part of; itself if it is whole.
    part_of: Vec<usize>,
    /// The outline that had an edge at first, from one end to the other; `None` if several.
    with_edge: HashMap<[VertexId; 2], Option<usize>>,
}

impl<'s> Joiner<'s> {
    fn new(scene: &'s Scene, pieces: &[u32]) -> Self {
        let outline = |&piece: &u32| Outline {
            corners: scene.pieces[piece as usize].vertices.clone(),
            pieces: vec![piece],
        };
        let outlines: Vec<Outline> = pieces.iter().map(outline).collect();
        let mut with_edge = HashMap::new();
        for (i, outline) in outlines.iter().enumerate() {
            let corners = &outline.corners;
            for k in 0..corners.len() {
                let edge = [corners[k], corners[(k + 1) % corners.len()]];
                with_edge
                    .entry(edge)
                    .and_modify(|of| *of = None)
                    .or_insert(Some(i));
            }
        }
        let face = scene.pieces[pieces[0] as usize].face;
        Self {
            scene,
            normal: scene.face(face).normal,
            part_of: (0..outlines.len()).collect(),
            outlines: outlines.into_iter().map(Some).collect(),
            with_edge,
        }
    }

    /// Joins every outline with neighbours as long as that goes; was any joined?
    fn join_all_once(&mut self) -> bool {
        let mut any = false;
        for i in 0..self.outlines.len() {
            let mut at = 0;
            while let Some(outline) = &self.outlines[i]
                && at < outline.corners.len()
            {
                let n = outline.corners.len();
                let back = [outline.corners[(at + 1) % n], outline.corners[at]];
                let other = self.with_edge.get(&back).copied().flatten();
                let other = other.map(|other| self.whole(other));
                match other.and_then(|other| Some((other, self.union(i, other, at)?))) {
                    Some((other, corners)) => {
                        let theirs = self.outlines[other].take().expect("it is whole");
                        let own = self.outlines[i].as_mut().expect("it is whole");
                        own.corners = corners;
                        own.pieces.extend(theirs.pieces);
                        self.part_of[other] = i;
                        any = true;
                        at = 0;
                    }
                    None => at += 1,
                }
            }
        }
        any
    }

    /// What an outline is a part of by now.
    fn whole(&mut self, outline: usize) -> usize {
        let mut at = outline;
        while self.part_of[at] != at {
            self.part_of[at] = self.part_of[self.part_of[at]];
            at = self.part_of[at];
        }
        at
    }

    /// The outline of two that share the edge of `a` from corner `at`; `None` if it is not
    /// convex.
    fn union(&self, a: usize, b: usize, at: usize) -> Option<Vec<VertexId>> {
        if a == b {
            return None;
        }
        let a = &self.outlines[a].as_ref().expect("it is whole").corners;
        let b = &self.outlines[b].as_ref().expect("it is whole").corners;
        let (n, m) = (a.len(), b.len());
        let on_b = b.iter().position(|&v| v == a[at])?;
        if b[(on_b + m - 1) % m] != a[(at + 1) % n] {
            return None;
        }
        // The chain they share: forwards on `a`, backwards on `b`.
        let (mut before, mut after) = (0, 1);
        while before + after < n.min(m) - 1
            && a[(at + n - before - 1) % n] == b[(on_b + before + 1) % m]
        {
            before += 1;
        }
        while before + after < n.min(m) - 1
            && a[(at + after + 1) % n] == b[(on_b + m - after - 1) % m]
        {
            after += 1;
        }
        let shared = before + after;
        let of_a = (0..n - shared).map(|k| a[(at + after + k) % n]);
        let of_b = (0..m - shared).map(|k| b[(on_b + before + k) % m]);
        let union: Vec<VertexId> = of_a.chain(of_b).collect();
        // The two corners where the outlines meet.
        [0, n - shared]
            .iter()
            .all(|&k| self.turns_left_or_straight(&union, k))
            .then_some(union)
    }

    fn turns_left_or_straight(&self, corners: &[VertexId], at: usize) -> bool {
        let n = corners.len();
        let [before, here, after] =
            [n - 1, 0, 1].map(|k| self.scene.position(corners[(at + k) % n]));
        let turn = self.normal.dot((here - before).cross(after - here));
        turn > 0.0 || is_straight(before, here, after, self.scene.rounding())
    }

    fn finish(self) -> Vec<Joined> {
        let rounding = self.scene.rounding();
        let whole = self.outlines.into_iter().flatten();
        whole
            .map(|mut outline| {
                outline.pieces.sort_unstable();
                let corners = self.scene.positions(&outline.corners);
                Joined {
                    corners: if outline.pieces.len() > 1 {
                        without_straight(&corners, rounding)
                    } else {
                        corners
                    },
                    pieces: outline.pieces,
                }
            })
            .collect()
    }
}

/// Does a corner lie on the way from one to another, to rounding?
fn is_straight(before: DVec3, here: DVec3, after: DVec3, rounding: f64) -> bool {
    let (to, along) = (here - before, after - before);
    let is_between = to.dot(along) > 0.0 && (after - here).dot(along) > 0.0;
    is_between && to.cross(along).length() <= rounding * along.length()
}

/// The corners of a polygon at which it bends.
fn without_straight(corners: &[DVec3], rounding: f64) -> Vec<DVec3> {
    let n = corners.len();
    let bends = |i: usize| {
        let [before, after] = [corners[(i + n - 1) % n], corners[(i + 1) % n]];
        !is_straight(before, corners[i], after, rounding)
    };
    // From a corner that surely stays.
    let Some(start) = (0..n).find(|&i| bends(i)) else {
        return corners.to_vec();
    };
    let mut kept = vec![corners[start]];
    for k in 1..n {
        let (here, after) = (corners[(start + k) % n], corners[(start + k + 1) % n]);
        let before = *kept.last().expect("the first stays");
        if !is_straight(before, here, after, rounding) {
            kept.push(here);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use antumbra_scene::{MaterialInput, SceneInput, SurfaceInput};
    use glam::dvec3;

    /// Rectangles of a floor, from lower left to upper right corner.
    fn floor(rectangles: &[[f64; 4]]) -> Scene {
        let surface = |(i, &[x0, y0, x1, y1]): (usize, &[f64; 4])| SurfaceInput {
            name: i.to_string(),
            material: "grey".into(),
            vertices: vec![
                dvec3(x0, y0, 0.0),
                dvec3(x1, y0, 0.0),
                dvec3(x1, y1, 0.0),
                dvec3(x0, y1, 0.0),
            ],
            holes: vec![],
        };
        let input = SceneInput {
            materials: vec![MaterialInput {
                name: "grey".into(),
                reflectance: vec![0.5],
                exitance: vec![0.0],
                two_sided: false,
            }],
            surfaces: rectangles.iter().enumerate().map(surface).collect(),
            ..SceneInput::default()
        };
        Scene::build(&input).expect("the scene is valid").scene
    }

    fn joined(scene: &Scene) -> Vec<Joined> {
        let all: Vec<u32> = (0..scene.pieces.len() as u32).collect();
        join(scene, &all)
    }

    #[test]
    fn tiles_of_a_floor_become_one_rectangle() {
        let tile = |k: u32| {
            let (x, y) = (f64::from(k % 7) * 0.3, f64::from(k / 7) * 0.7);
            let next = (f64::from(k % 7 + 1) * 0.3, f64::from(k / 7 + 1) * 0.7);
            [x, y, next.0, next.1]
        };
        let tiles: Vec<[f64; 4]> = (0..35).map(tile).collect();
        let joined = joined(&floor(&tiles));
        assert_eq!(joined.len(), 1);
        assert_eq!(joined[0].corners.len(), 4);
        assert_eq!(joined[0].pieces, (0..35).collect::<Vec<_>>());
    }

    #[test]
    fn an_l_stays_two_rectangles_and_loses_no_area() {
        let l = [
            [0.0, 0.0, 1.0, 1.0],
            [1.0, 0.0, 2.0, 1.0],
            [0.0, 1.0, 1.0, 2.0],
        ];
        let scene = floor(&l);
        let joined = joined(&scene);
        assert_eq!(joined.len(), 2);
        let scale = scene.frame.scale;
        let area: f64 = joined
            .iter()
            .map(|j| {
                let c = &j.corners;
                (1..c.len() - 1)
                    .map(|k| (c[k] - c[0]).cross(c[k + 1] - c[0]).z / 2.0)
                    .sum::<f64>()
            })
            .sum();
        assert!((area / (scale * scale) - 3.0).abs() < 1e-14, "{area}");
    }

    #[test]
    fn rectangles_that_share_a_part_of_a_side_stay_apart() {
        let joined = joined(&floor(&[[0.0, 0.0, 1.0, 1.0], [1.0, 0.0, 2.0, 0.5]]));
        assert_eq!(joined.len(), 2);
    }
}
