//! The command `ifg`, for the console script.

use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs `ifg` with these arguments, the program's name first, and returns its exit code. It listens
/// to Ctrl-C itself: for a process that does nothing else.
#[pyfunction]
pub(crate) fn ifg(py: Python<'_>, args: Vec<OsString>) -> u8 {
    py.detach(|| if_cli::run(args))
}
