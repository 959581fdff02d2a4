//! Elaboration: syntax trees to a [`Design`]. Imports, names, dimensions, evaluation, templates.
//!
//! Everything that can be wrong with a text is said here, with its place; the numerical stages see
//! only the design. No I/O: files come in through [`Files`].

mod aims;
mod arithmetic;
mod assertions;
mod cases;
mod check;
pub mod codes;
pub mod dimension;
mod drawn;
mod drives;
mod eval;
mod fittings;
mod forms;
mod frames;
mod free;
mod functions;
mod given;
mod goals;
mod holes;
mod instances;
mod known;
mod load;
mod loads;
mod lookup;
mod loops;
mod mechanism;
mod members;
mod mirroring;
mod motor_form;
mod names;
mod own_fittings;
mod places;
mod placing;
mod profiles;
mod queries;
mod records;
mod require;
mod scaling;
mod scope;
mod settings;
mod sheet;
mod solids;
mod stl;
mod strings;
mod structure;
mod table;
mod taper;
mod targets;
mod template;
mod terms;
mod theory;
pub mod units;
mod value;
mod variants;
mod workspaces;

use crate::diagnostic::{Diagnostic, Edit, Fix, Origin, SourceMap};
use crate::ir::{Assembly, Design};
use crate::syntax::ast::{self, Item, Mechanism};
pub use goals::EXPORTS;
pub use known::{KnownValue, quantity};
pub use load::{std_modules, std_source, std_text};
use settings::Settings;
use std::fmt;
use std::sync::Arc;
pub use stl::{MOST_BYTES as MOST_SOLID_BYTES, SolidFile, StlFault};

/// Why a file could not be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileError {
    /// It does not exist.
    NotFound,
    /// It lies outside the design's folder (through a link).
    Outside,
    /// It is larger than a source may be.
    TooLarge,
    /// It is not UTF-8 text.
    NotText,
    /// Anything else, in words.
    Other(String),
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FileError::NotFound => f.write_str("the file does not exist"),
            FileError::Outside => f.write_str("it leads out of the design's folder"),
            FileError::TooLarge => f.write_str("it is too large for a source"),
            FileError::NotText => f.write_str("it is not UTF-8 text"),
            FileError::Other(why) => f.write_str(why),
        }
    }
}

/// Where sources come from.
pub trait Files {
    /// The text of a file. `path` is relative to the root file's folder, uses `/`, and has no `.` or
    /// `..` parts; an implementation on a file system must also refuse links that lead outside.
    ///
    /// # Errors
    /// Why it could not be read.
    fn read(&self, path: &str) -> Result<String, FileError>;

    /// The file of a solid, by the same rules; it need not be text. Who can should keep it while it is the same: it is asked for
    /// whenever a text is understood anew.
    ///
    /// # Errors
    /// Why it could not be read.
    fn solid(&self, path: &str) -> Result<Arc<SolidFile>, FileError> {
        self.read(path).map(|text| Arc::new(SolidFile::new(text.into_bytes())))
    }
}

/// Files held in memory: pairs of path and text.
impl Files for std::collections::BTreeMap<String, String> {
    fn read(&self, path: &str) -> Result<String, FileError> {
        self.get(path).cloned().ok_or(FileError::NotFound)
    }
}

/// What the caller may change about a design.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// `--set name=value`: parameters of the mechanism (`r`), of a template (`knee.thickness`) or free
    /// values inside one (`knee.upper.from.at.r`).
    pub set: Vec<(String, String)>,
    /// `--steps`: number of steps in place of the text's.
    pub steps: Option<usize>,
    /// `--variant`: the variant that is built; none: the design as it stands.
    pub variant: Option<String>,
}

/// What [`elaborate`] gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Elaborated {
    /// What the file builds; none when there are errors.
    pub assembly: Option<Assembly>,
    /// Its design, if it is one mechanism that places no others.
    pub design: Option<Design>,
    /// Names of the variants of what the file builds.
    pub variants: Vec<String>,
    /// Where none was chosen, what each of them builds, in their order; empty where there are errors.
    pub others: Vec<Assembly>,
    /// Every text that was read: the root file first, then imports, then `--set` values.
    pub sources: SourceMap,
    /// The design's own files as understood, the root file first.
    pub files: Vec<OwnFile>,
    /// What names came to, also where there are errors elsewhere.
    pub values: Vec<KnownValue>,
    /// Findings of parsing and elaboration, in the order of the files and places.
    pub diagnostics: Vec<Diagnostic>,
}

/// A file of the design, not of the standard library, as understood.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnFile {
    /// Its index in the source map.
    pub id: u32,
    /// Its path.
    pub path: String,
    /// What it says.
    pub ast: ast::File,
}

/// Reads `root` and what it imports, and elaborates it. What is built is the *last* mechanism of the root file that
/// no other one places; the others are checked too.
pub fn elaborate(root: &str, files: &dyn Files, options: &Options) -> Elaborated {
    let mut sources = SourceMap::default();
    let mut diagnostics = Vec::new();
    let program = load::load(root, files, &mut sources, &mut diagnostics);
    let settings = Settings::parse(&options.set, &mut sources, &mut diagnostics);
    let Some(module) = program.root.and_then(|i| Some((i, program.modules.get(i)?))) else {
        return Elaborated {
            assembly: None,
            design: None,
            variants: Vec::new(),
            others: Vec::new(),
            sources,
            files: Vec::new(),
            values: Vec::new(),
            diagnostics,
        };
    };
    let (root_index, root_module) = module;
    let outside = mechanism::Outside { module: root_index, steps: options.steps, sources: &sources, files };
    let circular = placing::circles(&program, root_index, &mut diagnostics);
    let mut values = Vec::new();
    let (mut assembly, mut used) = (None, std::collections::BTreeSet::new());
    let no_settings = Settings::default();
    let (built, others) = roles(&program, root_index);
    let variants = built.map(|m| variants::of(m, &mut diagnostics)).unwrap_or_default();
    let chosen = options.variant.as_deref().and_then(|n| variants.iter().find(|v| v.name.node == n));
    if let (Some(name), None, Some(m)) = (&options.variant, chosen, built) {
        diagnostics.push(variants::missing(name, &variants, m));
    }
    let mut others_built = Vec::new();
    let own_settings = chosen.map(|v| variants::settings(v, &settings));
    for (m, is_root) in others.into_iter().map(|m| (m, false)).chain(built.map(|m| (m, true))) {
        let settings = if is_root { own_settings.as_ref().unwrap_or(&settings) } else { &no_settings };
        let mut found = elaborated(&program, settings, m, &outside, is_root);
        // Of a design that is right as it stands, the variants must be right too.
        if is_root && chosen.is_none() && found.assembly.is_some() {
            for variant in &variants {
                let settings = variants::settings(variant, settings);
                let mut other = elaborated(&program, &settings, m, &outside, true);
                found.used.append(&mut other.used);
                others_built.extend(other.assembly);
                let new = other.out.into_iter().filter(|d| !found.out.contains(d)).collect::<Vec<_>>();
                found.out.extend(new.into_iter().map(|d| d.also(variant.name.at, "in this variant")));
            }
        }
        used.append(&mut found.used);
        values.append(&mut found.values);
        diagnostics.append(&mut found.out);
        if is_root {
            assembly = found.assembly;
        }
    }
    if built.is_none() && !root_module.broken {
        diagnostics.push(
            Diagnostic::error(
                codes::NO_MECHANISM,
                format!("`{root}` declares no mechanism"),
                Origin { file: 0, start: 0, end: 0 },
            )
            .help("a design is a `mechanism NAME { … }`; materials and flexures alone are for importing"),
        );
    }
    if !circular && !diagnostics.iter().any(Diagnostic::is_error) {
        for (u, text) in root_module.file.uses.iter().enumerate() {
            if root_module.imported.get(u) == Some(&true) && !used.contains(&(root_index, u)) {
                diagnostics.push(
                    Diagnostic::warning(codes::UNUSED_IMPORT, "this import is not used", text.at)
                        .help("remove the line")
                        .fix(removal(&sources, text.at)),
                );
            }
        }
    } else {
        assembly = None;
        others_built.clear();
    }
    tidy(&mut diagnostics);
    let design = assembly.as_ref().and_then(Assembly::single).cloned();
    let variants = variants.iter().map(|v| v.name.node.clone()).collect();
    let mut files: Vec<OwnFile> = Vec::new();
    for module in program.modules.into_iter().filter(|m| !m.path.starts_with(load::STANDARD)) {
        files.push(OwnFile { id: module.file_id, path: module.path, ast: module.file });
    }
    files.sort_by_key(|f| f.id);
    Elaborated { assembly, design, variants, others: others_built, sources, files, values, diagnostics }
}

/// The repair that takes a statement out.
fn removal(sources: &SourceMap, at: Origin) -> Fix {
    let text = sources.files.get(at.file as usize).map_or("", |f| f.text.as_str());
    Fix::safe("remove it", vec![Edit::remove(text, at)])
}

/// One mechanism, with what is set of it.
fn elaborated(
    program: &load::Program,
    settings: &Settings,
    m: &Mechanism,
    outside: &mechanism::Outside<'_>,
    is_root: bool,
) -> instances::Assembled {
    if instances::is_assembly(m) {
        return instances::assemble(program, settings, m, outside, is_root);
    }
    let mut evaluator = eval::Evaluator::new(program, settings);
    let design = evaluator.mechanism(m, outside);
    if is_root {
        evaluator.unused_settings();
    }
    let values = evaluator.known();
    let (out, used) = (evaluator.out, evaluator.used);
    instances::Assembled { assembly: design.map(Assembly::of), out, used, values }
}

/// What a file builds, and the mechanisms that have to be checked by themselves because it does not place them.
fn roles(program: &load::Program, module: usize) -> (Option<&Mechanism>, Vec<&Mechanism>) {
    let items = program.modules.get(module).map(|m| m.file.items.as_slice()).unwrap_or_default();
    let mechanisms: Vec<(usize, &Mechanism)> = items
        .iter()
        .enumerate()
        .filter_map(|(i, item)| match item {
            Item::Mechanism(m) => Some((i, m)),
            _ => None,
        })
        .collect();
    let placed = |by: usize| placing::placed_by(program, (module, by)).into_iter().map(|(item, _)| item);
    let in_use: std::collections::BTreeSet<(usize, usize)> =
        mechanisms.iter().flat_map(|(i, _)| placed(*i)).collect();
    let free = mechanisms.iter().rev().find(|(i, _)| !in_use.contains(&(module, *i)));
    let Some((built, m)) = free.or(mechanisms.last()) else { return (None, Vec::new()) };
    let own: std::collections::BTreeSet<(usize, usize)> = placed(*built).collect();
    // One that is made of others cannot be placed yet: nobody has looked at it.
    let seen = |i: usize, m: &Mechanism| own.contains(&(module, i)) && !instances::is_assembly(m);
    let others = mechanisms.iter().filter(|(i, m)| i != built && !seen(*i, m));
    (Some(m), others.map(|(_, m)| *m).collect())
}

/// Most findings that are told one by one.
const MAX_FINDINGS: usize = 100;

/// Sorts by place and drops repetitions: a template used twice says a thing once.
fn tidy(diagnostics: &mut Vec<Diagnostic>) {
    let place =
        |d: &Diagnostic| d.labels.first().map(|l| (l.at.file, l.at.start, l.at.end)).unwrap_or_default();
    diagnostics.sort_by(|a, b| place(a).cmp(&place(b)).then_with(|| a.code.cmp(&b.code)));
    let mut kept: Vec<Diagnostic> = Vec::with_capacity(diagnostics.len());
    for d in diagnostics.drain(..) {
        if !kept
            .iter()
            .rev()
            .take_while(|k| place(k) == place(&d))
            .any(|k| k.code == d.code && k.message == d.message)
        {
            kept.push(d);
        }
    }
    if kept.len() > MAX_FINDINGS {
        let more = kept.len() - MAX_FINDINGS;
        let place = kept.get(MAX_FINDINGS).and_then(|d| d.labels.first()).map(|l| l.at).unwrap_or_default();
        let text = format!("{more} more findings from here on are not shown");
        let error = kept.iter().skip(MAX_FINDINGS).any(Diagnostic::is_error);
        kept.truncate(MAX_FINDINGS);
        kept.push(match error {
            true => Diagnostic::error(codes::TOO_LARGE, text, place),
            false => Diagnostic::warning(codes::TOO_LARGE, text, place),
        });
    }
    *diagnostics = kept;
}

impl eval::Evaluator<'_> {
    /// Reports `--set` of names that nothing looked for.
    pub(super) fn unused_settings(&mut self) {
        for (i, s) in self.settings.0.iter().enumerate() {
            // A second entry of the same name has been reported as such.
            let again = self.settings.0.iter().take(i).any(|earlier| earlier.path == s.path);
            if self.set_used.contains(&i) || again {
                continue;
            }
            let d = Diagnostic::error(
                codes::SET_UNKNOWN,
                format!("there is nothing to set by the name `{}`", s.path),
                s.at,
            );
            let near = names::suggestion(&s.path, self.settable.iter().map(String::as_str));
            self.out.push(match near {
                Some(n) => d.help(format!("did you mean `{n}`?")),
                None => d.help(
                    "parameters of the mechanism (`r`) and of its flexures (`knee.thickness`) can be set",
                ),
            });
        }
    }
}
