//! A folder with a manifest: when nothing is made again, and when everything is.

use super::*;
use crate::ir::Design;
use crate::pipeline::tests::{NoFiles, Ticks, Toy, codes, design, with_lock};
use crate::pipeline::{Request, build_upon};
use std::cell::{Cell, RefCell};
use std::sync::atomic::AtomicBool;

/// An output folder in memory.
#[derive(Default)]
struct Folder(RefCell<BTreeMap<String, Vec<u8>>>);

impl Made for Folder {
    fn read(&self, name: &str) -> Option<Vec<u8>> {
        self.0.borrow().get(name).cloned()
    }
}

impl Folder {
    /// Builds into the folder.
    fn build(&self, toy: &Toy, request: &Request) -> BuildOutcome {
        let clock = Ticks(Cell::new(0.0));
        let out = build_upon(request, self, toy, &NoFiles, &clock, &AtomicBool::new(false));
        let files = out.artefacts.iter().chain(&out.manifest).map(|a| (a.name.clone(), a.bytes.clone()));
        self.0.borrow_mut().extend(files);
        out
    }

    fn edit(&self, name: &str, change: impl FnOnce(&mut Vec<u8>)) {
        change(self.0.borrow_mut().get_mut(name).unwrap());
    }
}

const MANIFEST: &str = "toy.manifest";

fn request() -> Request {
    Request { source: "toy.mech".into(), ..Request::default() }
}

/// A folder after a build from a toy, and the request that takes its lock.
fn made(toy: &Toy) -> (Folder, Request, BuildOutcome) {
    let folder = Folder::default();
    let first = folder.build(toy, &request());
    let locked = Request { source: "toy.mech".into(), ..with_lock(&first) };
    (folder, locked, first)
}

fn warned() -> Toy {
    let finds = |d: &Design| {
        Diagnostic::warning("W0606", "no rest states", d.traces[0].origin)
            .also(d.origin, "of this")
            .help("add steps")
    };
    let at = |start| Origin { file: 0, start, end: start + 5 };
    assert_ne!(at(1), at(2));
    Toy {
        finds: Some(finds),
        change: Some(|d| {
            d.origin = Origin { file: 0, start: 10, end: 90 };
            d.traces[0].origin = Origin { file: 0, start: 20, end: 30 };
            d.requirements[0].bound = 0.1;
        }),
        ..Toy::default()
    }
}

#[test]
fn nothing_changed_nothing_made() {
    let toy = warned();
    let (folder, locked, first) = made(&toy);
    let simulated = toy.simulated.get();
    let again = folder.build(&toy, &locked);
    assert_eq!((toy.solved.get(), toy.simulated.get()), (1, simulated), "nothing is computed");
    assert!(again.unchanged && again.artefacts.is_empty() && again.manifest.is_none());
    assert_eq!(again.lock, None);
    assert!(again.made().eq(first.made()), "the same files stand");
    assert_eq!((&again.before, &again.after), (&first.before, &first.after));
    assert_eq!(again.requirements, first.requirements);
    assert_eq!(again.diagnostics, first.diagnostics);
    assert_eq!(codes(&again), ["W0606", "E0801"]);
    assert!(again.failed(), "a requirement that fails still does");
    let frozen = folder.build(&toy, &Request { frozen: true, ..locked });
    assert!(frozen.unchanged);
}

#[test]
fn a_comment_moves_the_findings_and_changes_nothing() {
    let toy = warned();
    let (folder, locked, first) = made(&toy);
    let moved = Toy {
        finds: toy.finds,
        change: Some(|d| {
            d.origin = Origin { file: 0, start: 17, end: 97 };
            d.traces[0].origin = Origin { file: 0, start: 27, end: 37 };
            d.requirements[0].bound = 0.1;
        }),
        ..Toy::default()
    };
    let again = folder.build(&moved, &locked);
    assert!(again.unchanged);
    let place = |out: &BuildOutcome| out.diagnostics[0].labels.iter().map(|l| l.at.start).collect::<Vec<_>>();
    assert_eq!((place(&first), place(&again)), (vec![20, 10], vec![27, 17]));
    // Where two items that shared a place no longer do, their numbers would mean others.
    let apart = Toy {
        change: Some(|d| {
            (warned().change.unwrap())(d);
            d.cycle.origin = Origin { file: 0, start: 40, end: 41 };
        }),
        ..warned()
    };
    assert!(!folder.build(&apart, &locked).unchanged);
}

#[test]
fn what_is_missing_or_edited_is_made_anew() {
    let toy = Toy::default();
    let (folder, locked, first) = made(&toy);
    let whole = folder.0.borrow().clone();
    for name in ["toy.stl", "toy_motor/toy_motor.ino", MANIFEST] {
        for edit in [true, false] {
            if edit {
                folder.edit(name, |bytes| {
                    let at = bytes.len() / 2;
                    bytes[at] ^= 1;
                });
            } else {
                folder.0.borrow_mut().remove(name);
            }
            let again = folder.build(&toy, &locked);
            assert!(!again.unchanged, "{name}, edited {edit}");
            assert_eq!(again.artefacts, first.artefacts);
            assert_eq!(*folder.0.borrow(), whole, "{name}: the folder is as before");
            assert!(folder.build(&toy, &locked).unchanged);
        }
    }
}

#[test]
fn what_changes_the_outcome_is_built() {
    let changes: [fn(&mut Design); 4] = [
        |d| d.requirements[0].bound = 0.6,
        |d| d.requirements.clear(),
        |d| d.exports.truncate(1),
        |d| d.material.e_mpa = 2000.0,
    ];
    for change in changes {
        let (folder, locked, _) = made(&Toy::default());
        let toy = Toy { change: Some(change), ..Toy::default() };
        assert!(!folder.build(&toy, &locked).unchanged);
        let request = Request { lock: None, ..locked };
        assert!(folder.build(&toy, &request).unchanged, "solved again to the same values");
    }
    let toy = Toy::default();
    let (folder, locked, _) = made(&toy);
    assert!(!folder.build(&toy, &Request { steps: Some(8), ..locked.clone() }).unchanged);
    assert!(!folder.build(&toy, &locked).unchanged, "the folder now holds the other one");
    assert!(!folder.build(&toy, &Request { fresh: true, ..locked.clone() }).unchanged);
    assert!(!Folder::default().build(&toy, &locked).unchanged, "another folder");
}

#[test]
fn another_compiler_makes_it_anew() {
    let toy = Toy::default();
    let (folder, locked, _) = made(&toy);
    folder.edit(MANIFEST, |bytes| {
        let mut manifest: Manifest = serde_json::from_slice(bytes).unwrap();
        assert_eq!(manifest.record.compiler, COMPILER);
        manifest.record.compiler = "0.0.9+0123456789abcdef".into();
        manifest.digest = manifest.record.digest().unwrap();
        *bytes = serde_json::to_vec_pretty(&manifest).unwrap();
    });
    assert!(!folder.build(&toy, &locked).unchanged);
}

#[test]
fn numbers_that_are_none_are_told_again() {
    let record: Measures = serde_json::from_str(
        r#"{"traces": {"tip": {"mean_error_mm": null, "max_error_mm": 1.5, "path_length_mm": 2.0}},
            "drives": {"m": {"max_force_n": null}}, "stress": {"max_mpa": null}, "gap": {"least_mm": 0.1},
            "stability": {"rest_states": [], "limit_points": [], "snaps": []}}"#,
    )
    .unwrap();
    assert!(record.traces["tip"].mean_error_mm.is_nan());
    let (what, force, unit) = record.drives["m"].parts();
    assert_eq!((what, unit), ("largest force", "N"));
    assert!(force.is_nan());
    assert_eq!(record.gap.least_mm, Some(0.1));
}

#[test]
fn places_are_no_part_of_the_digest_but_who_shares_them_is() {
    let digest = |change: fn(&mut Design)| {
        let mut d = design();
        change(&mut d);
        Fingerprint::of(&Assembly::of(d), &[vec![1.0]]).digest
    };
    let plain = digest(|_| ());
    assert_eq!(plain, digest(|d| d.name = "toy".into()));
    assert_ne!(plain, digest(|d| d.traces[0].origin.start = 4));
    assert_ne!(plain, digest(|d| d.requirements[0].text.push(' ')));
    let one = Fingerprint::of(&Assembly::of(design()), &[vec![1.0]]);
    assert_ne!(one.digest, Fingerprint::of(&Assembly::of(design()), &[vec![1.0 + f64::EPSILON]]).digest);
    assert_eq!(one.places.len(), 1, "all items of the toy share a place");
}
