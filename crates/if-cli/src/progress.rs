//! Progress on stderr, where that is a terminal.

use if_core::monitor::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::fmt::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

static HIDDEN: AtomicBool = AtomicBool::new(false);

/// From now on no line is drawn: something else writes to stderr.
pub(crate) fn hide() {
    HIDDEN.store(true, Ordering::Relaxed);
}

/// Where lines are drawn.
pub(crate) fn target() -> ProgressDrawTarget {
    if HIDDEN.load(Ordering::Relaxed) {
        ProgressDrawTarget::hidden()
    } else {
        ProgressDrawTarget::stderr()
    }
}

/// One line that says what is being done. Nothing is drawn where stderr is no terminal.
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

    /// Says what is being done.
    pub(crate) fn say(&self, what: &str) {
        self.bar.set_message(format!("{}{what}", self.outfit));
    }

    /// Takes the line away while something else is written.
    pub(crate) fn aside(&self, write: impl FnOnce()) {
        self.bar.suspend(write);
    }

    /// Says how far the resolving is.
    pub(crate) fn show(&self, progress: &Progress) {
        let mut text = progress.item.to_owned();
        let garment = (progress.measure("garment"), progress.measure("garments"));
        if let (Some(index), Some(count)) = garment {
            let _ = write!(text, " ({index}/{count})");
        }
        let _ = write!(text, " {}", progress.stage);
        if let Some(pairs) = progress.measure("pairs") {
            let _ = write!(text, ", round {}, {pairs} pairs left", progress.done);
        }
        self.say(&text);
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
