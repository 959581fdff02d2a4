//! `flexura lsp`: the language server on the standard input and output, with the disk behind it.

use super::Format;
use super::artefacts::write_below;
use super::commands::FINE;
use super::render::refuse;
use super::sources::Folder;
use clap::Args;
use flexura::elaborate::{FileError, std_source};
use flexura::lsp::{Host, server};
use flexura::pipeline::Files;
use std::path::{Path, PathBuf};

/// What `flexura lsp` takes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  flexura lsp      started by an editor; editors/ holds set-ups for VS Code, Neovim and Helix")]
pub struct Lsp {}

/// `flexura lsp`.
pub fn lsp(_: &Lsp) -> u8 {
    let (connection, threads) = server::Connection::stdio();
    let served = server::serve(connection, Box::new(Disk));
    let joined = threads.join();
    match (served, joined) {
        (Ok(()), Ok(())) => FINE,
        (Err(why), _) => refuse("E0755", why.to_string(), Format::Human),
        (_, Err(why)) => refuse("E0755", why.to_string(), Format::Human),
    }
}

struct Disk;

/// Deepest folder, and most files, that are looked at for mentions.
const DEEPEST: usize = 8;
const MOST_FILES: usize = 500;

impl Host for Disk {
    fn read(&self, folder: &str, path: &str) -> Result<String, FileError> {
        Folder::at(Path::new(folder))?.read(path)
    }

    fn list(&self, folder: &str) -> Vec<String> {
        fn collect(folder: &Path, depth: usize, found: &mut Vec<String>) {
            let Ok(entries) = std::fs::read_dir(folder) else { return };
            let mut paths: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
            paths.sort();
            for path in paths {
                let hidden = path.file_name().and_then(|n| n.to_str()).is_none_or(|n| n.starts_with('.'));
                let Ok(kind) = path.symlink_metadata() else { continue };
                if found.len() >= MOST_FILES || hidden {
                } else if kind.is_dir() && depth < DEEPEST {
                    collect(&path, depth + 1, found);
                } else if kind.is_file() && path.extension().is_some_and(|e| e == "mech") {
                    found.extend(path.to_str().map(|p| p.replace('\\', "/")));
                }
            }
        }
        let mut found = Vec::new();
        collect(Path::new(folder), 0, &mut found);
        found
    }

    /// A copy of the embedded text, which an editor can open.
    fn library(&self, module: &str) -> Option<String> {
        let folder = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from).filter(|p| p.is_absolute());
        let home =
            || std::env::var_os("HOME").or_else(|| std::env::var_os("LOCALAPPDATA")).map(PathBuf::from);
        let folder = folder.or_else(|| home().map(|h| h.join(".cache"))).unwrap_or_else(std::env::temp_dir);
        let folder = folder.join("flexura").join(format!("std-{}", env!("CARGO_PKG_VERSION")));
        let path = write_below(&folder, module, std_source(module)?.as_bytes()).ok()?;
        path.to_str().map(|p| p.replace('\\', "/"))
    }
}
