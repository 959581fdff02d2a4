//! Ctrl-C: the first one ends an optimisation and keeps the best point, a second one, or one while nothing is being
//! optimised, ends the program. A process has one handler, and `--watch` builds many times.

use super::render::tell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Exit code after Ctrl-C, as shells have it for SIGINT.
const INTERRUPTED: i32 = 130;

type Say = Box<dyn Fn() + Send>;

#[derive(Default)]
struct State {
    /// Asked to stop.
    cancel: Arc<AtomicBool>,
    /// An optimisation may be at work, and this is how to tell that it is stopping.
    say: Mutex<Option<Say>>,
}

static STATE: OnceLock<State> = OnceLock::new();

/// From now on the first Ctrl-C only sets what is returned, and says so.
pub fn during(say: impl Fn() + Send + 'static) -> Arc<AtomicBool> {
    let mut first = false;
    let state = STATE.get_or_init(|| {
        first = true;
        State::default()
    });
    *state.say.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(say));
    if first && let Err(e) = ctrlc::set_handler(|| on_interrupt(state_of_process())) {
        tell(&format!("warning: Ctrl-C will not keep the best point: {e}\n"));
    }
    Arc::clone(&state.cancel)
}

/// From now on Ctrl-C ends the program at once.
pub fn over() {
    if let Some(state) = STATE.get() {
        *state.say.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

/// Whether Ctrl-C has been pressed.
pub fn happened() -> bool {
    STATE.get().is_some_and(|s| s.cancel.load(Ordering::SeqCst))
}

fn state_of_process() -> &'static State {
    STATE.get_or_init(State::default)
}

fn on_interrupt(state: &State) {
    let say = state.say.lock().unwrap_or_else(PoisonError::into_inner);
    match &*say {
        Some(say) if !state.cancel.swap(true, Ordering::SeqCst) => say(),
        _ => std::process::exit(INTERRUPTED),
    }
}
