//! Normal equations of a posed body in the velocities of its joints, and in its pose.
//!
//! ```text
//! ξₖ = (ω, v)         velocity of what follows joint k alone: ṗ = v + ω × p
//! ṗ  = Σ wₖ (vₖ + ωₖ × pₖ),  ṅ ≈ Σ wₖ ωₖ × n         pₖ = Sₖ x, of a skinned point and its normal
//! ξₖ = Σ over the ancestors j of k, and k, of (Rⱼ δⱼ, tⱼ × Rⱼ δⱼ)  +  (0, τ)
//! ```
//!
//! with Gⱼ = (Rⱼ, tⱼ) the frame of joint j, δⱼ a small rotation in it, qⱼ ← qⱼ exp(δⱼ), and τ the
//! translation of the roots. Points add to blocks of 6 × 6 of at most four joints; the sums over
//! descendants are taken once, at the end.

use if_body::Skeleton;
use if_core::math::{Real, Vector};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Matrix6, SMatrix, SVector, Vector6};

/// The derivative of R residuals with respect to the velocity of a joint.
pub(super) type Row<const R: usize> = (usize, SMatrix<Real, R, 6>);

/// Normal equations in the velocities of the joints.
pub(super) struct Twists {
    joints: usize,
    /// Blocks (k, l), k ≥ l, at k · joints + l.
    h: Vec<Matrix6<Real>>,
    g: Vec<Vector6<Real>>,
}

/// Unknowns of a pose: three for each joint, and the translation of the root.
pub(super) fn unknowns(joints: usize) -> usize {
    3 * joints + 3
}

impl Twists {
    /// No terms.
    pub(super) fn new(joints: usize) -> Self {
        Self {
            joints,
            h: vec![Matrix6::zeros(); joints * joints],
            g: vec![Vector6::zeros(); joints],
        }
    }

    /// Adds ½ weight · |residual + Σ Jₖ ξₖ|². A joint may occur more than once.
    pub(super) fn add<const R: usize>(
        &mut self,
        rows: &[Row<R>],
        residual: &SVector<Real, R>,
        weight: Real,
    ) {
        for (k, jk) in rows {
            let scaled = jk.transpose() * weight;
            self.g[*k] += scaled * residual;
            for (l, jl) in rows {
                if k >= l {
                    self.h[k * self.joints + l] += scaled * jl;
                }
            }
        }
    }

    /// The normal equations in the unknowns of a pose, (δ₀ … δ_{J−1}, τ): the matrix and the
    /// gradient. `frames` are the joints' frames G.
    pub(super) fn into_pose(
        mut self,
        skeleton: &Skeleton,
        frames: &[Isometry3<Real>],
    ) -> (DMatrix<Real>, DVector<Real>) {
        let n = self.joints;
        let parents: Vec<Option<usize>> = skeleton.joints().iter().map(|j| j.parent).collect();
        for k in 0..n {
            for l in 0..k {
                self.h[l * n + k] = self.h[k * n + l].transpose();
            }
        }
        // Sums over descendants, first of rows, then of columns.
        for k in (0..n).rev() {
            let Some(p) = parents[k] else { continue };
            for l in 0..n {
                let block = self.h[k * n + l];
                self.h[p * n + l] += block;
            }
            let g = self.g[k];
            self.g[p] += g;
        }
        for k in (0..n).rev() {
            let Some(p) = parents[k] else { continue };
            for l in 0..n {
                let block = self.h[l * n + k];
                self.h[l * n + p] += block;
            }
        }
        // The columns of each joint, and of the translation, which moves all roots.
        let turn = |frame: &Isometry3<Real>| {
            let r = frame.rotation.to_rotation_matrix().into_inner();
            let mut a = SMatrix::<Real, 6, 3>::zeros();
            a.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
            a.fixed_view_mut::<3, 3>(3, 0).copy_from(&(cross(&frame.translation.vector) * r));
            a
        };
        let mut shift = SMatrix::<Real, 6, 3>::zeros();
        shift.fixed_view_mut::<3, 3>(3, 0).copy_from(&Matrix3::identity());
        let mut columns: Vec<(usize, usize, SMatrix<Real, 6, 3>)> =
            (0..n).map(|j| (3 * j, j, turn(&frames[j]))).collect();
        columns.extend((0..n).filter(|j| parents[*j].is_none()).map(|j| (3 * n, j, shift)));
        let size = unknowns(n);
        let (mut h, mut g) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for (at, j, a) in &columns {
            let mut part = g.fixed_rows_mut::<3>(*at);
            part += a.transpose() * self.g[*j];
            for (to, l, b) in &columns {
                let mut part = h.fixed_view_mut::<3, 3>(*at, *to);
                part += a.transpose() * self.h[j * n + l] * b;
            }
        }
        (h, g)
    }
}

/// The matrix of v × ·.
pub(super) fn cross(v: &Vector) -> Matrix3<Real> {
    v.cross_matrix()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use if_body::{Joint, Pose};
    use if_core::math::Point;
    use nalgebra::UnitQuaternion;

    /// A bent arm of three joints that coincide in part, and a leg.
    pub(in crate::reconstruct::poses) fn bent() -> (Skeleton, Pose) {
        let joint = |name: &str, parent, head: [Real; 3]| Joint {
            name: name.into(),
            parent,
            head: head.into(),
            tail: head.into(),
        };
        let skeleton = Skeleton::new(vec![
            joint("hips", None, [0.0, 1.0, 0.0]),
            joint("shoulder", Some(0), [0.0, 1.5, 0.0]),
            joint("elbow", Some(1), [0.3, 1.4, 0.1]),
            joint("leg", Some(0), [0.0, 1.0, 0.0]),
        ])
        .unwrap();
        let turns = [[0.1, 0.8, 0.0], [0.0, -0.2, 0.4], [0.5, 0.1, -0.3], [-0.4, 0.0, 0.1]];
        let pose = Pose {
            root_translation: Vector::new(0.05, -0.1, 0.2),
            rotations: turns.map(|t| UnitQuaternion::new(Vector::from(t))).to_vec(),
        };
        (skeleton, pose)
    }

    /// The pose with its unknown `k` changed by `h`.
    pub(in crate::reconstruct::poses) fn disturbed(pose: &Pose, k: usize, h: Real) -> Pose {
        let (mut pose, mut d) = (pose.clone(), Vector::zeros());
        d[k % 3] = h;
        match pose.rotations.get_mut(k / 3) {
            Some(q) => *q *= UnitQuaternion::new(d),
            None => pose.root_translation += d,
        }
        pose
    }

    #[test]
    fn equations_of_a_skinned_point_match_those_of_differences() {
        let (skeleton, pose) = bent();
        let (x, weights, target) = (
            Point::new(0.4, 1.3, 0.2),
            [(0, 0.1), (1, 0.3), (2, 0.35), (3, 0.25)],
            Vector::new(0.1, 1.0, 0.3),
        );
        let residual = |pose: &Pose| {
            let t = skeleton.transforms(pose).unwrap();
            weights.iter().fold(-target, |sum, (j, w)| sum + (t[*j] * x).coords * *w)
        };
        let transforms = skeleton.transforms(&pose).unwrap();
        let row = |(j, w): &(usize, Real)| {
            let mut row = SMatrix::<Real, 3, 6>::zeros();
            let p = (transforms[*j] * x).coords;
            row.fixed_view_mut::<3, 3>(0, 0).copy_from(&(cross(&p) * -*w));
            row.fixed_view_mut::<3, 3>(0, 3).copy_from(&(Matrix3::identity() * *w));
            (*j, row)
        };
        // The last joint in two halves: a joint may occur twice.
        let mut rows: Vec<Row<3>> = weights.iter().map(row).collect();
        let half = rows[3].1 * 0.5;
        rows[3].1 = half;
        rows.push((3, half));
        let mut twists = Twists::new(skeleton.len());
        twists.add(&rows, &residual(&pose), 2.0);
        let (h, g) = twists.into_pose(&skeleton, &skeleton.frames(&pose).unwrap());
        let (n, d) = (unknowns(skeleton.len()), 1e-6);
        assert_eq!((h.nrows(), g.len()), (n, n));
        let slopes = nalgebra::Matrix3xX::from_columns(
            &(0..n)
                .map(|k| {
                    let [up, down] = [d, -d].map(|d| residual(&disturbed(&pose, k, d)));
                    (up - down) / (2.0 * d)
                })
                .collect::<Vec<_>>(),
        );
        // Differences of step 1e-6 round at 1e-10.
        assert!((g - slopes.transpose() * residual(&pose) * 2.0).amax() < 1e-8);
        assert!((h - slopes.transpose() * &slopes * 2.0).amax() < 1e-8);
    }
}
