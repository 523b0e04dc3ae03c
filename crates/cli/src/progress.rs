//! Progress, the clock, and stopping: budget, memory, interruption.
//!
//! A thread of its own looks at clock, memory and interrupts a hundred times a second
//! and sets flags, so that the engine may ask as often as it likes.

use crate::Ending;
use crate::args::{Common, Limits};
use crate::output;
use antumbra::{Control, Phase, Stop};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering::SeqCst};
use std::time::{Duration, Instant};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
/// Work is to end with what there is.
static SHOULD_STOP: AtomicBool = AtomicBool::new(false);
/// There is no time left for rounding it off either.
static MUST_STOP: AtomicBool = AtomicBool::new(false);
/// One of [`WHY`], once `SHOULD_STOP` is set.
static REASON: AtomicU8 = AtomicU8::new(0);
/// [`READING`], [`WORKING`] or [`DONE`].
static STATE: AtomicU8 = AtomicU8::new(READING);
/// Bytes; 0 is no limit.
static MAX_MEMORY: AtomicU64 = AtomicU64::new(0);

/// There is nothing to write yet: a stop ends the process.
const READING: u8 = 0;
/// The engine works: a stop makes it end with what there is.
const WORKING: u8 = 1;
/// The result is there: nothing stops its being written but a second interrupt.
const DONE: u8 = 2;

const WHY: [(Ending, &str); 3] = [
    (Ending::BudgetReached, "the budget of time"),
    (Ending::BudgetReached, "the limit of memory"),
    (Ending::Interrupted, "an interrupt"),
];
const TIME: u8 = 0;
const MEMORY: u8 = 1;
const INTERRUPT: u8 = 2;

/// How often clock and memory are looked at.
const TICK: Duration = Duration::from_millis(10);

/// Work stops at this share of the memory: the rest is for packing and writing what
/// there is (measured: about a third of the meshes' memory).
const SHARE_FOR_WORK: f64 = 0.7;

/// After a stop, coarse meshes get as much of the budget again, but no less and no more
/// than this many seconds; after an interrupt or a lack of memory, the least.
const ROUNDING_OFF: f64 = 0.2;
const LEAST_ROUNDING_OFF: f64 = 0.8;
const MOST_ROUNDING_OFF: f64 = 10.0;

/// Starts the clock, and watches clock, memory and interrupts from now on.
///
/// The first Ctrl-C, or request to end from a scheduler (SIGTERM) or a closed terminal
/// (SIGHUP), ends the work with what there is; the second ends the process, and no
/// half-written file remains.
#[expect(
    clippy::exit,
    reason = "the user asks a second time: there is nothing left to wait for"
)]
pub(crate) fn start(limits: &Limits) {
    let started = Instant::now();
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, SeqCst) {
            output::remove_temporaries(|| std::process::exit(130));
        }
    });
    fail_at_largest_file();
    let Limits { budget, max_memory } = *limits;
    MAX_MEMORY.store(max_memory.unwrap_or(0), SeqCst);
    let watch = move || watch(started, budget, max_memory);
    // Without the thread nothing would hold; but a run without limits can do without.
    if let Err(error) = std::thread::Builder::new().spawn(watch) {
        eprintln!("antumbra: limits do not hold: {error}");
    }
}

/// A file that reaches the limit of its size (`ulimit -f`) is to fail as a full disk does:
/// the signal that comes with it would end the process, and leave the file.
fn fail_at_largest_file() {
    #[cfg(unix)]
    {
        use signal_hook::{consts::SIGXFSZ, flag::register};
        // Nobody looks at the flag: what counts is that the signal has a handler.
        if let Err(error) = register(SIGXFSZ, std::sync::Arc::new(AtomicBool::new(false))) {
            eprintln!("antumbra: a limit of file size may end this process: {error}");
        }
    }
}

fn watch(started: Instant, budget: Option<f64>, max_memory: Option<u64>) {
    let mut rounding_off = LEAST_ROUNDING_OFF;
    let reason = loop {
        let state = STATE.load(SeqCst);
        let share = if state == READING {
            1.0
        } else {
            SHARE_FOR_WORK
        };
        if INTERRUPTED.load(SeqCst) {
            break INTERRUPT;
        }
        if let Some(budget) = budget
            && started.elapsed().as_secs_f64() >= budget
        {
            rounding_off = (ROUNDING_OFF * budget).clamp(LEAST_ROUNDING_OFF, MOST_ROUNDING_OFF);
            break TIME;
        }
        if let Some(most) = max_memory
            && resident_memory() as f64 >= share * most as f64
        {
            break MEMORY;
        }
        std::thread::sleep(TICK);
    };
    REASON.store(reason, SeqCst);
    SHOULD_STOP.store(true, SeqCst);
    let stopped = Instant::now();
    loop {
        if STATE.load(SeqCst) == READING {
            end_without_result(reason);
        }
        // An interrupt does not wait for the rounding off of something else.
        if stopped.elapsed().as_secs_f64() >= rounding_off
            || (reason != INTERRUPT && INTERRUPTED.load(SeqCst))
            || max_memory.is_some_and(|most| resident_memory() >= most)
        {
            MUST_STOP.store(true, SeqCst);
            return;
        }
        std::thread::sleep(TICK);
    }
}

/// Stopped while there is nothing to write.
#[expect(clippy::exit, reason = "the scene is being read: there is no result")]
fn end_without_result(reason: u8) {
    let (ending, why) = WHY[usize::from(reason)];
    eprintln!("antumbra: stopped by {why} before there was anything to write");
    // Outputs are tried before the scene is read: that leaves no file either.
    output::remove_temporaries(|| std::process::exit(i32::from(ending.exit_code())));
}

/// Is there room for so many bytes more?
fn has_room(bytes: u64) -> bool {
    match MAX_MEMORY.load(SeqCst) {
        0 => available_memory().is_none_or(|available| bytes <= available),
        most => resident_memory().saturating_add(bytes) as f64 <= SHARE_FOR_WORK * most as f64,
    }
}

/// Watches one run: phases and their seconds, and when to stop.
pub(crate) struct Watch {
    started: Instant,
    phases: Mutex<Vec<(Phase, Instant)>>,
    bar: Option<ProgressBar>,
    lines: bool,
}

impl Watch {
    /// From now on there is something to write if the work is stopped.
    pub(crate) fn new(common: &Common) -> Self {
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
        STATE.store(WORKING, SeqCst);
        Self {
            started: Instant::now(),
            phases: Mutex::new(Vec::new()),
            bar,
            lines: shown && !terminal,
        }
    }

    /// Runs a part of the engine under this watch.
    pub(crate) fn run<T>(&self, work: impl FnOnce(&Control<'_>) -> T) -> T {
        work(&Control {
            stop: Stop::new(&|| SHOULD_STOP.load(SeqCst)),
            at_once: Stop::new(&|| MUST_STOP.load(SeqCst)),
            has_room: &has_room,
            progress: &|phase, done| self.progress(phase, done),
        })
    }

    /// Is the work to end with what there is?
    pub(crate) fn should_stop(&self) -> bool {
        SHOULD_STOP.load(SeqCst)
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

    /// How a run ends that did not come to its end: what stopped it, in words.
    pub(crate) fn stopped(&self) -> (Ending, &'static str) {
        stopped_by()
    }

    /// The phase that was begun last.
    pub(crate) fn phase(&self) -> Option<Phase> {
        self.phases.lock().ok().and_then(|p| p.last().map(|p| p.0))
    }

    /// Ends the phases; seconds of each, and of everything since the start.
    pub(crate) fn finish(&self) -> (Vec<(&'static str, f64)>, f64) {
        STATE.store(DONE, SeqCst);
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

/// What stopped the work, in words, and how the run ends.
pub(crate) fn stopped_by() -> (Ending, &'static str) {
    if SHOULD_STOP.load(SeqCst) {
        WHY[usize::from(REASON.load(SeqCst))]
    } else {
        // Nothing asked it to stop: there was no room for what comes next.
        WHY[usize::from(MEMORY)]
    }
}

/// From now on the scene is there, and with it something to write: what comes is asked to
/// stop.
pub(crate) fn scene_is_there() {
    STATE.store(WORKING, SeqCst);
}

/// Is the work to end with what there is?
pub(crate) fn is_stop_wanted() -> bool {
    SHOULD_STOP.load(SeqCst)
}

/// From now on there is something to write if the work is stopped, by the caller.
pub(crate) fn keep_going() {
    STATE.store(DONE, SeqCst);
}

/// Was the run interrupted, be it while its result was written?
pub(crate) fn was_interrupted() -> bool {
    INTERRUPTED.load(SeqCst)
}

/// Memory that the machine has left in bytes, where it tells.
fn available_memory() -> Option<u64> {
    field_of("/proc/meminfo", "MemAvailable:")
}

/// Memory of this process in bytes, now; 0 where the system does not tell.
fn resident_memory() -> u64 {
    status_field("VmRSS:")
}

/// Largest memory of this process in bytes; 0 where the system does not tell.
pub(crate) fn peak_memory() -> u64 {
    status_field("VmHWM:")
}

/// Memory of this process now, and the most since this was asked last, in bytes; zeros
/// where the system does not tell.
pub(crate) fn most_memory_since() -> [u64; 2] {
    let memory = [resident_memory(), peak_memory()];
    // On Linux this sets the peak back to what is taken now.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    memory
}

fn status_field(key: &str) -> u64 {
    field_of("/proc/self/status", key).unwrap_or(0)
}

/// A field in kB of one of the system's tables, in bytes.
fn field_of(table: &str, key: &str) -> Option<u64> {
    let table = std::fs::read_to_string(table).ok()?;
    let rest = table.lines().find_map(|line| line.strip_prefix(key))?;
    let kb = rest.trim().trim_end_matches("kB").trim();
    kb.parse::<u64>().ok().map(|kb| kb * 1024)
}
