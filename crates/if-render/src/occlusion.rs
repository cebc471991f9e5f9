//! Ambient occlusion: how much of the sky the surroundings of a pixel hide.

use crate::light::{at, facing_normal};
use crate::raster::{LINE, SUPER, Samples};
use crate::scene::Scene;
use rayon::prelude::*;

/// Radius of the surroundings, in metres.
const RADIUS: f32 = 0.06;
/// Points sampled around each pixel.
const TAPS: usize = 28;

/// Visible share of the sky for each pixel, from 0 to 1; 1 on the background.
///
/// # Source
///
/// McGuire et al. 2011, *The Alchemy screen-space ambient obscurance algorithm*, with a fixed
/// spiral instead of a random one.
pub(crate) fn occlusion(scene: &Scene, samples: &Samples, width: usize, height: usize) -> Vec<f32> {
    let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
    let taps: Vec<[f32; 2]> = (0..TAPS)
        .map(|k| {
            let (s, c) = (golden * k as f32).sin_cos();
            let r = RADIUS * scene.scale * ((k as f32 + 0.5) / TAPS as f32);
            [r * c, r * s]
        })
        .collect();
    let rows = height * SUPER;
    let mut out = vec![1.0; width * height];
    out.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        for (x, free) in row.iter_mut().enumerate() {
            let (sx, sy) = (x * SUPER, y * SUPER);
            let here = sy * samples.width + sx;
            if samples.depth[here].is_infinite() || samples.seen[here] & LINE != 0 {
                continue;
            }
            let (layer, t) = scene.triangle(samples.seen[here]);
            let n = facing_normal(layer, t, &at(layer, t, sx as f32 + 0.5, sy as f32 + 0.5)).0;
            let mut hidden = 0.0;
            for tap in &taps {
                let (tx, ty) = (sx as f32 + tap[0], sy as f32 + tap[1]);
                if tx < 0.0 || ty < 0.0 || tx >= samples.width as f32 || ty >= rows as f32 {
                    continue;
                }
                let there = ty as usize * samples.width + tx as usize;
                if samples.depth[there].is_infinite() {
                    continue;
                }
                let d = [
                    tap[0] / scene.scale,
                    -tap[1] / scene.scale,
                    samples.depth[here] - samples.depth[there],
                ];
                let d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                let up = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
                let near = (1.0 - d2 / (4.0 * RADIUS * RADIUS)).max(0.0);
                hidden += near * (up - 0.002).max(0.0) / (d2 + 2e-5).sqrt();
            }
            *free = (1.0 - 1.6 * hidden / TAPS as f32).clamp(0.0, 1.0);
        }
    });
    out
}
