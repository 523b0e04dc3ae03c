//! Every triangle into four of half its size.

use crate::trimesh::{TriMesh, ascending};
use antumbra_geom::cdt;
use std::collections::HashMap;

impl TriMesh {
    /// Splits every triangle into four similar ones at the middles of its edges. The halves
    /// of an edge inherit its curves.
    ///
    /// Returns for each triangle which triangle before the call it is a part of: the parts
    /// of triangle `t` are `4 t` (in the middle) to `4 t + 3`. A mesh with an edge shorter
    /// than four pixels of the arrangement stays as it is: its halves might fall together.
    ///
    /// # Source
    ///
    /// Regular ("red") refinement: Bank, Sherman & Weiser 1983.
    pub fn halve(&mut self) -> Option<Vec<u32>> {
        let shortest = (0..self.triangles.len() as u32)
            .flat_map(|t| {
                let [a, b, c] = self.corners(t);
                [a.distance(b), b.distance(c), c.distance(a)]
            })
            .fold(f64::INFINITY, f64::min);
        if shortest < 4.0 * self.pixel() {
            return None;
        }
        // For lookup only; numbers come in the order of the triangles.
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let mut triangles = Vec::with_capacity(4 * self.triangles.len());
        let mut parents = Vec::with_capacity(4 * self.triangles.len());
        for (t, &corners) in self.triangles.iter().enumerate() {
            let [a, b, c] = corners;
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[p, q]| {
                *middles.entry(ascending(p, q)).or_insert_with(|| {
                    let at = self.vertices[p as usize].midpoint(self.vertices[q as usize]);
                    self.vertices.push(at);
                    if let Some(curves) = self.edges.remove(&ascending(p, q)) {
                        let m = self.vertices.len() as u32 - 1;
                        self.edges.insert(ascending(p, m), curves);
                        self.edges.insert(ascending(m, q), curves);
                    }
                    self.vertices.len() as u32 - 1
                })
            });
            triangles.extend([[ab, bc, ca], [a, ab, ca], [b, bc, ab], [c, ca, bc]]);
            parents.extend([t as u32; 4]);
        }
        self.neighbours = cdt::neighbours(&triangles);
        self.triangles = triangles;
        Some(parents)
    }
}

#[cfg(test)]
mod tests {
    use crate::{ArrangementOptions, Order, TaggedCurve, TriMesh, arrange};
    use antumbra_geom::Control;
    use glam::dvec2;

    #[test]
    fn halves_cover_the_same_and_keep_their_curves() {
        let border = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0), (0.0, 0.0)];
        let curves = [
            TaggedCurve {
                points: border.iter().map(|&(x, y)| dvec2(x, y)).collect(),
                order: Order::Boundary,
            },
            TaggedCurve {
                points: vec![dvec2(0.0, 0.3), dvec2(2.0, 0.7)],
                order: Order::D1,
            },
        ];
        let arrangement =
            arrange(&curves, &ArrangementOptions::default(), &Control::NEVER).unwrap_or_default();
        let mut mesh = TriMesh::new(&arrangement, &curves).expect("a rectangle has area");
        let (n, area) = (mesh.triangles.len(), mesh.total_area());
        for k in 1..4 {
            let parents = mesh.halve().expect("edges are long");
            assert_eq!(parents.len(), mesh.triangles.len());
            assert_eq!(mesh.triangles.len(), n << (2 * k));
            assert!((mesh.total_area() - area).abs() < 1e-14);
            mesh.check().expect("a mesh that is halved is one");
        }
        let length: f64 = mesh
            .triangles
            .iter()
            .flat_map(|t| (0..3).map(move |k| (t[k], t[(k + 1) % 3])))
            .filter(|&(a, b)| a < b && mesh.edge_order(a, b) == Some(Order::D1))
            .map(|(a, b)| mesh.vertices[a as usize].distance(mesh.vertices[b as usize]))
            .sum();
        assert!((length - dvec2(2.0, 0.4).length()).abs() < 1e-12);
    }
}
