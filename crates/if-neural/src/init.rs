//! What θ is before the first step.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::mlp::{DeformationConfig, Layout, SdfConfig};

/// Normally distributed numbers by Box and Müller, from a seeded PCG.
pub(crate) struct Normal {
    rng: Pcg64Mcg,
    spare: Option<f64>,
}

impl Normal {
    pub(crate) fn seeded(seed: u64) -> Self {
        Normal { rng: Pcg64Mcg::seed_from_u64(seed), spare: None }
    }

    /// One number of mean 0 and deviation 1.
    pub(crate) fn next(&mut self) -> f64 {
        if let Some(value) = self.spare.take() {
            return value;
        }
        // 1 − u is in (0, 1], so that the logarithm is finite.
        let radius = (-2.0 * (1.0 - self.rng.random::<f64>()).ln()).sqrt();
        let angle = std::f64::consts::TAU * self.rng.random::<f64>();
        self.spare = Some(radius * angle.sin());
        radius * angle.cos()
    }
}

/// θ of a field that is close to the distance from a sphere of `config.radius`.
///
/// Last layer W ~ N(√π/√width, 1e-4), b = −radius; first layer: only the three coordinates are
/// seen, N(0, √2/√rows); the joined layer does not see the encoding's sines; else N(0, √2/√rows).
/// With weight norm the gains are the norms of the rows, so that the folded W is the drawn one.
///
/// # Source
///
/// Geometric initialisation of SAL [Atzmon and Lipman 2020] and IGR [Gropp et al. 2020], as IDR
/// [Yariv et al. 2020] has it with encoding.
///
/// # Accuracy
///
/// With β = 100 and radius 0.6, over four seeds: 512 wide the mean of |∇φ| in [−1, 1]³ is 0.91 to
/// 1.03 and φ(0) −0.15 to −0.20, not −radius; 256 wide 0.85 to 1.16 and −0.24 to −0.33.
pub(crate) fn geometric(config: &SdfConfig, layout: &Layout, seed: u64) -> Vec<f32> {
    let mut normal = Normal::seeded(seed);
    let mut theta = vec![0.0_f32; layout.parameters];
    let encoded = config.encoding().width();
    for (index, layer) in layout.layers.iter().enumerate() {
        let last = index == config.layers;
        let (mean, deviation) = if last {
            (std::f64::consts::PI.sqrt() / (config.width as f64).sqrt(), 1e-4)
        } else {
            (0.0, (2.0 / layer.rows as f64).sqrt())
        };
        // The columns that start at zero: all of the encoding but the coordinates themselves. In
        // the joined layer IDR zeroes all of its last (encoding − 3) columns, as we do.
        let seen = if index == 0 {
            3
        } else if config.skip == Some(index) {
            layer.columns - (encoded - 3)
        } else {
            layer.columns
        };
        for row in theta[layer.weight.clone()].chunks_exact_mut(layer.columns) {
            for weight in &mut row[..seen] {
                *weight = (mean + deviation * normal.next()) as f32;
            }
        }
        if last {
            theta[layer.bias.clone()].fill(-config.radius);
        }
        if let Some(gain) = &layer.gain {
            for row in 0..layer.rows {
                let at = layer.weight.start + row * layer.columns;
                theta[gain.start + row] = norm(&theta[at..at + layer.columns]) as f32;
            }
        }
    }
    theta
}

/// |v| in f64, whatever the length.
pub(crate) fn norm(v: &[f32]) -> f64 {
    v.iter().map(|&x| f64::from(x) * f64::from(x)).sum::<f64>().sqrt()
}

/// θ of a deformation that moves next to nothing, and embeddings that are smooth in time behind it.
///
/// Hidden layers as PyTorch's `Linear` (uniform, variance 1/(3·columns)), last layer W ~ N(0,
/// 1e-3), b = 0. Embeddings: a random combination of the first frames/5 vectors of the orthonormal
/// DCT, × 0.1.
pub(crate) fn deformation(config: &DeformationConfig, layout: &Layout, seed: u64) -> Vec<f32> {
    let mut normal = Normal::seeded(seed);
    let mut theta = vec![0.0_f32; layout.parameters + config.frames * config.embedding];
    for (index, layer) in layout.layers.iter().enumerate() {
        if index == config.layers {
            for weight in &mut theta[layer.weight.clone()] {
                *weight = (1e-3 * normal.next()) as f32;
            }
        } else {
            let bound = 1.0 / (layer.columns as f64).sqrt();
            for value in &mut theta[layer.weight.start..layer.bias.end] {
                *value = (bound * (2.0 * normal.rng.random::<f64>() - 1.0)) as f32;
            }
        }
    }
    let (frames, n) = (config.frames, config.frames as f64);
    let vectors = (frames / 5).max(1);
    let embeddings = &mut theta[layout.parameters..];
    for k in 0..vectors {
        let scale = if k == 0 { (1.0 / n).sqrt() } else { (2.0 / n).sqrt() };
        let share: Vec<f64> = (0..config.embedding).map(|_| 0.1 * normal.next()).collect();
        for (frame, row) in embeddings.chunks_exact_mut(config.embedding.max(1)).enumerate() {
            let phase = std::f64::consts::PI * (2 * frame + 1) as f64 * k as f64 / (2.0 * n);
            for (value, share) in row.iter_mut().zip(&share) {
                *value += (scale * phase.cos() * share) as f32;
            }
        }
    }
    theta
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_mean_0_and_deviation_1() {
        let mut normal = Normal::seeded(1);
        let n = 40_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..n {
            let x = normal.next();
            sum += x;
            squares += x * x;
        }
        // Four standard errors: 4/√n and 4·√(2/n).
        assert!((sum / f64::from(n)).abs() < 0.02);
        assert!((squares / f64::from(n) - 1.0).abs() < 0.03);
    }

    #[test]
    fn embeddings_are_smooth_in_time_and_small() {
        let config = DeformationConfig::fast(100);
        let layout = config.layout().expect("the preset");
        let theta = deformation(&config, &layout, 3);
        let rows: Vec<&[f32]> = theta[layout.parameters..].chunks_exact(32).collect();
        let size = |v: &[f32]| norm(v);
        let step: f64 = rows
            .windows(2)
            .map(|pair| {
                let d: Vec<f32> = pair[0].iter().zip(pair[1]).map(|(a, b)| a - b).collect();
                size(&d)
            })
            .sum::<f64>()
            / 99.0;
        let level: f64 = rows.iter().map(|row| size(row)).sum::<f64>() / 100.0;
        // White noise would step by √2 of its level; the band limit of a fifth allows 0.37.
        assert!(step < 0.45 * level, "step {step}, level {level}");
        assert!(level > 0.1 && level < 1.0, "level {level}");
    }
}
