//! The command line: arguments in, tables and files out.

mod any_tree;
mod args;
mod colour;
mod compare;
mod compare_args;
mod devices;
mod in_a_row;
mod interrupt;
mod leaves;
mod log;
mod one_run;
mod optimize;
mod optimize_args;
mod optimizer;
mod out_folder;
mod overwrite;
mod plan;
mod preset;
mod read_args;
mod render;
mod render_args;
mod scenes;
mod splits_args;
mod stability;
mod stats;
mod stdout;
mod summary;
mod target;
mod values;
mod wide_args;

use anyhow::Context;
use args::{Cli, Command, main_job};
use clap::{CommandFactory, FromArgMatches};
use colour::Colour;
use interrupt::Interrupt;
use prbvh::bvh::MaxDepth;
use prbvh::scene::{self, Scene};
use prbvh_lab::report::Machine;
use read_args::ReadArgs;
use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;
use stdout::unless_unread;
use values::BUILT_IN;

/// Runs the command; errors go to stderr with their causes.
pub(crate) fn main() -> ExitCode {
    let colour = Colour::settle();
    let parsed = Cli::command().color(colour.of_help()).try_get_matches();
    let cli = match parsed.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(said) => return say(&said),
    };
    let log = log::start(cli.quiet, cli.verbose, colour);
    let interrupt = Interrupt::listen();
    let result = match cli.command {
        None => optimize::run(&main_job(), &log, &interrupt),
        Some(Command::Optimize(args)) => optimize::run(&args, &log, &interrupt),
        Some(Command::Plan(args)) => plan::run(&args),
        Some(Command::Render(args)) => render::run(&args, &log, &interrupt),
        Some(Command::Compare(args)) => compare::run(&args, &log, &interrupt),
        Some(Command::Peer(args)) => Ok(compare::run_peer(&args, &interrupt)),
        Some(Command::Stability(args)) => stability::run(&args, &interrupt),
        Some(Command::Stats(args)) => stats::run(&args, &log),
        Some(Command::Devices(args)) => devices::run(&args),
    };
    let code = result.unwrap_or_else(|error| {
        print_error(&format!("prbvh: {}", told_once(&error)));
        ExitCode::FAILURE
    });
    interrupt.exit_code().unwrap_or(code)
}

/// Says what the parser of arguments has to say: help, the version, or an error.
fn say(said: &clap::Error) -> ExitCode {
    let printed = unless_unread(said.print().and_then(|()| io::stdout().flush()));
    match printed {
        Err(error) if !said.use_stderr() => {
            print_error(&format!("prbvh: stdout: {error}"));
            ExitCode::FAILURE
        }
        _ => u8::try_from(said.exit_code()).map_or(ExitCode::FAILURE, ExitCode::from),
    }
}

/// Prints a line to stderr; that nobody reads it is no error either.
fn print_error(text: &str) {
    // Names and words of files must not command the terminal.
    let plain = |c: char| match c {
        '\n' | '\t' => c.to_string(),
        c if c.is_control() => c.escape_default().to_string(),
        c => c.to_string(),
    };
    let _ = writeln!(io::stderr().lock(), "{}", text.chars().map(plain).collect::<String>());
}

/// The error with its causes, less those that the text before them tells already.
fn told_once(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if text.is_empty() {
            text = cause;
        } else if !text.ends_with(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

/// The scene that an argument names; what of it was not read is in the log.
fn load_scene(path: &Path, triangles: Option<usize>, read: &ReadArgs) -> anyhow::Result<Scene> {
    if path == Path::new(BUILT_IN) {
        let triangles = triangles.unwrap_or(scene::DEFAULT_TRIANGLES);
        let most = most_triangles();
        anyhow::ensure!(
            (1..=most).contains(&triangles),
            "--triangles {triangles}: this machine holds a built-in scene of 1 to {most} triangles"
        );
        return Ok(scene::built_in(triangles));
    }
    anyhow::ensure!(triangles.is_none(), "--triangles is for the built-in scene, not for {}", path.display());
    let scene = scene::load_with(path, &read.options())?;
    for note in &scene.notes {
        tracing::warn!("{}: {note}", scene.source);
    }
    Ok(scene)
}

/// Refuses a bound that no tree over the scene is within.
fn check_max_depth(max_depth: MaxDepth, scene: &Scene) -> anyhow::Result<()> {
    max_depth.check(scene.triangles.len()).with_context(|| format!("--max-depth {max_depth}"))
}

/// Size of the built-in scene that fits the machine's memory, trees and copies included.
fn most_triangles() -> usize {
    const BYTES_PER_TRIANGLE: u64 = 400;
    let most = match Machine::current().memory_bytes {
        0 => scene::MAX_TRIANGLES,
        memory => (memory / BYTES_PER_TRIANGLE).min(scene::MAX_TRIANGLES),
    };
    usize::try_from(most).unwrap_or(usize::MAX)
}
