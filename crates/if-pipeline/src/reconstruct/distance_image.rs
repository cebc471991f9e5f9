//! Signed distance of each pixel from the border of a mask.

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

    /// The distance from the border of another mask of the same size, filtered alike.
    pub(super) fn alike(&self, mask: &[bool]) -> Self {
        Self::new(mask, self.width, self.height, self.blur)
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

/// The squared distance of each pixel from the nearest one whose mask is `wanted`.
fn squared_distances(mask: &[bool], width: usize, height: usize, wanted: bool) -> Vec<f64> {
    let mut image: Vec<f64> =
        mask.iter().map(|m| if *m == wanted { 0.0 } else { FAR * FAR }).collect();
    let longest = width.max(height);
    let (mut line, mut out) = (vec![0.0; longest], vec![0.0; longest]);
    let mut scratch = Envelope { sites: vec![0; longest], from: vec![0.0; longest + 1] };
    for x in 0..width {
        (0..height).for_each(|y| line[y] = image[y * width + x]);
        scratch.transform(&line[..height], &mut out[..height]);
        (0..height).for_each(|y| image[y * width + x] = out[y]);
    }
    for row in image.chunks_exact_mut(width) {
        line[..width].copy_from_slice(row);
        scratch.transform(&line[..width], row);
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

/// Smoothed by a Gaussian of `sigma` pixels, cut at three, with the edge repeated beyond it.
fn blurred(image: &[f64], width: usize, height: usize, sigma: f64) -> Vec<f64> {
    let reach = (3.0 * sigma).ceil() as i64;
    let kernel: Vec<f64> =
        (-reach..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let sum: f64 = kernel.iter().sum();
    let pass = |from: &[f64], dx: i64, dy: i64| -> Vec<f64> {
        let clamp = |v: i64, n: usize| v.clamp(0, n as i64 - 1) as usize;
        let value = |i: usize| {
            let (x, y) = ((i % width) as i64, (i / width) as i64);
            let at = |k: i64| from[clamp(y + dy * k, height) * width + clamp(x + dx * k, width)];
            kernel.iter().zip(-reach..).map(|(w, k)| w * at(k)).sum::<f64>() / sum
        };
        (0..from.len()).map(value).collect()
    };
    pass(&pass(image, 1, 0), 0, 1)
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
