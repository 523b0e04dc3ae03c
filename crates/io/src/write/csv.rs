//! CSV: one row per node.
//!
//! Columns: `surface,part,x,y,z` and the fields, one column per band. The back
//! of a two-sided surface is named `NAME.back`. A missing value is empty.

use std::io::{Result, Write};

use super::{check, field_names, fields_in_order, value_names};
use crate::model::MeshedScene;

/// Writes the scene's nodes as CSV.
///
/// # Errors
///
/// `InvalidData` if the mesh does not fit together; otherwise what `out` reports.
pub fn write(scene: &MeshedScene, out: &mut impl Write) -> Result<()> {
    check(scene)?;
    write!(out, "surface,part,x,y,z")?;
    for name in value_names(scene) {
        write!(out, ",{}", quoted(&name))?;
    }
    writeln!(out)?;

    let names = field_names(scene);
    for surface in &scene.surfaces {
        let side = if surface.is_back { ".back" } else { "" };
        let name = quoted(&format!("{}{side}", surface.name));
        let fields = fields_in_order(surface, &names);
        for (i, p) in surface.nodes.iter().enumerate() {
            write!(out, "{name},{},{:?},{:?},{:?}", surface.part, p.x, p.y, p.z)?;
            for field in &fields {
                for band in 0..scene.n_bands {
                    match field.map(|f| f.values[i * scene.n_bands + band]) {
                        Some(value) if value.is_finite() => write!(out, ",{value:?}")?,
                        _ => write!(out, ",")?,
                    }
                }
            }
            writeln!(out)?;
        }
    }
    Ok(())
}

/// A field of a CSV file, in quotes if it needs them.
pub(crate) fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
