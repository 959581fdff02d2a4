//! The lock comes back bit for bit, and nothing a person or a merge does to it goes unnoticed.

use super::*;
use proptest::prelude::*;

fn sample() -> Lock {
    let values = [("knee.thickness", 0.8), ("knee.upper.from.at.phi", -0.1), ("scale", 1e-300)];
    let units = [("knee.thickness", "mm"), ("knee.upper.from.at.phi", "rad"), ("scale", "1")];
    Lock {
        design: digest(b"design"),
        solver: SOLVER_VERSION.into(),
        solution: Solution {
            values: values.map(|(p, v)| (p.to_string(), v)).into(),
            iterations: 23,
            converged: true,
        },
        units: units.map(|(p, u)| (p.to_string(), u.to_string())).into(),
        intact: true,
        ..Lock::default()
    }
}

fn codes(text: &str) -> Vec<String> {
    Lock::parse(text, 3).unwrap_err().into_iter().map(|d| d.code).collect()
}

#[test]
fn reads_what_it_writes() {
    insta::assert_snapshot!(sample().write());
    assert_eq!(Lock::parse(&sample().write(), 0), Ok(sample()));
}

#[test]
fn line_ends_of_windows_are_no_edit() {
    let text = sample().write().replace('\n', "\r\n");
    assert_eq!(Lock::parse(&text, 0), Ok(sample()));
}

#[test]
fn notices_an_edited_value() {
    let text = sample().write().replace("0.8 mm", "0.9 mm");
    let lock = Lock::parse(&text, 0).unwrap();
    assert!(!lock.intact);
    assert_eq!(lock.solution.values["knee.thickness"], 0.9);
}

#[test]
fn says_what_is_damaged_and_where() {
    let good = sample().write();
    assert_eq!(codes(""), ["E0701"]);
    assert_eq!(codes("hello"), ["E0701"]);
    assert_eq!(codes(&good.replace("lock 1", "lock 2")), ["E0701"]);
    assert_eq!(codes(&good.replace("iterations 23", "<<<<<<< ours\niterations 23")), ["E0702"]);
    assert_eq!(codes(&good.replace("0.8 mm", "NaN mm")), ["E0703"]);
    assert_eq!(codes(&good.replace("0.8 mm", "0.8 mm mm")), ["E0703"]);
    assert_eq!(codes(&good.replace("converged true", "converged perhaps\niterations 9")), ["E0703", "E0704"]);
    assert_eq!(codes(&good.replace("iterations 23\n", "")), ["E0705"]);
    let found = Lock::parse(&good.replace("iterations 23", "iterations many"), 3).unwrap_err();
    let at = found[0].labels[0].at;
    let text = good.replace("iterations 23", "iterations many");
    assert_eq!(at.file, 3);
    assert_eq!(&text[at.start as usize..at.end as usize], "iterations many");
    assert!(found.iter().all(|d| d.help.is_some()));
}

fn finite() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |v| v.is_finite())
}

proptest! {
    #[test]
    fn any_value_comes_back_bit_for_bit(values in prop::collection::btree_map("[a-z][a-z_0-9.]{0,12}", finite(), 0..8)) {
        let mut lock = sample();
        lock.units = values.keys().map(|p| (p.clone(), "mm".to_string())).collect();
        lock.solution.values = values;
        let back = Lock::parse(&lock.write(), 0).unwrap();
        prop_assert!(back.intact);
        prop_assert_eq!(back.solution.values.len(), lock.solution.values.len());
        for (path, value) in &lock.solution.values {
            prop_assert_eq!(back.solution.values[path].to_bits(), value.to_bits());
        }
    }

    #[test]
    fn any_text_is_read_without_a_panic(text in ".{0,200}") {
        let _ = Lock::parse(&text, 0);
        let _ = Lock::parse(&format!("{TITLE}\n{text}"), 0);
    }

    #[test]
    fn a_damaged_file_is_never_taken_for_whole(at in 0usize..2000, with in "[ -~]") {
        let good = sample().write();
        let at = at % good.len();
        let mut bytes = good.clone().into_bytes();
        bytes[at] = with.as_bytes()[0];
        let text = String::from_utf8(bytes).unwrap();
        if let Ok(lock) = Lock::parse(&text, 0) {
            // What still parses is either unchanged where it matters or known to be edited or stale.
            let same = lock.solution.values == sample().solution.values && lock.units == sample().units;
            prop_assert!(same || !lock.intact);
        }
    }
}

#[test]
fn several_designs_have_a_part_each() {
    let finger = sample();
    let mut thumb = sample();
    thumb.design = digest(b"thumb");
    thumb.solution.values.insert("knee.thickness".into(), 0.9);
    (thumb.solution.iterations, thumb.solution.converged) = (4, false);
    let joined = Lock::join([("finger".to_string(), finger.clone()), ("thumb".to_string(), thumb.clone())]);
    assert_eq!((joined.solution.iterations, joined.solution.converged), (27, false));
    let text = joined.write();
    let read = Lock::parse(&text, 0).unwrap();
    assert_eq!(read.part("finger"), finger);
    assert_eq!(read.part("thumb"), thumb);
    assert_eq!(read.write(), text);
    assert_eq!(read.part("palm").solution.values, BTreeMap::new(), "nothing is known of it");
    assert_eq!(codes(&text.replace("converged thumb false\n", "")), ["E0705"]);
    assert_eq!(codes(&text.replace("iterations finger 23", "iterations finger many")), ["E0703"]);
    let edited =
        Lock::parse(&text.replace("thumb.knee.thickness = 0.9", "thumb.knee.thickness = 0.7"), 0).unwrap();
    assert!(!edited.part("thumb").intact);
}
