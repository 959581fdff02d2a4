//! Writing to the disk: whole files or none (a temporary file beside the target, then a rename), and only
//! below the folder that was asked for.

use flexura::pipeline::Made;
use std::fmt;
use std::io::Write;
use std::path::{Component, Path, PathBuf};

/// Why a file was not written.
#[derive(Debug)]
pub struct WriteError {
    path: PathBuf,
    reason: String,
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cannot write `{}`: {}", self.path.display(), self.reason)
    }
}

/// Where `name` (relative, with `/`) lies below `folder`.
fn below(folder: &Path, name: &str) -> Option<PathBuf> {
    let plain = Path::new(name).components().all(|c| matches!(c, Component::Normal(_)));
    (plain && !name.is_empty()).then(|| folder.join(name))
}

/// Writes `name` (relative, with `/`) below `folder`; returns its path. A file that holds these bytes already is left
/// alone.
pub fn write_below(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, WriteError> {
    let Some(path) = below(folder, name) else {
        let path = folder.join(name);
        return Err(WriteError { path, reason: "it would lie outside the output folder".into() });
    };
    if read_regular(&path).is_none_or(|old| old != bytes) {
        write_atomic(&path, bytes)?;
    }
    Ok(path)
}

/// The output folder, as what was made there before.
pub struct Output<'a>(pub &'a Path);

impl Made for Output<'_> {
    fn read(&self, name: &str) -> Option<Vec<u8>> {
        read_regular(&below(self.0, name)?)
    }
}

/// The bytes of a regular file: what is linked from elsewhere was not made here, and a pipe could block for ever.
fn read_regular(path: &Path) -> Option<Vec<u8>> {
    let regular = path.symlink_metadata().is_ok_and(|m| m.is_file());
    if regular { std::fs::read(path).ok() } else { None }
}

/// Writes a whole file or leaves the old one.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let failed = |e: std::io::Error| WriteError { path: path.into(), reason: e.to_string() };
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(folder).map_err(failed)?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(".flexura-").suffix(".tmp");
    // Temporary files are private by default; what is made is as readable as any other file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644));
    let mut file = builder.tempfile_in(folder).map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    file.persist(path).map_err(|e| failed(e.error))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writes_only_below_the_folder() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let path = write_below(&out, "sketch/sketch.ino", b"text").unwrap();
        assert_eq!(std::fs::read(path).unwrap(), b"text");
        for name in ["../up", "/abs", "a/../../b", "", "."] {
            assert!(write_below(&out, name, b"no").is_err(), "{name}");
        }
        assert!(!dir.path().join("up").exists());
    }

    #[test]
    fn replaces_a_file_and_leaves_nothing_beside_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.lock");
        write_atomic(&path, b"one").unwrap();
        write_atomic(&path, b"two").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"two");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }
}
