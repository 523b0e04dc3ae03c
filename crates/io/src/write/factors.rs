//! Matrices of form factors: CSV, JSON, and the text of View3D.

use crate::model::FactorTable;
use crate::write::csv::quoted;
use serde::Serialize;
use std::io::{Error, ErrorKind, Result, Write};

/// Writes CSV: `surface,area,row_sum` and the names, then a row for every surface:
/// its factors to all.
///
/// Row sums are those of the factors as they stand in the row. Factors that are missing
/// are empty, and so is the sum of their row.
///
/// # Errors
///
/// `InvalidData` if the table does not fit together; otherwise what `out` reports.
pub fn write_csv(table: &FactorTable, out: &mut impl Write) -> Result<()> {
    check(table)?;
    write!(out, "surface,area,row_sum")?;
    for name in &table.names {
        write!(out, ",{}", quoted(name))?;
    }
    writeln!(out)?;
    let word = |value: Option<f64>| value.map_or(String::new(), digits);
    let sums = table.row_sums();
    for (i, row) in table.known_rows().enumerate() {
        write!(
            out,
            "{},{},{}",
            quoted(&table.names[i]),
            digits(table.areas[i]),
            word(sums[i])
        )?;
        for value in row {
            write!(out, ",{}", word(value))?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Seventeen significant digits; zeros are `0`.
fn digits(x: f64) -> String {
    if x == 0.0 {
        "0".to_owned()
    } else {
        format!("{x:.16e}")
    }
}

/// Version of the layout, the value of `antumbra_factors`.
pub const VERSION: u32 = 1;

#[derive(Serialize)]
struct Document<'a> {
    antumbra_factors: u32,
    provenance: &'a str,
    length_unit: &'a str,
    repaired: bool,
    surfaces: &'a [String],
    areas: &'a [f64],
    row_sums: Vec<Option<f64>>,
    factors: Vec<Vec<Option<f64>>>,
    errors: Vec<Vec<Option<f64>>>,
}

/// Writes JSON: the factors from surface `i` to all are `factors[i]`, `null` where they
/// are missing.
///
/// # Errors
///
/// `InvalidData` if the table does not fit together; otherwise what `out` reports.
pub fn write_json(table: &FactorTable, out: &mut impl Write) -> Result<()> {
    check(table)?;
    let document = Document {
        antumbra_factors: VERSION,
        provenance: &table.provenance,
        length_unit: &table.length_unit,
        repaired: table.is_repaired,
        surfaces: &table.names,
        areas: &table.areas,
        row_sums: table.row_sums(),
        factors: table.known_rows().collect(),
        errors: table.known_errors().collect(),
    };
    serde_json::to_writer(&mut *out, &document)?;
    writeln!(out)
}

/// Writes the text that View3D writes (version 3.3, format 0): a header, the areas,
/// the factors row by row, the emissivities. It has no names: surfaces are in the
/// order of the scene.
///
/// # Errors
///
/// `InvalidData` if the table does not fit together, or if factors are missing, for which
/// the format has no word; otherwise what `out` reports.
pub fn write_view3d(table: &FactorTable, out: &mut impl Write) -> Result<()> {
    check(table)?;
    let missing = table.n_missing();
    if missing > 0 {
        let message = format!(
            "{missing} form factors were not computed, and the text of View3D has no word for that"
        );
        return Err(Error::new(ErrorKind::InvalidData, message));
    }
    let n = table.names.len();
    writeln!(out, "View3D 3.3 0 {} 1 {n}", u8::from(table.is_closed))?;
    let line = |values: &[f64]| {
        let words: Vec<String> = values.iter().map(|&x| digits(x)).collect();
        words.join(" ")
    };
    writeln!(out, "{}", line(&table.areas))?;
    for row in table.rows() {
        writeln!(out, "{}", line(row))?;
    }
    writeln!(out, "{}", line(&table.emissivities))
}

fn check(table: &FactorTable) -> Result<()> {
    let n = table.names.len();
    let fits = table.areas.len() == n
        && table.emissivities.len() == n
        && table.values.len() == n * n
        && table.errors.len() == n * n
        && (table.missing.is_empty() || table.missing.len() == n * n);
    if !fits {
        let message = format!("a matrix of form factors of {n} surfaces does not fit together");
        return Err(Error::new(ErrorKind::InvalidData, message));
    }
    let bad = (0..n * n).find(|&k| !table.values[k].is_finite() || !table.errors[k].is_finite());
    match bad {
        None => Ok(()),
        Some(k) => Err(Error::new(
            ErrorKind::InvalidData,
            format!(
                "the form factor from '{}' to '{}' is not a number",
                table.names[k / n],
                table.names[k % n]
            ),
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> FactorTable {
        FactorTable {
            length_unit: "m".into(),
            names: vec!["a".into(), "b, \"left\"".into()],
            areas: vec![1.0, 2.0],
            emissivities: vec![0.9, 1.0],
            values: vec![0.0, 0.2, 0.1, 0.0],
            errors: vec![0.0, 1e-9, 1e-9, 0.0],
            provenance: "test".into(),
            ..FactorTable::default()
        }
    }

    fn text(write: impl Fn(&FactorTable, &mut Vec<u8>) -> Result<()>) -> String {
        let mut out = Vec::new();
        write(&table(), &mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn csv_has_names_areas_sums_and_all_digits() {
        let lines = text(write_csv);
        let mut lines = lines.lines();
        assert_eq!(
            lines.next(),
            Some(r#"surface,area,row_sum,a,"b, ""left""""#)
        );
        let row: Vec<&str> = lines.next().unwrap().split(',').collect();
        assert_eq!(row.len(), 5);
        assert_eq!(row[4], "2.0000000000000001e-1");
        assert_eq!(row[4].parse(), Ok(0.2));
    }

    #[test]
    fn json_holds_rows() {
        let document: serde_json::Value = serde_json::from_str(&text(write_json)).unwrap();
        assert_eq!(document["factors"][1][0], 0.1);
        assert_eq!(document["surfaces"][0], "a");
    }

    #[test]
    fn view3d_has_a_line_for_each_surface_and_three_more() {
        let text = text(write_view3d);
        assert!(text.starts_with("View3D 3.3 0 0 1 2\n"), "{text}");
        assert_eq!(text.lines().count(), 5);
    }

    #[test]
    fn a_missing_factor_is_no_zero() {
        let mut table = table();
        table.missing = vec![false, true, false, false];
        let mut out = Vec::new();
        write_csv(&table, &mut out).unwrap();
        let csv = String::from_utf8(out).unwrap();
        assert!(csv.contains("\na,1.0000000000000000e0,,0,\n"), "{csv}");
        let mut out = Vec::new();
        write_json(&table, &mut out).unwrap();
        let json: serde_json::Value = serde_json::from_slice(&out).unwrap();
        assert!(json["factors"][0][1].is_null() && json["errors"][0][1].is_null());
        assert!(json["row_sums"][0].is_null() && json["row_sums"][1] == 0.1);
        let mut out = Vec::new();
        let refused = write_view3d(&table, &mut out).unwrap_err();
        assert!(refused.to_string().contains("1 form factors"), "{refused}");
        assert!(out.is_empty());
    }

    #[test]
    fn a_factor_that_is_no_number_is_not_written() {
        let mut table = table();
        table.values[1] = f64::NAN;
        let mut out = Vec::new();
        assert!(write_csv(&table, &mut out).is_err());
        assert!(out.is_empty());
    }
}
