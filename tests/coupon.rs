//! `flexura coupon` as a user meets it: a test piece, its readings, the stiffness.
#![allow(clippy::unwrap_used)]

use flexura::geometry::{Mesh, check_mesh};
use nalgebra::Vector3;
use std::path::Path;
use std::process::{Command, Output};

fn flexura(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_flexura")).args(arguments).current_dir(folder).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn mesh(path: &Path) -> Mesh {
    let read = stl_io::read_stl(&mut std::fs::File::open(path).unwrap()).unwrap();
    let vertices = read.vertices.iter().map(|v| Vector3::new(v[0], v[1], v[2]).cast::<f64>()).collect();
    Mesh { vertices, triangles: read.faces.iter().map(|f| f.vertices).collect() }
}

#[test]
fn a_piece_is_made_measured_and_read() {
    let dir = tempfile::tempdir().unwrap();
    let made = flexura(dir.path(), &["coupon", "pla"]);
    assert_eq!(made.status.code(), Some(0), "{}", text(&made.stderr));
    let folder = dir.path().join("coupon");
    assert!(check_mesh(&mesh(&folder.join("coupon_comb.stl"))).is_printable());
    let checked = flexura(dir.path(), &["check", "coupon/coupon.mech"]);
    assert_eq!((checked.status.code(), text(&checked.stderr)), (Some(0), String::new()));
    assert_eq!(flexura(dir.path(), &["fmt", "--check", "coupon/coupon.mech"]).status.code(), Some(0));

    // Entered as the sheet foretells them, the drops give the library's own E, to the sheet's digits.
    let sheet = std::fs::read_to_string(folder.join("README.md")).unwrap();
    let foretold: Vec<&str> = sheet
        .lines()
        .filter(|l| l.starts_with("| th") || l.starts_with("| mid"))
        .filter_map(|l| l.split('|').nth(4))
        .collect();
    assert_eq!(foretold.len(), 6, "{sheet}");
    let readings = folder.join("measured.csv");
    let empty = std::fs::read_to_string(&readings).unwrap();
    let mut lines = empty.lines();
    let mut entered = format!("{}\n", lines.next().unwrap());
    for (line, drop) in lines.zip(foretold) {
        entered.push_str(&format!("{line}{}\n", drop.trim()));
    }
    std::fs::write(&readings, &entered).unwrap();
    let read = flexura(dir.path(), &["coupon", "pla", "--measured", "coupon/measured.csv"]);
    let told = text(&read.stdout);
    assert_eq!(read.status.code(), Some(0), "{}", text(&read.stderr));
    let e: f64 = told.lines().last().unwrap().trim().split(' ').nth(2).unwrap().parse().unwrap();
    assert!((e / 3000.0 - 1.0).abs() < 0.01, "{told}");

    // A second piece leaves readings alone.
    assert_eq!(flexura(dir.path(), &["coupon", "pla"]).status.code(), Some(0));
    assert_eq!(std::fs::read_to_string(&readings).unwrap(), entered);
}

#[test]
fn what_cannot_be_done_is_told() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("none.csv"), "beam,thickness_mm,width_mm,weight_g,drop_mm\n").unwrap();
    for (arguments, code, words) in [
        (vec!["coupon", "plaa"], "E0770", "did you mean `pla`"),
        (vec!["coupon", "pla", "--on", "fdn"], "E0770", "did you mean `fdm`"),
        (vec!["coupon", "pla", "--measured", "gone.csv"], "E0730", "gone.csv"),
        (vec!["coupon", "pla", "--measured", "none.csv"], "E0771", "nothing has been measured"),
    ] {
        let out = flexura(dir.path(), &arguments);
        let told = text(&out.stderr);
        assert_eq!(out.status.code(), Some(1), "{arguments:?}");
        assert!(told.contains(code) && told.contains(words), "{arguments:?}: {told}");
    }
}
