//! `antumbra probe`.

use crate::Ending;
use crate::args::{Probe, Work};
use crate::failure::Failure;
use crate::input;
use crate::mesh;
use crate::progress::Watch;
use crate::say::{self, say};
use antumbra::values::{self, Place};
use antumbra::{Control, Evaluator, ExactLight, Scratch};
use glam::DVec3;
use rayon::prelude::*;

/// A row of the points' file.
struct Row {
    /// As it stands in the file.
    fields: Vec<String>,
    target: Target,
}

impl Row {
    fn place(&self) -> Option<Place> {
        match self.target {
            Target::Surface(place) => Some(place),
            Target::Free { .. } => None,
        }
    }
}

enum Target {
    Surface(Place),
    Free { point: DVec3, normal: DVec3 },
}

pub(crate) fn run(probe: &Probe) -> Result<Ending, Failure> {
    let common = &probe.common;
    let options = probe.meshing.options()?;
    let loaded = input::load(common)?;
    let scene = &loaded.scene;
    let (header, rows) = read_points(probe, scene)?;
    let exact = probe.exact || !(probe.mesh || probe.solve);
    let n_bands = scene.n_bands;
    let mut columns: Vec<(&str, Vec<Option<Vec<f64>>>)> = Vec::new();
    let watch = Watch::new(common);
    // Points without a value, because there was no time for them.
    let mut is_cut_short = false;

    if exact {
        let evaluator = Evaluator::new(scene);
        let light = ExactLight::new(&evaluator, &Control::NEVER);
        let values: Result<Vec<_>, values::PointError> = rows
            .par_iter()
            .map_init(Scratch::default, |scratch, row| match &row.target {
                _ if watch.should_stop() => Ok(None),
                Target::Surface(place) => Ok(Some(values::exact(&light, place, scratch))),
                Target::Free { point, normal } => {
                    values::exact_free(&evaluator, *point, *normal, scratch).map(Some)
                }
            })
            .collect();
        let values = values.map_err(|e| Failure::usage(e.to_string()))?;
        is_cut_short |= values.iter().any(Option::is_none);
        columns.push(("direct_exact", values));
    }
    let mut ending = Ending::Done;
    if probe.mesh || probe.solve {
        let work = if probe.solve { Work::Solve } else { Work::Mesh };
        let outcome = mesh::compute(&loaded, &options, &watch, work)?;
        ending = mesh::ending(&watch, &outcome);
        let on_surface = |f: &dyn Fn(&Place) -> Option<Vec<f64>>| -> Vec<Option<Vec<f64>>> {
            rows.iter()
                .map(|row| match &row.target {
                    Target::Surface(place) => f(place),
                    Target::Free { .. } => None,
                })
                .collect()
        };
        if probe.mesh {
            columns.push((
                "direct_mesh",
                on_surface(&|place| values::on_mesh(&outcome.mesh, place)),
            ));
        }
        if let (true, Some(radiosity)) = (probe.solve, &outcome.radiosity) {
            let places: Vec<Place> = rows.iter().filter_map(Row::place).collect();
            let evaluator = Evaluator::new(scene);
            let light = ExactLight::new(&evaluator, &Control::NEVER);
            let found = watch
                .run(|control| values::solved(&light, &evaluator, radiosity, &places, control));
            is_cut_short |= found.iter().any(Option::is_none);
            let mut found = found.into_iter();
            let values = rows
                .iter()
                .map(|row| row.place().and_then(|_| found.next().flatten()))
                .collect();
            columns.push(("irradiance", values));
        }
    }
    watch.finish();
    if is_cut_short {
        let (stopped, why) = watch.stopped();
        eprintln!("antumbra: stopped by {why}: some points have no value");
        ending = stopped;
    }
    if common.json {
        print_json(&header, &rows, &columns, n_bands);
    } else {
        say::check(print_csv(&header, &rows, &columns, n_bands));
    }
    Ok(ending)
}

fn read_points(probe: &Probe, scene: &antumbra::Scene) -> Result<(Vec<String>, Vec<Row>), Failure> {
    let path = &probe.points;
    let at = |message: String| Failure::unreadable(format!("{}: {message}", path.display()));
    let source: Box<dyn std::io::Read> = if path.as_os_str() == "-" {
        Box::new(std::io::stdin())
    } else {
        Box::new(std::fs::File::open(path).map_err(|e| at(e.to_string()))?)
    };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(source);
    let header: Vec<String> = reader
        .headers()
        .map_err(|e| at(e.to_string()))?
        .iter()
        .map(str::to_owned)
        .collect();
    let with_normals = match header
        .iter()
        .map(String::as_str)
        .collect::<Vec<_>>()
        .as_slice()
    {
        ["surface", "x", "y", "z"] => false,
        ["surface", "x", "y", "z", "nx", "ny", "nz"] => true,
        _ => {
            return Err(at(format!(
                "the header is '{}': surface,x,y,z or surface,x,y,z,nx,ny,nz is needed",
                header.join(",")
            )));
        }
    };
    let mut rows = Vec::new();
    for (k, record) in reader.records().enumerate() {
        let line = k + 2;
        let record = record.map_err(|e| at(e.to_string()))?;
        let number = |i: usize| -> Result<f64, Failure> {
            match record[i].parse::<f64>() {
                Ok(x) if x.is_finite() => Ok(x),
                _ => Err(at(format!(
                    "line {line}: {} '{}' is not a number",
                    header[i], &record[i]
                ))),
            }
        };
        let point = DVec3::new(number(1)?, number(2)?, number(3)?);
        let target = if record[0].is_empty() {
            if !with_normals {
                return Err(at(format!(
                    "line {line}: a free sensor needs columns nx,ny,nz"
                )));
            }
            Target::Free {
                point,
                normal: DVec3::new(number(4)?, number(5)?, number(6)?),
            }
        } else {
            let place = values::place(scene, &record[0], point).map_err(|e| {
                Failure::not_acceptable(format!("{}: line {line}: {e}", path.display()))
            })?;
            Target::Surface(place)
        };
        rows.push(Row {
            fields: record.iter().map(str::to_owned).collect(),
            target,
        });
    }
    Ok((header, rows))
}

fn column_names(columns: &[(&str, Vec<Option<Vec<f64>>>)], n_bands: usize) -> Vec<String> {
    columns
        .iter()
        .flat_map(|(name, _)| {
            (0..n_bands).map(move |b| {
                if n_bands == 1 {
                    (*name).to_owned()
                } else {
                    format!("{name}_{b}")
                }
            })
        })
        .collect()
}

fn print_csv(
    header: &[String],
    rows: &[Row],
    columns: &[(&str, Vec<Option<Vec<f64>>>)],
    n_bands: usize,
) -> std::io::Result<()> {
    let mut out = csv::Writer::from_writer(std::io::stdout().lock());
    let write = |out: &mut csv::Writer<_>, record: Vec<String>| {
        out.write_record(&record)
            .map_err(|error| match error.into_kind() {
                csv::ErrorKind::Io(error) => error,
                other => std::io::Error::other(format!("{other:?}")),
            })
    };
    write(
        &mut out,
        header
            .iter()
            .cloned()
            .chain(column_names(columns, n_bands))
            .collect(),
    )?;
    for (k, row) in rows.iter().enumerate() {
        let mut record = row.fields.clone();
        for (_, values) in columns {
            for band in 0..n_bands {
                // Seventeen significant digits; empty where there is no value.
                record.push(
                    values[k]
                        .as_ref()
                        .map_or(String::new(), |v| format!("{:.16e}", v[band])),
                );
            }
        }
        write(&mut out, record)?;
    }
    out.flush()
}

fn print_json(
    header: &[String],
    rows: &[Row],
    columns: &[(&str, Vec<Option<Vec<f64>>>)],
    n_bands: usize,
) {
    let points: Vec<serde_json::Value> = rows
        .iter()
        .enumerate()
        .map(|(k, row)| {
            let mut object = serde_json::Map::new();
            for (key, field) in header.iter().zip(&row.fields) {
                let value = match field.parse::<f64>() {
                    Ok(x) if key != "surface" => serde_json::json!(x),
                    _ if key != "surface" && field.is_empty() => serde_json::Value::Null,
                    _ => serde_json::json!(field),
                };
                object.insert(key.clone(), value);
            }
            for (name, values) in columns {
                let value = match &values[k] {
                    Some(v) if n_bands == 1 => serde_json::json!(v[0]),
                    Some(v) => serde_json::json!(v),
                    None => serde_json::Value::Null,
                };
                object.insert((*name).to_owned(), value);
            }
            serde_json::Value::Object(object)
        })
        .collect();
    let document = serde_json::json!({ "version": env!("CARGO_PKG_VERSION"), "points": points });
    say!("{document:#}");
}
