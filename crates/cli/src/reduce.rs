//! `antumbra reduce`: every try in a process of its own.

use crate::Ending;
use crate::args::{FailureKind, Reduce, ReduceTry, ValueFailure};
use crate::failure::Failure;
use crate::input::{self, Loaded};
use crate::output;
use crate::progress::{Watch, keep_going, was_interrupted};
use crate::say::say;
use antumbra::geom::Stop;
use antumbra::io::scene_file;
use antumbra::reduce::{Size, reduce};
use antumbra::solver::Tolerance;
use antumbra::values::{self, Place};
use antumbra::visibility::Seen;
use antumbra::{Control, Ended, Evaluator, ExactLight, SceneInput, Scratch, Solution};
use indicatif::ProgressBar;
use serde_json::json;
use std::io::{IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// The exit code of a try that shows the failure: none of the command's own.
pub(crate) const FAILS: u8 = 17;

pub(crate) fn run(args: &Reduce) -> Result<Ending, Failure> {
    let common = &args.common;
    if let Some(out) = &args.output {
        output::formats(std::slice::from_ref(out), &[output::Format::Json])?;
    }
    let input = input::read(common)?;
    input::spare(args.output.as_slice())?;
    keep_going();
    let started = Instant::now();
    let is_spent = || {
        args.budget
            .is_some_and(|most| started.elapsed().as_secs_f64() >= most)
    };
    let tries = Tries::new(args)?;
    let mut trouble = None;
    let mut fails = |scene: &SceneInput| match tries.does_fail(scene) {
        Ok(fails) => fails,
        Err(failure) => {
            trouble.get_or_insert(failure);
            false
        }
    };
    let shown = !(common.quiet || common.no_progress);
    let bar = (shown && std::io::stderr().is_terminal()).then(ProgressBar::new_spinner);
    let mut last = usize::MAX;
    let mut progress = |scene: &SceneInput, n: u64| {
        let size = Size::of(scene);
        let line = format!(
            "{} surfaces, {} corners, {} materials, {} digits after {n} tries",
            size.surfaces, size.corners, size.materials, size.digits
        );
        if let Some(bar) = &bar {
            bar.set_message(line);
            bar.tick();
        } else if shown && size.surfaces < last {
            eprintln!("{line}");
        }
        last = size.surfaces;
    };
    let is_wanted = || was_interrupted() || is_spent();
    let reduced = reduce(&input, &mut fails, &mut progress, Stop::new(&is_wanted));
    if let Some(bar) = &bar {
        bar.finish_and_clear();
    }
    if let Some(failure) = trouble {
        return Err(failure);
    }
    let Some(reduced) = reduced else {
        if was_interrupted() {
            return Ok(Ending::Interrupted);
        }
        return Err(Failure::not_acceptable(format!(
            "{}: does not fail: {} is not seen on it",
            common.scene.display(),
            tries.name
        )));
    };
    let text = scene_file::write(&reduced.scene);
    if let Some(path) = &args.output {
        output::atomically(path, |out| out.write_all(text.as_bytes()))?;
    }
    let (before, after) = (Size::of(&input), Size::of(&reduced.scene));
    if common.json {
        let size = |s: Size| {
            json!({ "surfaces": s.surfaces, "corners": s.corners, "materials": s.materials,
                "digits": s.digits })
        };
        let written = args.output.as_ref().map(|p| p.display().to_string());
        say!(
            "{:#}",
            json!({
                "version": env!("CARGO_PKG_VERSION"),
                "failure": tries.name,
                "before": size(before),
                "after": size(after),
                "tries": reduced.tries,
                "minimal": reduced.is_minimal,
                "seconds": started.elapsed().as_secs_f64(),
                "written": written,
                "scene": if written.is_none() { json!(text) } else { json!(null) },
            })
        );
    } else {
        match &args.output {
            None => say!("{}", text.trim_end()),
            Some(path) if !common.quiet => say!(
                "{}: {} surfaces of {}, {} corners of {}, {} tries{}\nwrote {}",
                tries.name,
                after.surfaces,
                before.surfaces,
                after.corners,
                before.corners,
                reduced.tries,
                if reduced.is_minimal {
                    "; nothing more can be removed"
                } else {
                    "; stopped before it was smallest"
                },
                path.display()
            ),
            Some(_) => {}
        }
    }
    Ok(if was_interrupted() {
        Ending::Interrupted
    } else if reduced.is_minimal {
        Ending::Done
    } else {
        Ending::BudgetReached
    })
}

/// How a scene is tried.
struct Tries<'a> {
    args: &'a Reduce,
    name: String,
    program: PathBuf,
    /// Where candidates stand: one file, written anew for each.
    candidate: output::Temporary,
}

impl<'a> Tries<'a> {
    fn new(args: &'a Reduce) -> Result<Self, Failure> {
        let name = match &args.failure {
            FailureKind::Panic => "panic".to_owned(),
            FailureKind::Slow(seconds) => format!("slow={seconds}"),
            FailureKind::Values(failure) => key(*failure),
            FailureKind::Command(command) => format!("command={command}"),
        };
        let program = std::env::current_exe()
            .map_err(|e| Failure::internal(format!("this program cannot be found: {e}")))?;
        let path = std::env::temp_dir().join(format!("antumbra-{}.json", std::process::id()));
        let failed = |e| Failure::internal(format!("{}: cannot be written: {e}", path.display()));
        let (candidate, _) = output::Temporary::create(path.clone()).map_err(failed)?;
        Ok(Self {
            args,
            name,
            program,
            candidate,
        })
    }

    fn path(&self) -> &Path {
        self.candidate.path()
    }

    /// Is the failure seen on this scene?
    fn does_fail(&self, scene: &SceneInput) -> Result<bool, Failure> {
        std::fs::write(self.path(), scene_file::write(scene)).map_err(|e| {
            Failure::internal(format!("{}: cannot be written: {e}", self.path().display()))
        })?;
        let timeout = match self.args.failure {
            FailureKind::Slow(seconds) => seconds,
            _ => self.args.timeout,
        };
        let mut command = self.command(scene);
        command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        let ended = run_for(&mut command, Duration::from_secs_f64(timeout))
            .map_err(|e| Failure::internal(format!("{}: cannot be run: {e}", self.name)))?;
        let is_own = !matches!(self.args.failure, FailureKind::Command(_));
        if is_own && ended.and_then(|s| s.code()) == Some(2) {
            return Err(Failure::usage(format!(
                "mesh does not take these options: {}",
                self.args.meshing.join(" ")
            )));
        }
        Ok(match (&self.args.failure, ended) {
            (FailureKind::Slow(_), ended) => ended.is_none() && !was_interrupted(),
            (_, None) => false,
            // No code: ended by a signal, as an abort is.
            (FailureKind::Panic, Some(status)) => matches!(status.code(), Some(1) | None),
            (FailureKind::Values(_), Some(status)) => status.code() == Some(i32::from(FAILS)),
            (FailureKind::Command(_), Some(status)) => !status.success(),
        })
    }

    fn command(&self, scene: &SceneInput) -> Command {
        if let FailureKind::Command(command) = &self.args.failure {
            let mut shell = Command::new("sh");
            // The command may be of several words; the path is its last one.
            shell.args(["-c", &format!("{command} \"$1\""), "sh"]);
            shell.arg(self.path());
            return shell;
        }
        let mut own = Command::new(&self.program);
        match &self.args.failure {
            FailureKind::Values(failure) => own.args([
                "reduce-try",
                "--failure",
                &key(*failure),
                "--points",
                &self.args.points.to_string(),
            ]),
            _ => own.args(["mesh", "--json"]),
        };
        if let Some(threads) = self.args.common.threads {
            own.args(["--threads", &threads.to_string()]);
        }
        // Candidates are scene files, wherever they come from.
        if scene.triangulate {
            own.arg("--triangulate");
        }
        own.args(["--quiet", "--no-progress"]);
        own.args(&self.args.meshing);
        own.arg(self.path());
        own
    }
}

fn key(failure: ValueFailure) -> String {
    clap::ValueEnum::to_possible_value(&failure)
        .map(|v| v.get_name().to_owned())
        .unwrap_or_default()
}

/// How often a child is looked after.
const LOOK: Duration = Duration::from_millis(2);

/// Runs a command to its end; `None` if it took longer than it may, or if this process
/// was interrupted meanwhile.
fn run_for(command: &mut Command, most: Duration) -> std::io::Result<Option<ExitStatus>> {
    #[cfg(unix)]
    {
        // A group of its own: an interrupt is ours, and a shell dies with its children.
        use std::os::unix::process::CommandExt as _;
        command.process_group(0);
    }
    let started = Instant::now();
    let mut child = command.spawn()?;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if started.elapsed() >= most || was_interrupted() {
            end(&mut child);
            child.wait()?;
            return Ok(None);
        }
        std::thread::sleep(LOOK);
    }
}

fn end(child: &mut Child) {
    #[cfg(unix)]
    {
        let group = format!("-{}", child.id());
        let _ = Command::new("kill")
            .args(["-KILL", "--", &group])
            .stderr(Stdio::null())
            .status();
    }
    // It may have ended by itself.
    let _ = child.kill();
}

/// One try: meshes a scene and looks for a failure of values or meshes.
pub(crate) fn try_once(args: &ReduceTry) -> Result<Ending, Failure> {
    let loaded = input::load(&args.common)?;
    let watch = Watch::new(&args.common);
    let options = args.meshing.discontinuity("reduce")?;
    let mesh = watch
        .run(|control| antumbra::mesh(&loaded.scene, &options, control))
        .map_err(|e| Failure::internal(e.to_string()))?
        .mesh;
    watch.finish();
    let fails = match args.failure {
        ValueFailure::Check => {
            let mut triangles = mesh.receivers.iter().filter_map(|r| r.triangles());
            triangles.any(|t| t.check().is_err())
        }
        failure => has_wrong_value(&loaded, &mesh, options.tolerance, failure, args.points),
    };
    Ok(if fails { Ending::Fails } else { Ending::Done })
}

/// Above what it should not exceed by rounding alone, relative to it.
const ROUNDING: f64 = 1e-9;

fn has_wrong_value(
    loaded: &Loaded,
    mesh: &Solution,
    tolerance: Tolerance,
    failure: ValueFailure,
    n_points: u32,
) -> bool {
    let is_wrong = |x: &f64| !x.is_finite() || *x < 0.0;
    if failure == ValueFailure::Negative
        && mesh.receivers.iter().any(|r| r.direct.iter().any(is_wrong))
    {
        return true;
    }
    if failure == ValueFailure::AboveTolerance && mesh.ended != Ended::ToleranceReached {
        return false;
    }
    let scene = &loaded.scene;
    let evaluator = Evaluator::new(scene);
    let light = ExactLight::new(&evaluator, &Control::NEVER);
    let mut scratch = Scratch::default();
    values::random_places(scene, n_points, &|_| true)
        .iter()
        .any(|place| {
            let exact = values::exact(&light, place, &mut scratch);
            match failure {
                ValueFailure::Negative => exact.iter().any(is_wrong),
                ValueFailure::AboveUnoccluded => {
                    let most = unoccluded(&evaluator, place, &mut scratch);
                    exact
                        .iter()
                        .zip(&most)
                        .zip(&mesh.peak)
                        .any(|((x, most), peak)| *x > most + ROUNDING * peak)
                }
                ValueFailure::AboveTolerance => {
                    let Some(on_mesh) = values::on_mesh(mesh, place) else {
                        return false;
                    };
                    exact
                        .iter()
                        .zip(&on_mesh)
                        .zip(&mesh.peak)
                        .any(|((x, y), peak)| {
                            let allowed = match tolerance {
                                Tolerance::Relative(t) => t * peak,
                                Tolerance::Absolute(t) => t,
                            };
                            (x - y).abs() > allowed
                        })
                }
                ValueFailure::Check => false,
            }
        })
}

/// Irradiance per band without any occluders.
fn unoccluded(evaluator: &Evaluator<'_>, place: &Place, scratch: &mut Scratch) -> Vec<f64> {
    let view = evaluator.unprepared_view(place.face);
    let mut seen = vec![Seen::default(); evaluator.emitters().len()];
    evaluator.factors(&view, place.point, None, scratch, &mut seen);
    for seen in &mut seen {
        seen.factor = seen.unoccluded;
    }
    evaluator.weigh(&seen)
}
