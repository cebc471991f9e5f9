//! Parts of a phase that run beside one another.

use std::time::Instant;
use tracing::Span;

/// Runs two parts of the phase `span` in parallel, and records the wall seconds of each in the
/// span's fields of these names.
pub(crate) fn beside<A: Send, B: Send>(
    span: &Span,
    names: [&'static str; 2],
    first: impl FnOnce() -> A + Send,
    second: impl FnOnce() -> B + Send,
) -> (A, B) {
    fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
        let start = Instant::now();
        (work(), start.elapsed().as_secs_f64())
    }
    let _phase = span.enter();
    let ((a, of_a), (b, of_b)) = rayon::join(|| timed(first), || timed(second));
    span.record(names[0], of_a).record(names[1], of_b);
    (a, b)
}
