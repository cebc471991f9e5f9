//! Ambient occlusion: how much of the sky the surroundings of a pixel hide.

use crate::light::{at, facing_normal};
use crate::raster::{LINE, SUPER, Samples};
use crate::scene::Scene;
use rayon::prelude::*;

/// Radius of the surroundings, in metres.
const RADIUS: f32 = 0.06;
/// Points sampled around each pixel.
const TAPS: usize = 28;

/// Points in the surroundings of a pixel.
struct Taps {
    /// Samples to the right and down, rounded down.
    samples: [[i32; 2]; TAPS],
    /// Metres to the right.
    right: [f32; TAPS],
    /// Metres up.
    up: [f32; TAPS],
}

impl Taps {
    /// On a spiral; `scale` is in samples a metre.
    fn new(scale: f32) -> Self {
        let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
        let places: [[f32; 2]; TAPS] = std::array::from_fn(|k| {
            let (s, c) = (golden * k as f32).sin_cos();
            let r = RADIUS * scale * ((k as f32 + 0.5) / TAPS as f32);
            [r * c, r * s]
        });
        Self {
            samples: places.map(|place| place.map(|x| x.floor() as i32)),
            right: places.map(|[right, _]| right / scale),
            up: places.map(|[_, down]| -down / scale),
        }
    }

    /// How much of the sky they hide from a place with normal `n`, each up to 1; `nearer` are the metres
    /// by which they lie nearer to the eye.
    fn hidden(&self, n: &[f32; 3], nearer: &[f32; TAPS]) -> f32 {
        // Without branches, so that the compiler can look at several at once.
        let mut hidden = [0.0; TAPS];
        for k in 0..TAPS {
            let d = [self.right[k], self.up[k], nearer[k]];
            let d2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            let up = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
            let near = 1.0 - d2 / (4.0 * RADIUS * RADIUS);
            let share = near * (up - 0.002) / (d2 + 2e-5).sqrt();
            hidden[k] = if (near > 0.0) & (up > 0.002) { share } else { 0.0 };
        }
        hidden.iter().sum()
    }
}

/// Visible share of the sky for each pixel, from 0 to 1; 1 on the background.
///
/// # Source
///
/// McGuire et al. 2011, *The Alchemy screen-space ambient obscurance algorithm*, with a fixed
/// spiral instead of a random one.
pub(crate) fn occlusion(scene: &Scene, samples: &Samples, width: usize, height: usize) -> Vec<f32> {
    let taps = Taps::new(scene.scale);
    let rows = (height * SUPER) as i32;
    let columns = samples.width as i32;
    let mut out = vec![1.0; width * height];
    out.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        for (x, free) in row.iter_mut().enumerate() {
            let (sx, sy) = (x * SUPER, y * SUPER);
            let here = samples.index([sx, sy]);
            if samples.depth[here].is_infinite() || samples.seen[here] & LINE != 0 {
                continue;
            }
            let (layer, t) = scene.triangle(samples.seen[here]);
            let n = facing_normal(layer, t, &at(layer, t, sx as f32 + 0.5, sy as f32 + 0.5)).0;
            // Where nothing is visible, or beyond the picture, nothing is hidden.
            let mut nearer = [f32::NEG_INFINITY; TAPS];
            for (nearer, [right, down]) in nearer.iter_mut().zip(&taps.samples) {
                let (tx, ty) = (sx as i32 + right, sy as i32 + down);
                if (0..columns).contains(&tx) && (0..rows).contains(&ty) {
                    let there = samples.index([tx as usize, ty as usize]);
                    *nearer = samples.depth[here] - samples.depth[there];
                }
            }
            let hidden = taps.hidden(&n, &nearer);
            *free = (1.0 - 1.6 * hidden / TAPS as f32).clamp(0.0, 1.0);
        }
    });
    out
}
