//! Ctrl-C and SIGTERM: the first cancels the work, or ends a command that writes nothing; the second
//! ends the program.

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
    let installed = ctrlc::set_handler(move || {
        if REQUESTED.swap(true, Ordering::SeqCst) || at_once {
            for path in PARTIAL.lock().map(|mut p| std::mem::take(&mut *p)).unwrap_or_default() {
                let _ = std::fs::remove_dir_all(path);
            }
            exit(i32::from(CANCELLED));
        }
    });
    drop(installed);
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
