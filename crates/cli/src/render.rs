//! `antumbra render`.

use crate::Ending;
use crate::args::{Render, Work};
use crate::failure::Failure;
use crate::input;
use crate::mesh;
use crate::output::{self, Format};
use crate::progress::Watch;
use crate::say::say;

pub(crate) fn run(render: &Render) -> Result<Ending, Failure> {
    let common = &render.common;
    let options = render.meshing.options()?;
    let formats = output::formats(&render.output, &[Format::Png, Format::Svg])?;
    let loaded = input::load(common)?;
    input::spare(&render.output)?;
    let work = if render.direct {
        Work::Mesh
    } else {
        Work::Solve
    };
    output::check_look(&render.picture, &loaded.scene, work)?;
    let watch = Watch::new(common);
    let outcome = mesh::compute(&loaded, &options, &watch, work)?;
    watch.finish();
    let exported = mesh::export(&loaded, &outcome);
    output::write_all(&render.output, formats, &exported, &render.picture)?;
    if !common.json && !common.quiet {
        for path in &render.output {
            say!("wrote {}", path.display());
        }
    }
    if common.json {
        let written: Vec<String> = render
            .output
            .iter()
            .map(|p| p.display().to_string())
            .collect();
        say!(
            "{:#}",
            serde_json::json!({ "version": env!("CARGO_PKG_VERSION"), "written": written })
        );
    }
    Ok(mesh::ending(&watch, &outcome))
}
