//! Progress, the clock, and stopping: budget, memory, interruption.

use crate::Ending;
use crate::args::{Common, Limits};
use antumbra::Phase;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// The first Ctrl-C ends the work with what there is; the second ends the process.
#[expect(
    clippy::exit,
    reason = "the user asks a second time: there is nothing left to wait for"
)]
pub(crate) fn catch_interrupts() {
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    });
}

/// Watches one run: phases and their seconds, and when to stop.
pub(crate) struct Watch {
    started: Instant,
    budget: Option<Duration>,
    max_memory: Option<u64>,
    stopped: Mutex<Option<Ending>>,
    phases: Mutex<Vec<(Phase, Instant)>>,
    bar: Option<ProgressBar>,
    lines: bool,
}

impl Watch {
    pub(crate) fn new(common: &Common, limits: &Limits) -> Self {
        let shown = !(common.quiet || common.no_progress);
        let terminal = std::io::stderr().is_terminal();
        let bar = (shown && terminal).then(|| {
            let style = ProgressStyle::with_template(
                "{msg:12} [{bar:32}] {percent:>3} %  {elapsed_precise}  left {eta}",
            );
            let bar = ProgressBar::new(1000);
            if let Ok(style) = style {
                bar.set_style(style.progress_chars("=> "));
            }
            bar
        });
        Self {
            started: Instant::now(),
            budget: limits.budget.map(Duration::from_secs_f64),
            max_memory: limits.max_memory,
            stopped: Mutex::new(None),
            phases: Mutex::new(Vec::new()),
            bar,
            lines: shown && !terminal,
        }
    }

    /// Asked by the engine between steps.
    pub(crate) fn should_stop(&self) -> bool {
        let ending = if INTERRUPTED.load(Ordering::SeqCst) {
            Ending::Interrupted
        } else if self
            .budget
            .is_some_and(|budget| self.started.elapsed() >= budget)
            || self
                .max_memory
                .is_some_and(|most| resident_memory() >= most)
        {
            Ending::BudgetReached
        } else {
            return false;
        };
        if let Ok(mut stopped) = self.stopped.lock() {
            stopped.get_or_insert(ending);
        }
        true
    }

    /// Told by the engine.
    pub(crate) fn progress(&self, phase: Phase, done: f64) {
        if let Ok(mut phases) = self.phases.lock()
            && phases.last().map(|p| p.0) != Some(phase)
        {
            phases.push((phase, Instant::now()));
            if let Some(bar) = &self.bar {
                bar.reset();
                bar.set_message(phase.name());
            }
            if self.lines {
                eprintln!("{}", phase.name());
            }
        }
        if let Some(bar) = &self.bar {
            bar.set_position((done * 1000.0) as u64);
        }
    }

    /// Why the engine was stopped, if it was.
    pub(crate) fn stopped(&self) -> Option<Ending> {
        self.stopped.lock().ok().and_then(|s| *s)
    }

    /// Ends the phases; seconds of each, and of everything since the start.
    pub(crate) fn finish(&self) -> (Vec<(&'static str, f64)>, f64) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        let now = Instant::now();
        let mut seconds = Vec::new();
        if let Ok(phases) = self.phases.lock() {
            for (i, (phase, start)) in phases.iter().enumerate() {
                let end = phases.get(i + 1).map_or(now, |next| next.1);
                seconds.push((phase.name(), (end - *start).as_secs_f64()));
            }
        }
        (seconds, self.started.elapsed().as_secs_f64())
    }
}

/// Memory of this process in bytes, now; 0 where the system does not tell.
fn resident_memory() -> u64 {
    status_field("VmRSS:")
}

/// Largest memory of this process in bytes; 0 where the system does not tell.
pub(crate) fn peak_memory() -> u64 {
    status_field("VmHWM:")
}

fn status_field(key: &str) -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    status
        .lines()
        .find_map(|line| line.strip_prefix(key))
        .and_then(|rest| {
            rest.trim()
                .trim_end_matches("kB")
                .trim()
                .parse::<u64>()
                .ok()
        })
        .map_or(0, |kb| kb * 1024)
}
