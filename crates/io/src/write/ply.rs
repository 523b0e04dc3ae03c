//! PLY: binary, little endian, doubles.
//!
//! Vertices have `x y z` and one property per field and band; faces are the
//! linear triangles between an element's nodes, with the surface they are on.

use std::io::{Error, ErrorKind, Result, Write};

use super::lattice::{quad_sub_triangles, sub_triangles};
use super::{check, field_names, fields_in_order, labels, value_names};
use crate::model::MeshedScene;

/// Writes the scene as PLY.
///
/// A field that a surface does not have is written as 0 there, and the header
/// says so.
///
/// # Errors
///
/// `InvalidData` if the mesh does not fit together or has more nodes than a
/// 32-bit index can name; otherwise what `out` reports.
pub fn write(scene: &MeshedScene, out: &mut impl Write) -> Result<()> {
    check(scene)?;
    write_header(scene, out)?;

    let names = field_names(scene);
    for surface in &scene.surfaces {
        let fields = fields_in_order(surface, &names);
        for (i, p) in surface.nodes.iter().enumerate() {
            for x in p.to_array() {
                out.write_all(&x.to_le_bytes())?;
            }
            for field in &fields {
                for band in 0..scene.n_bands {
                    let value = field.map_or(0.0, |f| f.values[i * scene.n_bands + band]);
                    out.write_all(&value.to_le_bytes())?;
                }
            }
        }
    }

    let mut first_index = 0;
    for (surface_id, surface) in scene.surfaces.iter().enumerate() {
        let triangles = [
            sub_triangles(surface.degree),
            quad_sub_triangles(surface.degree),
        ];
        for (element, is_quad) in surface.each_element() {
            for triangle in &triangles[usize::from(is_quad)] {
                out.write_all(&[3])?;
                for &k in triangle {
                    let index = int(first_index + element[k] as usize)?;
                    out.write_all(&index.to_le_bytes())?;
                }
                out.write_all(&int(surface_id)?.to_le_bytes())?;
            }
        }
        first_index += surface.nodes.len();
    }
    Ok(())
}

fn write_header(scene: &MeshedScene, out: &mut impl Write) -> Result<()> {
    let n_nodes: usize = scene.surfaces.iter().map(|s| s.nodes.len()).sum();
    let n_faces: usize = (scene.surfaces.iter())
        .flat_map(|s| s.each_element().map(move |e| (e.1, usize::from(s.degree))))
        .map(|(is_quad, degree)| degree * degree * if is_quad { 2 } else { 1 })
        .sum();
    int(n_nodes)?;

    writeln!(out, "ply\nformat binary_little_endian 1.0")?;
    writeln!(out, "comment antumbra mesh")?;
    writeln!(out, "comment {}", ascii(&scene.provenance))?;
    writeln!(out, "comment length_unit {}", ascii(&scene.length_unit))?;
    writeln!(out, "comment unit {}", ascii(&scene.unit))?;
    for (i, label) in labels(scene).iter().enumerate() {
        writeln!(out, "comment surface {i} {}", ascii(label))?;
    }
    for name in field_names(scene) {
        for (i, surface) in scene.surfaces.iter().enumerate() {
            if surface.field(name).is_none() {
                writeln!(
                    out,
                    "comment surface {i} has no {}: written as 0",
                    ascii(name)
                )?;
            }
        }
    }
    writeln!(out, "element vertex {n_nodes}")?;
    for axis in ["x", "y", "z"] {
        writeln!(out, "property double {axis}")?;
    }
    for name in value_names(scene) {
        writeln!(out, "property double {}", ascii(&name).replace(' ', "_"))?;
    }
    writeln!(out, "element face {n_faces}")?;
    writeln!(out, "property list uchar int vertex_indices")?;
    writeln!(out, "property int surface")?;
    writeln!(out, "end_header")
}

fn int(index: usize) -> Result<i32> {
    let too_many = |_| {
        Error::new(
            ErrorKind::InvalidData,
            "too many nodes for PLY's 32-bit indices",
        )
    };
    i32::try_from(index).map_err(too_many)
}

/// Readers take the header for ASCII.
fn ascii(text: &str) -> String {
    let mut ascii = String::new();
    for c in text.chars() {
        match c {
            ' '..='~' => ascii.push(c),
            '²' => ascii += "^2",
            '³' => ascii += "^3",
            _ if c.is_control() => ascii.push(' '),
            _ => ascii.push('?'),
        }
    }
    ascii
}
