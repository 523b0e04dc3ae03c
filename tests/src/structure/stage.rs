//! What can stand in front of one emitter, and the incidences that hold from
//! everywhere: corners on lines, sides in one line, sides that touch.

use antumbra::scene::{EdgeId, FaceId, PlaneId, Scene, VertexId};
use glam::DVec3;
use std::collections::BTreeMap;

/// A point of the scene where an apparent vertex can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Corner {
    /// A vertex.
    Vertex(VertexId),
    /// Where an edge goes through the emitter's plane.
    Pierce(EdgeId),
    /// Where two edges touch that have no vertex there.
    Touch([Rim; 2]),
    /// Where the border between two pieces of a face goes through the emitter's
    /// plane: never an apparent vertex.
    Inner,
}

/// What can bound a shadow on the emitter. Edges that continue each other in one
/// line are one rim, named after the first of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Rim {
    /// An edge.
    Edge(EdgeId),
    /// Where a face goes through the emitter's plane.
    Cut(FaceId),
}

/// All convex pieces in front of an emitter's plane, cut off at it.
#[derive(Clone, Debug)]
pub(super) struct Stage {
    pub(super) emitter: FaceId,
    pub(super) points: Vec<DVec3>,
    /// Names of `points`.
    pub(super) corners: Vec<Corner>,
    /// Is it a corner of the emitter?
    pub(super) is_of_emitter: Vec<bool>,
    /// Two of `points` on every line.
    pub(super) lines: Vec<[u32; 2]>,
    /// The lines through each of `points`.
    pub(super) lines_at: Vec<Vec<Passing>>,
    /// For every line those that it meets in one of `points`, ascending.
    pub(super) meets: Vec<Vec<u32>>,
    pub(super) sides: Vec<Side>,
    pub(super) occluders: Vec<Convex>,
    pub(super) emitter_pieces: Vec<Convex>,
}

/// A line through a corner, and the rims that leave the corner along it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Passing {
    pub(super) line: u32,
    /// In the line's direction.
    pub(super) ahead: Option<Rim>,
    /// Against it.
    pub(super) behind: Option<Rim>,
}

/// A side of one or more convex pieces.
#[derive(Clone, Debug)]
pub(super) struct Side {
    pub(super) ends: [u32; 2],
    pub(super) line: u32,
    /// `None` for a border between two pieces of a face.
    pub(super) rim: Option<Rim>,
    pub(super) is_of_emitter: bool,
    /// The occluding pieces beside it, and the sign of [`Border`].
    pub(super) pieces: Vec<(u32, f64)>,
}

/// A convex piece of a face, in front of the emitter.
#[derive(Clone, Debug)]
pub(super) struct Convex {
    pub(super) plane: PlaneId,
    /// Unit normal of its front.
    pub(super) normal: DVec3,
    /// One of its corners.
    pub(super) point: DVec3,
    pub(super) corners: Vec<u32>,
    pub(super) borders: Vec<Border>,
}

/// One side of a convex piece.
#[derive(Clone, Copy, Debug)]
pub(super) struct Border {
    pub(super) side: u32,
    pub(super) line: u32,
    /// +1 if the piece's outline runs along the line, −1 if against it.
    pub(super) sign: f64,
}

impl Stage {
    pub(super) fn new(scene: &Scene, emitter: FaceId) -> Self {
        let lamp = scene.face(emitter);
        let mut builder = Builder::new(scene, emitter);
        for piece in &scene.pieces[lamp.pieces.start as usize..lamp.pieces.end as usize] {
            builder.add(emitter, &piece.vertices, true);
        }
        for piece in &scene.pieces {
            let face = scene.face(piece.face);
            if piece.hides && face.plane != lamp.plane {
                builder.add(piece.face, &piece.vertices, false);
            }
        }
        builder.finish()
    }
}

struct Builder<'s> {
    scene: &'s Scene,
    emitter: FaceId,
    /// Points closer than this are one point.
    tolerance: f64,
    stage: Stage,
    of_vertex: BTreeMap<VertexId, u32>,
    of_pierced: BTreeMap<[VertexId; 2], u32>,
    of_ends: BTreeMap<[u32; 2], u32>,
}

impl<'s> Builder<'s> {
    fn new(scene: &'s Scene, emitter: FaceId) -> Self {
        Self {
            scene,
            emitter,
            tolerance: 4.0 * scene.plane_tolerance(),
            stage: Stage {
                emitter,
                points: Vec::new(),
                corners: Vec::new(),
                is_of_emitter: Vec::new(),
                lines: Vec::new(),
                lines_at: Vec::new(),
                meets: Vec::new(),
                sides: Vec::new(),
                occluders: Vec::new(),
                emitter_pieces: Vec::new(),
            },
            of_vertex: BTreeMap::new(),
            of_pierced: BTreeMap::new(),
            of_ends: BTreeMap::new(),
        }
    }

    fn point(&mut self, position: DVec3, corner: Corner) -> u32 {
        self.stage.points.push(position);
        self.stage.corners.push(corner);
        self.stage.is_of_emitter.push(false);
        self.stage.points.len() as u32 - 1
    }

    fn vertex(&mut self, v: VertexId) -> u32 {
        if let Some(&at) = self.of_vertex.get(&v) {
            return at;
        }
        let at = self.point(self.scene.position(v), Corner::Vertex(v));
        self.of_vertex.insert(v, at);
        at
    }

    /// Where the side between two vertices goes through the emitter's plane.
    fn pierced(&mut self, v: VertexId, w: VertexId, [p, q]: [f64; 2]) -> u32 {
        let key = [v.min(w), v.max(w)];
        if let Some(&at) = self.of_pierced.get(&key) {
            return at;
        }
        let (a, b) = (self.scene.position(v), self.scene.position(w));
        let edge = self.scene.edge_between(v, w);
        let name = edge.map_or(Corner::Inner, Corner::Pierce);
        let at = self.point(a + (b - a) * (p / (p - q)), name);
        self.of_pierced.insert(key, at);
        at
    }

    /// Adds a convex piece, or what of it is in front of the emitter's plane.
    fn add(&mut self, id: FaceId, vertices: &[VertexId], is_of_emitter: bool) {
        let heights: Vec<f64> = vertices
            .iter()
            .map(|&v| self.lamp_height(v, is_of_emitter))
            .collect();
        if !is_of_emitter && !heights.iter().any(|&h| h > 0.0) {
            return;
        }
        // Corners, and the name of the side that leaves each of them.
        let mut outline: Vec<(u32, Option<Rim>)> = Vec::new();
        for (i, &v) in vertices.iter().enumerate() {
            let j = (i + 1) % vertices.len();
            let (w, p, q) = (vertices[j], heights[i], heights[j]);
            let edge = self.scene.edge_between(v, w).map(Rim::Edge);
            let cut = Some(Rim::Cut(id));
            if p >= 0.0 {
                let leaves = if p == 0.0 && q < 0.0 { cut } else { edge };
                outline.push((self.vertex(v), leaves));
            }
            if (p > 0.0 && q < 0.0) || (p < 0.0 && q > 0.0) {
                let leaves = if p > 0.0 { cut } else { edge };
                outline.push((self.pierced(v, w, [p, q]), leaves));
            }
        }
        let face = self.scene.face(id);
        let pieces = &self.stage.occluders;
        let piece = (!is_of_emitter).then_some(pieces.len() as u32);
        let borders = (0..outline.len())
            .map(|i| {
                let (a, rim) = outline[i];
                let b = outline[(i + 1) % outline.len()].0;
                let side = self.side([a, b], rim, is_of_emitter);
                if let Some(piece) = piece {
                    self.stage.sides[side as usize].pieces.push((piece, 0.0));
                }
                Border {
                    side,
                    line: 0,
                    sign: 0.0,
                }
            })
            .collect();
        let corners: Vec<u32> = outline.iter().map(|c| c.0).collect();
        let convex = Convex {
            plane: face.plane,
            normal: face.normal,
            point: self.stage.points[corners[0] as usize],
            corners,
            borders,
        };
        if is_of_emitter {
            for &c in &convex.corners {
                self.stage.is_of_emitter[c as usize] = true;
            }
            self.stage.emitter_pieces.push(convex);
        } else {
            self.stage.occluders.push(convex);
        }
    }

    /// Over the emitter's front; 0 in its plane.
    fn lamp_height(&self, v: VertexId, is_of_emitter: bool) -> f64 {
        let lamp = self.scene.face(self.emitter);
        let origin = self.scene.position(lamp.outline[0]);
        let h = lamp.normal.dot(self.scene.position(v) - origin);
        if is_of_emitter || h.abs() <= self.scene.plane_tolerance() {
            0.0
        } else {
            h
        }
    }

    fn side(&mut self, [a, b]: [u32; 2], rim: Option<Rim>, is_of_emitter: bool) -> u32 {
        let ends = [a.min(b), a.max(b)];
        let sides = &mut self.stage.sides;
        let at = *self.of_ends.entry(ends).or_insert_with(|| {
            sides.push(Side {
                ends,
                line: 0,
                rim,
                is_of_emitter: false,
                pieces: Vec::new(),
            });
            sides.len() as u32 - 1
        });
        sides[at as usize].is_of_emitter |= is_of_emitter && rim.is_some();
        at
    }

    fn finish(mut self) -> Stage {
        self.find_lines();
        self.orient_borders();
        let n_points = self.stage.points.len();
        self.stage.lines_at = (0..n_points).map(|c| self.lines_through(c)).collect();
        self.find_touches();
        self.stage.meets = self.meetings();
        self.name_rims();
        self.stage
    }

    /// Sides on one line, the longest first: it spans the line.
    fn find_lines(&mut self) {
        let stage = &mut self.stage;
        let length = |s: &Side| {
            let [a, b] = s.ends.map(|c| stage.points[c as usize]);
            a.distance(b)
        };
        let mut order: Vec<usize> = (0..stage.sides.len()).collect();
        order.sort_by(|&s, &t| {
            length(&stage.sides[t])
                .total_cmp(&length(&stage.sides[s]))
                .then(s.cmp(&t))
        });
        for s in order {
            let ends = stage.sides[s].ends;
            let known = (0..stage.lines.len()).find(|&l| {
                ends.iter().all(|&c| {
                    off_line(&stage.points, stage.lines[l], stage.points[c as usize])
                        <= self.tolerance
                })
            });
            let line = known.unwrap_or_else(|| {
                stage.lines.push(ends);
                stage.lines.len() - 1
            });
            stage.sides[s].line = line as u32;
        }
    }

    fn orient_borders(&mut self) {
        let stage = &mut self.stage;
        let of_occluders = stage
            .occluders
            .iter_mut()
            .enumerate()
            .map(|(i, p)| (Some(i as u32), p));
        let of_emitter = stage.emitter_pieces.iter_mut().map(|p| (None, p));
        for (id, piece) in of_occluders.chain(of_emitter) {
            for (i, border) in piece.borders.iter_mut().enumerate() {
                let a = piece.corners[i];
                let b = piece.corners[(i + 1) % piece.corners.len()];
                let side = &mut stage.sides[border.side as usize];
                let [from, to] = stage.lines[side.line as usize];
                let at = |c: u32| stage.points[c as usize];
                let along = (at(to) - at(from)).dot(at(b) - at(a));
                border.line = side.line;
                border.sign = along.signum();
                for beside in side.pieces.iter_mut().filter(|p| Some(p.0) == id) {
                    beside.1 = border.sign;
                }
            }
        }
    }

    fn lines_through(&self, corner: usize) -> Vec<Passing> {
        let stage = &self.stage;
        (0..stage.lines.len())
            .filter(|&l| {
                off_line(&stage.points, stage.lines[l], stage.points[corner]) <= self.tolerance
            })
            .map(|l| Passing {
                line: l as u32,
                ahead: None,
                behind: None,
            })
            .collect()
    }

    /// Corners where two sides touch between their ends.
    fn find_touches(&mut self) {
        let n_vertices = self.stage.points.len();
        for s in 0..self.stage.sides.len() {
            for t in s + 1..self.stage.sides.len() {
                let (one, other) = (&self.stage.sides[s], &self.stage.sides[t]);
                let (Some(a), Some(b)) = (one.rim, other.rim) else {
                    continue;
                };
                let meet = |of: &Side, line: u32| {
                    let passes = |c: &u32| {
                        let lines = &self.stage.lines_at[*c as usize];
                        lines.iter().any(|p| p.line == line)
                    };
                    of.ends.iter().any(passes)
                };
                let (l, m) = (one.line, other.line);
                if l == m || meet(one, m) || meet(other, l) {
                    continue;
                }
                let Some(point) = self.touch(one, other) else {
                    continue;
                };
                let is_known = self.stage.points[n_vertices..]
                    .iter()
                    .any(|p| p.distance(point) <= self.tolerance);
                if !is_known {
                    let at = self.point(point, Corner::Touch([a.min(b), a.max(b)]));
                    let lines = self.lines_through(at as usize);
                    self.stage.lines_at.push(lines);
                }
            }
        }
    }

    fn touch(&self, one: &Side, other: &Side) -> Option<DVec3> {
        let at = |c: u32| self.stage.points[c as usize];
        let ([a, b], [c, d]) = (one.ends.map(at), other.ends.map(at));
        let (u, v) = (b - a, d - c);
        let normal = u.cross(v);
        let normal_sq = normal.length_squared();
        if normal_sq <= 1e-18 * u.length_squared() * v.length_squared() {
            return None; // Parallel.
        }
        let w = c - a;
        if w.dot(normal).abs() > self.tolerance * normal_sq.sqrt() {
            return None;
        }
        let s = w.cross(v).dot(normal) / normal_sq;
        let t = w.cross(u).dot(normal) / normal_sq;
        let is_inside = |x: f64| x > 0.0 && x < 1.0;
        (is_inside(s) && is_inside(t)).then(|| a + u * s)
    }

    fn meetings(&self) -> Vec<Vec<u32>> {
        let mut meets = vec![Vec::new(); self.stage.lines.len()];
        for lines in &self.stage.lines_at {
            for p in lines {
                let others = lines.iter().map(|q| q.line).filter(|&q| q != p.line);
                meets[p.line as usize].extend(others);
            }
        }
        for lines in &mut meets {
            lines.sort_unstable();
            lines.dedup();
        }
        meets
    }

    /// Sides that overlap or follow each other in a line become one rim; and the
    /// rims that leave every corner are noted.
    fn name_rims(&mut self) {
        let stage = &mut self.stage;
        let mut on_line: Vec<Vec<(f64, f64, usize)>> = vec![Vec::new(); stage.lines.len()];
        let parameter = |line: u32, c: u32| {
            let [from, to] = stage.lines[line as usize].map(|c| stage.points[c as usize]);
            let along = (to - from).normalize_or_zero();
            (stage.points[c as usize] - from).dot(along)
        };
        for (i, side) in stage.sides.iter().enumerate() {
            if side.rim.is_some() {
                let [s, t] = side.ends.map(|c| parameter(side.line, c));
                on_line[side.line as usize].push((s.min(t), s.max(t), i));
            }
        }
        let mut chains: Vec<Vec<(f64, f64, Rim)>> = Vec::with_capacity(on_line.len());
        for spans in &mut on_line {
            spans.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
            let mut chain: Vec<(f64, f64, Rim)> = Vec::new();
            for &(from, to, i) in spans.iter() {
                let Some(rim) = stage.sides[i].rim else {
                    continue;
                };
                match chain.last_mut() {
                    Some(last) if from <= last.1 + self.tolerance => {
                        *last = (last.0, last.1.max(to), last.2.min(rim));
                    }
                    _ => chain.push((from, to, rim)),
                }
            }
            chains.push(chain);
        }
        let tolerance = self.tolerance;
        let rim_at = |line: u32, s: f64| {
            let chain = &chains[line as usize];
            chain.iter().find(|c| c.0 < s && s < c.1).map(|c| c.2)
        };
        let at_corners: Vec<Vec<Passing>> = stage
            .lines_at
            .iter()
            .enumerate()
            .map(|(c, lines)| {
                let named = |p: &Passing| {
                    let s = parameter(p.line, c as u32);
                    Passing {
                        line: p.line,
                        ahead: rim_at(p.line, s + 2.0 * tolerance),
                        behind: rim_at(p.line, s - 2.0 * tolerance),
                    }
                };
                lines.iter().map(named).collect()
            })
            .collect();
        let names: Vec<Option<Rim>> = stage
            .sides
            .iter()
            .map(|side| {
                let [s, t] = side.ends.map(|c| parameter(side.line, c));
                side.rim
                    .and_then(|own| rim_at(side.line, (s + t) / 2.0).or(Some(own)))
            })
            .collect();
        stage.lines_at = at_corners;
        for (side, name) in stage.sides.iter_mut().zip(names) {
            side.rim = name;
        }
    }
}

/// Distance of a point from the line through two others.
fn off_line(points: &[DVec3], [from, to]: [u32; 2], point: DVec3) -> f64 {
    let from = points[from as usize];
    let along = (points[to as usize] - from).normalize_or_zero();
    (point - from).cross(along).length()
}
