//! `prbvh optimize` of many scenes, one after another on one device: a folder and a line for each, and on after a failure.

use super::interrupt::{Held, Interrupt};
use super::log::Log;
use super::one_run::{self, Done, OUTPUTS};
use super::optimize_args::OptimizeArgs;
use super::out_folder::OutFolder;
use super::overwrite::refuse_overwrite;
use super::scenes::Named;
use super::stdout::print;
use super::summary::{Line, SUMMARY, Status, Summary};
use super::told_once;
use prbvh::device::{self, Device};
use prbvh::optimize::StopReason;
use prbvh::pipeline::{Initial, Settings};
use prbvh::scene;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

pub(super) fn run(
    args: &OptimizeArgs,
    settings: &Settings,
    scenes: &[Named],
    log: &Log,
    interrupt: &Interrupt,
) -> anyhow::Result<ExitCode> {
    let names = folder_names(scenes)?;
    let outputs = args.out.iter().flat_map(|folder| {
        let of_scene = |name: &String| OUTPUTS.map(|file| folder.join(name).join(file));
        names.iter().flat_map(of_scene).chain([folder.join(SUMMARY)]).collect::<Vec<PathBuf>>()
    });
    let inputs = scenes.iter().map(|scene| &*scene.path).chain(one_run::other_inputs(args, settings));
    refuse_overwrite(inputs, outputs)?;
    let device = Some(device::open(args.device, args.threads, args.validate)?);
    let folder = args.out.as_deref().map(OutFolder::open).transpose()?;
    let summary = folder.as_ref().map(|folder| Summary::open(folder.path())).transpose()?;
    let mut row = Row { args, settings, folder: folder.as_ref(), summary, device, log, interrupt, unprinted: None };
    if !args.json {
        row.print(&heading());
    }
    let mut lines = Vec::new();
    for (scene, name) in scenes.iter().zip(&names) {
        tracing::info!("{} of {}: {}", lines.len() + 1, scenes.len(), scene.path.display());
        lines.push(row.scene(scene, name)?);
        if interrupt.pressed() {
            break;
        }
    }
    match (conclude(&lines, scenes.len()), row.unprinted) {
        (concluded, None) => concluded,
        (Ok(_), Some(unprinted)) => Err(unprinted),
        (Err(failed), Some(unprinted)) => Err(failed.context(format!("{unprinted:#}"))),
    }
}

/// Says how it went.
///
/// # Errors
/// If a scene failed.
fn conclude(lines: &[Line], scenes: usize) -> anyhow::Result<ExitCode> {
    let count = |status| lines.iter().filter(|line| line.status == status).count();
    let [done, skipped, interrupted] = [Status::Done, Status::Skipped, Status::Interrupted].map(count);
    tracing::info!("{scenes} scenes: {done} optimised, {skipped} left as they were, {} failed", count(Status::Failed));
    let not_begun = scenes - lines.len();
    if interrupted + not_begun > 0 {
        tracing::warn!("interrupted: {interrupted} scenes have the best tree so far, {not_begun} were not begun");
    }
    let failed = lines.iter().filter_map(|line| Some((&line.scene, line.error.as_ref()?)));
    let failed: Vec<String> = failed.map(|(scene, error)| format!("  {}", with_name(scene, error))).collect();
    anyhow::ensure!(failed.is_empty(), "{} of {scenes} scenes failed:\n{}", failed.len(), failed.join("\n"));
    Ok(ExitCode::SUCCESS)
}

/// Most errors begin with the file.
fn with_name(scene: &str, error: &str) -> String {
    if error.starts_with(scene) { error.to_owned() } else { format!("{scene}: {error}") }
}

struct Row<'a> {
    args: &'a OptimizeArgs,
    settings: &'a Settings,
    folder: Option<&'a OutFolder>,
    summary: Option<Summary>,
    /// None after a failure: the device may be lost, and another scene gets a new one.
    device: Option<Box<dyn Device + Send>>,
    log: &'a Log,
    interrupt: &'a Interrupt,
    /// Why stdout could not be written. The files are worth going on for.
    unprinted: Option<anyhow::Error>,
}

impl<'a> Row<'a> {
    fn print(&mut self, text: &str) {
        if self.unprinted.is_none() {
            self.unprinted = print(text).err();
        }
    }

    /// One scene, whatever becomes of it.
    ///
    /// # Errors
    /// If that cannot be said.
    fn scene(&mut self, scene: &Named, name: &str) -> anyhow::Result<Line> {
        let path = scene.path.display().to_string();
        let (line, held) = match self.attempt(scene, name) {
            Ok(made) => made,
            Err(error) => {
                self.log.end_bar();
                if let Some(folder) = self.folder {
                    // Where nothing is in it, nothing is told by it.
                    let _ = std::fs::remove_dir(folder.path().join(name));
                }
                let error = told_once(&error);
                tracing::warn!("failed: {}", with_name(&path, &error));
                (Line::failed(path, name.to_owned(), error), None)
            }
        };
        if let Some(summary) = &mut self.summary
            && line.status != Status::Skipped
        {
            summary.append(&line)?;
        }
        drop(held);
        self.print(&if self.args.json { serde_json::to_string(&line)? } else { text(&line) });
        Ok(line)
    }

    fn attempt(&mut self, named: &Named, name: &str) -> anyhow::Result<(Line, Option<Held<'a>>)> {
        let Self { args, log, interrupt, .. } = *self;
        let scene = named.load()?;
        let (settings, known) = one_run::settings_for(args, self.settings, &scene)?;
        let as_json = serde_json::to_value(&settings)?;
        let path = self.folder.map(|folder| folder.path().join(name));
        if let (true, Some(summary), Some(path)) = (args.scenes.is_resumed(), &self.summary, &path)
            && let Some(line) = summary.done(name, path, &scene.hash, &as_json)
            && can_be_skipped(args, &settings)
        {
            tracing::info!("{name}: left as it was");
            return Ok((line.clone().left_as_it_was(), None));
        }
        let folder = path.as_deref().map(OutFolder::open).transpose()?;
        let mut device = match self.device.take() {
            Some(device) => device,
            None => device::open(args.device, args.threads, args.validate)?,
        };
        let Done { result, report, held } =
            one_run::optimized(args, &settings, &scene, known.as_ref(), &mut *device, (log, interrupt))?;
        self.device = Some(device);
        if let Some(folder) = &folder {
            one_run::write(folder.path(), &scene, &result, &report)?;
        }
        one_run::judge(report.accuracy.as_ref())?;
        let is_cut_short = result.outcome.stop == StopReason::Cancelled;
        let status = if is_cut_short { Status::Interrupted } else { Status::Done };
        let line = Line::of(named.path.display().to_string(), name.to_owned(), status, as_json, &report)?;
        Ok((line, held))
    }
}

/// Whether an earlier run tells all that this one would: not of the numbers that are to be checked, nor of a tree file, which may be another by now.
fn can_be_skipped(args: &OptimizeArgs, settings: &Settings) -> bool {
    !args.check_numerics && !matches!(settings.initial, Initial::File { .. })
}

fn heading() -> String {
    format!("{:<24} {:<11} {:>11} {:>12} {:>12} {:>11}", "scene", "", "triangles", "initial cost", "final cost", "time")
}

fn text(line: &Line) -> String {
    let number = |key| line.number(key);
    let status = match line.status {
        Status::Done => "done",
        Status::Skipped => "as it was",
        Status::Interrupted => "interrupted",
        Status::Failed => return format!("{:<24} failed", line.name),
    };
    let cost = |key| number(key).map_or_else(String::new, |cost| format!("{cost:.3}"));
    let triangles = number("triangles").map_or_else(String::new, |count| format!("{count:.0}"));
    let time = number("time_s").map_or_else(String::new, |seconds| format!("{seconds:.3} s"));
    let [initial, last] = [cost("initial_cost"), cost("final_cost")];
    format!("{:<24} {status:<11} {triangles:>11} {initial:>12} {last:>12} {time:>11}", line.name)
}

/// A folder for each scene: the name of its file without extensions. Those who would share one all have a hash of their path, too, so that no name depends on
/// the order of the scenes.
///
/// # Errors
/// If two have the same name even so.
fn folder_names(scenes: &[Named]) -> anyhow::Result<Vec<String>> {
    // File systems may not tell capital letters from small ones.
    let key = |name: &str| name.to_lowercase();
    let mut sharing: HashMap<String, usize> = HashMap::from([(key(SUMMARY), 1)]);
    let stems: Vec<String> = scenes.iter().map(|scene| stem(&scene.path)).collect();
    for stem in &stems {
        *sharing.entry(key(stem)).or_default() += 1;
    }
    let name = |(scene, stem): (&Named, String)| {
        if sharing[&key(&stem)] == 1 {
            return stem;
        }
        let hash = blake3::hash(scene.path.as_os_str().as_encoded_bytes()).to_hex();
        format!("{stem}-{}", &hash[..8])
    };
    let names: Vec<String> = scenes.iter().zip(stems).map(name).collect();
    let mut taken = HashSet::new();
    for (name, scene) in names.iter().zip(scenes) {
        anyhow::ensure!(taken.insert(key(name)), "{}: another scene has the folder {name}, too", scene.path.display());
    }
    Ok(names)
}

fn stem(path: &Path) -> String {
    let name = scene::name_of(path);
    // These are other folders.
    if matches!(&*name, "" | "." | "..") { "scene".to_owned() } else { name }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(paths: &[&str]) -> Vec<String> {
        let scenes: Vec<Named> =
            paths.iter().map(|path| Named { path: path.into(), triangles: None, read: Default::default() }).collect();
        folder_names(&scenes).unwrap()
    }

    #[test]
    fn a_folder_has_the_name_of_the_file() {
        let paths = ["a/chair.obj", "table.v2.PLY.xz", "built-in", "-", "lamp.glb.gz", "a/...obj"];
        assert_eq!(names(&paths), ["chair", "table.v2", "built-in", "stdin", "lamp", "scene"]);
    }

    #[test]
    fn who_would_share_a_name_has_one_that_the_order_does_not_change() {
        let one = names(&["a/chair.obj", "b/Chair.obj", "c.obj"]);
        let other = names(&["c.obj", "b/Chair.obj", "a/chair.obj"]);
        assert!(one[0].starts_with("chair-") && one[1].starts_with("Chair-") && one[0].len() == 14, "{one:?}");
        assert_ne!(one[0][6..], one[1][6..]);
        assert_eq!((&one[0], &one[1], &one[2]), (&other[2], &other[1], &other[0]));
        assert!(names(&["summary.jsonl.obj"])[0].starts_with("summary.jsonl-"), "that is a file of the same folder");
    }

    #[test]
    fn failed_scenes_are_all_told_at_the_end() {
        let failed = |scene: &str, error: &str| Line::failed(scene.into(), String::new(), error.into());
        assert!(conclude(&[], 0).is_ok());
        let lines = [failed("a.obj", "a.obj: no such file"), failed("b.obj", "no memory")];
        let error = conclude(&lines, 3).unwrap_err().to_string();
        assert_eq!(error, "2 of 3 scenes failed:\n  a.obj: no such file\n  b.obj: no memory");
    }
}
