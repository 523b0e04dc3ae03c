//! What the readers of other programs' formats have in common about materials.

use antumbra_scene::MaterialInput;

/// Reflectance of faces without a material.
pub(crate) const DEFAULT_REFLECTANCE: f64 = 0.5;

/// The material of faces without one.
pub(crate) fn default(name: String) -> MaterialInput {
    MaterialInput {
        name,
        reflectance: vec![DEFAULT_REFLECTANCE],
        exitance: vec![0.0],
        two_sided: false,
    }
}

/// One band for a grey file.
pub(crate) fn in_as_few_bands(materials: &mut [MaterialInput]) {
    let is_grey = |values: &[f64]| values.iter().all(|v| v.to_bits() == values[0].to_bits());
    if materials
        .iter()
        .all(|m| is_grey(&m.reflectance) && is_grey(&m.exitance))
    {
        for material in materials {
            material.reflectance.truncate(1);
            material.exitance.truncate(1);
        }
    }
}
