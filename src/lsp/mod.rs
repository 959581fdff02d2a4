//! The language server: what an editor asks of a design, answered from its tree.
//!
//! Every answer is a pure function of texts and a place (`hover`, `complete`, `names`, …) in bytes; `server` alone knows
//! the protocol, and `text` alone counts in UTF-16. Files and folders come in through [`Host`].

pub mod answers;
pub mod complete;
pub mod edits;
mod findings;
pub mod hints;
pub mod hover;
pub mod names;
pub mod outline;
mod requests;
pub mod server;
pub mod signature;
pub mod space;
pub mod text;
pub mod tokens;
mod uri;
mod vocabulary;

use crate::elaborate::FileError;

/// The world outside of the server: disk and folders.
pub trait Host: Send + Sync {
    /// The text of a file on the disk: `path` is relative to `folder`, which links may not leave.
    ///
    /// # Errors
    /// Why it could not be read.
    fn read(&self, folder: &str, path: &str) -> Result<String, FileError>;

    /// `.mech` files of a folder and its folders, absolute, sorted.
    fn list(&self, folder: &str) -> Vec<String>;

    /// Where an editor can read a file of the standard library, such as `materials/rigur.mech`.
    fn library(&self, module: &str) -> Option<String>;
}
