//! What a build tells an editor while it works: a line of JSON each, on the standard error.

use super::render::tell;
use flexura::lsp::Event;
use flexura::pipeline::{BuildOutcome, Iteration, Progress, Stage};
use std::path::Path;
use std::time::Instant;

/// Progress as lines.
pub struct Events {
    began: Instant,
}

impl Events {
    /// From now on.
    pub fn new() -> Self {
        Self { began: Instant::now() }
    }

    /// What was found and written.
    pub fn outcome(&self, out: &BuildOutcome, written: &[(String, usize)]) {
        send(&Event::Found(out.diagnostics.clone(), out.sources.clone(), !out.failed()));
        let absolute = |path: &String| {
            let full = std::path::absolute(Path::new(path)).ok();
            full.and_then(|p| p.to_str().map(|p| p.replace('\\', "/"))).unwrap_or_else(|| path.clone())
        };
        send(&Event::Files(written.iter().map(|(path, _)| absolute(path)).collect()));
    }
}

fn send(event: &Event) {
    if let Ok(line) = serde_json::to_string(event) {
        tell(&format!("{line}\n"));
    }
}

impl Progress for Events {
    fn seconds(&self) -> f64 {
        self.began.elapsed().as_secs_f64()
    }

    fn stage(&self, stage: Stage) {
        let text = match stage {
            Stage::Check => "reading",
            Stage::Solve => "optimising",
            Stage::Simulate => "simulating",
            Stage::Mesh => "meshing",
            Stage::Emit => "writing",
        };
        send(&Event::Stage(text.into()));
    }

    fn iteration(&self, iteration: &Iteration) {
        send(&Event::Iteration(iteration.number, iteration.objective));
    }
}
