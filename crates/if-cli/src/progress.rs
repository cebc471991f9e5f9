//! A line of progress on stderr, if that is a terminal.

use crate::cancel;
use if_core::monitor::{Cancelled, Monitor, Progress};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::fmt::Write;
use std::io::IsTerminal;
use std::sync::OnceLock;
use std::time::{Duration, Instant};
use tracing::Subscriber;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::Layer;
use tracing_subscriber::fmt::time::Uptime;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::registry::LookupSpan;
use tracing_subscriber::util::SubscriberInitExt;

/// When logging began, if it did.
static LOGGING_SINCE: OnceLock<Instant> = OnceLock::new();

/// Logs events on stderr instead of drawing lines, from now on.
pub(crate) fn log_instead() -> miette::Result<()> {
    LOGGING_SINCE.get_or_init(Instant::now);
    tracing_subscriber::registry().with(log()).try_init().map_err(|e| miette::miette!("{e}"))
}

/// Logs events on stderr; `None` if lines are drawn.
pub(crate) fn log<S: Subscriber + for<'s> LookupSpan<'s>>() -> Option<impl Layer<S>> {
    let since = LOGGING_SINCE.get()?;
    let stderr = std::io::stderr;
    let events = tracing_subscriber::fmt::layer()
        .with_target(false)
        .with_writer(stderr)
        .with_ansi(stderr().is_terminal())
        .with_timer(Uptime::from(*since));
    Some(events.with_filter(LevelFilter::DEBUG))
}

/// Where lines are drawn.
pub(crate) fn target() -> ProgressDrawTarget {
    if LOGGING_SINCE.get().is_some() {
        ProgressDrawTarget::hidden()
    } else {
        ProgressDrawTarget::stderr()
    }
}

/// A line that shows what is being done. Nothing is drawn if stderr is no terminal.
pub(crate) struct Line {
    bar: ProgressBar,
    /// Which outfit of how many, and its name.
    outfit: String,
}

impl Line {
    /// A line for outfit `index` of `outfits`, counted from 0.
    pub(crate) fn new(outfit: &str, index: usize, outfits: usize) -> Self {
        let bar = ProgressBar::with_draw_target(None, target());
        let style = ProgressStyle::with_template("{spinner} {elapsed:>3} {wide_msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
        bar.enable_steady_tick(Duration::from_millis(100));
        let outfit = if outfits > 1 {
            format!("[{}/{outfits}] {outfit}: ", index + 1)
        } else {
            String::new()
        };
        Self { bar, outfit }
    }

    /// Shows what is being done.
    pub(crate) fn message(&self, what: &str) {
        self.bar.set_message(format!("{}{what}", self.outfit));
    }

    /// Takes the line away while something else is written.
    pub(crate) fn aside(&self, write: impl FnOnce()) {
        self.bar.suspend(write);
    }
}

/// Shows progress, and cancels on Ctrl-C.
impl Monitor for &Line {
    fn report(&mut self, progress: &Progress<'_>) -> Result<(), Cancelled> {
        self.message(&text(progress));
        cancel::check()
    }
}

/// `jacket (2/3) settle, round 7, 12 pairs left`.
fn text(progress: &Progress<'_>) -> String {
    let mut text = progress.item.to_owned();
    if let (Some(k), Some(n)) = (progress.measure("garment"), progress.measure("garments")) {
        let _ = write!(text, " ({k}/{n})");
    }
    let separator = if text.is_empty() { "" } else { " " };
    let _ = write!(text, "{separator}{}", progress.stage);
    match (progress.total, progress.done) {
        (Some(total), done) => write!(text, ", {done} of {total}"),
        (None, 1..) => write!(text, ", round {}", progress.done),
        (None, 0) => Ok(()),
    }
    .expect("a string takes any text");
    if let Some(pairs) = progress.measure("pairs") {
        let _ = write!(text, ", {pairs} pairs left");
    }
    if let Some(seconds) = progress.measure("seconds_left") {
        let _ = write!(text, ", about {seconds:.0} s left");
    }
    text
}

impl Drop for Line {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_shows_what_is_known() {
        let measures = [("garment", 2.0), ("garments", 3.0), ("pairs", 12.0)];
        let round = Progress { done: 7, measures: &measures, ..Progress::stage("settle") };
        assert_eq!(text(&round.of("jacket")), "jacket (2/3) settle, round 7, 12 pairs left");
        let frame = Progress { done: 3, total: Some(24), ..Progress::stage("render") };
        assert_eq!(text(&frame), "render, 3 of 24");
        let measures = [("seconds_left", 12.4)];
        let frame = Progress { measures: &measures, ..frame };
        assert_eq!(text(&frame), "render, 3 of 24, about 12 s left");
    }
}
