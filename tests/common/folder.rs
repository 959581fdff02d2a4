//! A folder of the disk as the files of a design; benches use it too.

use flexura::elaborate::{FileError, Files, SolidFile};
use std::path::PathBuf;
use std::sync::Arc;

pub struct Folder(pub PathBuf);

impl Files for Folder {
    fn read(&self, path: &str) -> Result<String, FileError> {
        std::fs::read_to_string(self.0.join(path)).map_err(|_| FileError::NotFound)
    }

    fn solid(&self, path: &str) -> Result<Arc<SolidFile>, FileError> {
        let bytes = std::fs::read(self.0.join(path)).map_err(|_| FileError::NotFound)?;
        Ok(Arc::new(SolidFile::new(bytes)))
    }
}
