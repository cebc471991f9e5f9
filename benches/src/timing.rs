//! Time on a machine that others use too.

use std::time::{Duration, Instant};

/// What a call takes.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Least seconds of a call on the clock.
    pub least: f64,
    /// Mean CPU seconds of a call, all threads together; not a number where `/proc` is missing.
    pub cpu: f64,
}

/// Calls `work` once unmeasured and then for `time`.
pub fn measure(time: Duration, mut work: impl FnMut()) -> Timing {
    work();
    let (begin, cpu) = (Instant::now(), cpu_seconds());
    let (mut least, mut calls) = (f64::INFINITY, 0);
    while begin.elapsed() < time || calls < 2 {
        let start = Instant::now();
        work();
        least = least.min(start.elapsed().as_secs_f64());
        calls += 1;
    }
    Timing { least, cpu: (cpu_seconds() - cpu) / f64::from(calls) }
}

/// CPU seconds of this process, in ticks of a hundredth.
pub fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after = stat.rsplit(')').next().unwrap_or_default();
    let ticks = |field: usize| -> Option<f64> {
        after.split_whitespace().nth(field).and_then(|text| text.parse().ok())
    };
    // Fields 14 and 15 of proc(5), counted behind the command's name.
    match (ticks(11), ticks(12)) {
        (Some(user), Some(system)) => (user + system) / 100.0,
        _ => f64::NAN,
    }
}
