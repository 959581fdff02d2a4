//! The files of a design as they were at one moment: what is read once stays so for this run, however often an editor saves
//! meanwhile, and what was read is what is watched.

use super::super::sources::{self, Folder};
use flexura::pipeline::{FileError, Files, SolidFile};
use sha2::Digest;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// A file that a run depends on, with the digest of what was read; none: it was not there or not to be read.
pub type Input = (PathBuf, Option<Vec<u8>>);

/// See the module.
pub struct Snapshot {
    folder: Folder,
    texts: Mutex<BTreeMap<String, Result<String, FileError>>>,
    solids: Mutex<BTreeMap<String, Solid>>,
}

/// A solid's file, with the digest by which its change is noticed.
type Solid = (Result<Arc<SolidFile>, FileError>, Option<Vec<u8>>);

impl Snapshot {
    /// Of a folder, nothing read yet.
    pub fn of(folder: Folder) -> Self {
        Self { folder, texts: Mutex::default(), solids: Mutex::default() }
    }

    /// What has been read.
    pub fn inputs(&self) -> Vec<Input> {
        let texts = self.texts.lock().unwrap_or_else(PoisonError::into_inner);
        let input = |(name, text): (&String, &Result<String, FileError>)| {
            let path = self.folder.root().join(name);
            let digest = match text {
                Ok(text) => Some(sha2::Sha256::digest(text.as_bytes()).to_vec()),
                Err(FileError::NotFound) => None,
                Err(_) => sources::digest_of(&path),
            };
            (path, digest)
        };
        let solids = self.solids.lock().unwrap_or_else(PoisonError::into_inner);
        let solids = solids.iter().map(|(name, (_, digest))| (self.folder.root().join(name), digest.clone()));
        texts.iter().map(input).chain(solids).collect()
    }
}

impl Files for Snapshot {
    fn read(&self, path: &str) -> Result<String, FileError> {
        let mut texts = self.texts.lock().unwrap_or_else(PoisonError::into_inner);
        texts.entry(path.to_string()).or_insert_with(|| self.folder.read(path)).clone()
    }

    fn solid(&self, path: &str) -> Result<Arc<SolidFile>, FileError> {
        let mut solids = self.solids.lock().unwrap_or_else(PoisonError::into_inner);
        let read = || {
            // A file that changes meanwhile differs from this digest, and is read once more.
            let digest = sources::digest_of(&self.folder.root().join(path));
            (self.folder.solid(path), digest)
        };
        solids.entry(path.to_string()).or_insert_with(read).0.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_sees_one_state_of_the_files() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.mech");
        std::fs::write(&path, "old").unwrap();
        let (folder, _) = Folder::of(&path).unwrap();
        let files = Snapshot::of(folder);
        assert_eq!(files.read("a.mech"), Ok("old".into()));
        std::fs::write(&path, "new").unwrap();
        assert_eq!(files.read("a.mech"), Ok("old".into()));
        assert_eq!(files.read("b.mech"), Err(FileError::NotFound));
        assert_eq!(files.read("../c.mech"), Err(FileError::Outside));
        let inputs = files.inputs();
        let changed: Vec<bool> = inputs.iter().map(|(p, d)| sources::digest_of(p) != *d).collect();
        // `../c.mech` is never read, `a.mech` has changed, `b.mech` is still missing.
        assert_eq!(changed.iter().filter(|c| **c).count(), 1, "{inputs:?}");
    }
}
