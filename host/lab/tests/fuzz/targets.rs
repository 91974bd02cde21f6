//! What is fuzzed, and what must hold of it.

use peak_alloc::PeakAlloc;
use prbvh::bvh::{Bvh, file, validate};
use prbvh::scene::{LoadOptions, Scene, SceneError, load, load_with};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Memory is counted for the whole process, so one case runs at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// Extension and content of a file.
pub(crate) type Bytes = (&'static str, Vec<u8>);

/// The reader's error, or what is wrong with what it read.
pub(crate) type Outcome = Result<Result<(), String>, String>;

/// A reader of files.
pub(crate) struct Target {
    /// Its folder in the corpus.
    pub(crate) name: &'static str,
    /// What its files end with, the longest first.
    pub(crate) extensions: &'static [&'static str],
    /// Bytes of memory that it may take whatever the file.
    pub(crate) bound: usize,
    pub(crate) read: fn(&Path) -> Outcome,
}

/// Bytes of memory for each byte of a file. A corner of an OBJ polygon is 2 bytes and makes a triangle of 36 beside three indices, in
/// vectors that double while they grow.
const BYTES_PER_BYTE: usize = 256;

/// Buffers of readers, and what other threads of the tests hold meanwhile.
const FLAT: usize = 4 << 20;

/// Characters of the longest message.
const MESSAGE: usize = 2000;

pub(crate) const FILES: &[Target] = &[
    Target { name: "obj", extensions: &["obj"], bound: FLAT, read: scene },
    Target { name: "ply", extensions: &["ply"], bound: FLAT, read: scene },
    Target { name: "stl", extensions: &["stl"], bound: FLAT, read: scene },
    // Accessors without data are zeros, up to 2^19 of them.
    Target { name: "gltf", extensions: &["gltf", "glb"], bound: FLAT + (64 << 20), read: scene },
    // Told by their content; among them what xz may ask for by its header.
    Target { name: "content", extensions: &["model"], bound: FLAT + (513 << 20), read: scene },
    // What xz may ask for by its header.
    Target {
        name: "packed",
        extensions: &["obj.xz", "obj.gz", "obj.zst", "glb.gz"],
        bound: FLAT + (513 << 20),
        read: scene,
    },
    Target { name: "tree", extensions: &["bvh"], bound: FLAT, read: tree },
];

impl Target {
    pub(crate) fn named(name: &str) -> &'static Self {
        FILES.iter().find(|target| target.name == name).unwrap()
    }

    /// Reads a file of these bytes; says which property does not hold.
    pub(crate) fn check(&self, (extension, bytes): &Bytes) -> Result<(), String> {
        let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        let path = self.path(extension);
        std::fs::write(&path, bytes).map_err(|error| format!("{}: {error}", path.display()))?;
        MEMORY.reset_peak_usage();
        let before = MEMORY.current_usage();
        let outcome = catch_unwind(AssertUnwindSafe(|| (self.read)(&path)));
        let taken = MEMORY.peak_usage().saturating_sub(before);
        let kept = || format!("; {} bytes at {}, for tests/corpus/{}", bytes.len(), path.display(), self.name);

        // Before its memory: the text of a panic takes some.
        let outcome = outcome.map_err(|panic| format!("panic: {}{}", text_of(&*panic), kept()))?;
        let most = self.bound + BYTES_PER_BYTE * bytes.len();
        if taken > most {
            let fault = format!("{taken} bytes of memory for a file of {} bytes, {most} are allowed", bytes.len());
            return Err(fault + &kept());
        }
        match outcome {
            Ok(Ok(())) => Ok(()),
            Ok(Err(fault)) => Err(format!("invalid result: {fault}{}", kept())),
            Err(message) if !message.contains(&*path.to_string_lossy()) => {
                Err(format!("the error does not name the file: {message}{}", kept()))
            }
            Err(message) if message.chars().count() > MESSAGE => {
                Err(format!("an error of {} characters{}", message.chars().count(), kept()))
            }
            Err(_) => Ok(()),
        }
    }

    /// A fixed place, so that the input of a run that was aborted is still there.
    fn path(&self, extension: &str) -> PathBuf {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz").join(std::process::id().to_string());
        std::fs::create_dir_all(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        folder.join(format!("{}.{extension}", self.name))
    }
}

/// What a panic said.
pub(crate) fn text_of(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().cloned();
    text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned())).unwrap_or_default()
}

fn scene(path: &Path) -> Outcome {
    let scene = load(path).map_err(|error| error.to_string())?;
    match load_with(path, &LoadOptions::default().with(|s| s.strict = true)) {
        Ok(_) if scene.notes.is_empty() => {}
        Err(SceneError::NotWhole { notes, .. }) if !notes.is_empty() && notes == scene.notes => {}
        other => return Ok(Err(format!("{:?}, but strictly {other:?}", scene.notes))),
    }
    // What comes from a file is what a library's user may bring.
    let screened = Scene::from_triangles("again", scene.triangles).map_err(|error| error.to_string());
    Ok(screened.and_then(|again| if again.hash == scene.hash { Ok(()) } else { Err("another hash".to_owned()) }))
}

fn tree(path: &Path) -> Outcome {
    let read = file::read(path).map_err(|error| error.to_string())?;
    Ok(written_again(&read.tree, &read.scene_hash))
}

/// A tree that was read can be written, and is the same when read again; to look at its boxes does not panic.
fn written_again(tree: &Bvh, scene_hash: &str) -> Result<(), String> {
    // Not beside the input, which may be of the corpus.
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let copy = folder.path().join("copy.bvh");
    file::write(&copy, tree, scene_hash).map_err(|error| error.to_string())?;
    let again = file::read(&copy).map_err(|error| error.to_string())?.tree;
    // Boxes may hold NaN, which is unequal to itself.
    if format!("{again:?}") != format!("{tree:?}") {
        return Err("it is another tree when it is written and read again".to_owned());
    }
    // Either answer is right.
    let _ = validate(tree, None);
    Ok(())
}
