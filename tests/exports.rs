//! What a build writes for printers, viewers and pages: a small mechanism with every export of its parts, read back.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use dxf::{Drawing, entities::EntityType, enums::Units};
use flexura::geometry::{Mesh, check_mesh};
use flexura::pipeline::{Artefact, BuildOutcome, Compiler, Request, Show, Stages, build, simulate};
use nalgebra::{Matrix4, Quaternion, UnitQuaternion, Vector3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

/// One leaf, printed at rest and bent to both sides.
const FLAP: &str = "use std.materials.petg
use std.processes.fdm
use std.motors.nema17
use std.flexures.leaf

mechanism flap {
    point O = (0 mm, 0 mm)
    point B = (-25 mm, 0 mm)
    point P = (30 mm, 0 mm)
    ground base { B, O }
    link   arm  { O, P }
    hinge bend: base to arm at O  into base toward B  into arm toward P  as leaf { thickness = 0.8 mm }
    material petg
    print on fdm
    cycle 4 steps over 2 s
    drive bend from -10 deg to 10 deg with nema17
    trace tip = P on arm
    export stl, stl(assembled), 3mf, sheet, glb, svg, png
}
";

fn request() -> Request {
    Request { source: "flap.mech".into(), ..Request::default() }
}

fn built(text: &str, threads: usize) -> BuildOutcome {
    let files = BTreeMap::from([("flap.mech".to_string(), text.to_string())]);
    let compiler = Compiler { iterations: 0, ..Compiler::default() };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| build(&request(), &compiler, &files, &common::NoClock, &AtomicBool::new(false)))
}

fn flap() -> &'static BuildOutcome {
    static BUILT: OnceLock<BuildOutcome> = OnceLock::new();
    BUILT.get_or_init(|| built(FLAP, 1))
}

fn file(name: &str) -> &'static [u8] {
    let all = &flap().artefacts;
    let names: Vec<&str> = all.iter().map(|a| a.name.as_str()).collect();
    &all.iter().find(|a| a.name == name).unwrap_or_else(|| panic!("{name} is not among {names:?}")).bytes
}

/// All findings but those of the lints, which have tests of their own.
fn codes(out: &BuildOutcome) -> Vec<&str> {
    out.diagnostics.iter().map(|d| d.code.as_str()).filter(|c| !c.starts_with("W1")).collect()
}

fn read_stl(bytes: &[u8]) -> Mesh {
    let stl = stl_io::read_stl(&mut std::io::Cursor::new(bytes)).unwrap();
    let vertices = stl.vertices.iter().map(|v| Vector3::new(v[0], v[1], v[2]).cast()).collect();
    Mesh { vertices, triangles: stl.faces.iter().map(|f| f.vertices).collect() }
}

/// A binary glTF taken apart: its JSON and its binary chunk.
struct Glb {
    json: Value,
    binary: Vec<u8>,
}

impl Glb {
    fn read(bytes: &[u8]) -> Self {
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
        let json = word(12);
        assert_eq!((&bytes[16..20], json % 4), (&b"JSON"[..], 0));
        let second = 20 + json;
        assert_eq!((&bytes[second + 4..second + 8], second + 8 + word(second)), (&b"BIN\0"[..], bytes.len()));
        Self {
            json: serde_json::from_slice(&bytes[20..second]).unwrap(),
            binary: bytes[second + 8..].to_vec(),
        }
    }

    fn floats(&self, accessor: usize) -> Vec<f64> {
        let a = &self.json["accessors"][accessor];
        assert_eq!(a["componentType"], 5126);
        let wide = match a["type"].as_str().unwrap() {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            "MAT4" => 16,
            other => panic!("{other}"),
        };
        let view = &self.json["bufferViews"][a["bufferView"].as_u64().unwrap() as usize];
        let from = view["byteOffset"].as_u64().unwrap_or(0) as usize;
        let count = a["count"].as_u64().unwrap() as usize * wide;
        let bytes = &self.binary[from..from + 4 * count];
        bytes.chunks(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap()))).collect()
    }

    fn node(&self, name: &str) -> usize {
        let nodes = self.json["nodes"].as_array().unwrap();
        nodes.iter().position(|n| n["name"] == name).unwrap_or_else(|| panic!("no node {name}"))
    }

    /// Where a node is at a key, from the animation or as it stands.
    fn placed(&self, node: usize, key: usize) -> Matrix4<f64> {
        let own = |what: &str| -> Vec<f64> {
            let list = self.json["nodes"][node][what].as_array().unwrap();
            list.iter().map(|x| x.as_f64().unwrap()).collect()
        };
        let value = |what: &str| {
            let animation = &self.json["animations"][0];
            let channels = animation["channels"].as_array().unwrap();
            let mine = |c: &&Value| c["target"]["node"] == node && c["target"]["path"] == what;
            let Some(channel) = channels.iter().find(mine) else { return own(what) };
            let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap() as usize];
            let all = self.floats(sampler["output"].as_u64().unwrap() as usize);
            let wide = if what == "rotation" { 4 } else { 3 };
            all[key * wide..(key + 1) * wide].to_vec()
        };
        let (t, q) = (value("translation"), value("rotation"));
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(q[3], q[0], q[1], q[2]));
        Matrix4::new_translation(&Vector3::new(t[0], t[1], t[2])) * turn.to_homogeneous()
    }
}

/// The poses of `simulate` are the key frames of the file, in metres, and the ends of a flexure ride with its links.
#[test]
fn the_animation_is_the_solved_motion() {
    /// Single precision at 0.03 m.
    const METRES: f64 = 2e-8;
    let glb = Glb::read(file("flap.glb"));
    let files = BTreeMap::from([("flap.mech".to_string(), FLAP.to_string())]);
    let show = Show { rigid: false, poses: true };
    let (_, simulation) = simulate(&request(), show, &Compiler::default(), &files);
    let states = simulation.unwrap().motion.states;
    let times = glb.json["animations"][0]["samplers"][0]["input"].as_u64().unwrap() as usize;
    assert_eq!(glb.floats(times), [0.0, 0.5, 1.0, 1.5, 2.0]);
    let (arm, base) = (glb.node("arm"), glb.node("base"));
    // The node at rest: with the mesh about the body's centre, that is where the centre is.
    let mesh = &glb.json["meshes"][glb.json["nodes"][arm]["mesh"].as_u64().unwrap() as usize];
    let positions = glb.floats(mesh["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize);
    let in_place = read_stl(file("assembled/flap_base.stl"));
    let right = in_place.vertices.iter().map(|v| v.x).fold(f64::MIN, f64::max);
    let reach = positions.chunks(3).map(|p| p[0]).fold(f64::MIN, f64::max);
    let skin = &glb.json["skins"][0];
    let joints: Vec<usize> =
        skin["joints"].as_array().unwrap().iter().map(|j| j.as_u64().unwrap() as usize).collect();
    assert_eq!(joints.len(), 21, "a joint a station of 20 edges");
    let inverse = glb.floats(skin["inverseBindMatrices"].as_u64().unwrap() as usize);
    let rest = |k: usize| Matrix4::from_column_slice(&inverse[16 * k..16 * k + 16]).try_inverse().unwrap();
    for (key, state) in states.iter().enumerate() {
        let (t, turn) = state.poses[0];
        let turned = UnitQuaternion::from_scaled_axis(Vector3::from(turn)).to_homogeneous();
        let pose = Matrix4::new_translation(&(Vector3::from(t) * 1e-3)) * turned;
        // Its centre at rest is the hinge: the only joint.
        assert!((glb.placed(arm, key) - pose).norm() < 1e2 * METRES, "state {key}");
        // A station's frame is carried rigidly by the link it is clamped in.
        let last = joints.len() - 1;
        for (station, pose) in [(0, glb.placed(base, key)), (last, pose)] {
            let (now, was) = (glb.placed(joints[station], key), rest(station));
            let apart = now.column(3) - pose * was.column(3);
            assert!(apart.norm() < 1e2 * METRES, "station {station} in state {key} is {apart} off");
        }
    }
    assert!((reach * 1e3 - right).abs() < 1e-3, "the arm ends at {right} mm, in the file at {reach} m");
    // In the middle it bends: the stations do not lie on one line.
    let middle = |key: usize| glb.placed(joints[10], key).column(3).xyz();
    let (a, b) = (glb.placed(joints[0], 4).column(3).xyz(), glb.placed(joints[20], 4).column(3).xyz());
    let off = (middle(4) - a).cross(&(b - a)).norm() / (b - a).norm();
    assert!(off > 1e-4, "bent by {off} m");
}

#[test]
fn parts_lie_on_the_bed_and_stand_in_the_assembly() {
    let (lying, placed) = (read_stl(file("flap_base.stl")), read_stl(file("assembled/flap_base.stl")));
    let (facts, in_place) = (check_mesh(&lying), check_mesh(&placed));
    assert!(facts.is_printable() && in_place.is_printable(), "{facts:?}");
    assert!(facts.least.norm() < 1e-4, "the box begins at the origin: {}", facts.least);
    assert!(in_place.least.x < -25.0 && in_place.least.z < -5.0, "where it was drawn: {}", in_place.least);
    assert!((facts.volume_mm3 - in_place.volume_mm3).abs() < 1e-4 * facts.volume_mm3);
}

/// Solved figures in words: 0.8 mm are two lines of 0.4 mm.
#[test]
fn the_sheet_says_what_to_set() {
    let sheet = std::str::from_utf8(file("flap.print.md")).unwrap();
    insta::with_settings!({ snapshot_path => "exports/snapshots", prepend_module_to_snapshot => false }, {
        insta::assert_snapshot!("sheet", sheet);
    });
}

#[test]
fn the_archive_has_no_times_in_it() {
    let archive = file("flap.3mf");
    assert_eq!(&archive[..4], b"PK\x03\x04");
    // Time and date of the first file: 0:00:00 on 1 January 1980.
    assert_eq!(&archive[10..14], [0, 0, 0x21, 0]);
}

/// A part of plates is told whole by its outlines: they enclose its volume, holes left out. One with a leaf of elliptic section is not.
#[test]
fn outlines_of_plates_enclose_the_part() {
    let out = built(include_str!("exports/plates.mech"), 1);
    assert!(codes(&out).is_empty(), "{:?}", out.diagnostics);
    let bytes = |name: &str| &out.artefacts.iter().find(|a| a.name == name).unwrap().bytes;
    let drawing = Drawing::load(&mut std::io::Cursor::new(bytes("plates_base.dxf"))).unwrap();
    assert_eq!(drawing.header.default_drawing_units, Units::Millimeters);
    let (mut volume, mut least, mut round) = (0.0, f64::INFINITY, 0);
    for entity in drawing.entities() {
        let EntityType::LwPolyline(line) = &entity.specific else { panic!("{entity:?}") };
        assert!(line.is_closed() && line.vertices.len() >= 3);
        let [low, high] = entity
            .common
            .layer
            .trim_start_matches("z ")
            .trim_end_matches(" mm")
            .split_once(" to ")
            .map(|(a, b)| [a, b].map(|x| x.parse::<f64>().unwrap()))
            .unwrap();
        let next = line.vertices.iter().cycle().skip(1);
        let area: f64 = line.vertices.iter().zip(next).map(|(p, q)| 0.5 * (p.x * q.y - p.y * q.x)).sum();
        volume += area * (high - low);
        round += usize::from(area < 0.0);
        least = line.vertices.iter().fold(least, |least, v| least.min(v.x).min(v.y));
    }
    let part = check_mesh(&read_stl(bytes("plates_base.stl")));
    // Rounded rims are not cut.
    let rims = volume / part.volume_mm3 - 1.0;
    assert!((0.0..0.03).contains(&rims), "{volume} of {}", part.volume_mm3);
    assert!(round >= 1, "the hole is an outline of its own, the other way round");
    assert!(least.abs() < 1e-4, "where the part lies: {least}");
    let bent = built(&FLAP.replace("export stl, stl(assembled), 3mf, sheet, glb, svg, png", "export dxf"), 1);
    assert_eq!(codes(&bent), ["W0650"]);
}

#[test]
fn the_drawing_is_plain_text_with_short_numbers() {
    let svg = std::str::from_utf8(file("flap.svg")).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    for word in ["arm", "bend", "tip (trace)", ">30.0<"] {
        assert!(svg.contains(word), "no {word} in {svg}");
    }
    let digits = |text: &str| text.chars().take_while(char::is_ascii_digit).count();
    assert!(svg.split('.').skip(1).all(|after| digits(after) <= 3), "few decimals: {svg}");
    assert!(!svg.contains("NaN") && !svg.contains("inf") && !svg.contains("\"-0\""));
}

#[test]
fn the_picture_shows_something() {
    let mut reader = png::Decoder::new(std::io::Cursor::new(file("flap.png"))).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.width, info.height), (960, 720));
    let pixel = |x: usize, y: usize| -> [u8; 3] { pixels[3 * (y * 960 + x)..][..3].try_into().unwrap() };
    assert_eq!((pixel(0, 0), pixel(959, 719)), ([255; 3], [255; 3]), "white around");
    let dark = pixels.chunks(3).filter(|p| p.iter().any(|c| *c < 240)).count();
    let share = dark as f64 / (960.0 * 720.0);
    assert!((0.05..0.9).contains(&share), "{share} of the picture is covered");
    // The leaf is coloured: somewhere blue or green stands out.
    assert!(pixels.chunks(3).any(|p| i32::from(p[2]) > i32::from(p[0]) + 60), "no colour of stress");
}

#[test]
fn the_same_bytes_on_two_threads() {
    let again = built(FLAP, 2);
    let names = |out: &BuildOutcome| out.artefacts.iter().map(|a| a.name.clone()).collect::<Vec<_>>();
    assert_eq!(names(flap()), names(&again));
    for (a, b) in flap().artefacts.iter().zip(&again.artefacts) {
        assert!(a.bytes == b.bytes, "{} differs", a.name);
    }
}

/// The bed, and flexures that no way of laying keeps within the layers: each is told where the process says that it counts.
#[test]
fn what_cannot_be_printed_well_is_told() {
    assert!(!codes(flap()).iter().any(|c| c.starts_with("W064")), "{:?}", flap().diagnostics);
    let own = "process small {\n least_wall = 0.8 mm\n clearance = 0.5 mm\n bed_width = 30 mm\n \
               bed_depth = 40 mm\n bed_height = 50 mm\n}\n";
    let small = FLAP.replace("use std.processes.fdm\n", own).replace("print on fdm", "print on small");
    let small = small.replace("export stl, stl(assembled), 3mf, sheet, glb, svg, png", "export stl");
    assert_eq!(codes(&built(&small, 1)), ["W0645"]);
    // Two crossed hinges with axes at right angles: their leaves run in three directions.
    let space = include_str!("exports/wrist.mech");
    let out = built(space, 1);
    let told: Vec<_> = out.diagnostics.iter().filter(|d| d.code == "W0644").collect();
    assert_eq!(told.len(), 1, "{:?}", out.diagnostics);
    assert!(told[0].message.contains("2 of 4 leave them"), "{}", told[0].message);
    let sls = built(&space.replace("fdm", "sls"), 1);
    assert!(!codes(&sls).contains(&"W0644"), "the process does not say that it is weak across its layers");
    assert!(sls.artefacts.iter().any(|a: &Artefact| a.name.ends_with(".stl")));
}

#[test]
fn without_exports_the_stage_gives_parts_in_place() {
    let design = flap().design.clone().unwrap();
    let starts: Vec<f64> = design.free.iter().map(|f| f.start).collect();
    let (parts, _) = Compiler::default().mesh(&design, &starts).unwrap();
    assert_eq!(parts.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["flap_base.stl"]);
    assert!(parts[0].bytes == file("assembled/flap_base.stl"), "what was asked for by name");
}
