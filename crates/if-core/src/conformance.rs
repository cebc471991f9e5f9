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
    let mut random = crate::random::SplitMix64::new(5);
    let mut next = move || random.unit() * 3.0 - 1.5;
    (0..n).map(|_| crate::math::Point::new(next(), next(), next())).collect()
}
