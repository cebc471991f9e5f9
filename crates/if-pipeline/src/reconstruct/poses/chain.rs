//! The poses of all frames: priors, smoothness in time, and one Gauss–Newton step.

use super::params::PoseParams;
use super::rotations::{log, log_slope};
use super::twists::unknowns;
use if_body::Pose;
use if_core::math::{Real, Vector};
use if_sparse::{Cholesky, Entry, Mat};
use nalgebra::{DMatrix, DVector, Matrix3, UnitQuaternion};

/// Largest rotation of a joint in a step, in radians.
const LONGEST_TURN: Real = 0.3;
/// Largest translation of the root in a step, in metres.
const LONGEST_SHIFT: Real = 0.1;

/// Given poses, and what is assumed about their errors and about motion.
pub(super) struct Chain<'a> {
    /// The poses as given.
    given: &'a [Pose],
    /// Time of each frame, in mean intervals between frames.
    times: Vec<Real>,
    /// Standard deviation of a joint's rotation about each axis, in radians.
    turn_sigma: Real,
    shift_sigma: Real,
    /// Standard deviation of each joint's angular acceleration about each axis, in radians.
    turn_acceleration: Vec<Real>,
    shift_acceleration: Real,
}

/// Normal equations of a frame's images; `None` without images.
pub(super) type FrameTerms = Option<(DMatrix<Real>, DVector<Real>)>;

impl<'a> Chain<'a> {
    /// `numbers` are those of the frames, increasing: their times.
    pub(super) fn new(given: &'a [Pose], numbers: &[u32], params: &PoseParams) -> Self {
        let first = numbers.first().copied().unwrap_or(0);
        let span = numbers.last().map_or(0, |l| l - first);
        let mean = (Real::from(span) / (numbers.len().max(2) - 1) as Real).max(1.0);
        let times: Vec<Real> = numbers.iter().map(|n| Real::from(n - first) / mean).collect();
        let (turn_sigma, shift_sigma) = params.axis_sigmas();
        let mut chain = Self {
            given,
            times,
            turn_sigma,
            shift_sigma,
            turn_acceleration: Vec::new(),
            shift_acceleration: params.acceleration,
        };
        chain.estimate_accelerations(params);
        chain
    }

    /// Accelerations that the given poses show beyond their noise.
    fn estimate_accelerations(&mut self, params: &PoseParams) {
        let least = params.acceleration_degrees.to_radians() / Real::sqrt(3.0);
        let joints = self.given.first().map_or(0, |p| p.rotations.len());
        let middle = || 1..self.given.len().saturating_sub(1);
        self.turn_acceleration = (0..joints)
            .map(|j| {
                let changes: Vec<_> =
                    middle().map(|i| self.turn_change(self.given, i, j).0).collect();
                beyond_noise(&changes, self.turn_sigma).max(least)
            })
            .collect();
        let changes: Vec<_> = middle().map(|i| self.shift_change(self.given, i).0).collect();
        self.shift_acceleration = beyond_noise(&changes, self.shift_sigma).max(params.acceleration);
    }

    /// The angular acceleration of joint `j` at frame `i`, per mean interval squared, and its
    /// derivatives by the small rotations of frames i − 1, i and i + 1.
    fn turn_change(&self, poses: &[Pose], i: usize, j: usize) -> (Vector, [Matrix3<Real>; 3]) {
        let [before, after] = self.paces(i);
        let q = |i: usize| &poses[i].rotations[j];
        let (a, b) = (log(&(q(i - 1).inverse() * q(i))), log(&(q(i).inverse() * q(i + 1))));
        let (ja, jb) = (log_slope(&a) * before, log_slope(&b) * after);
        (b * after - a * before, [ja.transpose(), -jb.transpose() - ja, jb])
    }

    /// The same for the root's position.
    fn shift_change(&self, poses: &[Pose], i: usize) -> (Vector, [Real; 3]) {
        let [before, after] = self.paces(i);
        let t = |i: usize| poses[i].root_translation;
        let change = (t(i + 1) - t(i)) * after - (t(i) - t(i - 1)) * before;
        (change, [before, -after - before, after])
    }

    /// Frames per mean interval before and after frame `i`.
    fn paces(&self, i: usize) -> [Real; 2] {
        let t = &self.times;
        [1.0 / (t[i] - t[i - 1]), 1.0 / (t[i + 1] - t[i])]
    }

    /// One Gauss–Newton step of all poses towards the least of
    ///
    /// ```text
    /// images + Σ |log(q₀⁻¹ q)|² / 2σ² + |t − t₀|² / 2σ² + Σ |acceleration|² / 2σ²
    /// ```
    ///
    /// Returns root mean squares of its turns, in radians, and shifts, in metres. `None` if the
    /// equations have no finite solution.
    pub(super) fn step(&self, poses: &mut [Pose], images: &[FrameTerms]) -> Option<(Real, Real)> {
        let joints = self.turn_acceleration.len();
        let size = unknowns(joints);
        let n = poses.len() * size;
        let (entries, mut right) = self.equations(poses, images);
        Cholesky::new(n, &entries).ok()?.solve_in_place(&mut right);
        let (mut turns, mut shifts) = (0.0, 0.0);
        for (i, pose) in poses.iter_mut().enumerate() {
            let read = |k: usize| Vector::from_fn(|c, _| right[(i * size + 3 * k + c, 0)]);
            for (j, q) in pose.rotations.iter_mut().enumerate() {
                let turn = clamped(read(j), LONGEST_TURN);
                *q *= UnitQuaternion::new(turn);
                turns += turn.norm_squared();
            }
            let shift = clamped(read(joints), LONGEST_SHIFT);
            pose.root_translation += shift;
            shifts += shift.norm_squared();
        }
        let count = poses.len().max(1) as Real;
        let done = ((turns / (count * joints.max(1) as Real)).sqrt(), (shifts / count).sqrt());
        (done.0.is_finite() && done.1.is_finite()).then_some(done)
    }

    /// Entries of the matrix's lower triangle, and the right-hand side.
    fn equations(&self, poses: &[Pose], images: &[FrameTerms]) -> (Vec<Entry>, Mat) {
        let joints = self.turn_acceleration.len();
        let size = unknowns(joints);
        let mut right = Mat::zeros(poses.len() * size, 1);
        let mut entries = Vec::with_capacity(poses.len() * (size * (size + 1) / 2 + 30 * size));
        for (i, terms) in images.iter().enumerate() {
            let Some((h, g)) = terms else { continue };
            for row in 0..size {
                right[(i * size + row, 0)] -= g[row];
                entries.extend(
                    (0..=row).map(|c| Entry::new(i * size + row, i * size + c, h[(row, c)])),
                );
            }
        }
        let mut add = |blocks: &[(usize, Matrix3<Real>)], r: &Vector, sigma: Real| {
            let weight = 1.0 / (sigma * sigma);
            for (a, ja) in blocks {
                let scaled = ja.transpose() * weight;
                let g = scaled * r;
                (0..3).for_each(|c| right[(a + c, 0)] -= g[c]);
                for (b, jb) in blocks {
                    let h = scaled * jb;
                    for row in 0..3 {
                        let columns = (0..3).filter(|c| b + c <= a + row);
                        entries.extend(columns.map(|c| Entry::new(a + row, b + c, h[(row, c)])));
                    }
                }
            }
        };
        for (i, (pose, given)) in poses.iter().zip(self.given).enumerate() {
            for (j, (q, q0)) in pose.rotations.iter().zip(&given.rotations).enumerate() {
                let r = log(&(q0.inverse() * q));
                add(&[(i * size + 3 * j, log_slope(&r))], &r, self.turn_sigma);
            }
            let r = pose.root_translation - given.root_translation;
            add(&[(i * size + 3 * joints, Matrix3::identity())], &r, self.shift_sigma);
        }
        for i in 1..poses.len().saturating_sub(1) {
            let at = |k: usize, j: usize| (i + k - 1) * size + 3 * j;
            for (j, sigma) in self.turn_acceleration.iter().enumerate() {
                let (r, slopes) = self.turn_change(poses, i, j);
                add(&[0, 1, 2].map(|k| (at(k, j), slopes[k])), &r, *sigma);
            }
            let (r, slopes) = self.shift_change(poses, i);
            let blocks = [0, 1, 2].map(|k| (at(k, joints), Matrix3::identity() * slopes[k]));
            add(&blocks, &r, self.shift_acceleration);
        }
        (entries, right)
    }
}

/// The deviation of accelerations along an axis beyond that of the noise of positions, of stated
/// deviation `sigma`.
///
/// Independent noise of variance σ² adds 6 σ² to the mean square of second differences and 70 σ² to
/// that of fourth ones, and motion with periods above six frames adds no more to the latter than to
/// the former: (70 − 6) σ² is at most their difference. Noise that is less than stated, or not
/// independent, is not mistaken for motion to be smoothed away.
fn beyond_noise(accelerations: &[Vector], sigma: Real) -> Real {
    let mean = |squares: &[Real]| squares.iter().sum::<Real>() / squares.len().max(1) as Real;
    let second: Vec<Real> = accelerations.iter().map(Vector::norm_squared).collect();
    let fourth: Vec<Real> =
        accelerations.windows(3).map(|a| (a[0] - a[1] * 2.0 + a[2]).norm_squared()).collect();
    let (second, fourth, count) = (mean(&second) / 3.0, mean(&fourth) / 3.0, 3 * second.len());
    let shown = ((fourth - second) / 64.0).max(0.0);
    // Two standard deviations of the mean of squares.
    let margin = 1.0 + 2.0 * (2.0 / count.max(1) as Real).sqrt();
    (second - 6.0 * margin * shown.min(sigma * sigma)).max(0.0).sqrt()
}

fn clamped(v: Vector, longest: Real) -> Vector {
    let length = v.norm();
    if length > longest { v * (longest / length) } else { v }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::poses::twists::tests::{bent, disturbed};

    /// A turn at a constant pace with a swinging arm, at uneven times, and errors.
    fn walk(numbers: &[u32], error: Real) -> Vec<Pose> {
        let (_, rest) = bent();
        // Uniform in ± error, and independent.
        let noise =
            |k: usize| error * (2.0 * (4e4 * (12.99 * k as Real).sin()).fract().abs() - 1.0);
        let pose = |(i, t): (usize, &u32)| {
            let (mut pose, t) = (rest.clone(), Real::from(*t));
            pose.rotations[0] *= UnitQuaternion::new(Vector::new(0.0, 0.25 * t, 0.0));
            pose.rotations[1] *= UnitQuaternion::new(Vector::new(0.1 * t, 0.0, 0.0));
            pose.root_translation.x += 0.01 * t;
            (0..15).fold(pose, |pose, k| disturbed(&pose, k, noise(100 * i + k)))
        };
        numbers.iter().enumerate().map(pose).collect()
    }

    #[test]
    fn the_right_hand_side_is_the_slope_of_the_energy() {
        let numbers = [3, 4, 6, 7, 11];
        let (given, poses) = (walk(&numbers, 0.02), walk(&numbers, 0.05));
        let params = PoseParams::default();
        let chain = Chain::new(&given, &numbers, &params);
        let energy = |poses: &[Pose]| {
            let mut sum = 0.0;
            for (p, q) in poses.iter().zip(&given) {
                let turns = p.rotations.iter().zip(&q.rotations);
                sum += turns.map(|(a, b)| a.angle_to(b).powi(2)).sum::<Real>()
                    / chain.turn_sigma.powi(2);
                sum += (p.root_translation - q.root_translation).norm_squared()
                    / chain.shift_sigma.powi(2);
            }
            for i in 1..poses.len() - 1 {
                for (j, sigma) in chain.turn_acceleration.iter().enumerate() {
                    sum += chain.turn_change(poses, i, j).0.norm_squared() / sigma.powi(2);
                }
                sum += chain.shift_change(poses, i).0.norm_squared()
                    / chain.shift_acceleration.powi(2);
            }
            0.5 * sum
        };
        let images = vec![None; poses.len()];
        let (_, right) = chain.equations(&poses, &images);
        let h = 1e-6;
        for at in 0..5 * 15 {
            let side = |h: Real| {
                let mut poses = poses.clone();
                poses[at / 15] = disturbed(&poses[at / 15], at % 15, h);
                energy(&poses)
            };
            let slope = (side(h) - side(-h)) / (2.0 * h);
            // Energies of 1e4 round at 1e-12, and differences of step 1e-6 at 1e-6 of them.
            let right = right[(at, 0)];
            assert!((right + slope).abs() < 1e-6 * energy(&poses), "{at}: {right} {slope}");
        }
    }

    #[test]
    fn independent_errors_are_smoothed_and_images_are_followed() {
        let numbers: Vec<u32> = (0..16).collect();
        let (truth, given) = (walk(&numbers, 0.0), walk(&numbers, 0.05));
        let params = PoseParams::default();
        let chain = Chain::new(&given, &numbers, &params);
        let error = |poses: &[Pose]| {
            let all = poses.iter().zip(&truth).flat_map(|(p, q)| {
                p.rotations.iter().zip(&q.rotations).map(|(a, b)| a.angle_to(b).powi(2))
            });
            all.sum::<Real>().sqrt()
        };
        let mut poses = given.clone();
        let mut images: Vec<FrameTerms> = vec![None; 16];
        for _ in 0..3 {
            chain.step(&mut poses, &images).unwrap();
        }
        let smoothed = error(&poses);
        assert!(smoothed < 0.7 * error(&given), "{smoothed} {}", error(&given));
        // Images of two frames that ask for a turn of the elbow; frames without follow.
        for i in [5, 6] {
            let (mut h, mut g) = (DMatrix::zeros(15, 15), DVector::zeros(15));
            (h[(6, 6)], g[6]) = (1e6, -1e5);
            images[i] = Some((h, g));
        }
        let before = poses.clone();
        chain.step(&mut poses, &images).unwrap();
        let turned = |i: usize| poses[i].rotations[2].angle_to(&before[i].rotations[2]);
        assert!((turned(5) - 0.1).abs() < 0.01 && turned(7) > 0.03 && turned(0) < 0.05);
    }

    #[test]
    fn motion_is_told_from_independent_noise_and_noise_from_motion() {
        let numbers: Vec<u32> = (0..24).collect();
        let swinging = |error: Real, amount: Real, pace: Real| {
            let mut given = walk(&numbers, error);
            for (i, pose) in given.iter_mut().enumerate() {
                let swing = amount * (pace * i as Real).sin();
                pose.rotations[3] *= UnitQuaternion::new(Vector::new(swing, 0.0, 0.0));
            }
            Chain::new(&given, &numbers, &PoseParams::default()).turn_acceleration
        };
        let rms =
            |amount: Real, pace: Real| amount * 4.0 * (0.5 * pace).sin().powi(2) / Real::sqrt(6.0);
        // At a constant pace there is only noise, of deviation 0.05 / √3 about each axis.
        let noise = 0.05 * Real::sqrt(6.0 / 3.0);
        let fast = swinging(0.05, 0.8, 1.7);
        assert!(fast[1] < 0.5 * noise, "{} of {noise}", fast[1]);
        assert!((fast[3] / rms(0.8, 1.7) - 1.0).abs() < 0.15, "{}", fast[3]);
        // Motion without noise, slower than noise as stated would be, is motion all the same.
        let slow = swinging(0.0, 0.06, 0.8);
        assert!(slow[3] > 0.7 * rms(0.06, 0.8), "{} {}", slow[3], rms(0.06, 0.8));
        assert_eq!(slow[1], 0.3f64.to_radians() / 3f64.sqrt());
    }
}
