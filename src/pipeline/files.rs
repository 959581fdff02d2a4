//! How the core reads: through a trait, never from the disk.

use std::fmt;

/// Why a file was not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileError {
    /// There is none.
    NotFound,
    /// It lies outside the design's folder.
    Outside,
    /// It is not text.
    NotText,
    /// Anything else.
    Other(String),
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFound => write!(f, "the file does not exist"),
            Self::Outside => write!(f, "it leads out of the design's folder"),
            Self::NotText => write!(f, "it is not UTF-8 text"),
            Self::Other(why) => write!(f, "{why}"),
        }
    }
}

impl std::error::Error for FileError {}

/// Reads the files of a design by their path relative to its folder, with `/`.
pub trait Files {
    /// Text of a file.
    ///
    /// # Errors
    /// Why it cannot be read.
    fn read(&self, path: &str) -> Result<String, FileError>;
}
