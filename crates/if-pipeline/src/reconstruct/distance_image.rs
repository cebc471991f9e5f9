//! Signed distance of each pixel from the border of a mask.

use std::ops::Range;

/// Distance in pixels that replaces infinity for empty masks.
const FAR: f64 = 1e6;

/// An image of one number per pixel, rows from the top, interpolated between pixel centres.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct DistanceImage {
    width: usize,
    height: usize,
    /// Standard deviation of its filter, in pixels.
    blur: f64,
    values: Vec<f32>,
}

impl DistanceImage {
    /// The signed distance of each pixel's centre from the border of `mask`, in pixels: positive
    /// outside. The border lies half a pixel from the centres on both of its sides. Exact, then
    /// smoothed by a Gaussian of `blur` pixels (0 for none).
    ///
    /// # Source
    ///
    /// Felzenszwalb and Huttenlocher 2012.
    pub(super) fn new(mask: &[bool], width: usize, height: usize, blur: f64) -> Self {
        debug_assert_eq!(mask.len(), width * height);
        let outside = squared_distances(mask, width, height, true);
        let inside = squared_distances(mask, width, height, false);
        let signed =
            |i: usize| if mask[i] { 0.5 - inside[i].sqrt() } else { outside[i].sqrt() - 0.5 };
        let mut values: Vec<f64> = (0..mask.len()).map(signed).collect();
        if blur > 0.0 {
            values = blurred(&values, width, height, blur);
        }
        Self { width, height, blur, values: values.into_iter().map(|v| v as f32).collect() }
    }

    /// The distance from the border of the figure `mask` of the same size, filtered alike, as it is
    /// within `beside` pixels of one of the figure: only the part of the image that this depends on
    /// is computed. `None` without a figure.
    pub(super) fn outline(&self, mask: &[bool], beside: f64) -> Option<Outline> {
        debug_assert_eq!(mask.len(), self.width * self.height);
        // A pixel more for the interpolation. The nearest pixel beside the figure touches it.
        let margin = beside.ceil() as usize + 1 + taps(self.blur);
        let (columns, rows) = occupied(mask, self.width)?;
        let within = |r: Range<usize>, n: usize| {
            r.start.saturating_sub(margin)..r.end.saturating_add(margin).min(n)
        };
        let (columns, rows) = (within(columns, self.width), within(rows, self.height));
        let part: Vec<bool> = rows
            .clone()
            .flat_map(|y| &mask[y * self.width + columns.start..y * self.width + columns.end])
            .copied()
            .collect();
        let image = Self::new(&part, columns.len(), rows.len(), self.blur);
        Some(Outline { image, first: (columns.start as f64, rows.start as f64) })
    }

    /// The value at a pixel position: bilinear between centres, constant outside.
    pub(super) fn at(&self, u: f64, v: f64) -> f64 {
        let x = (u - 0.5).clamp(0.0, (self.width - 1) as f64);
        let y = (v - 0.5).clamp(0.0, (self.height - 1) as f64);
        let (i, j) = (
            (x as usize).min(self.width.saturating_sub(2)),
            (y as usize).min(self.height.saturating_sub(2)),
        );
        let (a, b) = (x - i as f64, y - j as f64);
        let (i1, j1) = ((i + 1).min(self.width - 1), (j + 1).min(self.height - 1));
        let value = |i: usize, j: usize| f64::from(self.values[j * self.width + i]);
        (value(i, j) * (1.0 - a) + value(i1, j) * a) * (1.0 - b)
            + (value(i, j1) * (1.0 - a) + value(i1, j1) * a) * b
    }

    /// The gradient at a pixel position, by central differences over two pixels.
    pub(super) fn slope(&self, u: f64, v: f64) -> [f64; 2] {
        [
            0.5 * (self.at(u + 1.0, v) - self.at(u - 1.0, v)),
            0.5 * (self.at(u, v + 1.0) - self.at(u, v - 1.0)),
        ]
    }

    /// The value at a pixel's centre.
    pub(super) fn pixel(&self, i: usize) -> f32 {
        self.values[i]
    }
}

/// The distance from a figure's own outline, near it.
pub(super) struct Outline {
    image: DistanceImage,
    /// The place of its first pixel in the whole image.
    first: (f64, f64),
}

impl Outline {
    /// The value at a pixel position of the whole image.
    pub(super) fn at(&self, u: f64, v: f64) -> f64 {
        self.image.at(u - self.first.0, v - self.first.1)
    }
}

/// The columns and rows of the smallest box that holds all pixels of a mask; `None` without any.
fn occupied(mask: &[bool], width: usize) -> Option<(Range<usize>, Range<usize>)> {
    let mut found: Option<(Range<usize>, Range<usize>)> = None;
    for (y, row) in mask.chunks_exact(width).enumerate() {
        let Some(first) = row.iter().position(|m| *m) else { continue };
        let end = row.iter().rposition(|m| *m).unwrap_or(first) + 1;
        found = Some(match found {
            None => (first..end, y..y + 1),
            Some((columns, rows)) => {
                (columns.start.min(first)..columns.end.max(end), rows.start..y + 1)
            }
        });
    }
    found
}

/// The squared distance of each pixel from the nearest one whose mask is `wanted`.
fn squared_distances(mask: &[bool], width: usize, height: usize, wanted: bool) -> Vec<f64> {
    // Within columns by steps from row to row, down and up, then the squares.
    let mut image: Vec<f64> = mask.iter().map(|m| if *m == wanted { 0.0 } else { FAR }).collect();
    let step = |to: &mut [f64], from: &[f64]| {
        to.iter_mut().zip(from).for_each(|(t, f)| *t = t.min(f + 1.0));
    };
    for y in 1..height {
        let (before, after) = image.split_at_mut(y * width);
        step(&mut after[..width], &before[(y - 1) * width..]);
    }
    for y in (1..height).rev() {
        let (before, after) = image.split_at_mut(y * width);
        step(&mut before[(y - 1) * width..], &after[..width]);
    }
    image.iter_mut().for_each(|d| *d *= *d);
    let mut line = vec![0.0; width];
    let mut scratch = Envelope { sites: vec![0; width], from: vec![0.0; width + 1] };
    for row in image.chunks_exact_mut(width) {
        line.copy_from_slice(row);
        scratch.transform(&line, row);
    }
    image
}

/// The lower envelope of parabolas.
struct Envelope {
    sites: Vec<usize>,
    from: Vec<f64>,
}

impl Envelope {
    /// `out[q] = min over p of line[p] + (q − p)²`.
    fn transform(&mut self, line: &[f64], out: &mut [f64]) {
        let (sites, from) = (&mut self.sites, &mut self.from);
        let mut last = 0;
        sites[0] = 0;
        (from[0], from[1]) = (f64::NEG_INFINITY, f64::INFINITY);
        for q in 1..line.len() {
            let meet = |p: usize| {
                ((line[q] + (q * q) as f64) - (line[p] + (p * p) as f64)) / (2 * (q - p)) as f64
            };
            let mut s = meet(sites[last]);
            while s <= from[last] {
                last -= 1;
                s = meet(sites[last]);
            }
            last += 1;
            sites[last] = q;
            (from[last], from[last + 1]) = (s, f64::INFINITY);
        }
        let mut k = 0;
        for (q, o) in out.iter_mut().enumerate() {
            while from[k + 1] < q as f64 {
                k += 1;
            }
            let d = q as f64 - sites[k] as f64;
            *o = line[sites[k]] + d * d;
        }
    }
}

/// Pixels to each side that a Gaussian of `sigma` pixels reads.
fn taps(sigma: f64) -> usize {
    (3.0 * sigma).ceil() as usize
}

/// Smoothed by a Gaussian of `sigma` pixels, cut at three, with the edge repeated beyond it.
fn blurred(image: &[f64], width: usize, height: usize, sigma: f64) -> Vec<f64> {
    let reach = taps(sigma);
    let kernel: Vec<f64> = (0..=2 * reach)
        .map(|k| (-0.5 * ((k as f64 - reach as f64) / sigma).powi(2)).exp())
        .collect();
    let sum: f64 = kernel.iter().sum();
    let mut across = vec![0.0; image.len()];
    let mut line = vec![0.0; width + 2 * reach];
    for (row, to) in image.chunks_exact(width).zip(across.chunks_exact_mut(width)) {
        line[..reach].fill(row[0]);
        line[reach..reach + width].copy_from_slice(row);
        line[reach + width..].fill(row[width - 1]);
        for (k, w) in kernel.iter().enumerate() {
            to.iter_mut().zip(&line[k..]).for_each(|(t, v)| *t += w * v);
        }
        to.iter_mut().for_each(|t| *t /= sum);
    }
    let mut all = vec![0.0; image.len()];
    for (y, to) in all.chunks_exact_mut(width).enumerate() {
        for (k, w) in kernel.iter().enumerate() {
            let from = (y + k).saturating_sub(reach).min(height - 1) * width;
            let row = &across[from..from + width];
            to.iter_mut().zip(row).for_each(|(t, v)| *t += w * v);
        }
        to.iter_mut().for_each(|t| *t /= sum);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_match_brute_force() {
        let (w, h) = (17, 11);
        let mut state = 3u32;
        for trial in 0..5 {
            let mask: Vec<bool> = (0..w * h)
                .map(|_| {
                    state = state.wrapping_mul(1664525).wrapping_add(1013904223);
                    state >> 24 < 40 * trial
                })
                .collect();
            let image = DistanceImage::new(&mask, w, h, 0.0);
            for i in 0..w * h {
                let near = |wanted: bool| {
                    let others = (0..w * h).filter(|k| mask[*k] == wanted);
                    let distance = |k: usize| {
                        ((i % w) as f64 - (k % w) as f64).hypot((i / w) as f64 - (k / w) as f64)
                    };
                    others.map(distance).fold(f64::INFINITY, f64::min)
                };
                let expected = if mask[i] { 0.5 - near(false) } else { near(true) - 0.5 };
                let got = f64::from(image.pixel(i));
                assert!(
                    (got - expected).abs() < 1e-4 || (expected.is_infinite() && got.abs() > 1e5),
                    "trial {trial}, pixel {i}: {got}, {expected}"
                );
            }
        }
    }

    #[test]
    fn the_outline_of_a_figure_is_the_whole_distance_image_near_it() {
        let (w, h) = (40, 31);
        let whole_of = |inside: &dyn Fn(f64, f64) -> bool, blur: f64| {
            let mask: Vec<bool> =
                (0..w * h).map(|i| inside((i % w) as f64, (i / w) as f64)).collect();
            (DistanceImage::new(&mask, w, h, blur), mask)
        };
        let ring = |x: f64, y: f64| (2.5..6.0).contains(&(x - 17.0).hypot(y - 14.0));
        let at_the_edge = |x: f64, y: f64| x > 33.0 && y < 9.0;
        for inside in [&ring as &dyn Fn(f64, f64) -> bool, &at_the_edge] {
            for blur in [0.0, 0.7, 1.5] {
                let (whole, mask) = whole_of(inside, blur);
                let outline = whole.outline(&mask, 2.0).unwrap();
                assert!(outline.image.values.len() < whole.values.len());
                for k in 0..40_000 {
                    let (u, v) = (0.2 * (k % 200) as f64 + 0.07, 0.155 * (k / 200) as f64 + 0.03);
                    let near = (0..w * h)
                        .filter(|i| mask[*i])
                        .any(|i| ((i % w) as f64 + 0.5 - u).hypot((i / w) as f64 + 0.5 - v) <= 2.0);
                    assert!(!near || outline.at(u, v) == whole.at(u, v), "{blur}: {u} {v}");
                }
            }
        }
        let (nothing, mask) = whole_of(&|_, _| false, 1.0);
        assert!(nothing.outline(&mask, 2.0).is_none());
    }

    #[test]
    fn beside_a_straight_border_the_slope_is_one_pixel_a_pixel() {
        let (w, h) = (20, 16);
        let mask: Vec<bool> = (0..w * h).map(|i| i % w < 8).collect();
        for blur in [0.0, 1.0] {
            let image = DistanceImage::new(&mask, w, h, blur);
            assert!(
                (image.at(8.0, 7.3)).abs() < 1e-6 && (image.at(10.25, 4.0) - 2.25).abs() < 1e-3,
                "{blur}"
            );
            let [du, dv] = image.slope(9.0, 8.0);
            assert!((du - 1.0).abs() < 1e-3 && dv.abs() < 1e-6, "{du} {dv}");
        }
        assert_eq!(
            DistanceImage::new(&[true], 1, 1, 0.0).at(5.0, -3.0),
            f64::from((0.5 - FAR) as f32)
        );
    }
}
