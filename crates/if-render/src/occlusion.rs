//! Ambient occlusion: how much of the sky the surroundings of a pixel hide.

use crate::light::{at, facing_normal};
use crate::raster::{LINE, SUPER, Samples};
use crate::scene::Scene;
use rayon::prelude::*;

/// Radius of the surroundings, in metres.
const RADIUS: f32 = 0.06;
/// Points sampled around each pixel.
const TAPS: usize = 28;

/// A point in the surroundings of a pixel.
struct Tap {
    /// Samples to the right and down, rounded down.
    samples: [i32; 2],
    /// Metres to the right and up.
    metres: [f32; 2],
}

impl Tap {
    fn new([right, down]: [f32; 2], scale: f32) -> Self {
        let samples = [right, down].map(|x| x.floor() as i32);
        Self { samples, metres: [right / scale, -down / scale] }
    }
}

/// Visible share of the sky for each pixel, from 0 to 1; 1 on the background.
///
/// # Source
///
/// McGuire et al. 2011, *The Alchemy screen-space ambient obscurance algorithm*, with a fixed
/// spiral instead of a random one.
pub(crate) fn occlusion(scene: &Scene, samples: &Samples, width: usize, height: usize) -> Vec<f32> {
    let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
    let taps: Vec<Tap> = (0..TAPS)
        .map(|k| {
            let (s, c) = (golden * k as f32).sin_cos();
            let r = RADIUS * scene.scale * ((k as f32 + 0.5) / TAPS as f32);
            Tap::new([r * c, r * s], scene.scale)
        })
        .collect();
    let rows = (height * SUPER) as i32;
    let columns = samples.width as i32;
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
                let (tx, ty) = (sx as i32 + tap.samples[0], sy as i32 + tap.samples[1]);
                if tx < 0 || ty < 0 || tx >= columns || ty >= rows {
                    continue;
                }
                let there = samples.depth[ty as usize * samples.width + tx as usize];
                if there.is_infinite() {
                    continue;
                }
                let d = [tap.metres[0], tap.metres[1], samples.depth[here] - there];
                let d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                let up = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
                let near = 1.0 - d2 / (4.0 * RADIUS * RADIUS);
                if near > 0.0 && up > 0.002 {
                    hidden += near * (up - 0.002) / (d2 + 2e-5).sqrt();
                }
            }
            *free = (1.0 - 1.6 * hidden / TAPS as f32).clamp(0.0, 1.0);
        }
    });
    out
}
