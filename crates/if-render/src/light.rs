//! Shading: the linear light that a sample receives.

use crate::raster::{LINE, NOTHING, SUPER, Samples};
use crate::scene::{Scene, Seen};

/// Linear red of highlighted triangles.
const RED: [f32; 3] = [0.80, 0.010, 0.012];
/// Depth below the surface to which highlighted triangles show through, in metres.
const SHINES_THROUGH: f32 = 0.03;
/// Directions to the lights in axes right, up, towards the eye, of unit length, and their
/// strengths.
const LIGHTS: [([f32; 3], f32); 2] = [([-0.45, 0.62, 0.643], 0.62), ([0.70, 0.10, 0.707], 0.20)];

/// Barycentric coordinates of a sample in a triangle; (1, 0, 0) in one seen edge-on.
pub(crate) fn at(layer: &Seen, t: usize, x: f32, y: f32) -> [f32; 3] {
    let [a, b, c] = layer.triangles[t].map(|v| layer.points[v as usize]);
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if area == 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let wa = ((b[1] - c[1]) * (x - c[0]) + (c[0] - b[0]) * (y - c[1])) / area;
    let wb = ((c[1] - a[1]) * (x - c[0]) + (a[0] - c[0]) * (y - c[1])) / area;
    [wa, wb, 1.0 - wa - wb]
}

/// The interpolated normal, turned towards the eye, and whether the back faces the eye.
pub(crate) fn facing_normal(layer: &Seen, t: usize, w: &[f32; 3]) -> ([f32; 3], bool) {
    let tri = layer.triangles[t];
    let [a, b, c] = tri.map(|v| layer.points[v as usize]);
    // y points down: seen from the front, corners run clockwise here.
    let back = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0;
    let sign = if back { -1.0 } else { 1.0 };
    let [na, nb, nc] = tri.map(|v| layer.normals[v as usize]);
    let mean = |k: usize| sign * (w[0] * na[k] + w[1] * nb[k] + w[2] * nc[k]);
    let mut n = [mean(0), mean(1), mean(2)];
    n[2] = n[2].max(0.0); // smooth normals may look away at silhouettes
    let length = n.iter().map(|v| v * v).sum::<f32>().sqrt();
    if length > 0.0 { (n.map(|v| v / length), back) } else { ([0.0, 0.0, 1.0], back) }
}

/// Samples of a pixel.
const SAMPLES: usize = SUPER * SUPER;

/// Linear light of the pixel in column `x` of row `y`: the mean of its samples. Those that see the same
/// triangle are shaded once, in their middle. `free` is the visible share of the sky.
pub(crate) fn pixel(scene: &Scene, samples: &Samples, [x, y]: [usize; 2], free: f32) -> [f32; 3] {
    let of: [[usize; 2]; SAMPLES] =
        std::array::from_fn(|s| [x * SUPER + s % SUPER, y * SUPER + s / SUPER]);
    let seen = of.map(|place| samples.seen[samples.index(place)]);
    if seen.iter().all(|id| *id == seen[0]) {
        return shaded(scene, samples, &of, free);
    }
    let mut sum = [0.0; 3];
    for (s, id) in seen.iter().enumerate() {
        if seen[..s].contains(id) {
            continue; // shaded already
        }
        let (mut same, mut count) = ([[0; 2]; SAMPLES], 0);
        for (place, _) in of.iter().zip(&seen).filter(|(_, other)| *other == id) {
            same[count] = *place;
            count += 1;
        }
        let color = shaded(scene, samples, &same[..count], free);
        (0..3).for_each(|k| sum[k] += color[k] * (count as f32 / SAMPLES as f32));
    }
    sum
}

/// Linear light of samples, given by column and row, that see the same.
fn shaded(scene: &Scene, samples: &Samples, same: &[[usize; 2]], free: f32) -> [f32; 3] {
    let of_all = 1.0 / same.len() as f32;
    let [x, y] = [0, 1].map(|k| same.iter().map(|p| p[k] as f32 + 0.5).sum::<f32>() * of_all);
    let id = samples.seen[samples.index(same[0])];
    if id == NOTHING {
        return scene.backdrop.light([x, y]);
    }
    if id & LINE != 0 {
        return scene.lines[(id & !LINE) as usize].color;
    }
    let (layer, t) = scene.triangle(id);
    let (n, back) = facing_normal(layer, t, &at(layer, t, x, y));
    if back && layer.solid {
        // The cut through a solid: flat, with a fine hatch.
        let hatch = |[x, y]: &[usize; 2]| {
            let along = (*x as f32 + 0.5) + (*y as f32 + 0.5);
            if (along / 7.0).rem_euclid(2.0) < 0.4 { 0.62 } else { 0.78 }
        };
        let hatch = same.iter().map(hatch).sum::<f32>() * of_all;
        return layer.color.map(|c| hatch * c);
    }
    let mut color = if back { layer.color.map(|c| 0.42 * c + 0.012) } else { layer.color };
    if !samples.highlight.is_empty() {
        let share = |place: &[usize; 2]| {
            let index = samples.index(*place);
            let below = samples.highlight[index] - samples.depth[index];
            match layer.highlighted[t] {
                true => 0.92,
                false if below < SHINES_THROUGH => 0.45 * (1.0 - below / SHINES_THROUGH) + 0.12,
                false => 0.0,
            }
        };
        let share = same.iter().map(share).sum::<f32>() * of_all;
        (0..3).for_each(|k| color[k] += share * (RED[k] - color[k]));
    }
    let sky = 0.30 + 0.12 * n[1];
    let direct: f32 = LIGHTS
        .iter()
        .map(|(d, strength)| {
            // Cloth lights up a little beyond the terminator.
            let c = (n[0] * d[0] + n[1] * d[1] + n[2] * d[2] + 0.15) / 1.15;
            strength * c.max(0.0)
        })
        .sum();
    let light = sky * free + direct * (0.35 + 0.65 * free);
    let rim = 0.05 * (1.0 - n[2]).powi(3) * free;
    color.map(|c| c * light * 1.12 + rim)
}
