//! Materials: bands, ranges, and who uses what.

use super::{Findings, listed};
use crate::input::{MaterialInput, SceneInput};
use crate::problem::{Problem, Severity};
use crate::scene::{Material, MaterialId};
use std::collections::BTreeMap;

/// All materials with their bands broadcast, and the number of bands. Materials
/// with an error are reported and keep their values.
pub(super) fn check(input: &SceneInput, findings: &mut Findings) -> (Vec<Material>, usize) {
    let n_bands = check_bands(input, findings);
    let mut users: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for surface in &input.surfaces {
        users
            .entry(&surface.material)
            .or_default()
            .push(surface.name.clone());
    }
    let materials = input
        .materials
        .iter()
        .map(|material| {
            let users = users
                .get(material.name.as_str())
                .map_or(&[][..], Vec::as_slice);
            check_values(material, users, findings);
            let broadcast = |values: &[f64]| match values {
                [one] => vec![*one; n_bands],
                _ => (0..n_bands)
                    .map(|b| values.get(b).copied().unwrap_or(0.0))
                    .collect(),
            };
            Material {
                name: material.name.clone(),
                reflectance: broadcast(&material.reflectance),
                exitance: broadcast(&material.exitance),
                two_sided: material.two_sided,
            }
        })
        .collect();
    (materials, n_bands)
}

/// The material of each surface, the first of that name.
pub(super) fn ids(input: &SceneInput) -> Vec<Option<MaterialId>> {
    let mut by_name: BTreeMap<&str, MaterialId> = BTreeMap::new();
    for (m, material) in input.materials.iter().enumerate() {
        by_name
            .entry(&material.name)
            .or_insert(MaterialId(m as u32));
    }
    input
        .surfaces
        .iter()
        .map(|s| by_name.get(s.material.as_str()).copied())
        .collect()
}

/// Every array has one value or the same number of values.
fn check_bands(input: &SceneInput, findings: &mut Findings) -> usize {
    let mut by_length: BTreeMap<usize, Vec<String>> = BTreeMap::new();
    for material in &input.materials {
        for values in [&material.reflectance, &material.exitance] {
            if values.is_empty() {
                findings.error(
                    Findings::MATERIAL,
                    "bands",
                    vec![material.name.clone()],
                    format!(
                        "material '{}': an array of bands is empty (at least 1 value is needed)",
                        material.name
                    ),
                );
            } else if values.len() > 1 {
                let names = by_length.entry(values.len()).or_default();
                if names.last() != Some(&material.name) {
                    names.push(material.name.clone());
                }
            }
        }
    }
    if by_length.len() > 1 {
        let parts: Vec<String> = by_length
            .iter()
            .map(|(n, names)| format!("{n} bands in {}", listed(names)))
            .collect();
        findings.error(
            Findings::MATERIAL,
            "bands",
            by_length.values().flatten().cloned().collect(),
            format!(
                "materials disagree: {} (allowed one number of bands)",
                parts.join(", ")
            ),
        );
    }
    by_length.last_key_value().map_or(1, |(n, _)| *n)
}

fn check_values(material: &MaterialInput, users: &[String], findings: &mut Findings) {
    let mut report = |what: &str, value: f64, allowed: f64, range: &str, advice: &str| {
        let used = if users.is_empty() {
            "not used".to_owned()
        } else {
            format!("used by {}", listed(users))
        };
        let mut names = vec![material.name.clone()];
        names.extend_from_slice(users);
        findings.push(
            Findings::MATERIAL,
            Problem {
                severity: Severity::Error,
                kind: "material",
                names,
                found: Some(value),
                allowed: Some(allowed),
                message: format!(
                    "material '{}' ({used}): {what} {} (allowed {range}){advice}",
                    material.name, value
                ),
            },
        );
    };
    if let Some(&bad) = material
        .reflectance
        .iter()
        .find(|r| !(0.0..1.0).contains(*r))
    {
        let advice = if bad >= 1.0 {
            ": nothing would absorb the light; lower it, to 0.9 for a very white paint"
        } else {
            ""
        };
        report("reflectance", bad, 1.0, "0 to 1, without 1", advice);
    }
    if let Some(&bad) = material
        .exitance
        .iter()
        .find(|m| !(m.is_finite() && **m >= 0.0))
    {
        report("exitance", bad, 0.0, "0 or more, finite", "");
    }
}
