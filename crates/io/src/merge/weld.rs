//! Corners become ids: equal ones, then those within the tolerance.

use super::Part;
use super::nearby::Nearby;
use antumbra_geom::DVec3;
use std::collections::HashMap;

/// Vertices, and the triangles over them.
pub(super) struct Welded {
    pub(super) vertices: Vec<DVec3>,
    /// The smallest tolerance of the parts that use the vertex.
    pub(super) tolerances: Vec<f64>,
    /// Per part.
    pub(super) corners: Vec<Vec<[u32; 3]>>,
}

/// Gives every corner a vertex, in the order of the file.
///
/// A vertex joins the first one within both tolerances, whose coordinates stay;
/// chains do not grow.
pub(super) fn weld(parts: &[Part]) -> Welded {
    let mut ids: HashMap<[u64; 3], u32> = HashMap::new();
    let mut vertices: Vec<DVec3> = Vec::new();
    let mut tolerances: Vec<f64> = Vec::new();
    let mut corners: Vec<Vec<[u32; 3]>> = Vec::new();
    for part in parts {
        let tolerance = part.tolerance();
        let mut id = |corner: DVec3| {
            // Adding zero makes one zero of two.
            let point = corner + DVec3::ZERO;
            let id = *ids
                .entry(point.to_array().map(f64::to_bits))
                .or_insert_with(|| {
                    vertices.push(point);
                    tolerances.push(tolerance);
                    vertices.len() as u32 - 1
                });
            tolerances[id as usize] = tolerances[id as usize].min(tolerance);
            id
        };
        corners.push(part.triangles.iter().map(|t| t.map(&mut id)).collect());
    }

    let numbered: Vec<(u32, DVec3)> = (0u32..).zip(vertices.iter().copied()).collect();
    let nearby = Nearby::new(&numbered);
    let mut joined: Vec<u32> = (0..vertices.len() as u32).collect();
    for v in 0..vertices.len() {
        let (point, tolerance) = (vertices[v], tolerances[v]);
        let first = nearby.around(point, tolerance).into_iter().find(|&u| {
            let reach = tolerance.min(tolerances[u as usize]);
            (u as usize) < v
                && joined[u as usize] == u
                && vertices[u as usize].distance(point) <= reach
        });
        if let Some(first) = first {
            joined[v] = first;
        }
    }
    for corner in corners.iter_mut().flatten().flatten() {
        *corner = joined[*corner as usize];
    }
    Welded {
        vertices,
        tolerances,
        corners,
    }
}
