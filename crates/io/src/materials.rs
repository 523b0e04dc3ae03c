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

/// In place of a reflectance of 1 or more, which files have for the whitest of white, and
/// with which light in a closed room has no end.
pub(crate) const MOST: f64 = 0.999;

/// Takes reflectances of 1 or more down to [`MOST`]; says of which materials. Programs that
/// show pictures have no reason to forbid them.
pub(crate) fn below_one(materials: &mut [MaterialInput], notes: &mut Vec<String>) {
    const SHOWN: usize = 8;
    let mut names = Vec::new();
    for material in materials {
        let too_much = |r: &&mut f64| r.is_finite() && **r >= 1.0;
        let mut is_changed = false;
        for r in material.reflectance.iter_mut().filter(too_much) {
            *r = MOST;
            is_changed = true;
        }
        if is_changed {
            names.push(format!("'{}'", material.name));
        }
    }
    if names.is_empty() {
        return;
    }
    let more = match names.len().saturating_sub(SHOWN) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    names.truncate(SHOWN);
    notes.push(format!(
        "a reflectance of 1 or more is taken as {MOST}, for nothing reflects all light: in {}{more}",
        names.join(", ")
    ));
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
