//! The one number of a field that a picture shows.

use crate::model::{MeshedScene, SurfaceMesh};

/// Which number of a field is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Band {
    /// The mean of all bands.
    #[default]
    Luminance,
    /// One band, counted from 0.
    Index(usize),
}

/// The chosen number of the field at every node; empty where there is none.
pub(crate) fn band_values(
    scene: &MeshedScene,
    surface: &SurfaceMesh,
    field: &str,
    band: Band,
) -> Vec<f64> {
    let n_bands = scene.n_bands;
    let Some(field) = surface.field(field).filter(|_| n_bands > 0) else {
        return Vec::new();
    };
    let of_node = |bands: &[f64]| match band {
        Band::Luminance => bands.iter().sum::<f64>() / n_bands as f64,
        Band::Index(b) => bands.get(b).copied().unwrap_or(f64::NAN),
    };
    field.values.chunks_exact(n_bands).map(of_node).collect()
}
