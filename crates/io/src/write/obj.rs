//! OBJ: positions with false colours, one object per surface.
//!
//! A triangle of degree p becomes p² triangles between its nodes, a quadrilateral 2 p². The colour
//! behind each position (`v x y z r g b`, as most viewers read it) shows the
//! scene's last field; the header says on which scale.

use std::io::{Result, Write};

use super::{check, field_names, labels, lattice, one_line};
use crate::model::MeshedScene;
use crate::picture::{Band, ColorMap, Scale, band_values};

/// Colour of a node without a value.
const GREY: [f64; 3] = [0.5; 3];

/// Writes the scene as OBJ.
///
/// # Errors
///
/// `InvalidData` if the mesh does not fit together; otherwise what `out` reports.
pub fn write(scene: &MeshedScene, out: &mut impl Write) -> Result<()> {
    check(scene)?;
    let field = field_names(scene).last().copied().unwrap_or_default();
    let scale = Scale::of_field(scene, field, Band::Luminance);

    writeln!(out, "# antumbra mesh")?;
    writeln!(out, "# {}", one_line(&scene.provenance))?;
    writeln!(out, "# length unit: {}", one_line(&scene.length_unit))?;
    if field.is_empty() {
        writeln!(out, "# v x y z r g b: no field, all grey")?;
    } else {
        let (name, unit) = (one_line(field), one_line(&scene.unit));
        let (min, max) = (scale.min, scale.max);
        let mean = if scene.n_bands > 1 {
            ", mean of bands"
        } else {
            ""
        };
        writeln!(
            out,
            "# v x y z r g b: {name}{mean}, viridis from {min:?} to {max:?} {unit}"
        )?;
    }

    let mut first_index = 1;
    for (surface, label) in scene.surfaces.iter().zip(labels(scene)) {
        writeln!(out, "o {}", one_line(&label))?;
        let values = band_values(scene, surface, field, Band::Luminance);
        for (i, p) in surface.nodes.iter().enumerate() {
            let value = values.get(i).copied().filter(|v| v.is_finite());
            let [r, g, b] = value.map_or(GREY, |v| ColorMap::Viridis.rgb(scale.fraction(v)));
            writeln!(out, "v {:?} {:?} {:?} {r:.4} {g:.4} {b:.4}", p.x, p.y, p.z)?;
        }
        let triangles = [
            lattice::sub_triangles(surface.degree),
            lattice::quad_sub_triangles(surface.degree),
        ];
        for (element, is_quad) in surface.each_element() {
            for triangle in &triangles[usize::from(is_quad)] {
                let [a, b, c] = triangle.map(|k| first_index + element[k] as usize);
                writeln!(out, "f {a} {b} {c}")?;
            }
        }
        first_index += surface.nodes.len();
    }
    Ok(())
}
