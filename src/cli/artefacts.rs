//! Writing to the disk: whole files or none (a temporary file beside the target, then a rename), and only
//! below the folder that was asked for.

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

/// Writes `name` (relative, with `/`) below `folder`; returns its path.
pub fn write_below(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, WriteError> {
    let relative = Path::new(name);
    let path = folder.join(relative);
    let plain = relative.components().all(|c| matches!(c, Component::Normal(_)));
    if !plain || name.is_empty() {
        return Err(WriteError { path, reason: "it would lie outside the output folder".into() });
    }
    write_atomic(&path, bytes)?;
    Ok(path)
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
