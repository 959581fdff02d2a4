//! `--watch`: does it again whenever something it read has changed.
//!
//! What counts is the bytes of the files that the last run read (or looked for in vain): an editor that writes a file
//! anew without a change, and what the run itself writes, set off nothing.

use super::interrupt;
use super::manners::Manners;
use super::render::{self, tell};
use super::sources;
use flexura::diagnostic::{Severity, SourceMap};
use flexura::pipeline::placeless;
use notify::{RecursiveMode, Watcher};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// Editors write in several steps: what comes within this time is one change.
const SETTLE: Duration = Duration::from_millis(60);
/// Some file systems tell nothing: files are looked at this often in any case.
const LOOK: Duration = Duration::from_secs(2);

/// Runs until Ctrl-C; returns the last exit code if watching ends otherwise.
pub fn watch(run: impl Fn() -> u8) -> u8 {
    let (sender, events) = channel();
    // It matters only that something happened.
    let mut watcher = notify::recommended_watcher(move |_| {
        let _ = sender.send(());
    })
    .inspect_err(|e| {
        let d = placeless(Severity::Warning, "W0753", format!("the system cannot watch files: {e}"));
        render::show(&[d.help("they are looked at every two seconds")], &SourceMap::default());
    })
    .ok();
    let mut folders = BTreeSet::new();
    loop {
        sources::forget();
        let code = run();
        interrupt::over();
        if interrupt::happened() {
            return code;
        }
        let read = inputs();
        if let Some(watcher) = &mut watcher {
            for folder in read.iter().filter_map(|(path, _)| existing(path)) {
                if folders.insert(folder.clone()) {
                    let _ = watcher.watch(&folder, RecursiveMode::NonRecursive);
                }
            }
        }
        if !Manners::chosen().quiet {
            tell(&format!("watching {} files; Ctrl-C ends\n", read.len()));
        }
        let changed = wait(&events, &read);
        if !Manners::chosen().quiet {
            tell(&format!("\n{} has changed\n", changed.display()));
        }
    }
}

/// What the run read, but for locks: these it writes itself.
fn inputs() -> Vec<(PathBuf, Option<Vec<u8>>)> {
    sources::seen().into_iter().filter(|(p, _)| p.extension().is_none_or(|e| e != "lock")).collect()
}

/// The nearest folder that exists.
fn existing(path: &Path) -> Option<PathBuf> {
    path.ancestors().skip(1).find(|p| p.is_dir()).map(Path::to_path_buf)
}

/// Waits until a file differs from what was read, and has settled.
fn wait(events: &Receiver<()>, read: &[(PathBuf, Option<Vec<u8>>)]) -> PathBuf {
    loop {
        match events.recv_timeout(LOOK) {
            Ok(()) => while events.recv_timeout(SETTLE).is_ok() {},
            Err(RecvTimeoutError::Timeout) => {}
            // Without a watcher the channel is closed.
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(LOOK),
        }
        let differs = |(path, old): &&(PathBuf, Option<Vec<u8>>)| sources::digest_of(path) != *old;
        if let Some((path, _)) = read.iter().find(differs) {
            return path.clone();
        }
    }
}
