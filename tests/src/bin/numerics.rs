//! What `cargo xtask numerics` does.

use anyhow::Context;
use clap::Parser;
use prbvh::scene;
use prbvh::write::write_atomically;
use prbvh_tests::numerics::document::{Block, difference, filled};
use prbvh_tests::numerics::{catalogue, f32_sum, fresh_sum, runs, safe_range, threshold};
use std::path::PathBuf;
use std::process::ExitCode;

#[derive(Parser)]
#[command(name = "prbvh-numerics")]
struct Cli {
    /// The document.
    #[arg(long)]
    document: PathBuf,
    /// Compare instead of writing.
    #[arg(long)]
    check: bool,
    /// Scenes of the table of scenes; without any it stays as it is.
    scenes: Vec<PathBuf>,
}

type Experiment = (&'static str, fn() -> Block);

const EXPERIMENTS: [Experiment; 6] = [
    ("catalogue", catalogue::block),
    ("f32-sum", f32_sum::block),
    ("safe-range", safe_range::block),
    ("threshold", threshold::block),
    ("fresh-sum", fresh_sum::block),
    ("runs", runs::block),
];

fn main() -> ExitCode {
    run(&Cli::parse()).unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::FAILURE
    })
}

fn run(cli: &Cli) -> anyhow::Result<ExitCode> {
    let shown = cli.document.display();
    let before = std::fs::read_to_string(&cli.document).with_context(|| format!("cannot read {shown}"))?;
    let scenes = cli.scenes.iter().map(|path| scene::load(path)).collect::<Result<Vec<_>, _>>()?;
    let mut blocks = Vec::new();
    for (name, experiment) in EXPERIMENTS {
        println!("{name}");
        blocks.push(experiment());
    }
    let mut others = Vec::new();
    if scenes.is_empty() {
        others.push("scenes");
    } else {
        println!("scenes");
        blocks.push(runs::block_of(&scenes));
    }
    let after = filled(&before, &blocks, &others).with_context(|| shown.to_string())?;
    match difference(&before, &after) {
        None => println!("{shown}: as it was"),
        Some(found) if cli.check => {
            eprintln!("{shown}: {found}");
            return Ok(ExitCode::FAILURE);
        }
        Some(_) => {
            write_atomically(&cli.document, |out| out.write_all(after.as_bytes()))?;
            println!("wrote {shown}");
        }
    }
    Ok(ExitCode::SUCCESS)
}
