//! Progress on the terminal while a build works, and its clock. On anything but a terminal it is silent.

use flexura::pipeline::{Iteration, Progress, Stage};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// A line with a spinner that says what goes on.
pub struct Terminal {
    began: Instant,
    bar: ProgressBar,
}

impl Terminal {
    /// Shows progress if wanted and the standard error is a terminal.
    pub fn new(wanted: bool) -> Self {
        let bar = if wanted && std::io::stderr().is_terminal() {
            let bar = ProgressBar::new_spinner();
            if let Ok(style) = ProgressStyle::with_template("{spinner} {msg}  {elapsed}") {
                bar.set_style(style);
            }
            bar.enable_steady_tick(Duration::from_millis(100));
            bar
        } else {
            ProgressBar::hidden()
        };
        Self { began: Instant::now(), bar }
    }

    /// Takes the line away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Progress for Terminal {
    fn seconds(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    fn stage(&self, stage: Stage) {
        self.bar.set_message(match stage {
            Stage::Check => "reading",
            Stage::Solve => "optimising",
            Stage::Simulate => "simulating",
            Stage::Mesh => "meshing",
            Stage::Emit => "writing",
        });
    }

    fn iteration(&self, iteration: &Iteration) {
        let line = iteration_line(iteration, self.seconds());
        self.bar.println(&line);
        self.bar.set_message(format!("optimising, iteration {}", iteration.number + 1));
    }
}

/// Iteration, objective by term, largest error, time.
fn iteration_line(iteration: &Iteration, seconds: f64) -> String {
    let mut line = format!("{:>4}  objective {:<11.5e}", iteration.number, iteration.objective);
    for (name, value) in &iteration.terms {
        line.push_str(&format!("  {name} {value:<10.4e}"));
    }
    if let Some(error) = iteration.max_error_mm {
        line.push_str(&format!("  error {error:8.4} mm"));
    }
    if let Some(stress) = iteration.max_stress_mpa {
        line.push_str(&format!("  stress {stress:7.2} MPa"));
    }
    line.push_str(&format!("  {seconds:6.2} s"));
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_iteration_terms_error_and_time() {
        let iteration = Iteration {
            number: 3,
            objective: 0.25,
            terms: vec![("track(tip)".into(), 0.2)],
            max_error_mm: Some(0.5),
            max_stress_mpa: None,
        };
        assert_eq!(
            iteration_line(&iteration, 1.5),
            "   3  objective 2.50000e-1   track(tip) 2.0000e-1   error   0.5000 mm    1.50 s"
        );
    }
}
