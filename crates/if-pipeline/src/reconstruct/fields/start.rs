//! The start of d: embeddings, and the solved motion of single frames.

use super::params::FieldsParams;
use super::step::random_of;
use crate::reconstruct::error::ReconstructError;
use crate::reconstruct::motion::{Motion, distil_into};
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_core::monitor::Monitor;
use if_neural::deform::DeformParams;
use if_neural::deformation::DeformationNetwork;
use if_neural::frame::Frame;
use if_neural::mlp::DeformationConfig;
use if_neural::schedule::Schedule;
use nalgebra::DMatrix;
use rand::RngExt;
use std::f64::consts::PI;

/// Embeddings that are smooth in time, of mean zero and as large as the features beside them: with
/// almost equal ones all frames would learn one common motion first, which belongs to φ.
///
/// ```text
/// hᵢ = Σ_k cos(π (2i + 1) k / 2n) aₖ / √K,   k = 1 … K = n / 4, at least 2;   a random, from −1 to 1
/// ```
pub(super) fn spread_embeddings(network: &mut DeformationNetwork, seed: u64) {
    let &DeformationConfig { frames, embedding, .. } = network.config();
    let waves = (frames / 4).max(2);
    let mut random = random_of(seed, u64::MAX - 1);
    let shares: Vec<f64> = (0..waves * embedding).map(|_| random.random_range(-1.0..1.0)).collect();
    set_embeddings(network, |i, c| {
        let wave = |k: usize| {
            let phase = PI * ((2 * i + 1) * (k + 1)) as f64 / (2 * frames) as f64;
            phase.cos() * shares[k * embedding + c]
        };
        (0..waves).map(wave).sum::<f64>() / (waves as f64).sqrt()
    });
}

fn set_embeddings(network: &mut DeformationNetwork, value: impl Fn(usize, usize) -> f64) {
    let &DeformationConfig { frames, embedding, .. } = network.config();
    let first = network.parameters().len() - frames * embedding;
    let rows = &mut network.parameters_mut()[first..];
    for (e, to) in rows.iter_mut().enumerate() {
        *to = value(e / embedding, e % embedding) as f32;
    }
    network.refresh();
}

/// Fits d to the solved `motion` of the vertices of a `surface`. Embeddings begin as its principal
/// components in time, of which d is then almost a linear function: a few hundred steps suffice.
/// Without any motion nothing changes.
pub(super) fn start_at(
    network: &mut DeformationNetwork,
    frame: &Frame,
    (motion, surface): (&Motion, &TriMesh),
    params: &FieldsParams,
    monitor: &mut dyn Monitor,
) -> Result<(), ReconstructError> {
    let Some(components) = components(motion) else { return Ok(()) };
    set_embeddings(network, |i, c| if c < components.ncols() { components[(i, c)] } else { 0.0 });
    let fit = DeformParams {
        steps: params.motion_steps,
        // Smoothness is that of the motion, which is given everywhere on the surface.
        between: 0.0,
        rigidity: 0.0,
        small: 0.0,
        anneal: 0,
        schedule: Schedule { rate: 3e-3, warmup: 20, last: 0.02 },
        seed: params.seed,
        ..DeformParams::default()
    };
    distil_into(network, frame, (motion, surface), &fit, monitor)?;
    Ok(())
}

/// The principal components in time of a motion, the largest first, each with a root mean square of
/// the fourth root of its share; `None` if nothing moves.
fn components(motion: &Motion) -> Option<DMatrix<Real>> {
    let n = motion.offsets.len();
    let product = |i: usize, j: usize| -> Real {
        motion.offsets[i].iter().zip(&motion.offsets[j]).map(|(a, b)| a.dot(b)).sum()
    };
    let mut gram = DMatrix::zeros(n, n);
    for i in 0..n {
        for j in 0..=i {
            let value = product(i, j);
            (gram[(i, j)], gram[(j, i)]) = (value, value);
        }
    }
    let eigen = gram.symmetric_eigen();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]).then(a.cmp(b)));
    let largest = order.first().map_or(0.0, |k| eigen.eigenvalues[*k]);
    let found = (largest > 0.0).then(|| {
        DMatrix::from_fn(n, n, |i, c| {
            let k = order[c];
            let share = (eigen.eigenvalues[k] / largest).max(0.0).sqrt().sqrt();
            eigen.eigenvectors[(i, k)] * share * (n as Real).sqrt()
        })
    });
    found.filter(|c| c.iter().all(|x| x.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::MotionReport;
    use if_core::math::{Point, Vector};
    use if_core::monitor::Silent;
    use if_core::shapes::meshes;
    use if_neural::mlp::DeformationConfig;

    #[test]
    fn d_starts_at_the_solved_motion_and_without_any_where_it_was() {
        let ball = meshes::icosphere(0.5, 3);
        let wave = |frame: usize| {
            let d = |p: &Point| p.coords * (0.04 * (6.0 * p.x + frame as Real).sin());
            ball.vertices().iter().map(d).collect::<Vec<_>>()
        };
        let offsets: Vec<_> = (0..6).map(wave).collect();
        let motion = Motion { offsets, report: MotionReport::default() };
        let frame = Frame::around(&ball.aabb(), 0.05).unwrap();
        let config = DeformationConfig { bands: 3, embedding: 8, frames: 6, width: 32, layers: 2 };
        let mut network = DeformationNetwork::new(&config, 1).unwrap();
        spread_embeddings(&mut network, 1);
        let params = FieldsParams { motion_steps: 200, ..Default::default() };
        let before = network.parameters().to_vec();
        let still = Motion { offsets: vec![Vec::new(); 6], report: MotionReport::default() };
        start_at(&mut network, &frame, (&still, &ball), &params, &mut Silent).unwrap();
        assert_eq!(network.parameters(), before);

        start_at(&mut network, &frame, (&motion, &ball), &params, &mut Silent).unwrap();
        let units: Vec<_> = ball.vertices().iter().map(|p| frame.to_unit(p)).collect();
        let (mut off, mut size) = (0.0, 0.0);
        for (i, wanted) in motion.offsets.iter().enumerate() {
            let mut found = vec![[0.0; 3]; units.len()];
            network.offsets(&units, &vec![i as u32; units.len()], &mut found);
            for (found, wanted) in found.iter().zip(wanted) {
                off += (Vector::from(found.map(Real::from)) / frame.scale - wanted).norm();
                size += wanted.norm();
            }
        }
        assert!(off < 0.15 * size, "{off} of {size}");
    }
}
