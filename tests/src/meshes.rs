//! What tests ask of finished meshes.

use antumbra::values::{self, Place};
use antumbra::{Control, Elements, Evaluator, ExactLight, Order, Outcome, ReceiverMesh, TriMesh};

/// The triangulation of a mesh along curves.
///
/// # Panics
///
/// If it is one of cells.
#[must_use]
pub fn triangles(mesh: &ReceiverMesh) -> &TriMesh {
    mesh.triangles().expect("a mesh along curves has triangles")
}

/// The order of every curve of a mesh along curves, by curve id.
///
/// # Panics
///
/// If it is one of cells.
#[must_use]
pub fn orders_of(mesh: &ReceiverMesh) -> &[Order] {
    match &mesh.elements {
        Elements::Triangles(triangles) => &triangles.orders,
        Elements::Cells(_) => panic!("cells have no curves"),
    }
}

/// Irradiance with interreflection at places, per band, gathered from what was solved.
///
/// # Panics
///
/// If it was not solved.
#[must_use]
pub fn gathered(
    light: &ExactLight<'_, '_>,
    evaluator: &Evaluator<'_>,
    outcome: &Outcome,
    places: &[Place],
) -> Vec<Vec<f64>> {
    let radiosity = outcome.radiosity.as_ref().expect("it was solved");
    values::solved(light, evaluator, radiosity, places, &Control::NEVER)
        .into_iter()
        .map(|bands| bands.expect("nothing stops it"))
        .collect()
}
