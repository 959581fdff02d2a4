//! Where the mechanism stays when nobody holds its drives, for a person.

use flexura::pipeline::{DriveValues, Stability};
use std::fmt::Write;

/// One line a rest state, empty where there is none.
pub fn released(stability: &Stability) -> String {
    let mut text = String::new();
    for (i, rest) in stability.rest_states.iter().enumerate() {
        let barrier = |b: Option<f64>, way: &str| b.map(|b| format!(", {b:.3} {way}")).unwrap_or_default();
        let _ = writeln!(
            text,
            "{} at {}: {:.3} N·mm{}{}",
            if i == 0 { "released, it rests" } else { "and               " },
            place(&rest.drives),
            rest.energy_n_mm,
            barrier(rest.barrier_up_n_mm, "more to leave it upwards"),
            barrier(rest.barrier_down_n_mm, "downwards"),
        );
    }
    text
}

fn place(drives: &DriveValues) -> String {
    let one = |(name, v): (&String, &f64)| {
        let (name, unit) = name.rsplit_once('_').unwrap_or((name, ""));
        format!("{name} = {v:.3} {unit}")
    };
    drives.iter().map(one).collect::<Vec<_>>().join(", ")
}
