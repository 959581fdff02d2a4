//! A file with all that it imports, and where its names lead.

use super::names::{Mention, Names, Symbol, What};
use crate::elaborate::{Files, std_source};
use crate::syntax::{self, tree::Node};
use std::collections::BTreeMap;
use std::ops::Range;

/// Most files that are looked at.
const MOST_FILES: usize = 128;

/// One file.
#[derive(Clone, Debug)]
pub struct Text {
    /// Its text.
    pub text: String,
    /// Its tree.
    pub tree: Node,
    /// Its names.
    pub names: Names,
}

impl Text {
    /// Reads a text.
    pub fn new(text: String) -> Self {
        let tree = syntax::parse(0, &text).tree;
        let names = Names::of(&tree, &text);
        Self { text, tree, names }
    }
}

/// A file with what it imports. Files are called as the elaborator calls them: paths from the root file's folder, and
/// `std/materials/rigur.mech`.
#[derive(Clone, Debug)]
pub struct Space {
    /// Name of the root file.
    pub root: String,
    /// All files by name.
    pub files: BTreeMap<String, Text>,
}

/// A declaration: file and index of the symbol.
pub type Place = (String, usize);

impl Space {
    /// Reads `root` and what it imports; what cannot be read is not there.
    pub fn read(root: &str, files: &dyn Files) -> Self {
        let mut space = Self { root: root.into(), files: BTreeMap::new() };
        let mut waiting = vec![root.to_string()];
        while let Some(name) = waiting.pop() {
            if space.files.contains_key(&name) || space.files.len() >= MOST_FILES {
                continue;
            }
            let text = match name.strip_prefix("std/") {
                Some(module) => std_source(module).map(str::to_owned),
                None => files.read(&name).ok(),
            };
            let Some(text) = text.map(Text::new) else { continue };
            waiting.extend(text.names.uses.iter().filter_map(|u| target(&name, &u.target, u.file)));
            space.files.insert(name, text);
        }
        space
    }

    /// A declaration.
    pub fn symbol(&self, place: &Place) -> Option<&Symbol> {
        self.files.get(&place.0)?.names.symbols.get(place.1)
    }

    /// What is declared or mentioned at a byte: its declaration and the place of the name.
    pub fn at(&self, file: &str, byte: usize) -> Option<(Place, Range<usize>)> {
        let names = &self.files.get(file)?.names;
        let here = |r: &Range<usize>| r.start <= byte && byte <= r.end;
        if let Some(i) = names.symbols.iter().position(|s| here(&s.at)) {
            return Some(((file.into(), i), names.symbols.get(i)?.at.clone()));
        }
        let mention = names.mentions.iter().find(|m| here(&m.at))?;
        Some((self.resolve(file, mention)?, mention.at.clone()))
    }

    /// The file that an import at a byte leads to.
    pub fn import_at(&self, file: &str, byte: usize) -> Option<String> {
        let names = &self.files.get(file)?.names;
        let import = names.uses.iter().find(|u| u.at.start <= byte && byte <= u.at.end)?;
        target(file, &import.target, import.file).filter(|t| self.files.contains_key(t))
    }

    /// Where a mention leads.
    pub fn resolve(&self, file: &str, mention: &Mention) -> Option<Place> {
        if let Some(template) = &mention.template {
            let place = self.top(file, template)?;
            return self.inside(&place, mention.path.last()?);
        }
        let mut path = mention.path.iter();
        let first = path.next()?;
        let names = &self.files.get(file)?.names;
        let own = names.find(mention.block, first).filter(|_| mention.block.is_some());
        let mut place = own.map(|i| (file.to_string(), i)).or_else(|| self.top(file, first))?;
        for name in path {
            place = self.inside(&place, name)?;
        }
        Some(place)
    }

    /// What a file sees at its top: its own, and what it imports.
    pub fn top(&self, file: &str, name: &str) -> Option<Place> {
        let names = &self.files.get(file)?.names;
        if let Some(i) = names.find(None, name) {
            return Some((file.into(), i));
        }
        names.uses.iter().find_map(|u| {
            let from = target(file, &u.target, u.file)?;
            let wanted = u.file || u.target.rsplit('.').next() == Some(name);
            let found = self.files.get(&from)?.names.find(None, name)?;
            (wanted && (!u.file || !name.starts_with('_'))).then_some((from, found))
        })
    }

    /// All that a file sees at its top.
    pub fn visible(&self, file: &str) -> Vec<Place> {
        let Some(text) = self.files.get(file) else { return Vec::new() };
        let tops = |name: &str, only: Option<&str>| -> Vec<Place> {
            let symbols = self.files.get(name).map(|t| t.names.symbols.as_slice()).unwrap_or_default();
            let wanted = |s: &Symbol| s.block.is_none() && only.is_none_or(|o| o == s.name);
            (0..symbols.len())
                .filter(|i| symbols.get(*i).is_some_and(wanted))
                .map(|i| (name.to_string(), i))
                .collect()
        };
        let mut all = tops(file, None);
        for import in &text.names.uses {
            if let Some(from) = target(file, &import.target, import.file) {
                all.extend(tops(&from, if import.file { None } else { import.target.rsplit('.').next() }));
            }
        }
        all
    }

    /// A name in what a declaration opens: a record's field, a template's parameter, an instance's part.
    fn inside(&self, place: &Place, name: &str) -> Option<Place> {
        let (file, block) = self.opened(place)?;
        let i = self.files.get(&file)?.names.find(Some(block), name)?;
        Some((file, i))
    }

    /// The block that can be reached into by a declaration's name.
    pub fn opened(&self, place: &Place) -> Option<(String, usize)> {
        let mut place = place.clone();
        // An image of an image of an instance …
        for _ in 0..MOST_FILES {
            let symbol = self.symbol(&place)?;
            if let Some(block) = symbol.opens {
                return Some((place.0, block));
            }
            let of = symbol.of.as_deref().filter(|_| matches!(symbol.what, What::Instance | What::Joint))?;
            let names = &self.files.get(&place.0)?.names;
            let beside = names
                .find(symbol.block, of)
                .filter(|i| names.symbols.get(*i).is_some_and(|s| s.what == What::Instance));
            place = match beside {
                Some(i) => (place.0, i),
                None => self.top(&place.0, of)?,
            };
        }
        None
    }

    /// Every place in this space where a declaration is named, itself included, by file.
    pub fn references(&self, place: &Place) -> Vec<(String, Range<usize>)> {
        let mut all: Vec<(String, Range<usize>)> = Vec::new();
        for (file, text) in &self.files {
            if *file == place.0 {
                all.extend(self.symbol(place).map(|s| (file.clone(), s.at.clone())));
            }
            for mention in &text.names.mentions {
                // Most names are others: these are not looked for.
                let same = mention.path.last() == self.symbol(place).map(|s| &s.name);
                if same && self.resolve(file, mention).as_ref() == Some(place) {
                    all.push((file.clone(), mention.at.clone()));
                }
            }
            // `use std.materials.rigur` names it too.
            for import in &text.names.uses {
                let leads = !import.file
                    && target(file, &import.target, false).as_ref() == Some(&place.0)
                    && import.target.rsplit('.').next() == self.symbol(place).map(|s| s.name.as_str());
                if leads {
                    let length = self.symbol(place).map_or(0, |s| s.name.len());
                    all.push((file.clone(), import.target_at.end - length..import.target_at.end));
                }
            }
        }
        all.sort_by(|a, b| (&a.0, a.1.start).cmp(&(&b.0, b.1.start)));
        all.dedup();
        all
    }
}

/// The name of the file that an import of `from` leads to.
fn target(from: &str, target: &str, file: bool) -> Option<String> {
    if !file {
        return Some(format!("std/{}.mech", target.strip_prefix("std.")?.replace('.', "/")));
    }
    match from.rsplit_once('/') {
        _ if from.starts_with("std/") => None,
        Some((folder, _)) => Some(format!("{folder}/{target}")),
        None => Some(target.to_string()),
    }
}
