//! Ctrl-C and SIGTERM: the first asks the work to stop, the second stops the program.

use std::path::{Path, PathBuf};
use std::process::exit;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// The exit code of a program that a signal stopped.
pub(crate) const CANCELLED: u8 = 130;

static ASKED: AtomicBool = AtomicBool::new(false);
/// What a sudden stop must remove.
static PARTIAL: Mutex<Option<PathBuf>> = Mutex::new(None);

/// Starts listening. Where the system refuses, signals stop the program as they always do.
pub(crate) fn listen() {
    let heard = ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::SeqCst) {
            if let Ok(Some(path)) = PARTIAL.lock().map(|mut p| p.take()) {
                let _ = std::fs::remove_dir_all(path);
            }
            exit(i32::from(CANCELLED));
        }
    });
    drop(heard);
}

/// Whether the user asked to stop.
pub(crate) fn asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}

/// Names the folder that a sudden stop must remove, or none.
pub(crate) fn guard(partial: Option<&Path>) {
    if let Ok(mut slot) = PARTIAL.lock() {
        *slot = partial.map(Path::to_path_buf);
    }
}
