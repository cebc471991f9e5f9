//! Normally distributed vectors.

use if_core::math::{Real, Vector};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// Three independent numbers of mean 0 and deviation 1 (Box and Muller 1958).
pub(crate) fn gaussian(random: &mut Pcg64Mcg) -> Vector {
    let mut pair = || {
        let u: Real = 1.0 - random.random::<Real>(); // above zero
        let v: Real = random.random();
        let r = (-2.0 * u.ln()).sqrt();
        let (s, c) = (2.0 * std::f64::consts::PI * v).sin_cos();
        [r * s, r * c]
    };
    let ([a, b], [c, _]) = (pair(), pair());
    Vector::new(a, b, c)
}
