//! Errors of an estimator of poses and camera.

use super::noise::normal;
use crate::capture::PoseSigma;
use if_body::Pose;
use if_core::math::{Real, Vector};
use if_mesh::camera::Camera;
use nalgebra::UnitQuaternion;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// The poses as an estimator gives them: rotations and roots with normally distributed errors. In
/// frames d apart errors correlate by exp(−2 d² / c²) with c = `correlation`, and not at all if that
/// is 0.
pub(super) fn estimated(
    truth: &[Pose],
    sigma: PoseSigma,
    correlation: Real,
    seed: u64,
) -> Vec<Pose> {
    let (turn, shift) = (sigma.degrees.to_radians() / Real::sqrt(3.0), sigma.translation);
    let joints = truth.first().map_or(0, |p| p.rotations.len());
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let tracks: Vec<Vec<Real>> =
        (0..3 * joints + 3).map(|_| track(truth.len(), correlation, &mut rng)).collect();
    let disturbed = |(frame, pose): (usize, &Pose)| {
        let error = |k: usize| Vector::from_fn(|c, _| tracks[3 * k + c][frame]);
        let mut pose = pose.clone();
        for (j, q) in pose.rotations.iter_mut().enumerate() {
            *q *= UnitQuaternion::new(error(j) * turn);
        }
        pose.root_translation += error(joints) * shift;
        pose
    };
    truth.iter().enumerate().map(disturbed).collect()
}

/// The camera with a constant error of its orientation: turned about its centre by normally
/// distributed angles of this deviation about each axis.
pub(super) fn mistaken(camera: &Camera, degrees: Real, seed: u64) -> Camera {
    let mut rng = Pcg64Mcg::seed_from_u64(seed ^ 0x00CA_3E7A);
    let turn = Vector::from_fn(|_, _| normal(&mut rng)) * degrees.to_radians();
    camera.turned(&UnitQuaternion::new(turn))
}

/// Normally distributed numbers of deviation 1, one for each frame: white noise, filtered by a
/// Gaussian of deviation c / √8.
fn track(frames: usize, correlation: Real, rng: &mut Pcg64Mcg) -> Vec<Real> {
    let spread = correlation / Real::sqrt(8.0);
    let reach = (3.0 * spread).ceil() as usize;
    let weight = |k: usize| {
        let d = k as Real - reach as Real;
        if reach == 0 { 1.0 } else { (-0.5 * (d / spread).powi(2)).exp() }
    };
    let kernel: Vec<Real> = (0..=2 * reach).map(weight).collect();
    let length = kernel.iter().map(|w| w * w).sum::<Real>().sqrt();
    let white: Vec<Real> = (0..frames + 2 * reach).map(|_| normal(rng)).collect();
    let at = |i: usize| kernel.iter().zip(&white[i..]).map(|(w, x)| w * x).sum::<Real>() / length;
    (0..frames).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_the_stated_size_and_correlation() {
        let sigma = PoseSigma { degrees: 3.0, translation: 0.009 };
        let truth = vec![Pose::rest(10); 200];
        for (correlation, expected) in [(0.0, 0.0), (8.0, (-2.0f64 / 64.0).exp())] {
            let poses = estimated(&truth, sigma, correlation, 7);
            let (mut turn, mut shift, mut product) = (0.0, 0.0, 0.0);
            for (i, pose) in poses.iter().enumerate() {
                for (j, q) in pose.rotations.iter().enumerate() {
                    turn += q.angle().to_degrees().powi(2) / 2000.0;
                    let next = poses.get(i + 1).map_or(q, |p| &p.rotations[j]);
                    let next = next.scaled_axis() * 1f64.to_degrees();
                    product += q.scaled_axis().dot(&next) * 1f64.to_degrees() / 2000.0;
                }
                shift += pose.root_translation.norm_squared() / 600.0;
            }
            // 6,000 numbers, of which an eighth are independent.
            assert!((turn.sqrt() / 3.0 - 1.0).abs() < 0.1, "{}", turn.sqrt());
            assert!((shift.sqrt() / 0.009 - 1.0).abs() < 0.25, "{}", shift.sqrt());
            assert!((product / turn - expected).abs() < 0.05, "{}", product / turn);
        }
        assert_eq!(estimated(&truth, PoseSigma::EXACT, 0.0, 7), truth);
    }
}
