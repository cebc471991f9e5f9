//! The simpler methods that if-garments is measured against, and what its measuring programs share.
//!
//! The programs are in `examples`, criterion benches in `criterion`, comparisons with other people's
//! programs in `peers`.

pub mod baselines;
pub mod comparators;
pub mod timing;
