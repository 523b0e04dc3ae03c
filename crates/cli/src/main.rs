//! The `antumbra` command: the only place that opens files, prints, reads the
//! clock and exits.
#![expect(clippy::print_stderr, reason = "a command line talks to its terminal")]

mod args;
mod check;
mod factors;
mod failure;
mod input;
mod mesh;
mod output;
mod plan;
mod probe;
mod progress;
mod reduce;
mod render;
mod report;
mod say;
mod study;
mod summary;

use args::{Command, Options};
use clap::Parser;
use failure::Failure;
use std::process::ExitCode;

/// What a command ended with when nothing failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    Done,
    ToleranceNotReached,
    BudgetReached,
    Interrupted,
    /// A try of `reduce` shows the failure.
    Fails,
}

impl Ending {
    pub(crate) fn exit_code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::ToleranceNotReached => 5,
            Self::BudgetReached => 6,
            Self::Interrupted => 130,
            Self::Fails => reduce::FAILS,
        }
    }
}

fn main() -> ExitCode {
    // clap exits with 2 on bad usage and with 0 after --help.
    let options = Options::parse();
    progress::start(&options.command.limits());
    if let Some(threads) = options.command.common().threads {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build_global();
        if let Err(error) = pool {
            eprintln!("antumbra: cannot start {threads} threads: {error}");
            return ExitCode::from(1);
        }
    }
    // A panic is a bug of ours: say so and where, with the exit code of a bug.
    let outcome = std::panic::catch_unwind(|| match &options.command {
        Command::Check(check) => check::run(check),
        Command::Plan(plan) => plan::run(plan),
        Command::Mesh(mesh) => mesh::run(mesh, args::Work::Mesh),
        Command::Solve(mesh) => mesh::run(mesh, args::Work::Solve),
        Command::Probe(probe) => probe::run(probe),
        Command::Factors(factors) => factors::run(factors),
        Command::Study(study) => study::run(study),
        Command::Render(render) => render::run(render),
        Command::Reduce(args) => reduce::run(args),
        Command::ReduceTry(args) => reduce::try_once(args),
    });
    let failure = match outcome {
        Ok(Ok(ending)) => match say::failure() {
            None => return ExitCode::from(ending.exit_code()),
            Some(failure) => failure,
        },
        Ok(Err(failure)) => failure,
        Err(_) => Failure::internal("this is a bug in antumbra; please report it with the scene"),
    };
    eprintln!("antumbra: {failure}");
    ExitCode::from(failure.exit_code())
}
