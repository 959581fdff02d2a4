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

    /// What to say at the first Ctrl-C; it works from any thread.
    pub fn on_stop(&self) -> impl Fn() + Send + 'static {
        let bar = self.bar.clone();
        move || {
            bar.println(
                "stopping: the best point found is kept (Ctrl-C again ends at once and keeps nothing)",
            )
        }
    }

    /// Takes the line away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Nothing is shown: it is done at once, or several designs are worked on at a time.
pub struct Silent;

impl Progress for Silent {
    fn seconds(&self) -> f64 {
        0.0
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

    fn design(&self, name: &str) {
        self.bar.println(name);
    }

    fn iteration(&self, iteration: &Iteration) {
        let [heading, line] = iteration_lines(iteration, self.seconds());
        if iteration.number == 0 {
            self.bar.println(heading);
        }
        self.bar.println(line);
        self.bar.set_message(format!(
            "optimising, iteration {} (Ctrl-C keeps the best so far)",
            iteration.number + 1
        ));
    }
}

/// Heading and row: iteration, objective and its terms, largest error and stress, time.
fn iteration_lines(iteration: &Iteration, seconds: f64) -> [String; 2] {
    let mut lines = [String::from("iteration"), format!("{:>9}", iteration.number)];
    let mut column = |name: &str, value: String| {
        let width = name.chars().count().max(9);
        lines[0].push_str(&format!("  {name:>width$}"));
        lines[1].push_str(&format!("  {value:>width$}"));
    };
    column("objective", format!("{:.3e}", iteration.objective));
    for (name, value) in &iteration.terms {
        column(name, format!("{value:.2e}"));
    }
    if let Some(error) = iteration.max_error_mm {
        column("max error", format!("{error:.3} mm"));
    }
    if let Some(stress) = iteration.max_stress_mpa {
        column("max stress", format!("{stress:.1} MPa"));
    }
    column("time", format!("{seconds:.1} s"));
    lines
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
            iteration_lines(&iteration, 1.5),
            [
                "iteration  objective  track(tip)  max error       time",
                "        3   2.500e-1     2.00e-1   0.500 mm      1.5 s",
            ]
        );
    }
}
