//! sRGB and linear light.

use std::sync::LazyLock;

/// Linear light of an sRGB colour.
pub(crate) fn decode(color: [u8; 3]) -> [f32; 3] {
    color.map(|c| linear(f32::from(c) / 255.0))
}

fn linear(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// The sRGB value of linear light, clamped.
pub(crate) fn encode(c: f32) -> u8 {
    let table = &*TABLE;
    let c = c.clamp(0.0, 1.0);
    let mut code = table.first[(c * CELLS as f32) as usize];
    while c >= table.next[usize::from(code)] {
        code += 1;
    }
    code
}

/// Equal parts of linear light from 0 to 1. In the first there are two values of sRGB, in others fewer.
const CELLS: usize = 4096;

static TABLE: LazyLock<Table> = LazyLock::new(Table::new);

/// Linear light to sRGB: a power for each pixel would take longer than its light.
struct Table {
    /// The value at the beginning of each part.
    first: Vec<u8>,
    /// Of each value the light from which on the next one is nearer; infinite of the last.
    next: Vec<f32>,
}

impl Table {
    fn new() -> Self {
        let mut next: Vec<f32> = (0..255u8).map(|k| linear((f32::from(k) + 0.5) / 255.0)).collect();
        next.push(f32::INFINITY);
        let first = (0..=CELLS).map(|cell| cell as f32 / CELLS as f32);
        let first = first.map(|c| next.partition_point(|next| *next <= c) as u8).collect();
        Self { first, next }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_becomes_the_nearest_value() {
        for k in 0..=255 {
            assert_eq!(encode(decode([k; 3])[0]), k);
        }
        let exact = |c: f32| {
            let c = f64::from(c);
            let c = if c <= 0.0031308 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
            255.0 * c
        };
        for k in 0..=100_000u32 {
            let c = k as f32 * 1e-5;
            assert!((f64::from(encode(c)) - exact(c)).abs() < 0.501, "{c}");
        }
        assert_eq!([encode(-1.0), encode(2.0), encode(f32::NAN)], [0, 255, 0]);
    }
}
