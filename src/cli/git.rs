//! Files of a git revision, read by git itself.

use super::sources::MOST_BYTES;
use flexura::pipeline::{FileError, Files, MOST_SOLID_BYTES, SolidFile};
use std::path::{Component, Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

/// Newest commits that are looked at for a file's content.
const MOST_COMMITS: &str = "-n100";

/// A folder as it was in a revision.
#[derive(Clone, Debug)]
pub struct Revision {
    /// Where git is run: somewhere in the repository.
    at: PathBuf,
    /// The revision; empty for the index.
    rev: String,
    /// Relative to the top of the repository, with `/` at its end unless empty. It may begin with `./` (relative to
    /// where git is run).
    folder: String,
}

/// What git answers, or what it complains about.
fn ask(at: &Path, arguments: &[&str]) -> Result<Vec<u8>, String> {
    let git = Command::new("git").arg("-C").arg(at).args(arguments).stdin(Stdio::null()).output();
    let output = git.map_err(|e| format!("git cannot be run: {e}"))?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let last = said.lines().rev().find(|l| !l.trim().is_empty()).unwrap_or("git failed");
    Err(last.trim_start_matches("fatal: ").to_string())
}

fn ask_line(at: &Path, arguments: &[&str]) -> Result<String, String> {
    let text = String::from_utf8(ask(at, arguments)?).map_err(|_| "git answers with no text".to_string())?;
    Ok(text.trim_end().to_string())
}

impl Revision {
    /// The folder of `path` in `rev`, and the file's name in it. `path` counts as in `git show REV:PATH`.
    pub fn of(at: &Path, rev: &str, path: &str) -> Result<(Self, String), String> {
        if rev.starts_with('-') || path.starts_with('/') || path.split('/').any(|part| part == "..") {
            return Err(format!("`{rev}:{path}` is no file of a revision"));
        }
        let (folder, name) = match path.rsplit_once('/') {
            Some((folder, name)) => (format!("{folder}/"), name),
            None => (String::new(), path),
        };
        Ok((Self { at: at.to_path_buf(), rev: rev.to_string(), folder }, name.to_string()))
    }

    /// The same file as on the disk, in `rev`.
    pub fn of_file(file: &Path, rev: &str) -> Result<(Self, String), String> {
        let folder = match file.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let name = file.file_name().and_then(|n| n.to_str()).ok_or("its name is not UTF-8 text")?;
        let prefix = ask_line(folder, &["rev-parse", "--show-prefix"])?;
        Self::of(folder, rev, &format!("{prefix}{name}"))
    }

    /// A revision that holds this content (its object's name) at a path relative to the top, and the file's name. The
    /// index and the newest commit are looked at first: with `newest`, in this order.
    pub fn holding(path: &str, object: &str, newest: bool) -> Option<(Self, String)> {
        let at = Path::new(".");
        let has = |rev: &str| {
            let name = format!("{rev}:{path}");
            ask_line(at, &["rev-parse", "--verify", "--quiet", &name]).is_ok_and(|o| o.starts_with(object))
        };
        if object.is_empty() || !object.bytes().all(|b| b.is_ascii_hexdigit()) {
            return None;
        }
        let near = if newest { ["", "HEAD"] } else { ["HEAD", ""] };
        if let Some(rev) = near.into_iter().find(|rev| has(rev)) {
            return Self::of(at, rev, path).ok();
        }
        let found = format!("--find-object={object}");
        let commits =
            ask_line(at, &["log", "--all", "--format=%H", MOST_COMMITS, &found, "--", path]).ok()?;
        let rev = commits.lines().find(|rev| has(rev))?.to_string();
        Self::of(at, &rev, path).ok()
    }
}

impl Revision {
    /// Bytes of a file, at most so many.
    fn bytes(&self, path: &str, most: u64) -> Result<Vec<u8>, FileError> {
        if !Path::new(path).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir)) {
            return Err(FileError::Outside);
        }
        let name = format!("{}:{}{path}", self.rev, self.folder);
        let Ok(size) = ask_line(&self.at, &["cat-file", "-s", &name]) else {
            // Git says the same of a revision that does not exist: that is worth telling.
            let known = self.rev.is_empty()
                || ask(&self.at, &["rev-parse", "--verify", "--quiet", &format!("{}^{{tree}}", self.rev)])
                    .is_ok();
            let why = format!("there is no revision `{}` in this repository", self.rev);
            return Err(if known { FileError::NotFound } else { FileError::Other(why) });
        };
        if size.parse::<u64>().is_ok_and(|bytes| bytes > most) {
            return Err(FileError::TooLarge);
        }
        ask(&self.at, &["cat-file", "blob", &name]).map_err(FileError::Other)
    }
}

impl Files for Revision {
    fn read(&self, path: &str) -> Result<String, FileError> {
        String::from_utf8(self.bytes(path, MOST_BYTES)?).map_err(|_| FileError::NotText)
    }

    fn solid(&self, path: &str) -> Result<Arc<SolidFile>, FileError> {
        Ok(Arc::new(SolidFile::new(self.bytes(path, MOST_SOLID_BYTES as u64)?)))
    }
}
