//! `flexura lsp`: the language server on the standard input and output, with the disk behind it.

use super::Format;
use super::artefacts::write_below;
use super::commands::FINE;
use super::lints::LintFlags;
use super::render::refuse;
use super::sources::Folder;
use clap::Args;
use flexura::elaborate::{FileError, SolidFile, std_source};
use flexura::lint::Levels;
use flexura::lsp::{Host, Work, server};
use flexura::pipeline::Files;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// What `flexura lsp` takes.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  flexura lsp      started by an editor; editors/ holds set-ups for VS Code, Neovim and Helix")]
pub struct Lsp {
    /// Answer one question of the language server: JSON on the standard input and output
    #[arg(long, hide = true)]
    solve: bool,
}

/// `flexura lsp`.
pub fn lsp(arguments: &Lsp) -> u8 {
    if arguments.solve {
        return solve();
    }
    let (connection, threads) = server::Connection::stdio();
    let served = server::serve(connection, Box::new(Disk));
    let joined = threads.join();
    match (served, joined) {
        (Ok(()), Ok(())) => FINE,
        (Err(why), _) => refuse("E0755", why.to_string(), Format::Human),
        (_, Err(why)) => refuse("E0755", why.to_string(), Format::Human),
    }
}

/// The simulation of one design, for the server's margin: it leaves a core to who is typing.
fn solve() -> u8 {
    let mut question = String::new();
    let read = std::io::stdin().read_to_string(&mut question).map_err(|e| e.to_string());
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(cores.saturating_sub(1).max(1)).build();
    let answer = read.and_then(|_| pool.map_err(|e| e.to_string()));
    match answer.and_then(|pool| pool.install(|| flexura::lsp::solve(&question, Arc::new(Disk)))) {
        Ok(answer) => super::commands::print(&answer),
        Err(why) => refuse("E0755", why, Format::Human),
    }
}

/// A `flexura` of its own.
struct Process {
    child: Mutex<Option<Child>>,
    pipes: Mutex<Option<(ChildStdout, ChildStderr)>>,
}

impl Process {
    fn child(&self) -> MutexGuard<'_, Option<Child>> {
        self.child.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Work for Process {
    fn stop(&self) {
        if let Some(mut child) = self.child().take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }

    fn wait(&self, told: &mut dyn FnMut(&str)) -> Option<String> {
        let (mut stdout, stderr) = self.pipes.lock().unwrap_or_else(PoisonError::into_inner).take()?;
        // Both at once: one that is not read would stop the other.
        let output = std::thread::scope(|scope| {
            let output = scope.spawn(move || {
                let mut text = String::new();
                stdout.read_to_string(&mut text).ok().map(|_| text)
            });
            BufReader::new(stderr).lines().map_while(Result::ok).for_each(|line| told(&line));
            output.join().ok().flatten()
        });
        // Who was stopped has no child any more.
        let mut child = self.child().take()?;
        child.wait().ok()?;
        output
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

    fn solid(&self, folder: &str, path: &str) -> Result<Arc<SolidFile>, FileError> {
        Folder::at(Path::new(folder))?.solid(path)
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

    fn levels(&self, folder: &str) -> Levels {
        // What is wrong with the configuration, the commands say.
        LintFlags::default().levels(Path::new(folder)).unwrap_or_default()
    }

    fn start(&self, folder: &str, arguments: &[String], input: String) -> Result<Arc<dyn Work>, String> {
        let flexura = std::env::current_exe().map_err(|e| e.to_string())?;
        let mut command = Command::new(flexura);
        command.args(arguments).current_dir(folder);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|e| e.to_string())?;
        if let Some(mut stdin) = child.stdin.take() {
            // One that has gone already says so when it is waited for.
            std::thread::spawn(move || drop(stdin.write_all(input.as_bytes())));
        }
        let pipes = Mutex::new(child.stdout.take().zip(child.stderr.take()));
        Ok(Arc::new(Process { child: Mutex::new(Some(child)), pipes }))
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
