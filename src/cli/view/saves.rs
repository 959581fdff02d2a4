//! Notices saves. What counts is the bytes of the files that the last run has read or looked for.

use super::super::{interrupt, render, sources};
use super::engine::Engine;
use super::files::Input;
use flexura::diagnostic::{Severity, SourceMap};
use flexura::pipeline::placeless;
use notify::{RecursiveMode, Watcher};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// How often Ctrl-C is looked for.
const TICK: Duration = Duration::from_millis(100);
/// Editors write in several steps: what comes within this time is one change …
const SETTLE: Duration = Duration::from_millis(30);
/// … but who writes without end is followed at this pace.
const LONGEST: Duration = Duration::from_millis(250);
/// A file that is empty or gone is probably being written: it is given this long.
const WRITTEN: Duration = Duration::from_millis(200);
/// Some file systems tell nothing: files are looked at this often in any case.
const LOOK: Duration = Duration::from_secs(1);

/// Tells the engine of every change until Ctrl-C.
pub fn watch(engine: &Engine, source: &Path) {
    let (sender, events) = channel();
    let mut watcher = notify::recommended_watcher(move |_| {
        let _ = sender.send(());
    })
    .inspect_err(|e| {
        let d = placeless(Severity::Warning, "W0753", format!("the system cannot watch files: {e}"));
        render::show(&[d.help("they are looked at every second")], &SourceMap::default());
    })
    .ok();
    let mut folders: BTreeSet<PathBuf> = BTreeSet::new();
    let mut told: Vec<Input> = Vec::new();
    let mut looked = Instant::now();
    while !interrupt::happened() {
        let mut inputs = engine.inputs();
        if inputs.iter().all(|i| i.0 != source) && inputs.is_empty() {
            inputs.push((source.to_path_buf(), sources::digest_of(source)));
        }
        if let Some(watcher) = &mut watcher {
            let new: Vec<PathBuf> =
                inputs.iter().filter_map(|i| existing(&i.0)).filter(|f| !folders.contains(f)).collect();
            for folder in new {
                let _ = watcher.watch(&folder, RecursiveMode::NonRecursive);
                folders.insert(folder);
            }
        }
        match events.recv_timeout(TICK) {
            Ok(()) => {
                let began = Instant::now();
                while began.elapsed() < LONGEST && events.recv_timeout(SETTLE).is_ok() {}
            }
            Err(RecvTimeoutError::Timeout) if looked.elapsed() < LOOK => continue,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(LOOK),
        }
        looked = Instant::now();
        let began = Instant::now();
        let mut changed = differing(&engine.inputs());
        while changed.iter().any(|(path, _)| is_empty(path)) && began.elapsed() < WRITTEN {
            std::thread::sleep(SETTLE);
            changed = differing(&engine.inputs());
        }
        // The run may not have read what has been told already.
        if !changed.is_empty() && changed != told {
            engine.saved();
        }
        told = changed;
    }
}

/// Inputs that are no longer what was read, as they are now.
fn differing(inputs: &[Input]) -> Vec<Input> {
    let now = |(path, old): &Input| {
        let now = sources::digest_of(path);
        (now != *old).then(|| (path.clone(), now))
    };
    inputs.iter().filter_map(now).collect()
}

fn is_empty(path: &Path) -> bool {
    path.metadata().map_or(true, |m| m.len() == 0)
}

/// The nearest folder that exists.
fn existing(path: &Path) -> Option<PathBuf> {
    path.ancestors().skip(1).find(|p| p.is_dir()).map(Path::to_path_buf)
}
