//! Ctrl-C and SIGTERM: the first asks the work to stop, the second stops the program.

use std::path::{Path, PathBuf};
use std::process::exit;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

/// The exit code of a program that a signal stopped.
pub(crate) const CANCELLED: u8 = 130;

static ASKED: AtomicBool = AtomicBool::new(false);
/// What a sudden stop must remove.
static PARTIAL: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Starts listening. Where the system refuses, signals stop the program as they always do.
pub(crate) fn listen() {
    let heard = ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::SeqCst) {
            for path in PARTIAL.lock().map(|mut p| std::mem::take(&mut *p)).unwrap_or_default() {
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

/// Names a folder that a sudden stop must remove.
pub(crate) fn guard(partial: &Path) {
    if let Ok(mut all) = PARTIAL.lock() {
        all.push(partial.to_path_buf());
    }
}

/// Takes the name back.
pub(crate) fn unguard(partial: &Path) {
    if let Ok(mut all) = PARTIAL.lock() {
        all.retain(|p| p != partial);
    }
}
