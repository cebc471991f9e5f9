//! Rasterisation: the visible triangle of each pixel of a camera.
//!
//! ```text
//! corners → camera frame → pixels in fixed point (1/1024)
//! triangles, in blocks:   no pixel centre in its box? dropped.   else → list of each band of rows
//! bands of rows:          for its triangles, in ascending order: for each centre inside (top-left rule),
//!                         keep the triangle if it is nearer; at equal depth the smaller index stays
//! ```
//!
//! Blocks and bands have fixed sizes and run on any number of threads with the same result. Tests
//! of pixel centres are exact, so that triangles that share an edge leave no gap and cover no pixel
//! twice. Parts in front of the near plane, or far outside the picture, are clipped.

mod clip;
#[cfg(test)]
mod tests;

use crate::camera::Camera;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use nalgebra::Point2;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// No triangle.
pub const NOTHING: u32 = u32::MAX;

/// Parameters of rasterisation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RasterParams {
    /// Depth of the near plane, in metres: positive.
    pub near: Real,
    /// Skips triangles that face away from the camera: faster, and correct for closed meshes only.
    pub cull_back: bool,
}

impl Default for RasterParams {
    /// From 1 cm on, both sides.
    fn default() -> Self {
        Self { near: 0.01, cull_back: false }
    }
}

/// The visible triangle at the centre of each pixel, rows from the top.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct IdBuffer {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The triangle, or [`NOTHING`].
    pub triangle: Vec<u32>,
    /// Its depth (z in the camera's frame) in metres; infinite without a triangle.
    pub depth: Vec<f32>,
}

/// Steps of a fixed-point coordinate in a pixel: 2 to this power. Ten bits move a corner by half a
/// thousandth of a pixel; with [`GUARD`] below 2²⁰ pixels, products of differences stay below 2⁶².
const STEP_BITS: u32 = 10;
const STEP: i32 = 1 << STEP_BITS;
/// Distance from the picture, in pixels, beyond which triangles are clipped. Pictures have at most
/// 2¹⁵ pixels on a side.
const GUARD: Real = 262_144.0;
/// Triangles that one task bins.
const BLOCK: usize = 1 << 14;
/// Rows that one task fills.
const BAND: usize = 16;
/// Marks a corner that fixed point cannot hold: its triangles are clipped.
const OUTSIDE: [i32; 2] = [i32::MIN; 2];

/// Rasterises meshes, and reuses its memory from one call to the next.
#[derive(Clone, Debug, Default)]
pub struct Rasteriser {
    /// Vertices in the camera's frame.
    camera_points: Vec<Point>,
    /// The same in steps of pixels, or [`OUTSIDE`].
    fixed: Vec<[i32; 2]>,
    /// For each block, and in it for each band, the triangles that may cover a pixel there.
    bins: Vec<Block>,
}

#[derive(Clone, Debug, Default)]
struct Block {
    whole: Vec<Vec<u32>>,
    /// Clipped triangles: the index, and one piece.
    pieces: Vec<(u32, [[i32; 2]; 3])>,
}

impl Rasteriser {
    /// Rasterises `mesh`, with its vertices at `positions`, into `out`.
    ///
    /// # Panics
    ///
    /// If there are not as many positions as vertices, or `near` is not positive.
    pub fn rasterise(
        &mut self,
        mesh: &TriMesh,
        positions: &[Point],
        camera: &Camera,
        params: &RasterParams,
        out: &mut IdBuffer,
    ) {
        assert_eq!(mesh.vertices().len(), positions.len(), "one position for each vertex");
        assert!(
            params.near > 0.0,
            "the near plane lies before the camera, not at {} m",
            params.near
        );
        let (width, height) = (camera.width(), camera.height());
        (out.width, out.height) = (width, height);
        out.triangle.resize(width * height, NOTHING);
        out.depth.resize(width * height, f32::INFINITY);

        self.project(positions, camera, params.near);
        self.bin(mesh, camera, params);
        self.fill(mesh, camera, params.cull_back, out);
    }

    /// Takes positions to the camera, and to pixels.
    fn project(&mut self, positions: &[Point], camera: &Camera, near: Real) {
        let low = |c: Real| c.abs() <= GUARD;
        self.camera_points.resize(positions.len(), Point::origin());
        self.fixed.resize(positions.len(), OUTSIDE);
        self.camera_points
            .par_chunks_mut(BLOCK)
            .zip(self.fixed.par_chunks_mut(BLOCK))
            .zip(positions.par_chunks(BLOCK))
            .for_each(|((points, fixed), positions)| {
                for ((q, f), p) in points.iter_mut().zip(fixed).zip(positions) {
                    *q = camera.to_camera(p);
                    let pixel = camera.to_pixel(q);
                    let holds = q.z >= near && low(pixel.x) && low(pixel.y);
                    *f = if holds { fixed_point(&pixel) } else { OUTSIDE };
                }
            });
    }

    /// Sorts triangles into bands of rows, and clips those that reach out of range.
    fn bin(&mut self, mesh: &TriMesh, camera: &Camera, params: &RasterParams) {
        let (width, height) = (camera.width(), camera.height());
        let bands = height.div_ceil(BAND);
        let blocks = mesh.triangles().len().div_ceil(BLOCK);
        self.bins.resize_with(blocks, Block::default);
        let (points, fixed) = (&self.camera_points, &self.fixed);
        self.bins.par_iter_mut().zip(mesh.triangles().par_chunks(BLOCK)).enumerate().for_each(
            |(block, (bin, triangles))| {
                bin.whole.resize_with(bands, Vec::new);
                bin.whole.iter_mut().for_each(Vec::clear);
                bin.pieces.clear();
                for (t, tri) in triangles.iter().enumerate() {
                    let id = (block * BLOCK + t) as u32;
                    let corners = tri.map(|v| fixed[v as usize]);
                    if corners.contains(&OUTSIDE) {
                        let ends = tri.map(|v| points[v as usize]);
                        clip::pieces(*tri, &ends, camera, params.near, |piece| {
                            bin.pieces.push((id, piece))
                        });
                        continue;
                    }
                    let Some([_, _, top, bottom]) = pixels(&corners, width, height) else {
                        continue;
                    };
                    if params.cull_back && area(&corners) >= 0 {
                        continue;
                    }
                    for band in top as usize / BAND..=bottom as usize / BAND {
                        bin.whole[band].push(id);
                    }
                }
            },
        );
    }

    /// Draws the triangles of each band.
    fn fill(&self, mesh: &TriMesh, camera: &Camera, cull_back: bool, out: &mut IdBuffer) {
        let Self { camera_points: points, fixed, bins } = self;
        let width = out.width;
        let chunk = BAND * width;
        out.triangle
            .par_chunks_mut(chunk)
            .zip(out.depth.par_chunks_mut(chunk))
            .enumerate()
            .for_each(|(band, (triangle, depth))| {
                triangle.fill(NOTHING);
                let mut nearness = vec![0.0; triangle.len()];
                let mut target =
                    Band { first: band * BAND, width, camera, triangle, nearness: &mut nearness };
                for bin in bins {
                    for &id in &bin.whole[band] {
                        let tri = mesh.triangles()[id as usize];
                        target.fill(
                            id,
                            &tri.map(|v| fixed[v as usize]),
                            &Plane::new(tri.map(|v| points[v as usize])),
                        );
                    }
                    for (id, corners) in &bin.pieces {
                        if cull_back && area(corners) >= 0 {
                            continue;
                        }
                        let tri = mesh.triangles()[*id as usize];
                        target.fill(*id, corners, &Plane::new(tri.map(|v| points[v as usize])));
                    }
                }
                depth.iter_mut().zip(&nearness).for_each(|(z, n)| {
                    *z = if *n > 0.0 { (1.0 / n) as f32 } else { f32::INFINITY }
                });
            });
    }

    /// Intersects the ray through the centre of a pixel with its visible triangle, after
    /// [`Rasteriser::rasterise`]: returns barycentric coordinates, clamped to the triangle, and the cosine
    /// between the triangle's normal and the direction to the camera, negative for a back face.
    /// `None` if the triangle is parallel to the ray.
    pub fn hit(
        &self,
        mesh: &TriMesh,
        camera: &Camera,
        triangle: u32,
        column: usize,
        row: usize,
    ) -> Option<([Real; 3], Real)> {
        let [a, b, c] =
            mesh.triangles()[triangle as usize].map(|v| self.camera_points[v as usize].coords);
        let d = camera.pixel_direction(&center(column, row));
        // The volumes that the ray spans with the edges.
        let w = [d.dot(&b.cross(&c)), d.dot(&c.cross(&a)), d.dot(&a.cross(&b))];
        let normal = (b - a).cross(&(c - a));
        let (sum, length) = (w[0] + w[1] + w[2], normal.norm() * d.norm());
        if sum == 0.0 || length == 0.0 {
            return None;
        }
        let w = w.map(|x| (x / sum).max(0.0));
        let sum: Real = w.iter().sum();
        Some((w.map(|x| x / sum), (-normal.dot(&d) / length).clamp(-1.0, 1.0)))
    }
}

/// Rasterises a mesh once.
///
/// # Panics
///
/// If `near` is not positive.
pub fn rasterise(mesh: &TriMesh, camera: &Camera, params: &RasterParams) -> IdBuffer {
    let mut out = IdBuffer::default();
    Rasteriser::default().rasterise(mesh, mesh.vertices(), camera, params, &mut out);
    out
}

/// The middle of a pixel.
fn center(column: usize, row: usize) -> Point2<Real> {
    Point2::new(column as Real + 0.5, row as Real + 0.5)
}

/// The nearest fixed-point position; the pixel lies within [`GUARD`].
fn fixed_point(pixel: &Point2<Real>) -> [i32; 2] {
    [pixel.x, pixel.y].map(|c| {
        // Half a step rounds away from zero, as in `round`, which would be a library call.
        let steps = c * Real::from(STEP);
        let whole = steps as i32;
        let rest = steps - Real::from(whole);
        whole + i32::from(rest >= 0.5) - i32::from(rest <= -0.5)
    })
}

/// First and last column, first and last row whose centres lie in the box of the corners.
#[inline]
fn pixels(c: &[[i32; 2]; 3], width: usize, height: usize) -> Option<[i32; 4]> {
    let range = |k: usize, n: usize| {
        let low = c[0][k].min(c[1][k]).min(c[2][k]);
        let high = c[0][k].max(c[1][k]).max(c[2][k]);
        // Centres stand at (i + ½) STEP: round up from the low end, down from the high one.
        let first = (low + STEP / 2 - 1) >> STEP_BITS;
        let last = (high - STEP / 2) >> STEP_BITS;
        (first.max(0), last.min(n as i32 - 1))
    };
    let (left, right) = range(0, width);
    let (top, bottom) = range(1, height);
    (left <= right && top <= bottom).then_some([left, right, top, bottom])
}

/// Twice the area in steps², positive where the corners turn clockwise on the screen, whose y
/// points down: a triangle that faces the camera turns the other way.
#[inline]
fn area(c: &[[i32; 2]; 3]) -> i64 {
    let d = |p: [i32; 2], k: usize| i64::from(p[k]) - i64::from(c[0][k]);
    d(c[1], 0) * d(c[2], 1) - d(c[1], 1) * d(c[2], 0)
}

/// One over the depth is linear on the screen: `1/z = q · d` for the direction d of a pixel.
struct Plane {
    q: Vector,
    /// Depths of the corners bound that of the triangle.
    least: Real,
    most: Real,
}

impl Plane {
    fn new([a, b, c]: [Point; 3]) -> Self {
        let normal = (b - a).cross(&(c - a));
        let height = normal.dot(&a.coords);
        // Parallel to the rays, or without area: the depth of its nearest corner is used.
        let q = if height == 0.0 { Vector::zeros() } else { normal / height };
        let near = a.z.min(b.z).min(c.z);
        let far = a.z.max(b.z).max(c.z);
        let most = if near > 0.0 { 1.0 / near } else { Real::INFINITY };
        Self { q, least: if height == 0.0 { most } else { 1.0 / far }, most }
    }

    #[inline]
    fn nearness(&self, d: &Vector) -> Real {
        self.q.dot(d).clamp(self.least, self.most)
    }
}

/// Some rows of the picture.
struct Band<'a> {
    first: usize,
    width: usize,
    camera: &'a Camera,
    triangle: &'a mut [u32],
    /// One over the depth; zero for nothing.
    nearness: &'a mut [Real],
}

impl Band<'_> {
    fn fill(&mut self, id: u32, corners: &[[i32; 2]; 3], plane: &Plane) {
        let rows = self.triangle.len() / self.width;
        let Some([left, right, top, bottom]) = pixels(corners, self.width, self.first + rows)
        else {
            return;
        };
        let top = top.max(self.first as i32);
        let twice = area(corners);
        if twice == 0 || top > bottom {
            return;
        }
        // Clockwise on the screen.
        let [a, b, c] = *corners;
        let ring = if twice > 0 { [a, b, c] } else { [a, c, b] };
        let edges = [0, 1, 2].map(|k| Edge::new(ring[k], ring[(k + 1) % 3]));
        for row in top..=bottom {
            for column in left..=right {
                if !edges.iter().all(|e| e.holds(column, row)) {
                    continue;
                }
                let at = (row as usize - self.first) * self.width + column as usize;
                let d = self.camera.pixel_direction(&center(column as usize, row as usize));
                let nearness = plane.nearness(&d);
                let (seen, before) = (&mut self.triangle[at], &mut self.nearness[at]);
                if nearness > *before || (nearness == *before && id < *seen) {
                    (*seen, *before) = (id, nearness);
                }
            }
        }
    }
}

/// The side of an edge on which a clockwise triangle lies.
struct Edge {
    from: [i64; 2],
    along: [i64; 2],
    /// 0 if centres on the edge are inside, 1 if not.
    least: i64,
}

impl Edge {
    fn new(a: [i32; 2], b: [i32; 2]) -> Self {
        let (from, to) = (a.map(i64::from), b.map(i64::from));
        let along = [to[0] - from[0], to[1] - from[1]];
        // y points down: upper edges lead right, left edges lead up.
        let top_left = (along[1] == 0 && along[0] > 0) || along[1] < 0;
        Self { from, along, least: i64::from(!top_left) }
    }

    #[inline]
    fn holds(&self, column: i32, row: i32) -> bool {
        let x = (i64::from(column) << STEP_BITS) + i64::from(STEP / 2) - self.from[0];
        let y = (i64::from(row) << STEP_BITS) + i64::from(STEP / 2) - self.from[1];
        self.along[0] * y - self.along[1] * x >= self.least
    }
}
