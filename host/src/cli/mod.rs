//! The command line: arguments in, tables and files out.

mod args;
mod compare;
mod compare_args;
mod devices;
mod interrupt;
mod leaves;
mod log;
mod optimize;
mod optimizer;
mod plan;
mod preset;
mod read_args;
mod render;
mod render_args;
mod stability;
mod stats;
mod target;

use args::{BUILT_IN, Cli, Command, OptimizeArgs};
use clap::Parser;
use prbvh::report::Machine;
use prbvh::scene::{self, Scene};
use read_args::ReadArgs;
use std::path::Path;
use std::process::ExitCode;

/// Runs the command; errors go to stderr with their causes.
pub(crate) fn main() -> ExitCode {
    let cli = Cli::parse();
    let log = log::start(cli.quiet, cli.verbose);
    let result = match cli.command {
        None => optimize::run(&OptimizeArgs::main_job(), &log),
        Some(Command::Optimize(args)) => optimize::run(&args, &log),
        Some(Command::Plan(args)) => plan::run(&args),
        Some(Command::Render(args)) => render::run(&args, &log),
        Some(Command::Compare(args)) => compare::run(&args, &log),
        Some(Command::Peer(args)) => Ok(compare::run_peer(&args)),
        Some(Command::Stability(args)) => stability::run(&args),
        Some(Command::Stats(args)) => stats::run(&args),
        Some(Command::Devices(args)) => devices::run(&args),
    };
    match result {
        Ok(code) => code,
        Err(error) => {
            print_error(&format!("prbvh: {}", told_once(&error)));
            ExitCode::FAILURE
        }
    }
}

/// Prints a line to stdout; a reader that went away (`prbvh … | head`) is no error.
fn print(text: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stdout().lock(), "{text}");
}

/// Prints a line to stderr; that nobody reads it is no error either.
fn print_error(text: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr().lock(), "{text}");
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

/// Size of the built-in scene that fits the machine's memory, trees and copies included.
fn most_triangles() -> usize {
    const BYTES_PER_TRIANGLE: u64 = 400;
    let most = match Machine::current().memory_bytes {
        0 => scene::MAX_TRIANGLES,
        memory => (memory / BYTES_PER_TRIANGLE).min(scene::MAX_TRIANGLES),
    };
    usize::try_from(most).unwrap_or(usize::MAX)
}
