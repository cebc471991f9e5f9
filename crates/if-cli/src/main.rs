//! The command `ifg`.

use std::process::ExitCode;

fn main() -> ExitCode {
    if_cli::run(std::env::args_os()).into()
}
