//! Tells the compiler which sources it was made of: what one build of it has written, another need not write again
//! the same. The digest is FNV-1a, 64 bits: it has to tell versions apart, not to withstand anybody.

use std::path::{Path, PathBuf};

/// All that can change what comes out …
const SOURCES: &[&str] = &["src", "grammar", "stdlib", "build.rs", "Cargo.toml", "Cargo.lock"];
/// … but not the command, which writes what it is given.
const COMMAND: &[&str] = &["src/cli", "src/main.rs"];

fn main() {
    let mut files = Vec::new();
    for name in SOURCES {
        println!("cargo:rerun-if-changed={name}");
        collect(Path::new(name), &mut files);
    }
    files.sort();
    let mut digest = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |bytes: &[u8]| {
        for byte in bytes {
            digest = (digest ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    for file in files {
        add(file.to_string_lossy().replace('\\', "/").as_bytes());
        // A packaged crate may lack its lock file; what cannot be read is not there.
        add(&std::fs::read(&file).unwrap_or_default());
    }
    // The last digits of sines are those of the system's library.
    add(std::env::var("TARGET").unwrap_or_default().as_bytes());
    println!("cargo:rustc-env=FLEXURA_SOURCES={digest:016x}");
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) {
    if COMMAND.iter().any(|c| path == Path::new(c)) {
        return;
    }
    match std::fs::read_dir(path) {
        Ok(entries) => entries.flatten().for_each(|e| collect(&e.path(), files)),
        Err(_) => files.push(path.to_path_buf()),
    }
}
