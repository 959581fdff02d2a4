//! `flexura doc`: the standard library and files of one's own by their doc comments.

use super::Format;
use super::artefacts::write_below;
use super::commands::{FAILED, FINE, print};
use super::render;
use super::sources::read_text;
use super::style::Style;
use clap::Args;
use flexura::diagnostic::{Diagnostic, Severity, SourceMap};
use flexura::doc::text::{Paper, Tone};
use flexura::doc::{Page, html, library};
use flexura::pipeline::placeless;
use std::path::{Path, PathBuf};

/// Columns where the standard output is no terminal.
const WIDTH: usize = 100;
/// Fewer are not worth wrapping to, more are hard to read.
const BOUNDS: (usize, usize) = (40, 110);

#[derive(Debug, Args)]
pub struct Doc {
    /// A page such as `std.flexures.wire` (or `wire`), a folder of the library such as `flexures`, or files of your own;
    /// without it all pages are listed
    #[arg(value_name = "PAGE|FILE")]
    pages: Vec<String>,
    /// Write HTML into the folder given by --out: one file a page, and a list of them
    #[arg(long, requires = "out", conflicts_with = "format")]
    html: bool,
    /// Folder for the HTML
    #[arg(long, value_name = "FOLDER", requires = "html")]
    out: Option<PathBuf>,
    /// How to report
    #[arg(long, value_enum, default_value_t = Format::Human)]
    format: Format,
}

/// Runs it.
pub fn run(arguments: &Doc) -> u8 {
    super::sarif::refuse(arguments.format);
    let library = library();
    let mut found: Vec<Page> = Vec::new();
    for wanted in &arguments.pages {
        match pages(wanted, &library) {
            Ok(pages) => found.extend(pages),
            Err(diagnostic) => {
                render::report(&[*diagnostic], &SourceMap::default(), arguments.format);
                return FAILED;
            }
        }
    }
    if let Some(folder) = &arguments.out {
        // Pages link to each other: the library is always there.
        let own = found.into_iter().filter(|p| p.group().is_empty());
        return site(library.iter().cloned().chain(own).collect(), folder);
    }
    let list = found.is_empty();
    if arguments.format == Format::Json {
        let pages = if list { &library } else { &found };
        return print(&format!("{}\n", serde_json::json!({ "pages": pages })));
    }
    let style = Style::stdout();
    let paint = |tone, text: &str| match tone {
        Tone::Strong => style.bold(text),
        Tone::Dim => style.dim(text),
    };
    let width = terminal_size::terminal_size().map_or(WIDTH, |(w, _)| usize::from(w.0));
    let paper = Paper { width: width.clamp(BOUNDS.0, BOUNDS.1), paint: &paint };
    let text = match (list, found.as_slice()) {
        (true, _) => paper.list(&library),
        (false, pages) => pages.iter().map(|p| paper.page(p)).collect::<Vec<_>>().join("\n"),
    };
    print(&text)
}

/// The pages by a name: of a file, of a page or of a folder of the library.
fn pages(wanted: &str, library: &[Page]) -> Result<Vec<Page>, Box<Diagnostic>> {
    if wanted.ends_with(".mech") || Path::new(wanted).is_file() {
        let text = read_text(Path::new(wanted)).map_err(|e| {
            Box::new(placeless(Severity::Error, "E0730", format!("cannot read `{wanted}`: {e}")))
        })?;
        // Pages may be put elsewhere: where this machine keeps the file is no part of them.
        let path = Path::new(wanted);
        let name = path.file_name().and_then(|n| n.to_str()).filter(|_| path.is_absolute());
        return Ok(vec![Page::of(name.unwrap_or(wanted), &text)]);
    }
    let name = wanted.strip_prefix("std.").unwrap_or(wanted);
    let short = |p: &Page| p.path.strip_prefix("std.").unwrap_or(&p.path).to_string();
    let is = |p: &Page| {
        let path = short(p);
        path == name || p.group() == name || path.split('.').next_back() == Some(name)
    };
    let found: Vec<Page> = library.iter().filter(|p| is(p)).cloned().collect();
    if !found.is_empty() {
        return Ok(found);
    }
    let mut d = placeless(Severity::Error, "E0760", format!("there is no page `{wanted}`"));
    let names = library.iter().flat_map(|p| {
        let path = short(p);
        let last = path.split('.').next_back().unwrap_or_default().to_string();
        [path, last]
    });
    d = match nearest(wanted.strip_prefix("std.").unwrap_or(wanted), names) {
        Some(near) => d.help(format!("did you mean `{near}`?")),
        None => d.help("`flexura doc` lists all pages; a file of your own ends in `.mech`"),
    };
    Err(Box::new(d))
}

/// The name most like `wanted`, if one is.
pub fn nearest(wanted: &str, names: impl Iterator<Item = String>) -> Option<String> {
    /// Less alike than this is another name.
    const ALIKE: f64 = 0.75;
    let alike = names.map(|n| (strsim::jaro_winkler(wanted, &n), n)).filter(|(s, _)| *s > ALIKE);
    alike.max_by(|a, b| a.0.total_cmp(&b.0).then_with(|| b.1.cmp(&a.1))).map(|(_, n)| n)
}

fn site(pages: Vec<Page>, folder: &Path) -> u8 {
    let files = match html::site(&pages) {
        Ok(files) => files,
        Err(e) => {
            render::show(&[placeless(Severity::Error, "E0731", e.to_string())], &SourceMap::default());
            return FAILED;
        }
    };
    for (name, text) in &files {
        if let Err(e) = write_below(folder, name, text.as_bytes()) {
            render::show(&[placeless(Severity::Error, "E0731", e.to_string())], &SourceMap::default());
            return FAILED;
        }
    }
    print(&format!("{}: {} pages\n", folder.join("index.html").display(), files.len() - 1));
    FINE
}
