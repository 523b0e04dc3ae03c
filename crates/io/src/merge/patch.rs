//! Flat patches of a mesh: triangles that share edges, a plane and a direction.

use super::nearby::Nearby;
use antumbra_geom::{DVec3, Plane, newell_normal};
use std::collections::BTreeSet;

/// The triangles that count.
pub(super) struct Usable {
    pub(super) triangles: Vec<usize>,
    pub(super) n_flat: usize,
    pub(super) n_duplicate: usize,
}

/// Sorts out triangles without area (not higher than the tolerance) and those
/// that have the same corners in the same direction as one before.
pub(super) fn usable(corners: &[[u32; 3]], vertices: &[DVec3], tolerance: f64) -> Usable {
    let mut seen = BTreeSet::new();
    let mut usable = Usable {
        triangles: Vec::new(),
        n_flat: 0,
        n_duplicate: 0,
    };
    for (t, &[a, b, c]) in corners.iter().enumerate() {
        let positions = [a, b, c].map(|v| vertices[v as usize]);
        if a == b || b == c || c == a || height(positions) <= tolerance {
            usable.n_flat += 1;
        } else if seen.insert([[a, b, c], [b, c, a], [c, a, b]].into_iter().min()) {
            usable.triangles.push(t);
        } else {
            usable.n_duplicate += 1;
        }
    }
    usable
}

/// Twice the area over the longest side.
fn height(positions: [DVec3; 3]) -> f64 {
    let [a, b, c] = positions;
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    newell_normal(&positions).length() / longest
}

/// The usable triangles of a part and their neighbours.
pub(super) struct Mesh<'a> {
    corners: &'a [[u32; 3]],
    vertices: &'a [DVec3],
    tolerance: f64,
    triangles: Vec<usize>,
    /// Corners and the T-vertices between them, by triangle of the part; empty
    /// for those that do not count.
    outlines: Vec<Vec<u32>>,
    /// Twice the vector area, by triangle of the part.
    areas: Vec<DVec3>,
    /// Directed edges, sorted, and whose they are.
    edges: Vec<([u32; 2], usize)>,
}

impl<'a> Mesh<'a> {
    pub(super) fn new(
        corners: &'a [[u32; 3]],
        triangles: Vec<usize>,
        vertices: &'a [DVec3],
        tolerance: f64,
    ) -> Self {
        let mut mesh = Self {
            corners,
            vertices,
            tolerance,
            outlines: vec![Vec::new(); corners.len()],
            areas: vec![DVec3::ZERO; corners.len()],
            edges: Vec::new(),
            triangles,
        };
        for &t in &mesh.triangles {
            mesh.outlines[t] = corners[t].to_vec();
            mesh.areas[t] = newell_normal(&mesh.positions(t));
        }
        mesh.list_edges();
        if mesh.close_t_vertices() {
            mesh.list_edges();
        }
        mesh
    }

    pub(super) fn corners(&self, t: usize) -> [u32; 3] {
        self.corners[t]
    }

    pub(super) fn outline(&self, t: usize) -> &[u32] {
        &self.outlines[t]
    }

    pub(super) fn area(&self, t: usize) -> f64 {
        self.areas[t].length() / 2.0
    }

    /// The plane of some triangles: their vector area, through their centroid.
    pub(super) fn plane(&self, triangles: &[usize]) -> Plane {
        let mut sum = Sum::default();
        for &t in triangles {
            sum.add(self, t);
        }
        sum.plane()
    }

    /// The flat patches, each in ascending order, the first triangles of all too.
    ///
    /// A patch starts at the largest triangle left, whose plane is known best.
    pub(super) fn patches(&self) -> Vec<Vec<usize>> {
        let mut seeds = self.triangles.clone();
        seeds.sort_by(|&s, &t| {
            let area = |t: usize| self.areas[t].length_squared();
            area(t).total_cmp(&area(s)).then(s.cmp(&t))
        });
        let mut patch_of: Vec<Option<usize>> = vec![None; self.corners.len()];
        let mut patches = Vec::new();
        for seed in seeds {
            if patch_of[seed].is_some() {
                continue;
            }
            // The plane turns a little while a patch grows, so what it holds in the
            // end is checked; a smaller tolerance while growing lets it pass.
            let mut patch = [1.0, 0.5, 0.25]
                .into_iter()
                .find_map(|part| self.grown(seed, &mut patch_of, patches.len(), part))
                .unwrap_or_else(|| vec![seed]);
            for &t in &patch {
                patch_of[t] = Some(patches.len());
            }
            patch.sort_unstable();
            patches.push(patch);
        }
        patches.sort();
        patches
    }

    /// The patch around `seed`, if it is flat in the end; `patch_of` is left as
    /// it was.
    fn grown(
        &self,
        seed: usize,
        patch_of: &mut [Option<usize>],
        patch: usize,
        part: f64,
    ) -> Option<Vec<usize>> {
        let mut members = vec![seed];
        patch_of[seed] = Some(patch);
        let mut sum = Sum::default();
        sum.add(self, seed);
        let mut next = 0;
        while next < members.len() {
            let t = members[next];
            next += 1;
            let plane = sum.plane();
            for edge in edges_of(&self.outlines[t]) {
                let Some(neighbour) = self.neighbour(t, edge, &plane, part * self.tolerance) else {
                    continue;
                };
                if patch_of[neighbour].is_none() {
                    patch_of[neighbour] = Some(patch);
                    sum.add(self, neighbour);
                    members.push(neighbour);
                }
            }
        }
        for &t in &members {
            patch_of[t] = None;
        }
        let plane = sum.plane();
        let is_flat = members
            .iter()
            .all(|&t| self.lies_in(t, &plane, self.tolerance));
        is_flat.then_some(members)
    }

    /// The one triangle that continues `t` across an edge in the plane. Where
    /// several could, none does: sheets that lie over each other.
    fn neighbour(&self, t: usize, [a, b]: [u32; 2], plane: &Plane, reach: f64) -> Option<usize> {
        let in_plane = |edge: [u32; 2]| {
            self.with_edge(edge)
                .iter()
                .map(|&(_, other)| other)
                .filter(|&other| self.lies_in(other, plane, reach))
        };
        if in_plane([a, b]).any(|other| other != t) {
            return None;
        }
        let mut across = in_plane([b, a]);
        let neighbour = across.next()?;
        across.next().is_none().then_some(neighbour)
    }

    fn lies_in(&self, t: usize, plane: &Plane, reach: f64) -> bool {
        self.areas[t].dot(plane.normal) > 0.0
            && self
                .positions(t)
                .iter()
                .all(|&p| plane.distance(p).abs() <= reach)
    }

    fn with_edge(&self, edge: [u32; 2]) -> &[([u32; 2], usize)] {
        let from = self.edges.partition_point(|e| e.0 < edge);
        let n = self.edges[from..].partition_point(|e| e.0 == edge);
        &self.edges[from..from + n]
    }

    fn list_edges(&mut self) {
        self.edges = self
            .triangles
            .iter()
            .flat_map(|&t| edges_of(&self.outlines[t]).map(move |edge| (edge, t)))
            .collect();
        self.edges.sort_unstable();
    }

    /// Puts the ends of open edges that lie on other open edges into those: where
    /// one long edge meets two short ones, and where a triangle without area lay.
    fn close_t_vertices(&mut self) -> bool {
        let open: Vec<([u32; 2], usize)> = self
            .edges
            .iter()
            .filter(|([a, b], _)| self.with_edge([*b, *a]).is_empty())
            .copied()
            .collect();
        let mut ends: Vec<u32> = open.iter().flat_map(|e| e.0).collect();
        ends.sort_unstable();
        ends.dedup();
        let points: Vec<(u32, DVec3)> = ends
            .iter()
            .map(|&v| (v, self.vertices[v as usize]))
            .collect();
        let nearby = Nearby::new(&points);
        let mut any = false;
        for ([a, b], t) in open {
            let [p, q] = [a, b].map(|v| self.vertices[v as usize]);
            let along = q - p;
            let mut on: Vec<(f64, u32)> = nearby
                .along(p, q, self.tolerance)
                .into_iter()
                .filter(|&v| v != a && v != b)
                .filter_map(|v| {
                    let at = self.vertices[v as usize];
                    let x = (at - p).dot(along) / along.length_squared();
                    let is_on = x > 0.0 && x < 1.0 && at.distance(p + x * along) <= self.tolerance;
                    is_on.then_some((x, v))
                })
                .collect();
            if on.is_empty() {
                continue;
            }
            any = true;
            on.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
            let outline = &mut self.outlines[t];
            let n = outline.len();
            let edge = (0..n).find(|&i| outline[i] == a && outline[(i + 1) % n] == b);
            if let Some(i) = edge {
                outline.splice(i + 1..i + 1, on.into_iter().map(|(_, v)| v));
            }
        }
        any
    }

    fn positions(&self, t: usize) -> [DVec3; 3] {
        self.corners[t].map(|v| self.vertices[v as usize])
    }
}

/// The directed edges of a loop.
pub(super) fn edges_of(corners: &[u32]) -> impl Iterator<Item = [u32; 2]> + '_ {
    (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]])
}

/// Sums over triangles from which their common plane follows.
#[derive(Default)]
struct Sum {
    /// Relative to this point, so that far offsets cost no digits.
    origin: Option<DVec3>,
    twice_vector_area: DVec3,
    twice_area: f64,
    moment: DVec3,
}

impl Sum {
    fn add(&mut self, mesh: &Mesh<'_>, t: usize) {
        let positions = mesh.positions(t);
        let origin = *self.origin.get_or_insert(positions[0]);
        let area = mesh.areas[t].length();
        self.twice_vector_area += mesh.areas[t];
        self.twice_area += area;
        self.moment += area / 3.0 * positions.map(|p| p - origin).iter().sum::<DVec3>();
    }

    fn plane(&self) -> Plane {
        let length = self.twice_vector_area.length();
        Plane {
            // A quotient, not a product with the inverse: exactly unit along an axis.
            normal: self.twice_vector_area / length + DVec3::ZERO,
            point: self.origin.unwrap_or_default() + self.moment / self.twice_area,
        }
    }
}
