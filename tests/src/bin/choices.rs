//! What `cargo xtask bless` and `cargo xtask presets` do.

use anyhow::Context;
use clap::{Parser, Subcommand};
use prbvh::write::write_atomically;
use prbvh_lab::presets::{self, Trial};
use prbvh_lab::reference::{self, Blessed, ReferenceCosts};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

#[derive(Parser)]
#[command(name = "prbvh-choices")]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Lowers the reference costs.
    Bless {
        /// The file of reference costs.
        #[arg(long)]
        reference: PathBuf,
        /// compare.json and report.json files.
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
    /// Repeats the choice of the presets.
    Presets {
        /// The file of reference costs.
        #[arg(long)]
        reference: PathBuf,
        /// compare.json files.
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
}

fn main() -> ExitCode {
    let result = match Cli::parse().task {
        Task::Bless { reference, files } => bless(&reference, &files).map(|()| ExitCode::SUCCESS),
        Task::Presets { reference, files } => choose(&reference, &files),
    };
    result.unwrap_or_else(|error| {
        eprintln!("error: {error:#}");
        ExitCode::FAILURE
    })
}

fn load(path: &Path) -> anyhow::Result<ReferenceCosts> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(ReferenceCosts::parse(&path.display().to_string(), &text)?)
}

/// All files or none: a cost that is refused leaves the reference costs as they were.
fn bless(path: &Path, files: &[PathBuf]) -> anyhow::Result<()> {
    let before = load(path)?;
    let mut costs = before.clone();
    for file in files {
        for found in reference::read(file)? {
            costs.bless(found.cost).with_context(|| file.display().to_string())?;
        }
    }
    for file in files {
        // Only the lowest of a file's rows is worth a line.
        let mut told: Vec<String> = Vec::new();
        for found in reference::read(file)? {
            if told.contains(&found.cost.hash) {
                continue;
            }
            told.push(found.cost.hash.clone());
            let (Some(now), sah) = (costs.get(&found.cost.hash, &found.cost.sah), &found.cost.sah) else { continue };
            let change = match before.get(&found.cost.hash, sah) {
                None => Blessed::New,
                Some(old) if now.cost < old.cost => Blessed::Lowered(old.cost),
                Some(old) => Blessed::Kept(old.cost),
            };
            match change {
                Blessed::New => println!("{}: new, {} ({})", now.scene, now.cost, now.method),
                Blessed::Lowered(old) => println!("{}: lowered from {old} to {} ({})", now.scene, now.cost, now.method),
                Blessed::Kept(old) => {
                    println!("{}: kept {old} ({}): nothing lower in {}", now.scene, now.method, file.display());
                }
            }
        }
    }
    if costs == before {
        println!("nothing changed");
        return Ok(());
    }
    let text = costs.to_json()?;
    write_atomically(path, |out| out.write_all(text.as_bytes()))?;
    println!("wrote {}", path.display());
    Ok(())
}

fn choose(path: &Path, files: &[PathBuf]) -> anyhow::Result<ExitCode> {
    let mut costs = load(path)?;
    let mut found = Vec::new();
    for file in files {
        found.extend(reference::read(file)?);
    }
    // Errors are relative to the lowest of what is known and what is here; nothing is written.
    for one in &found {
        costs.bless(one.cost.clone())?;
    }
    let trials: Vec<Trial> = found
        .iter()
        .filter_map(|one| {
            let known = costs.get(&one.cost.hash, &one.cost.sah)?;
            let (candidate, _) = one.cost.method.rsplit_once(" on ")?;
            let (scene, candidate) = (one.cost.scene.clone(), candidate.to_owned());
            Some(Trial { scene, candidate, build_s: one.build_s?, error: known.error_of(one.cost.cost) })
        })
        .collect();
    let choices = presets::choose(&trials)?;
    println!("scenes: {}", choices.scenes.join(", "));
    println!("     time   error   (time of LBVH = 1; geometric means; * on the Pareto front)");
    for score in &choices.scores {
        let mark = if score.is_on_front { '*' } else { ' ' };
        println!("{mark} {:8.2} {:6.2} %  {}", score.time, 100.0 * score.error, score.name);
    }
    println!(
        "rule: the fastest with an error of at most {} % (fast), {} % (balanced), {} % above the lowest (best)",
        100.0 * presets::FAST_ERROR,
        100.0 * presets::BALANCED_ERROR,
        100.0 * presets::BEST_ERROR
    );
    for [preset, winner, has] in &choices.presets {
        let verdict = if winner == has { "as in the code".to_owned() } else { format!("the code has `{has}`") };
        println!("{preset}: `{winner}`, {verdict}");
    }
    Ok(if choices.agree() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
