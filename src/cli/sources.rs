//! Reading from the disk: only text files below the design's own folder, and not without limit.

use flexura::pipeline::{FileError, Files, MOST_SOLID_BYTES, SolidFile};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime};

/// Largest file read, bytes. The sample designs have about 3 kB, their locks less.
pub const MOST_BYTES: u64 = 4 << 20;

/// The files below one folder.
pub struct Folder {
    root: PathBuf,
}

impl Folder {
    /// The folder of a source, and the source's name in it.
    pub fn of(source: &Path) -> Result<(Self, String), FileError> {
        // What is missing may come.
        let path = source.canonicalize().inspect_err(|_| note(source)).map_err(|e| reason(&e))?;
        let name = path.file_name().and_then(|n| n.to_str()).ok_or_else(not_a_name)?.to_string();
        let root = path.parent().ok_or_else(not_a_name)?.to_path_buf();
        Ok((Self { root }, name))
    }

    /// A folder by its path.
    pub fn at(folder: &Path) -> Result<Self, FileError> {
        Ok(Self { root: folder.canonicalize().map_err(|e| reason(&e))? })
    }

    /// The folder itself, without symbolic links.
    pub fn root(&self) -> &Path {
        &self.root
    }
}

impl Folder {
    /// Where a file is, if it is below the folder.
    fn below(&self, path: &str) -> Result<PathBuf, FileError> {
        let relative = Path::new(path);
        if !relative.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir)) {
            return Err(FileError::Outside);
        }
        let full = self.root.join(relative);
        // What is missing may come.
        let full = full.canonicalize().inspect_err(|_| note(&full)).map_err(|e| reason(&e))?;
        if !full.starts_with(&self.root) {
            return Err(FileError::Outside);
        }
        Ok(full)
    }
}

impl Files for Folder {
    fn read(&self, path: &str) -> Result<String, FileError> {
        read_text(&self.below(path)?)
    }

    fn solid(&self, path: &str) -> Result<Arc<SolidFile>, FileError> {
        let full = self.below(path)?;
        let read = read_solid(&full);
        note(&full);
        read
    }
}

/// Files of solids that have been read, by path, with their length and time at that moment.
static SOLIDS: Mutex<BTreeMap<PathBuf, Seen>> = Mutex::new(BTreeMap::new());
/// Length and time of a file, and what was in it.
type Seen = (u64, SystemTime, Arc<SolidFile>);
/// A file that was written less than this before it was read may be written once more at the same time of its system's clock.
const SETTLED: Duration = Duration::from_secs(2);

/// The file of a solid: the one that was read before where neither its length nor its time have changed.
fn read_solid(path: &Path) -> Result<Arc<SolidFile>, FileError> {
    let found = path.metadata().map_err(|e| reason(&e))?;
    if !found.is_file() {
        return Err(FileError::Other("it is not a file".into()));
    }
    let (length, time) = (found.len(), found.modified().unwrap_or(SystemTime::UNIX_EPOCH));
    let mut solids = SOLIDS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, _, known)) = solids.get(path).filter(|(l, t, _)| (*l, *t) == (length, time)) {
        return Ok(known.clone());
    }
    let most = MOST_SOLID_BYTES as u64;
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|e| reason(&e))?;
    file.take(most + 1).read_to_end(&mut bytes).map_err(|e| reason(&e))?;
    if bytes.len() as u64 > most {
        return Err(FileError::TooLarge);
    }
    let read = Arc::new(SolidFile::new(bytes));
    if SystemTime::now().duration_since(time).is_ok_and(|age| age > SETTLED) {
        solids.insert(path.to_path_buf(), (length, time, read.clone()));
    } else {
        solids.remove(path);
    }
    Ok(read)
}

/// Text of a file, if it is a file, text, and not too large. (A pipe could block for ever.)
pub fn read_text(path: &Path) -> Result<String, FileError> {
    let read = read_unseen(path);
    note(path);
    read
}

/// What has been read since [`forget`], or looked for in vain: absolute paths and digests.
static SEEN: Mutex<BTreeMap<PathBuf, Option<Vec<u8>>>> = Mutex::new(BTreeMap::new());

fn note(path: &Path) {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf());
    let digest = digest_of(&absolute);
    SEEN.lock().unwrap_or_else(PoisonError::into_inner).entry(absolute).or_insert(digest);
}

/// Files read since the last [`forget`], by path, with their digests at that time.
pub fn seen() -> Vec<(PathBuf, Option<Vec<u8>>)> {
    let seen = SEEN.lock().unwrap_or_else(PoisonError::into_inner);
    seen.iter().map(|(path, digest)| (path.clone(), digest.clone())).collect()
}

/// Begins anew.
pub fn forget() {
    SEEN.lock().unwrap_or_else(PoisonError::into_inner).clear();
}

/// Digest of a regular file; none where there is none. Of a large one, which only a solid's may be, that of its length and time: it
/// is asked for every few seconds.
pub fn digest_of(path: &Path) -> Option<Vec<u8>> {
    use sha2::Digest;
    let found = path.metadata().ok().filter(|m| m.is_file() && m.len() <= MOST_SOLID_BYTES as u64)?;
    if found.len() > MOST_BYTES {
        let time = found.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
        return Some(sha2::Sha256::digest(format!("{} {}", found.len(), time.as_nanos())).to_vec());
    }
    Some(sha2::Sha256::digest(std::fs::read(path).ok()?).to_vec())
}

fn read_unseen(path: &Path) -> Result<String, FileError> {
    if !path.metadata().map_err(|e| reason(&e))?.is_file() {
        return Err(FileError::Other("it is not a file".into()));
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|e| reason(&e))?;
    file.take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(|e| reason(&e))?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(FileError::Other(format!("it is larger than {} MiB", MOST_BYTES >> 20)));
    }
    String::from_utf8(bytes).map_err(|_| FileError::NotText)
}

fn reason(error: &std::io::Error) -> FileError {
    match error.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => FileError::NotFound,
        _ => FileError::Other(error.to_string()),
    }
}

fn not_a_name() -> FileError {
    FileError::Other("its name is not UTF-8 text".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_only_below_its_folder() {
        let outer = tempfile::tempdir().unwrap();
        let inner = outer.path().join("inner");
        std::fs::create_dir_all(inner.join("parts")).unwrap();
        std::fs::write(outer.path().join("secret.mech"), "no").unwrap();
        std::fs::write(inner.join("a.mech"), "yes").unwrap();
        std::fs::write(inner.join("parts/b.mech"), "also").unwrap();
        std::fs::write(inner.join("bytes.mech"), [0xff, 0xfe]).unwrap();
        let (folder, name) = Folder::of(&inner.join("a.mech")).unwrap();
        assert_eq!(name, "a.mech");
        assert_eq!(folder.read("a.mech").unwrap(), "yes");
        assert_eq!(folder.read("parts/b.mech").unwrap(), "also");
        assert_eq!(folder.read("../secret.mech"), Err(FileError::Outside));
        assert_eq!(folder.read("parts/../../secret.mech"), Err(FileError::Outside));
        let absolute = outer.path().join("secret.mech");
        assert_eq!(folder.read(absolute.to_str().unwrap()), Err(FileError::Outside));
        assert_eq!(folder.read("none.mech"), Err(FileError::NotFound));
        assert_eq!(folder.read("bytes.mech"), Err(FileError::NotText));
        assert!(matches!(folder.read("parts"), Err(FileError::Other(_))));
    }

    #[cfg(unix)]
    #[test]
    fn follows_no_link_out_of_its_folder() {
        let outer = tempfile::tempdir().unwrap();
        let inner = outer.path().join("inner");
        std::fs::create_dir(&inner).unwrap();
        std::fs::write(inner.join("a.mech"), "yes").unwrap();
        std::fs::write(outer.path().join("secret.mech"), "no").unwrap();
        std::os::unix::fs::symlink("../secret.mech", inner.join("link.mech")).unwrap();
        let (folder, _) = Folder::of(&inner.join("a.mech")).unwrap();
        assert_eq!(folder.read("link.mech"), Err(FileError::Outside));
    }

    #[test]
    fn a_solid_is_read_once_while_its_file_is_the_same() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.stl");
        let long_ago = |seconds: u64| SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000_000 + seconds);
        let write = |text: &str, time: Option<SystemTime>| {
            std::fs::write(&path, text).unwrap();
            let file = File::options().write(true).open(&path).unwrap();
            time.into_iter().for_each(|t| file.set_modified(t).unwrap());
        };
        let folder = Folder::at(dir.path()).unwrap();
        let read = || folder.solid("a.stl").unwrap();
        write("old", Some(long_ago(0)));
        let first = read();
        assert!(Arc::ptr_eq(&first, &read()));
        write("new", Some(long_ago(1)));
        assert!(!Arc::ptr_eq(&first, &read()));
        // What has only just been written may be written once more at what the system takes for the same time.
        write("now", None);
        assert!(!Arc::ptr_eq(&read(), &read()));
        assert_eq!(folder.solid("../a.stl").err(), Some(FileError::Outside));
        assert_eq!(folder.solid("b.stl").err(), Some(FileError::NotFound));
    }

    #[test]
    fn refuses_what_is_too_large() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("large.mech");
        std::fs::write(&path, vec![b' '; MOST_BYTES as usize + 1]).unwrap();
        assert_eq!(read_text(&path), Err(FileError::Other("it is larger than 4 MiB".into())));
    }
}
