//! A study as a table and as a document.

use super::{Spread, Study};
use crate::write::csv::quoted;
use std::io::{Result, Write};

/// Version of the document.
const VERSION: u32 = 1;

/// Writes one line a run: comma-separated, with a header.
///
/// # Errors
///
/// What `out` reports.
pub fn write_csv(study: &Study, out: &mut impl Write) -> Result<()> {
    writeln!(
        out,
        "mesher,degree,setting,elements,nodes,exact_evaluations,seconds,seconds_min,seconds_max,repeats,memory_bytes,error_max,error_rms,penumbra_max,penumbra_rms,claimed_error,on_front,quality_min,quality_median,smallest_angle,t_vertices,elements_per_area"
    )?;
    for series in &study.series {
        for run in &series.runs {
            let Spread {
                median,
                min,
                max,
                n,
            } = run.seconds;
            let (error, quality) = (&run.error, &run.quality);
            writeln!(
                out,
                "{},{},{},{},{},{},{median},{min},{max},{n},{},{:e},{:e},{:e},{:e},{:e},{},{},{},{},{},{}",
                series.mesher,
                series.degree,
                quoted(&run.setting),
                run.elements,
                run.nodes,
                run.exact_evaluations,
                run.memory_bytes,
                error.max,
                error.rms,
                error.penumbra_max,
                error.penumbra_rms,
                run.claimed_error,
                run.on_front,
                quality.min,
                quality.median,
                quality.smallest_angle,
                quality.t_vertices,
                quality.density,
            )?;
        }
    }
    Ok(())
}

/// Writes everything but the pixels of the maps as JSON.
///
/// # Errors
///
/// What `out` reports.
pub fn write_json(study: &Study, out: &mut impl Write) -> Result<()> {
    #[derive(serde::Serialize)]
    struct Document<'a> {
        antumbra_study: u32,
        #[serde(flatten)]
        study: &'a Study,
    }
    serde_json::to_writer_pretty(
        &mut *out,
        &Document {
            antumbra_study: VERSION,
            study,
        },
    )?;
    writeln!(out)
}
