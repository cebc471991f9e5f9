//! The clothes' own motion: waves along their normals that travel while the body turns.

use if_core::math::{Point, Real, Vector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// Number of superposed waves.
const WAVES: usize = 6;
/// Largest wave number along each axis, in radians per metre: wavelengths are at least 20 cm.
const LARGEST: Real = 18.0;

/// A sum of waves.
pub(super) struct Waves {
    amount: Real,
    /// Wave vector, phase, and periods per turn of each wave.
    waves: Vec<(Vector, Real, Real)>,
}

impl Waves {
    /// Waves of about `amount` metres; their root mean square is 0.7 of it.
    pub(super) fn new(amount: Real, seed: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut within = |a: Real, b: Real| random.random_range(a..b);
        let wave = |_| {
            let along = Vector::from_fn(|_, _| within(-LARGEST, LARGEST));
            (along, within(0.0, std::f64::consts::TAU), within(1.0, 4.0).floor())
        };
        Self { amount, waves: (0..WAVES).map(wave).collect() }
    }

    /// Displacement of a rest position along its normal after a share `turn` of a full turn, in
    /// metres.
    pub(super) fn at(&self, p: &Point, turn: Real) -> Real {
        let one = |(along, phase, cycles): &(Vector, Real, Real)| {
            (along.dot(&p.coords) + phase + std::f64::consts::TAU * cycles * turn).sin()
        };
        self.amount * self.waves.iter().map(one).sum::<Real>() / (WAVES as Real).sqrt()
    }

    /// Whether the amplitude is zero.
    pub(super) fn still(&self) -> bool {
        self.amount == 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_have_the_given_amplitude_and_repeat_after_a_turn() {
        let waves = Waves::new(0.01, 3);
        let mut square = 0.0;
        for k in 0..1000 {
            let k = Real::from(k);
            let p = Point::new((0.37 * k).fract(), (0.61 * k).fract() * 2.0, (0.83 * k).fract());
            let turn = (0.29 * k).fract();
            approx::assert_relative_eq!(
                waves.at(&p, turn),
                waves.at(&p, turn + 1.0),
                epsilon = 1e-12
            );
            square += waves.at(&p, turn).powi(2) / 1000.0;
        }
        assert!((0.006..0.008).contains(&square.sqrt()), "{}", square.sqrt());
        assert!(Waves::new(0.0, 3).still() && !waves.still());
    }
}
