//! Questions about faces: their charts, their bounds, what lies on them.

use crate::bvh::Aabb;
use crate::scene::{FaceId, Scene, SurfaceId};
use antumbra_geom::{Chart, point_in_polygon};
use glam::{DVec2, DVec3};

impl Scene {
    /// The chart of a face's plane class on the face's side: equal for all faces
    /// of a class that face the same way.
    #[must_use]
    pub fn chart(&self, face: FaceId) -> Chart {
        let face = self.face(face);
        Chart::new(self.planes[face.plane.index()].point, face.normal)
    }

    /// The outline and the holes of a face in a chart.
    #[must_use]
    pub fn loops_in_chart(&self, face: FaceId, chart: &Chart) -> Vec<Vec<DVec2>> {
        let flat = |&v: &_| chart.to_chart(self.position(v));
        self.face(face)
            .loops()
            .map(|corners| corners.iter().map(flat).collect())
            .collect()
    }

    /// The smallest box of all vertices, scene units.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        Aabb::of(self.vertices.iter().copied())
    }

    /// The front face of a surface on which a point lies.
    ///
    /// * `point` — scene units.
    ///
    /// The nearest face whose outline contains the foot of the point, or from
    /// whose outline the foot is no more than 10⁻⁹ of the surface's size away.
    /// `None` if there is no such face within 10⁻⁶ of the scene's extent.
    #[must_use]
    pub fn face_containing(&self, surface: SurfaceId, point: DVec3) -> Option<FaceId> {
        let fronts = self.surfaces[surface.index()].faces.clone().map(FaceId);
        let fronts: Vec<FaceId> = fronts.filter(|&f| !self.face(f).is_back).collect();
        let corners = fronts.iter().flat_map(|&f| self.face(f).outline.iter());
        let bounds = Aabb::of(corners.map(|&v| self.position(v)));
        let margin = 1e-9 * (bounds.max - bounds.min).length();

        let mut best: Option<(f64, FaceId)> = None;
        for f in fronts {
            let chart = self.chart(f);
            let height = chart.height(point).abs();
            if height > 1e-6 * self.extent {
                continue;
            }
            let loops = self.loops_in_chart(f, &chart);
            let foot = chart.to_chart(point);
            let outside = if point_in_polygon(foot, loops.iter().map(Vec::as_slice)) {
                0.0
            } else {
                distance_to_border(foot, &loops)
            };
            let distance = height + outside;
            if outside <= margin && best.is_none_or(|(d, _)| distance < d) {
                best = Some((distance, f));
            }
        }
        best.map(|(_, f)| f)
    }
}

fn distance_to_border(point: DVec2, loops: &[Vec<DVec2>]) -> f64 {
    let mut nearest = f64::INFINITY;
    for corners in loops {
        for (i, &a) in corners.iter().enumerate() {
            let along = corners[(i + 1) % corners.len()] - a;
            let t = ((point - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            nearest = nearest.min(point.distance(a + t * along));
        }
    }
    nearest
}
