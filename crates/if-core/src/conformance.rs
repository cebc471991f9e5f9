//! Suites that every implementor of the traits runs in its tests.
//!
//! They return the first broken promise, with the point and the numbers; a test unwraps the result.

mod closest;
mod field;

pub use closest::{ClosestFault, check_closest_point};
pub use field::{FieldFault, FieldTolerances, check_signed_distance};

/// `n` points in [−1.5, 1.5]³, always the same.
#[cfg(test)]
fn points(n: usize) -> Vec<crate::math::Point> {
    let mut state = 5u64;
    let mut next = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64 * 3.0 - 1.5
    };
    (0..n).map(|_| crate::math::Point::new(next(), next(), next())).collect()
}
