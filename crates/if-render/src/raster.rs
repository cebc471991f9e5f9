//! Visibility: the nearest triangle of each sample.

use crate::scene::Scene;
use crate::section::Line;
use rayon::prelude::*;

/// Samples along each side of a pixel.
pub(crate) const SUPER: usize = 2;
/// No triangle.
pub(crate) const NOTHING: u32 = u32::MAX;
/// Bit that marks the number of a line instead of a triangle.
pub(crate) const LINE: u32 = 1 << 31;
/// Rows of samples that one task draws.
const BAND: usize = 32;
/// Half the width of lines, in samples.
const LINE_WIDTH: f32 = 2.2;
/// Offset of lines towards the eye, in metres, so that surfaces do not hide them.
const LINE_LIFT: f32 = 0.004;

/// What is visible in each sample of a picture.
pub(crate) struct Samples {
    /// Samples in a row.
    pub(crate) width: usize,
    /// Nearest triangle, [`NOTHING`], or a line.
    pub(crate) seen: Vec<u32>,
    /// Its distance, in metres; infinite where nothing is visible.
    pub(crate) depth: Vec<f32>,
    /// Distance of the nearest highlighted triangle; empty if no triangle is highlighted.
    pub(crate) highlight: Vec<f32>,
}

impl Samples {
    pub(crate) fn new(scene: &Scene, width: usize, height: usize) -> Self {
        let bands = height.div_ceil(BAND);
        // Triangles and lines are sorted into bands of rows, which are drawn in parallel.
        let mut triangles: Vec<Vec<u32>> = vec![Vec::new(); bands];
        let rows = |low: f32, high: f32| {
            let (low, high) = (low.max(0.0) as usize, high.min(height as f32 - 1.0));
            if high < low as f32 { 0..0 } else { low / BAND..high as usize / BAND + 1 }
        };
        for layer in &scene.layers {
            for (t, tri) in layer.triangles.iter().enumerate() {
                let y = tri.map(|v| layer.points[v as usize][1]);
                for band in rows(y[0].min(y[1]).min(y[2]), y[0].max(y[1]).max(y[2])) {
                    triangles[band].push(layer.first + t as u32);
                }
            }
        }
        let mut lines: Vec<Vec<u32>> = vec![Vec::new(); bands];
        for (k, line) in scene.lines.iter().enumerate() {
            let y = line.ends.map(|p| p[1]);
            for band in rows(y[0].min(y[1]) - LINE_WIDTH, y[0].max(y[1]) + LINE_WIDTH) {
                lines[band].push(k as u32);
            }
        }
        let n = width * height;
        let any = scene.layers.iter().any(|l| l.highlighted.contains(&true));
        let mut this = Self {
            width,
            seen: vec![NOTHING; n],
            depth: vec![f32::INFINITY; n],
            highlight: vec![f32::INFINITY; if any { n } else { 0 }],
        };
        let chunk = (BAND * width).max(1);
        let mut highlights: Vec<&mut [f32]> = this.highlight.chunks_mut(chunk).collect();
        highlights.resize_with(bands, || &mut []);
        this.seen
            .par_chunks_mut(chunk)
            .zip(this.depth.par_chunks_mut(chunk))
            .zip(highlights)
            .enumerate()
            .for_each(|(band, ((seen, depth), highlight))| {
                let mut target = Band { first: band * BAND, width, seen, depth, highlight };
                for &id in &triangles[band] {
                    target.triangle(scene, id);
                }
                for &k in &lines[band] {
                    target.line(&scene.lines[k as usize], k);
                }
            });
        this
    }

    /// The index of the sample in a column and row.
    pub(crate) fn index(&self, [column, row]: [usize; 2]) -> usize {
        row * self.width + column
    }

    /// Whether nothing is visible in the pixel in a column and row.
    pub(crate) fn is_empty_pixel(&self, [x, y]: [usize; 2]) -> bool {
        (0..SUPER).all(|row| {
            let first = self.index([x * SUPER, y * SUPER + row]);
            self.seen[first..first + SUPER].iter().all(|seen| *seen == NOTHING)
        })
    }
}

/// The first sample whose middle is not before `v`. (Casts, because rounding calls a function.)
fn from(v: f32) -> usize {
    let v = (v - 0.5).max(0.0);
    let below = v as u32;
    below.saturating_add(u32::from((below as f32) < v)) as usize
}

/// The sample after the last one whose middle is not after `v`.
fn to(v: f32) -> usize {
    if v < 0.5 { 0 } else { ((v - 0.5) as u32).saturating_add(1) as usize }
}

/// Some rows of the picture.
struct Band<'a> {
    first: usize,
    width: usize,
    seen: &'a mut [u32],
    depth: &'a mut [f32],
    highlight: &'a mut [f32],
}

impl Band<'_> {
    /// The rows and columns of this band between the given corners.
    fn window(
        &self,
        low: [f32; 2],
        high: [f32; 2],
    ) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let rows = self.seen.len() / self.width.max(1);
        let in_band = |row: usize| row.saturating_sub(self.first).min(rows);
        let y = in_band(from(low[1]))..in_band(to(high[1]));
        let x = from(low[0]).min(self.width)..to(high[0]).min(self.width);
        (y, x)
    }

    fn triangle(&mut self, scene: &Scene, id: u32) {
        let (layer, t) = scene.triangle(id);
        let [a, b, c] = layer.triangles[t].map(|v| layer.points[v as usize]);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area == 0.0 {
            return;
        }
        let low = [0, 1].map(|k| a[k].min(b[k]).min(c[k]));
        let high = [0, 1].map(|k| a[k].max(b[k]).max(c[k]));
        let (rows, columns) = self.window(low, high);
        if columns.is_empty() {
            return;
        }
        // Barycentric coordinates and depth are linear in x and y.
        let per_area = 1.0 / area;
        let slope =
            |p: &[f32; 3], q: &[f32; 3]| [(p[1] - q[1]) * per_area, (q[0] - p[0]) * per_area];
        let (sa, sb) = (slope(&b, &c), slope(&c, &a));
        let cut = scene.cut.unwrap_or([0.0, 0.0, 0.0, f32::INFINITY]);
        for row in rows {
            let y = (self.first + row) as f32 + 0.5;
            let of_row = [sa[1] * (y - c[1]), sb[1] * (y - c[1])];
            // Whether the triangle is in a column, and how far away. Without branches, so that several
            // columns are looked at at once.
            let sample = |column: u32| {
                let x = column as i32 as f32 + 0.5;
                let wa = sa[0] * (x - c[0]) + of_row[0];
                let wb = sb[0] * (x - c[0]) + of_row[1];
                let wc = 1.0 - wa - wb;
                let z = wa * a[2] + wb * b[2] + wc * c[2];
                let is_cut_away = cut[0] * x + cut[1] * y + cut[2] * z > cut[3];
                ((wa >= 0.0) & (wb >= 0.0) & (wc >= 0.0) & !is_cut_away, z)
            };
            let here = row * self.width + columns.start..row * self.width + columns.end;
            let start = columns.start as u32;
            let samples = self.depth[here.clone()].iter_mut().zip(&mut self.seen[here.clone()]);
            for (column, (depth, seen)) in (start..).zip(samples) {
                let (is_inside, z) = sample(column);
                let is_nearest = is_inside & (z < *depth);
                *depth = if is_nearest { z } else { *depth };
                *seen = if is_nearest { id } else { *seen };
            }
            if layer.highlighted[t] {
                for (column, nearest) in (start..).zip(&mut self.highlight[here]) {
                    let (is_inside, z) = sample(column);
                    *nearest = if is_inside { nearest.min(z) } else { *nearest };
                }
            }
        }
    }

    fn line(&mut self, line: &Line, k: u32) {
        let [a, b] = line.ends;
        let low = [0, 1].map(|k| a[k].min(b[k]) - LINE_WIDTH);
        let high = [0, 1].map(|k| a[k].max(b[k]) + LINE_WIDTH);
        let (rows, columns) = self.window(low, high);
        let d = [b[0] - a[0], b[1] - a[1]];
        let length2 = d[0] * d[0] + d[1] * d[1];
        for row in rows {
            for column in columns.clone() {
                let p = [column as f32 + 0.5 - a[0], (self.first + row) as f32 + 0.5 - a[1]];
                let s = if length2 > 0.0 {
                    ((p[0] * d[0] + p[1] * d[1]) / length2).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let (x, y) = (p[0] - s * d[0], p[1] - s * d[1]);
                let z = a[2] + s * (b[2] - a[2]) - LINE_LIFT;
                let at = row * self.width + column;
                if x * x + y * y <= LINE_WIDTH * LINE_WIDTH && z < self.depth[at] {
                    self.depth[at] = z;
                    self.seen[at] = LINE | k;
                }
            }
        }
    }
}
