//! Rows, how long things take, and what is written of them.

use crate::plot::draw;
use crate::row::{Row, front};
use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// All runs so far.
pub(crate) struct Record {
    pub(crate) quick: bool,
    rows: Vec<Row>,
}

/// What a problem says of each of its runs.
pub(crate) struct Run<'a> {
    pub(crate) problem: &'a str,
    pub(crate) method: &'a str,
    pub(crate) parameter: String,
    pub(crate) unit: &'static str,
    pub(crate) default: bool,
}

impl Record {
    pub(crate) fn new(quick: bool) -> Self {
        Self { quick, rows: Vec::new() }
    }

    /// Adds a run, and prints it.
    pub(crate) fn push(&mut self, run: Run<'_>, milliseconds: f64, error: f64, counts: [u64; 2]) {
        let Run { problem, method, parameter, unit, default } = run;
        let star = if default { " *" } else { "" };
        println!(
            "{problem:<28} {method:<22} {parameter:<34} {milliseconds:>11.3} ms {error:>12.3e} {unit}{star}"
        );
        self.rows.push(Row {
            problem: problem.into(),
            method: method.into(),
            parameter,
            milliseconds,
            error,
            unit,
            evaluations: counts[0],
            skipped: counts[1],
            default,
        });
    }

    /// Writes the table, the pictures and the Pareto fronts, in the order of the problems.
    pub(crate) fn write(&self, out: &Path) -> Result<(), Box<dyn Error>> {
        std::fs::create_dir_all(out)?;
        let mut csv = csv::Writer::from_path(out.join("runs.csv"))?;
        for row in &self.rows {
            csv.serialize(row)?;
        }
        csv.flush()?;
        let mut problems: Vec<&str> = Vec::new();
        for row in &self.rows {
            if !problems.contains(&row.problem.as_str()) {
                problems.push(&row.problem);
            }
        }
        let mut text = String::from(
            "Runs that no other beats in both time and error; the default is marked by a star.\n",
        );
        for problem in problems {
            let rows: Vec<&Row> = self.rows.iter().filter(|r| r.problem == problem).collect();
            let file: String =
                problem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
            draw(&out.join(format!("{file}.svg")), problem, &rows)?;
            write!(text, "\n### {problem}\n\n![{problem}]({file}.svg)\n\n")?;
            text += "| method | setting | ms | error | evaluations | skipped |\n|---|---|---:|---:|---:|---:|\n";
            let front = front(&rows);
            for row in
                rows.iter().filter(|r| front.iter().any(|f| std::ptr::eq(*f, **r)) || r.default)
            {
                let star = if row.default { " \\*" } else { "" };
                let beaten = if front.iter().any(|f| std::ptr::eq(*f, *row)) {
                    ""
                } else {
                    " (not on the front)"
                };
                writeln!(
                    text,
                    "| {} | {}{star}{beaten} | {:.3} | {:.2e} {} | {} | {} |",
                    row.method,
                    row.parameter,
                    row.milliseconds,
                    row.error,
                    row.unit,
                    row.evaluations,
                    row.skipped
                )?;
            }
        }
        std::fs::write(out.join("pareto.md"), text)?;
        Ok(())
    }
}

/// Whether runs that take long are told in processor time ([`timed`]).
static PROCESSOR: AtomicBool = AtomicBool::new(false);
/// Wall time below which it is told after all, in milliseconds: the kernel counts by the
/// millisecond.
const SHORT: f64 = 50.0;

/// From now on, [`timed`] tells processor time, where the kernel tells it.
pub(crate) fn count_processor_time() -> Result<(), &'static str> {
    PROCESSOR.store(true, Ordering::Relaxed);
    processor_ms().map(drop).ok_or("--processor needs /proc/self/task/*/schedstat")
}

/// What all threads of this program have computed so far, in milliseconds.
fn processor_ms() -> Option<f64> {
    let mut sum = 0.0;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        sum += text.split_whitespace().next()?.parse::<f64>().ok()? / 1e6;
    }
    Some(sum)
}

/// The median time of `work` in milliseconds, and what it gave: once where it takes long, at least
/// three times else. With `--processor` the least of these times, and where it is 50 ms at least,
/// processor time: other programs disturb both less.
pub(crate) fn timed<T>(mut work: impl FnMut() -> T) -> (f64, T) {
    let begin = Instant::now();
    let mut times = Vec::new();
    let counted = || PROCESSOR.load(Ordering::Relaxed).then(processor_ms).flatten();
    loop {
        let (before, start) = (counted(), Instant::now());
        let found = work();
        let wall = start.elapsed().as_secs_f64() * 1e3;
        let computed = before.zip(counted()).map(|(a, b)| b - a).filter(|_| wall >= SHORT);
        times.push(computed.unwrap_or(wall));
        let spent = begin.elapsed();
        if spent > Duration::from_millis(1500)
            || (times.len() >= 3 && spent > Duration::from_millis(200))
            || times.len() == 1000
        {
            times.sort_by(f64::total_cmp);
            let at = if PROCESSOR.load(Ordering::Relaxed) { 0 } else { times.len() / 2 };
            return (times[at], found);
        }
    }
}
