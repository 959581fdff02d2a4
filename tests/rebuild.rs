//! Building again where nothing has changed: the command touches no file and tells the same.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::SystemTime;

/// A bar on one flexure: small enough to be simulated and meshed in no time. The second requirement fails, and the
/// first finding is a warning of the check.
const DESIGN: &str = "use std.materials.rigur
use std.processes.polyjet
use std.motors.nema17
use std.flexures.leaf
use std.flexures.wire

mechanism flap {
    point O = (0 mm, 0 mm)
    point B = (-25 mm, 0 mm)
    point P = (30 mm, 0 mm)
    ground base { B, O }
    link   arm  { O, P }
    hinge bend: base to arm at O  into base toward B  into arm toward P  as leaf
    material rigur
    print on polyjet
    cycle 4 steps over 1 s
    drive bend from 0 deg to 10 deg with nema17
    trace tip = P on arm
    require max(error(tip)) <= 5 mm
    require max(stress()) <= 0.01 MPa
    export stl, arduino(bend)
}
";

struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        place.write(DESIGN);
        place
    }

    fn write(&self, text: &str) {
        std::fs::write(self.0.path().join("flap.mech"), text).unwrap();
    }

    fn build(&self, arguments: &[&str]) -> Output {
        let output = Command::new(env!("CARGO_BIN_EXE_flexura"))
            .args(["build", "flap.mech"])
            .args(arguments)
            .current_dir(self.0.path())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1), "a requirement fails: {output:?}");
        output
    }

    /// Whether a build says that nothing has changed.
    fn unchanged(&self, arguments: &[&str]) -> bool {
        let output = self.build(arguments);
        String::from_utf8(output.stdout).unwrap().contains("nothing has changed")
    }

    /// All files with their bytes and times.
    fn files(&self) -> BTreeMap<PathBuf, (Vec<u8>, SystemTime)> {
        fn collect(folder: &Path, found: &mut BTreeMap<PathBuf, (Vec<u8>, SystemTime)>) {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    collect(&path, found);
                } else {
                    let when = path.metadata().unwrap().modified().unwrap();
                    found.insert(path.clone(), (std::fs::read(&path).unwrap(), when));
                }
            }
        }
        let mut found = BTreeMap::new();
        collect(self.0.path(), &mut found);
        found
    }
}

/// The report without the line of times.
fn report(output: &Output) -> String {
    let text = std::str::from_utf8(&output.stdout).unwrap();
    text.lines().filter(|l| !l.contains(" s: check ")).map(|l| format!("{l}\n")).collect()
}

#[test]
fn a_second_build_touches_nothing_and_tells_the_same() {
    let place = Place::new();
    place.build(&[]);
    // Without its manifest the folder is made from the lock: that is what must be told again.
    std::fs::remove_file(place.0.path().join("out/flap.manifest")).unwrap();
    let made = place.build(&[]);
    let files = place.files();
    for arguments in [&[][..], &["--frozen"], &["--threads", "1"]] {
        let again = place.build(arguments);
        assert!(String::from_utf8_lossy(&again.stdout).contains("nothing has changed"), "{arguments:?}");
        assert_eq!(report(&again), report(&made));
        assert_eq!(again.stderr, made.stderr, "the same findings");
        assert!(String::from_utf8_lossy(&again.stderr).contains("E0801"));
        assert_eq!(place.files(), files, "no byte and no time has changed");
    }
    let value = |output: &Output| -> serde_json::Value {
        let mut value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        value["seconds"].take();
        value
    };
    let json = place.build(&["--format", "json"]);
    std::fs::remove_file(place.0.path().join("out/flap.manifest")).unwrap();
    assert_eq!(value(&json), value(&place.build(&["--format", "json"])));
    assert_eq!(value(&json)["artefacts"].as_array().unwrap().len(), 2);
}

#[test]
fn a_comment_changes_nothing_and_a_number_does() {
    let place = Place::new();
    place.build(&[]);
    place.build(&[]);
    place.write(&format!("// A comment.\n{DESIGN}"));
    let before = place.files();
    let moved = place.build(&[]);
    assert!(String::from_utf8_lossy(&moved.stdout).contains("nothing has changed"));
    assert_eq!(place.files(), before);
    let found = String::from_utf8(moved.stderr).unwrap();
    let line = DESIGN.lines().position(|l| l.contains("0.01 MPa")).unwrap() + 2;
    assert!(found.contains(&format!("flap.mech:{line}:")), "at its new line {line}: {found}");
    for (from, to) in [("(30 mm, 0 mm)", "(31 mm, 0 mm)"), ("0.01 MPa", "0.02 MPa"), ("stl, ", "")] {
        place.write(&DESIGN.replace(from, to));
        assert!(!place.unchanged(&[]), "{to}");
        assert!(place.unchanged(&[]), "{to}");
    }
}

#[test]
fn what_is_lost_or_edited_comes_back() {
    let place = Place::new();
    place.build(&[]);
    let files = place.files();
    let stl = files.keys().find(|p| p.extension().is_some_and(|e| e == "stl")).unwrap();
    let sketch = files.keys().find(|p| p.extension().is_some_and(|e| e == "ino")).unwrap();
    std::fs::remove_file(stl).unwrap();
    assert!(!place.unchanged(&[]));
    let edited = String::from_utf8(files[sketch].0.clone()).unwrap().replacen("//", "///", 1);
    std::fs::write(sketch, edited).unwrap();
    assert!(!place.unchanged(&[]));
    for (path, (bytes, when)) in place.files() {
        assert_eq!(bytes, files[&path].0, "{path:?}");
        assert_eq!(
            when == files[&path].1,
            path != *stl && path != *sketch,
            "only what was missing: {path:?}"
        );
    }
    assert!(!place.unchanged(&["--fresh"]), "made from the start");
    assert!(!place.unchanged(&["--out", "elsewhere"]), "another folder is empty");
    assert!(!place.unchanged(&["--steps", "5"]));
    assert!(!place.unchanged(&[]), "the folder holds another design");
    assert!(place.unchanged(&[]));
}

/// A manifest cannot make the command read what is not below the output folder, nor what is no plain file.
#[cfg(unix)]
#[test]
fn links_are_not_what_was_made() {
    let place = Place::new();
    place.build(&[]);
    let stl = place.files().into_keys().find(|p| p.extension().is_some_and(|e| e == "stl")).unwrap();
    let aside = place.0.path().join("aside.stl");
    std::fs::rename(&stl, &aside).unwrap();
    std::os::unix::fs::symlink(&aside, &stl).unwrap();
    assert!(!place.unchanged(&[]), "a link to the same bytes is no file of the folder");
    assert!(stl.symlink_metadata().unwrap().is_file());
}

#[test]
fn another_file_of_a_solid_is_another_design() {
    let place = Place::new();
    let block = include_str!("elaborate/errors/solids/block.stl");
    let stl = place.0.path().join("block.stl");
    std::fs::write(&stl, block).unwrap();
    place.write(&DESIGN.replace("    material", "    solid \"block.stl\" on arm at P\n    material"));
    place.build(&[]);
    assert!(place.unchanged(&[]));
    let before = place.files();
    std::fs::write(&stl, block.replace('6', "6.5")).unwrap();
    assert!(!place.unchanged(&[]), "the block is higher");
    let after = place.files();
    let changed: Vec<&PathBuf> =
        after.iter().filter(|(p, f)| before.get(*p).is_none_or(|b| b.0 != f.0)).map(|f| f.0).collect();
    assert!(changed.iter().any(|p| p.ends_with("flap_base.stl")), "{changed:?}");
    assert!(!changed.iter().any(|p| p.extension().is_some_and(|e| e == "lock")), "{changed:?}");
    // The same bytes again change nothing, whatever their time.
    std::fs::write(&stl, block.replace('6', "6.5")).unwrap();
    assert!(place.unchanged(&[]));
}
