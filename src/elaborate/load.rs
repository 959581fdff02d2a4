//! Reading the root file and everything it imports. Paths are checked here before anything is read:
//! a source reaches only files below its own folder and the embedded standard library.

use super::codes;
use super::names::suggestion;
use super::{FileError, Files};
use crate::diagnostic::{Diagnostic, Edit, Fix, Origin, SourceMap};
use crate::syntax::ast::{self, Item, UseTarget};
use include_dir::{Dir, include_dir};
use std::collections::BTreeMap;

static STDLIB: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/stdlib");

/// What paths of the standard library begin with, as shown. (A file of a design could be called so only in a folder
/// of that name.)
pub const STANDARD: &str = "std/";

/// Longest chain of imports.
const MAX_IMPORT_DEPTH: usize = 32;
/// Most files of one design.
const MAX_FILES: usize = 128;
/// Largest source file, bytes. The samples have about 3 kB.
const MAX_FILE_BYTES: usize = 1 << 20;
/// Most bytes of all files together.
const MAX_TOTAL_BYTES: usize = 4 << 20;

/// A parsed file and what it sees of others.
pub struct Module {
    /// Its index in the source map.
    pub file_id: u32,
    /// Path shown to the user.
    pub path: String,
    /// Its tree.
    pub file: ast::File,
    /// Whether parsing it gave errors.
    pub broken: bool,
    /// Names at the top level of this file: own ones and imported ones.
    pub names: BTreeMap<String, Visible>,
    /// Per `use`, whether it has been found.
    pub imported: Vec<bool>,
    /// A file could not be imported: names that seem unknown may come from it.
    pub lacks_file: bool,
}

/// A top-level name seen in a module.
#[derive(Clone, Copy)]
pub struct Visible {
    /// Where the item is: module and index of the item.
    pub item: (usize, usize),
    /// Which `use` brought it; none: declared here.
    pub by_use: Option<usize>,
}

/// All files of a design.
#[derive(Default)]
pub struct Program {
    /// Modules; the root is the first to be *started*, its index is `root`.
    pub modules: Vec<Module>,
    /// Index of the root module, if it could be read.
    pub root: Option<usize>,
}

/// Name, place of the name, and whole place of an item.
pub fn item_name(item: &Item) -> &ast::Ident {
    match item {
        Item::Mechanism(m) => &m.name,
        Item::Flexure(f) => &f.name,
        Item::Record(r) => &r.name,
    }
}

/// What an item is, in a word.
pub fn item_kind(item: &Item) -> &str {
    match item {
        Item::Mechanism(_) => "mechanism",
        Item::Flexure(_) => "flexure",
        Item::Record(r) => &r.kind.node,
    }
}

impl Program {
    /// The item at a reference.
    pub fn item(&self, at: (usize, usize)) -> Option<&Item> {
        self.modules.get(at.0)?.file.items.get(at.1)
    }
}

/// Reads `root` and its imports.
pub fn load(root: &str, files: &dyn Files, sources: &mut SourceMap, out: &mut Vec<Diagnostic>) -> Program {
    let mut loader = Loader {
        files,
        sources,
        out,
        program: Program::default(),
        done: BTreeMap::new(),
        total_bytes: 0,
        chain: Vec::new(),
    };
    loader.program.root = loader.module(Key::File(root.to_string()), None, Origin::default());
    loader.program
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Key {
    Std(String),
    File(String),
}

impl Key {
    fn shown(&self) -> String {
        match self {
            Key::Std(p) => format!("{STANDARD}{p}"),
            Key::File(p) => p.clone(),
        }
    }
}

struct Loader<'a> {
    files: &'a dyn Files,
    sources: &'a mut SourceMap,
    out: &'a mut Vec<Diagnostic>,
    program: Program,
    /// Finished modules; none where reading failed.
    done: BTreeMap<Key, Option<usize>>,
    /// Length of all texts read.
    total_bytes: usize,
    /// Files being read, with the `use` that asked for each.
    chain: Vec<(Key, Origin)>,
}

impl Loader<'_> {
    /// Reads one file; `at` is the `use` that asked for it.
    fn module(&mut self, key: Key, use_at: Option<Origin>, root_at: Origin) -> Option<usize> {
        let at = use_at.unwrap_or(root_at);
        if let Some(i) = self.chain.iter().position(|(k, _)| *k == key) {
            self.import_cycle(i, &key, at);
            return None;
        }
        if let Some(done) = self.done.get(&key) {
            return *done;
        }
        if self.chain.len() >= MAX_IMPORT_DEPTH || self.done.len() + self.chain.len() >= MAX_FILES {
            self.out.push(
                Diagnostic::error(codes::TOO_LARGE, "too many files import each other", at)
                    .label("this import is one too many")
                    .help(format!("at most {MAX_FILES} files, {MAX_IMPORT_DEPTH} deep")),
            );
            return None;
        }
        let text = match self.text(&key, use_at) {
            Ok(text) => text,
            Err(diagnostic) => {
                if use_at.is_none() {
                    // The root: the place of this finding must exist.
                    self.sources.add(key.shown(), "");
                }
                self.out.push(*diagnostic);
                self.done.insert(key, None);
                return None;
            }
        };
        let file_id = self.sources.add(key.shown(), text.clone());
        let parsed = crate::syntax::parse(file_id, &text);
        let broken = parsed.diagnostics.iter().any(Diagnostic::is_error);
        self.out.extend(parsed.diagnostics);
        let file = parsed.file;
        if let Some(edition) = &file.edition
            && edition.node != 1
        {
            self.out.push(
                Diagnostic::error(codes::EDITION, format!("unknown edition {}", edition.node), edition.at)
                    .help("write `edition 1`"),
            );
        }
        self.chain.push((key.clone(), at));
        let index = self.build(&key, file_id, file, broken);
        self.chain.pop();
        self.done.insert(key, Some(index));
        Some(index)
    }

    fn text(&mut self, key: &Key, use_at: Option<Origin>) -> Result<String, Box<Diagnostic>> {
        let at = use_at.unwrap_or_default();
        let unreadable = |why: &str| {
            Box::new(
                Diagnostic::error(codes::IMPORT_UNREADABLE, format!("cannot read `{}`", key.shown()), at)
                    .label(why.to_string()),
            )
        };
        let text = match key {
            Key::Std(path) => match STDLIB.get_file(path).and_then(|f| f.contents_utf8()) {
                Some(text) => text.to_string(),
                None => {
                    let name = path.trim_end_matches(".mech").replace('/', ".");
                    let known = std_modules();
                    let mut d = Diagnostic::error(
                        codes::IMPORT_UNKNOWN,
                        format!("the standard library has no `std.{name}`"),
                        at,
                    );
                    let near = suggestion(&name, known.iter().map(String::as_str));
                    d = match near {
                        Some(n) => {
                            let fix = Edit::replace(at, format!("use std.{n}"));
                            d.help(format!("did you mean `use std.{n}`?"))
                                .fix(Fix::risky(format!("write `use std.{n}`"), vec![fix]))
                        }
                        None => d.help(format!("it has: {}", list(&known))),
                    };
                    return Err(Box::new(d));
                }
            },
            Key::File(path) => match self.files.read(path) {
                Ok(text) => text,
                Err(FileError::NotFound) if use_at.is_some() => {
                    return Err(Box::new(
                        Diagnostic::error(codes::IMPORT_UNKNOWN, format!("there is no file `{path}`"), at)
                            .help("the path is relative to the folder of the importing file"),
                    ));
                }
                Err(FileError::Outside) => {
                    return Err(Box::new(refused(path, at, "it leads out of the design's folder")));
                }
                Err(e) => return Err(unreadable(&e.to_string())),
            },
        };
        if text.len() > MAX_FILE_BYTES {
            return Err(unreadable("the file is larger than 1 MiB"));
        }
        self.total_bytes += text.len();
        if self.total_bytes > MAX_TOTAL_BYTES {
            return Err(unreadable("all files together are larger than 4 MiB"));
        }
        Ok(text)
    }

    fn build(&mut self, key: &Key, file_id: u32, file: ast::File, broken: bool) -> usize {
        let mut names: BTreeMap<String, Visible> = BTreeMap::new();
        // The own index is not known before the imports are read: patched below.
        const OWN: usize = usize::MAX;
        for (i, item) in file.items.iter().enumerate() {
            let name = item_name(item);
            match names.get(&name.node) {
                Some(first) => {
                    let first_at = file.items.get(first.item.1).map(|f| item_name(f).at).unwrap_or_default();
                    self.out.push(duplicate(&name.node, name.at, first_at));
                }
                None => {
                    names.insert(name.node.clone(), Visible { item: (OWN, i), by_use: None });
                }
            }
        }
        let mut imported = vec![false; file.uses.len()];
        let mut lacks_file = false;
        for (u, item) in file.uses.iter().enumerate() {
            let (target, only) = match self.resolve(key, &item.target) {
                Ok(found) => found,
                Err(d) => {
                    lacks_file |= matches!(item.target, UseTarget::File(_));
                    self.out.push(*d);
                    continue;
                }
            };
            let Some(m) = self.module(target, Some(item.at), item.at) else {
                lacks_file |= only.is_none();
                continue;
            };
            if let Some(flag) = imported.get_mut(u) {
                *flag = true;
            }
            let mut found = false;
            let mut brought: Vec<(String, (usize, usize), Origin)> = Vec::new();
            if let Some(module) = self.program.modules.get(m) {
                for (i, it) in module.file.items.iter().enumerate() {
                    let name = &item_name(it).node;
                    let wanted = only.as_ref().is_none_or(|o| o == name);
                    if wanted && (!name.starts_with('_') || only.is_some()) {
                        found = true;
                        brought.push((name.clone(), (m, i), item_name(it).at));
                    }
                }
            }
            if let (Some(name), false) = (&only, found) {
                self.out.push(Diagnostic::error(
                    codes::IMPORT_UNKNOWN,
                    format!("the imported file declares no `{name}`"),
                    item.at,
                ));
            }
            for (name, reference, declared) in brought {
                match names.get(&name) {
                    Some(v) if v.item == reference => {}
                    Some(v) => {
                        let (place, text) = match v.by_use {
                            None => (
                                file.items.get(v.item.1).map(|f| item_name(f).at).unwrap_or_default(),
                                "declared here too",
                            ),
                            Some(k) => {
                                (file.uses.get(k).map(|k| k.at).unwrap_or_default(), "also imported here")
                            }
                        };
                        self.out.push(
                            Diagnostic::error(
                                codes::DUPLICATE,
                                format!("`{name}` comes from two places"),
                                item.at,
                            )
                            .label(format!("imports `{name}`"))
                            .also(place, text)
                            .also(declared, "the imported declaration"),
                        );
                    }
                    None => {
                        names.insert(name, Visible { item: reference, by_use: Some(u) });
                    }
                }
            }
        }
        let index = self.program.modules.len();
        for v in names.values_mut() {
            if v.item.0 == OWN {
                v.item.0 = index;
            }
        }
        self.program.modules.push(Module {
            file_id,
            path: key.shown(),
            file,
            broken,
            names,
            imported,
            lacks_file,
        });
        index
    }

    /// Where an import leads, and the one name it brings (none: all public ones).
    fn resolve(&self, from: &Key, target: &UseTarget) -> Result<(Key, Option<String>), Box<Diagnostic>> {
        match target {
            UseTarget::Std(segments) => {
                let rest: Vec<&str> = segments.iter().skip(1).map(|s| s.node.as_str()).collect();
                let at = span(segments);
                let head = segments.first().map_or("", |s| s.node.as_str());
                let Some(last) = rest.last().filter(|_| head == "std") else {
                    return Err(Box::new(
                        Diagnostic::error(
                            codes::IMPORT_UNKNOWN,
                            "imports start with `std.` or name a file",
                            at,
                        )
                        .help("write `use std.materials.rigur` or `use \"file.mech\"`"),
                    ));
                };
                Ok((Key::Std(format!("{}.mech", rest.join("/"))), Some((*last).to_string())))
            }
            UseTarget::File(path) => {
                let p = path.node.as_str();
                if let Some(why) = forbidden(p) {
                    return Err(Box::new(refused(p, path.at, why)));
                }
                match from {
                    Key::Std(_) => {
                        Err(Box::new(refused(p, path.at, "the standard library imports only `std.`")))
                    }
                    Key::File(f) => {
                        let joined = match f.rsplit_once('/') {
                            Some((folder, _)) if self.chain.len() > 1 => format!("{folder}/{p}"),
                            _ => p.to_string(),
                        };
                        Ok((Key::File(joined), None))
                    }
                }
            }
        }
    }

    fn import_cycle(&mut self, first: usize, key: &Key, at: Origin) {
        let circle = self.chain.get(first..).unwrap_or_default();
        let mut names: Vec<String> = circle.iter().map(|(k, _)| k.shown()).collect();
        names.push(key.shown());
        let mut d = Diagnostic::error(
            codes::IMPORT_CYCLE,
            format!("files import each other in a circle: {}", names.join(" → ")),
            at,
        )
        .label(format!("imports `{}` again", key.shown()))
        .help("move what both need into a third file");
        for (k, place) in circle.iter().skip(1) {
            d = d.also(*place, format!("`{}` is imported here", k.shown()));
        }
        self.out.push(d);
    }
}

fn duplicate(name: &str, second: Origin, first: Origin) -> Diagnostic {
    Diagnostic::error(codes::DUPLICATE, format!("`{name}` is declared twice"), second)
        .label("again here")
        .also(first, "first here")
        .help("rename one of them")
}

fn refused(path: &str, at: Origin, why: &str) -> Diagnostic {
    Diagnostic::error(codes::IMPORT_REFUSED, format!("`{path}` may not be imported"), at)
        .label(why.to_string())
        .help("a source reads only `.mech` files below its own folder and the standard library")
}

/// Why a path may not be imported.
fn forbidden(path: &str) -> Option<&'static str> {
    if let Some(why) = leads_out(path) {
        return Some(why);
    }
    if !path.ends_with(".mech") {
        return Some("only `.mech` files can be imported");
    }
    None
}

/// Why a path could lead out of the design's folder, or is none.
pub(super) fn leads_out(path: &str) -> Option<&'static str> {
    if path.is_empty() || path.len() > 512 {
        return Some("not a file name");
    }
    if path.starts_with(['/', '~']) || path.contains([':', '\\', '\0']) {
        return Some("not a plain path relative to this file");
    }
    if path.split('/').any(|part| part.is_empty() || part.trim_matches('.').is_empty()) {
        return Some("the parts of the path must be names, not `.` or `..`");
    }
    if path.chars().any(char::is_control) {
        return Some("the path contains control characters");
    }
    None
}

fn span(segments: &[ast::Ident]) -> Origin {
    match (segments.first(), segments.last()) {
        (Some(a), Some(b)) => Origin { file: a.at.file, start: a.at.start, end: b.at.end },
        _ => Origin::default(),
    }
}

fn list(names: &[String]) -> String {
    names.iter().map(|n| format!("`std.{n}`")).collect::<Vec<_>>().join(", ")
}

/// Text of a standard module, by its dotted path without the leading `std.`.
pub fn std_text(module: &str) -> Option<&'static str> {
    STDLIB.get_file(format!("{}.mech", module.replace('.', "/")))?.contents_utf8()
}

/// The text of a file of the standard library, such as `materials/rigur.mech`.
pub fn std_source(path: &str) -> Option<&'static str> {
    STDLIB.get_file(path)?.contents_utf8()
}

/// Dotted paths of all standard modules without the leading `std.`, sorted.
pub fn std_modules() -> Vec<String> {
    fn walk(dir: &Dir<'_>, out: &mut Vec<String>) {
        for f in dir.files() {
            if let Some(p) = f.path().to_str().and_then(|p| p.strip_suffix(".mech")) {
                out.push(p.replace('/', "."));
            }
        }
        for d in dir.dirs() {
            walk(d, out);
        }
    }
    let mut out = Vec::new();
    walk(&STDLIB, &mut out);
    out.sort();
    out
}
