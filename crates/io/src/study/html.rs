//! A study as one page that needs nothing else: no network, no other file.

use super::{ErrorMap, Horizontal, Study, Vertical, figure, table};
use crate::picture::{ColorMap, Picture, write_png};
use crate::write::xml;
use antumbra_geom::dvec2;
use base64::Engine as _;
use std::fmt::Write as _;
use std::io::{Error, Result, Write};

/// Errors of the maps' colours: the first and the last.
const MAP_RANGE: [f64; 2] = [1e-6, 1e-1];

/// Writes the page. Its plots are drawn without scripts; with them, axes can be chosen
/// and series hidden.
///
/// # Errors
///
/// What `out` reports.
pub fn write_html(study: &Study, out: &mut impl Write) -> Result<()> {
    let mut page = String::new();
    head(study, &mut page);
    plots(study, &mut page)?;
    runs(study, &mut page);
    orders(study, &mut page);
    estimators(study, &mut page);
    steps(study, &mut page);
    shapes(study, &mut page);
    maps(study, &mut page)?;
    foot(study, &mut page);
    out.write_all(page.as_bytes())
}

fn head(study: &Study, page: &mut String) {
    let _ = write!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <link rel=\"icon\" href=\"data:,\">\n\
         <title>{title}: what accuracy costs</title>\n<style>{STYLE}</style></head><body><main>\n\
         <h1>{title}: what accuracy costs</h1>\n<p class=\"advice\">{advice}</p>\n\
         <p>Error of the {quantity}, relative to the peak of {peak:.6} {unit}, at {n} points that no \
         mesh used, {penumbra} of them where some of the light is hidden. \
         The values there are off by at most {uncertainty:.0e}. \
         Seconds are those from the scene to the finished mesh, the median of the repeats. \
         One evaluation takes {micro:.2} µs: whoever asks for fewer points than a mesh \
         evaluates needs no mesh.</p>\n",
        title = xml(&study.title),
        advice = marked(&study.advice),
        quantity = xml(&study.quantity),
        peak = study.peak,
        unit = xml(&study.unit),
        n = study.n_points,
        penumbra = study.n_penumbra,
        uncertainty = study.reference_uncertainty,
        micro = 1e6 * study.exact_seconds,
    );
}

/// Words in backticks as code.
fn marked(text: &str) -> String {
    let parts = text.split('`').enumerate().map(|(i, part)| match i % 2 {
        1 => format!("<code>{}</code>", xml(part)),
        _ => xml(part),
    });
    parts.collect()
}

fn plots(study: &Study, page: &mut String) -> Result<()> {
    page.push_str(
        "<section><h2>Error against cost</h2>\n\
         <div class=\"controls\" id=\"controls\" hidden>\
         <label>across <select id=\"across\"><option value=\"seconds\">seconds</option>\
         <option value=\"elements\">elements</option>\
         <option value=\"evaluations\">exact evaluations</option>\
         <option value=\"memory\">memory</option></select></label>\
         <label>up <select id=\"up\"><option value=\"rms\">rms error</option>\
         <option value=\"max\">largest error</option>\
         <option value=\"penumbra_rms\">rms error in penumbras</option>\
         <option value=\"penumbra_max\">largest error in penumbras</option></select></label>\
         <span id=\"series\"></span></div>\n<div id=\"plot\">",
    );
    page.push_str(&figure::svg(
        study,
        Horizontal::Seconds,
        Vertical::Rms,
        dvec2(1000.0, 640.0),
    ));
    page.push_str("</div>\n<div class=\"pair\" id=\"still\">");
    for (x, y) in [
        (Horizontal::Elements, Vertical::Rms),
        (Horizontal::Evaluations, Vertical::Max),
    ] {
        let _ = write!(
            page,
            "<div>{}</div>",
            figure::svg(study, x, y, dvec2(800.0, 600.0))
        );
    }
    page.push_str(
        "</div>\n<p>Dots grow with the degree. A ring marks the Pareto front: no other run is both \
         faster and more accurate.</p></section>\n",
    );
    let mut data = Vec::new();
    table::write_json(study, &mut data)?;
    let data = String::from_utf8(data).map_err(Error::other)?;
    // Nothing in it may look like a tag or a comment.
    let data = data.replace('<', "\\u003c");
    let colors: Vec<String> = study
        .series
        .iter()
        .map(|s| format!("\"#{:06x}\"", super::color_of(&s.mesher)))
        .collect();
    let _ = write!(
        page,
        "<script type=\"application/json\" id=\"data\">{data}</script>\n\
         <script>const colors = [{}];\n{SCRIPT}</script>\n",
        colors.join(",")
    );
    Ok(())
}

fn runs(study: &Study, page: &mut String) {
    page.push_str(
        "<section><h2>All runs</h2><div class=\"wide\"><table><thead><tr><th>mesher</th>\
         <th>degree</th><th>asked for</th><th>elements</th><th>nodes</th><th>evaluations</th>\
         <th>seconds</th><th>from … to</th><th>memory</th><th>rms</th><th>largest</th>\
         <th>penumbra rms</th><th>penumbra largest</th><th>says of itself</th></tr></thead><tbody>\n",
    );
    for series in &study.series {
        for run in &series.runs {
            let memory = match run.memory_bytes {
                0 => "–".to_owned(),
                bytes => format!("{:.1} MB", bytes as f64 / 1e6),
            };
            let _ = writeln!(
                page,
                "<tr{}><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.4}</td>\
                 <td>{:.4} … {:.4} ({})</td><td>{memory}</td><td>{:.2e}</td><td>{:.2e}</td>\
                 <td>{:.2e}</td><td>{:.2e}</td><td>{:.2e}</td></tr>",
                if run.on_front { " class=\"front\"" } else { "" },
                xml(&series.mesher),
                series.degree,
                xml(&run.setting),
                run.elements,
                run.nodes,
                run.exact_evaluations,
                run.seconds.median,
                run.seconds.min,
                run.seconds.max,
                run.seconds.n,
                run.error.rms,
                run.error.max,
                run.error.penumbra_rms,
                run.error.penumbra_max,
                run.claimed_error,
            );
        }
    }
    page.push_str("</tbody></table></div></section>\n");
}

fn orders(study: &Study, page: &mut String) {
    page.push_str(
        "<section><h2>Observed orders</h2><p>The error falls with this power of the mean size of \
         elements, over the finer half of the runs.</p><div class=\"wide\"><table><thead><tr>\
         <th>mesher</th><th>degree</th><th>rms</th><th>largest</th><th>the ladder ended</th></tr>\
         </thead><tbody>\n",
    );
    let order = |o: Option<f64>| o.map_or_else(|| "–".to_owned(), |o| format!("{o:.2}"));
    for series in &study.series {
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            xml(&series.mesher),
            series.degree,
            order(series.order_rms),
            order(series.order_max),
            xml(&series.ended)
        );
    }
    page.push_str("</tbody></table></div></section>\n");
}

fn estimators(study: &Study, page: &mut String) {
    if study.estimators.is_empty() {
        return;
    }
    page.push_str(
        "<section><h2>Error estimators</h2><p>Estimate over true error: of the whole mesh (largest \
         errors), and of its elements (median, and the middle four fifths). 1 is perfect, less \
         than 1 promises too much. “Too small” is the share of the elements that err by more than \
         the estimate; the correlation is that of ranks.</p><div class=\"wide\"><table><thead><tr><th>mesh</th>\
         <th>estimator</th><th>elements</th><th>whole mesh</th><th>median</th><th>10 % … 90 %</th>\
         <th>too small</th><th>correlation</th><th>evaluations on top</th></tr></thead><tbody>\n",
    );
    for e in &study.estimators {
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.2}</td><td>{:.2}</td><td>{:.2} … {:.2}</td>\
             <td>{:.0} %</td><td>{:.2}</td><td>{}</td></tr>",
            xml(&e.mesh),
            xml(&e.estimator),
            e.elements,
            e.of_max,
            e.median,
            e.low,
            e.high,
            100.0 * e.below,
            e.correlation,
            e.evaluations
        );
    }
    page.push_str("</tbody></table></div></section>\n");
}

fn steps(study: &Study, page: &mut String) {
    if study.steps.is_empty() {
        return;
    }
    page.push_str(
        "<section><h2>Steps after meshing</h2><div class=\"wide\"><table><thead><tr><th>mesh</th><th>step</th>\
         <th>rms before</th><th>after</th><th>largest before</th><th>after</th><th>elements</th>\
         <th>evaluations</th><th></th></tr></thead><tbody>\n",
    );
    for s in &study.steps {
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td>{}</td><td>{:.2e}</td><td>{:.2e}</td><td>{:.2e}</td><td>{:.2e}</td>\
             <td>{} → {}</td><td>{} → {}</td><td>{}</td></tr>",
            xml(&s.mesh),
            xml(&s.step),
            s.before.rms,
            s.after.rms,
            s.before.max,
            s.after.max,
            s.elements[0],
            s.elements[1],
            s.evaluations[0],
            s.evaluations[1],
            xml(s.reason.as_deref().unwrap_or_default())
        );
    }
    page.push_str("</tbody></table></div></section>\n");
}

/// Shapes of the elements of the finest run of every series, as bars.
fn shapes(study: &Study, page: &mut String) {
    page.push_str(
        "<section><h2>Shapes of the elements</h2><p>Of the finest run: inscribed over circumscribed \
         radius, 1 for an equilateral triangle or a square; bars from 0 to 1.</p><div class=\"wide\">\
         <table><thead><tr><th>mesher</th><th>degree</th><th>elements</th><th>per area</th>\
         <th>smallest</th><th>median</th><th>smallest angle</th><th>T-vertices</th><th>histogram</th>\
         </tr></thead><tbody>\n",
    );
    for series in &study.series {
        let Some(run) = series.runs.last() else {
            continue;
        };
        let q = &run.quality;
        let most = q.histogram.iter().copied().max().unwrap_or(0).max(1) as f64;
        let mut bars = String::from("<svg viewBox=\"0 0 100 24\" width=\"150\" height=\"36\">");
        for (k, &n) in q.histogram.iter().enumerate() {
            let height = 22.0 * n as f64 / most;
            let _ = write!(
                bars,
                "<rect x=\"{}\" y=\"{:.1}\" width=\"9\" height=\"{height:.1}\" fill=\"#{:06x}\"><title>{n}</title></rect>",
                10 * k,
                23.0 - height,
                super::color_of(&series.mesher),
            );
        }
        bars.push_str("</svg>");
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.2}</td><td>{:.3}</td><td>{:.3}</td>\
             <td>{:.2}°</td><td>{}</td><td>{bars}</td></tr>",
            xml(&series.mesher),
            series.degree,
            run.elements,
            q.density,
            q.min,
            q.median,
            q.smallest_angle,
            q.t_vertices
        );
    }
    page.push_str("</tbody></table></div></section>\n");
}

fn maps(study: &Study, page: &mut String) -> Result<()> {
    if study.maps.is_empty() {
        return Ok(());
    }
    let _ = writeln!(
        page,
        "<section><h2>Where the error is</h2><p>From {:.0e} of the peak (dark) to {:.0e} (light), \
         on a logarithmic scale. <label class=\"toggle\"><input type=\"checkbox\" id=\"edges\" checked> \
         draw the elements</label></p><div class=\"scale\"></div>",
        MAP_RANGE[0], MAP_RANGE[1]
    );
    for group in &study.maps {
        let _ = write!(
            page,
            "<h3>{} on ‘{}’</h3><div class=\"maps\">",
            xml(&group.caption),
            xml(&group.surface)
        );
        for map in &group.maps {
            let mut png = Vec::new();
            write_png(&picture(map), &mut png)?;
            let _ = write!(
                page,
                "<figure><div class=\"map\" style=\"aspect-ratio:{w}/{h}\">\
                 <img alt=\"map of the error of {label}\" src=\"data:image/png;base64,{}\">\
                 <svg viewBox=\"0 0 {w} {h}\" class=\"edges\"><path d=\"{}\"/></svg></div>\
                 <figcaption><b>{label}</b><br>{} elements, {:.4} s<br>rms {:.2e}</figcaption></figure>",
                base64::engine::general_purpose::STANDARD.encode(&png),
                path(map),
                map.elements,
                map.seconds,
                map.rms,
                w = map.width,
                h = map.height,
                label = xml(&map.label),
            );
        }
        page.push_str("</div>\n");
    }
    page.push_str("</section>\n");
    Ok(())
}

fn path(map: &ErrorMap) -> String {
    let mut path = String::new();
    for [a, b] in &map.edges {
        let _ = write!(path, "M{:.1} {:.1}L{:.1} {:.1}", a[0], a[1], b[0], b[1]);
    }
    path
}

/// The error in colours; white outside of the surface.
fn picture(map: &ErrorMap) -> Picture {
    let [low, high] = MAP_RANGE.map(f64::log10);
    let rgb = map
        .errors
        .iter()
        .flat_map(|&e| {
            let color = if e.is_nan() {
                [1.0; 3]
            } else {
                let e = f64::from(e).max(1e-300).log10();
                ColorMap::Inferno.rgb((e - low) / (high - low))
            };
            color.map(|c| (255.0 * c).round() as u8)
        })
        .collect();
    Picture {
        width: map.width,
        height: map.height,
        rgb,
    }
}

fn foot(study: &Study, page: &mut String) {
    page.push_str("<section><h2>How it was measured</h2><ul>\n");
    for note in &study.notes {
        let _ = writeln!(page, "<li>{}</li>", xml(note));
    }
    let _ = write!(
        page,
        "</ul><p>Machine: {}.</p><p>Command: <code>{}</code></p><p>antumbra {}</p></section>\n\
         </main></body></html>\n",
        xml(&study.machine),
        xml(&study.command),
        xml(&study.version)
    );
}

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
