//! Instruction counts of the kernels that everything else stands on, against those on record.
//!
//! ```sh
//! # compares; exit code 1 where a kernel needs 5 % more or less
//! cargo bench -p if-benches --bench instructions
//! # writes benches/criterion/instructions/counts.csv
//! cargo bench -p if-benches --bench instructions -- --record
//! ```
//!
//! Each kernel runs under `valgrind --tool=callgrind`, once and three times, and half of the
//! difference counts: what stands before it is subtracted. On one thread counts repeat to a few per
//! mille, whatever else the machine does. They depend on the compiler; the record names it, and
//! with another one differences are told but are no fault.

#![allow(clippy::print_stdout, clippy::unwrap_used)] // a program for the terminal

mod kernels;

use kernels::KERNELS;
use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// Largest change that is no fault.
const TOLERANCE: f64 = 0.05;

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        ["--kernel", name, times] => {
            let (_, run) = KERNELS.iter().find(|(n, _)| n == name).ok_or("no such kernel")?;
            run(times.parse()?);
            Ok(ExitCode::SUCCESS)
        }
        [] => compare(),
        ["--record"] => record(),
        _ => Err("usage: instructions [--record]".into()),
    }
}

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("criterion/instructions/counts.csv")
}

fn compiler() -> Result<String, Box<dyn Error>> {
    let out = Command::new("rustc").arg("--version").output()?;
    Ok(String::from_utf8(out.stdout)?.trim().to_owned())
}

/// Instructions of the whole process, or `None` where there is no valgrind.
fn counted(name: &str, times: u32) -> Result<Option<u64>, Box<dyn Error>> {
    let run = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(std::env::current_exe()?)
        .args(["--kernel", name, &times.to_string()])
        .env("RAYON_NUM_THREADS", "1")
        .output();
    let out = match run {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
        other => other?,
    };
    let told = String::from_utf8_lossy(&out.stderr);
    if !out.status.success() {
        return Err(
            format!("{name} did not end well under valgrind, {}:\n{told}", out.status).into()
        );
    }
    let line =
        told.lines().find(|l| l.contains("Collected")).and_then(|l| l.split(':').next_back());
    let count = line.and_then(|n| n.trim().parse().ok());
    Ok(Some(count.ok_or_else(|| format!("valgrind told no count of {name}:\n{told}"))?))
}

/// Kernels with their counts.
type Counts = Vec<(&'static str, u64)>;

fn counts() -> Result<Option<Counts>, Box<dyn Error>> {
    let mut all = Vec::new();
    for (name, _) in KERNELS {
        let (Some(once), Some(thrice)) = (counted(name, 1)?, counted(name, 3)?) else {
            println!("skipped: there is no valgrind (apt install valgrind)");
            return Ok(None);
        };
        all.push((name, thrice.saturating_sub(once) / 2));
    }
    Ok(Some(all))
}

fn record() -> Result<ExitCode, Box<dyn Error>> {
    let Some(all) = counts()? else { return Ok(ExitCode::from(2)) };
    let mut csv = csv::Writer::from_path(file())?;
    csv.write_record(["kernel", "instructions", "compiler"])?;
    for (name, count) in all {
        println!("{name:<24} {count:>14}");
        csv.write_record([name, &count.to_string(), &compiler()?])?;
    }
    csv.flush()?;
    Ok(ExitCode::SUCCESS)
}

fn compare() -> Result<ExitCode, Box<dyn Error>> {
    let mut known = BTreeMap::new();
    for row in csv::Reader::from_path(file())?.into_deserialize() {
        let (name, count, by): (String, u64, String) = row?;
        known.insert(name, (count, by));
    }
    let Some(all) = counts()? else { return Ok(ExitCode::SUCCESS) };
    let mut faults = 0;
    for (name, count) in all {
        let (before, by) =
            known.get(name).ok_or_else(|| format!("{name} is not on record; run with --record"))?;
        let change = count as f64 / *before as f64 - 1.0;
        let same = *by == compiler()?;
        let word = match change.abs() > TOLERANCE {
            false => "",
            true if same => "  CHANGED",
            true => "  (another compiler)",
        };
        faults += u32::from(word == "  CHANGED");
        println!("{name:<24} {count:>14}  {:>+7.2} %{word}", 100.0 * change);
    }
    Ok(ExitCode::from(u8::from(faults > 0)))
}
