//! What elaboration knows of a design, by place: values of names, and free variables with the lock's values.

use crate::elaborate::{Elaborated, Files, Options, elaborate};
use crate::emit::lock::{Lock, LockState};
use std::collections::BTreeMap;
use std::ops::Range;

/// Values by file and place of the name.
#[derive(Clone, Debug, Default)]
pub struct Evaluated {
    values: BTreeMap<(String, usize), String>,
    /// Optimised values by file and end of the `free` expression.
    pub solved: BTreeMap<(String, usize), Vec<String>>,
}

impl Evaluated {
    /// Elaborates a root file and reads its lock.
    pub fn of(root: &str, files: &dyn Files, lock: Option<&str>) -> (Self, Elaborated) {
        let out = elaborate(root, files, &Options::default());
        let mut known = Self::default();
        let name = |file: u32| out.sources.files.get(file as usize).map(|f| f.name.clone());
        for value in &out.values {
            if let Some(file) = name(value.at.file) {
                known.values.entry((file, value.at.start as usize)).or_insert_with(|| value.text.clone());
            }
        }
        let lock = lock.and_then(|text| Lock::parse(text, 0).ok());
        if let (Some(lock), Some(assembly)) = (lock, &out.assembly) {
            for design in &assembly.designs {
                let part = if assembly.single().is_some() { lock.clone() } else { lock.part(&design.name) };
                if part.state(design) != LockState::Current {
                    continue;
                }
                for free in &design.free {
                    let value = part.solution.values.iter().find(|(path, _)| **path == free.path);
                    if let (Some((_, value)), Some(file)) = (value, name(free.origin.file)) {
                        let shown = crate::elaborate::quantity(*value, &free.unit);
                        known.solved.entry((file, free.origin.end as usize)).or_default().push(shown);
                    }
                }
            }
        }
        (known, out)
    }

    /// The value of the name declared at a place.
    pub fn value(&self, file: &str, at: &Range<usize>) -> Option<&str> {
        self.values.get(&(file.to_string(), at.start)).map(String::as_str)
    }
}
