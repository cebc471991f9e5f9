//! Ctrl-C and SIGTERM: the first cancels the work, or ends a command that writes nothing; the second
//! ends the program. A signal that whoever started the program has it ignore, as `nohup` and shells do, stays
//! ignored.

use crate::end::{CANCELLED, End};
use crate::errors;
use if_core::monitor::Cancelled;
use std::path::{Path, PathBuf};
use std::process::exit;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);
/// What a sudden end must remove.
static PARTIAL: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Starts listening; `at_once` if the first signal may end the program. Where the system has no
/// handlers, signals end the program as they always do.
pub(crate) fn listen(at_once: bool) {
    on_signal(move || {
        if REQUESTED.swap(true, Ordering::SeqCst) || at_once {
            for path in PARTIAL.lock().map(|mut p| std::mem::take(&mut *p)).unwrap_or_default() {
                let _ = std::fs::remove_dir_all(path);
            }
            exit(i32::from(CANCELLED));
        }
    });
}

/// Calls `act` at each signal, on a thread of its own.
#[cfg(unix)]
fn on_signal(act: impl Fn() + Send + 'static) {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let ignored = ignored();
    let heard = [SIGINT, SIGTERM].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
    if let Ok(mut signals) = signal_hook::iterator::Signals::new(heard) {
        std::thread::spawn(move || signals.forever().for_each(|_| act()));
    }
}

/// A bit for each signal that is ignored, the first one lowest, as far as the system says.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let bits = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    bits.and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok()).unwrap_or(0)
}

/// Calls `act` at each Ctrl-C, on a thread of its own.
#[cfg(not(unix))]
fn on_signal(act: impl FnMut() + Send + 'static) {
    drop(ctrlc::set_handler(act));
}

/// Whether the user has cancelled.
pub(crate) fn is_requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}

/// [`is_requested`] in the form that monitors return.
pub(crate) fn check() -> Result<(), Cancelled> {
    if is_requested() { Err(Cancelled) } else { Ok(()) }
}

/// The end of a cancelled command, with a line that names what was not written.
pub(crate) fn end(unwritten: impl std::fmt::Display) -> End {
    errors::note(&format!("cancelled; `{unwritten}` was not written"));
    End::Cancelled
}

/// Registers a folder that a sudden end must remove.
pub(crate) fn guard(partial: &Path) {
    if let Ok(mut all) = PARTIAL.lock() {
        all.push(partial.to_path_buf());
    }
}

/// Removes the folder from the register.
pub(crate) fn unguard(partial: &Path) {
    if let Ok(mut all) = PARTIAL.lock() {
        all.retain(|p| p != partial);
    }
}
