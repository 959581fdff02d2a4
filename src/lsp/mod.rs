//! The language server: what an editor asks of a design, answered from its tree.
//!
//! Every answer is a pure function of texts and a place (`hover`, `complete`, `names`, …) in bytes; `server` alone knows
//! the protocol, and `text` alone counts in UTF-16. Files, folders and processes come in through [`Host`]: what takes
//! seconds is done by the command itself, beside the server.

mod actions;
pub mod answers;
pub mod apply;
mod changes;
mod commands;
pub mod complete;
pub mod edits;
mod findings;
pub mod hints;
pub mod hover;
pub mod names;
mod offers;
pub mod outline;
mod requests;
mod running;
pub mod server;
mod shown;
pub mod signature;
mod solver;
pub mod space;
pub mod text;
pub mod tokens;
mod uri;
mod vocabulary;

use crate::elaborate::{FileError, SolidFile};
use crate::lint::Levels;
pub use running::Event;
pub use solver::solve;
use std::sync::Arc;

/// The world outside of the server: disk and folders.
pub trait Host: Send + Sync {
    /// The text of a file on the disk: `path` is relative to `folder`, which links may not leave.
    ///
    /// # Errors
    /// Why it could not be read.
    fn read(&self, folder: &str, path: &str) -> Result<String, FileError>;

    /// The file of a solid, likewise; kept while it is the same, since every key asks for it.
    ///
    /// # Errors
    /// Why it could not be read.
    fn solid(&self, folder: &str, path: &str) -> Result<Arc<SolidFile>, FileError> {
        self.read(folder, path).map(|text| Arc::new(SolidFile::new(text.into_bytes())))
    }

    /// `.mech` files of a folder and its folders, absolute, sorted.
    fn list(&self, folder: &str) -> Vec<String>;

    /// Where an editor can read a file of the standard library, such as `materials/rigur.mech`.
    fn library(&self, module: &str) -> Option<String>;

    /// Which findings of the designs in a folder are told, and how loudly.
    fn levels(&self, _folder: &str) -> Levels {
        Levels::default()
    }

    /// Starts `flexura ARGUMENTS` in a folder, with `input` on its standard input.
    ///
    /// # Errors
    /// Why it could not be started.
    fn start(&self, folder: &str, arguments: &[String], input: String) -> Result<Arc<dyn Work>, String>;
}

/// A command at work.
pub trait Work: Send + Sync {
    /// Ends it at once. It writes whole files or none, so nothing is left half done.
    fn stop(&self);

    /// Waits for its end, giving each line of its standard error to `told`; then its standard output, or none where it
    /// was stopped.
    fn wait(&self, told: &mut dyn FnMut(&str)) -> Option<String>;
}
