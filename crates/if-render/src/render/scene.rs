//! The scene as the eye sees it: x to the right and y down in samples, z away from the eye in
//! metres.

use crate::render::{RenderLayer, View, light};
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use rayon::prelude::*;

/// Part of the picture that stays free on each side.
const MARGIN: Real = 0.04;

/// The common scale and place of several views.
pub(super) struct Frame {
    /// Where views turn about, and what stands in their middle.
    middle: Point,
    /// Samples a metre.
    pub(super) scale: Real,
    /// Samples to the middle of the picture.
    offset: [Real; 2],
    /// Height of the floor, in metres.
    floor: Real,
}

impl Frame {
    pub(super) fn new(scene: &[RenderLayer], views: &[View], width: usize, height: usize) -> Self {
        let aabb = scene.iter().fold(if_core::aabb::Aabb::EMPTY, |b, l| b.merged(&l.mesh.aabb()));
        let mut frame = Self {
            middle: Point::origin(),
            scale: 1.0,
            offset: [0.5 * width as Real, 0.5 * height as Real],
            floor: 0.0,
        };
        if aabb.is_empty() {
            return frame;
        }
        (frame.middle, frame.floor) = (aabb.center(), aabb.min.y);
        let mut reach = [0.0f64; 2];
        for axes in views.iter().map(axes) {
            for p in scene.iter().flat_map(|l| l.mesh.vertices()) {
                (0..2)
                    .for_each(|k| reach[k] = reach[k].max(axes[k].dot(&(p - frame.middle)).abs()));
            }
        }
        let fits = |k: usize| (1.0 - 2.0 * MARGIN) * frame.offset[k] / reach[k];
        let scale = fits(0).min(fits(1));
        frame.scale = if scale.is_finite() && scale > 0.0 { scale } else { 1.0 };
        frame
    }
}

/// Right, up and away from the eye.
fn axes(view: &View) -> [Vector; 3] {
    let (sa, ca) = view.azimuth.to_radians().sin_cos();
    let (se, ce) = view.elevation.to_radians().sin_cos();
    [
        Vector::new(ca, 0.0, -sa),
        Vector::new(-se * sa, ce, -se * ca),
        Vector::new(-ce * sa, -se, -ce * ca),
    ]
}

/// A layer before the eye.
pub(super) struct Seen {
    /// Vertices: samples to the right, samples down, metres away.
    pub(super) points: Vec<[f32; 3]>,
    /// Vertex normals in axes right, up, towards the eye.
    pub(super) normals: Vec<[f32; 3]>,
    /// Corners.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Whether each triangle is highlighted.
    pub(super) highlighted: Vec<bool>,
    /// Linear red, green and blue.
    pub(super) color: [f32; 3],
    /// Whether a cut shows the inside of a solid.
    pub(super) solid: bool,
    /// Index of its first triangle among those of all layers.
    pub(super) first: u32,
}

/// All layers before the eye.
pub(super) struct Scene {
    pub(super) layers: Vec<Seen>,
    /// Samples a metre.
    pub(super) scale: f32,
    /// What is left out: points in the coordinates of [`Seen::points`] with `n · p > n[3]`.
    pub(super) cut: Option<[f32; 4]>,
    /// Where layers meet the cut.
    pub(super) lines: Vec<Line>,
    /// The shadow on the floor.
    pub(super) shadow: Shadow,
}

/// A piece of a line, as points of [`Seen::points`].
pub(super) struct Line {
    pub(super) ends: [[f32; 3]; 2],
    pub(super) color: [f32; 3],
}

/// An ellipse in the picture.
pub(super) struct Shadow {
    pub(super) center: [f32; 2],
    pub(super) radii: [f32; 2],
}

impl Scene {
    pub(super) fn new(scene: &[RenderLayer], view: &View, frame: &Frame) -> Self {
        let axes = axes(view);
        let project = |p: &Point| {
            let d = p - frame.middle;
            let (x, y) = (axes[0].dot(&d) * frame.scale, axes[1].dot(&d) * frame.scale);
            [(frame.offset[0] + x) as f32, (frame.offset[1] - y) as f32, axes[2].dot(&d) as f32]
        };
        let mut first = 0;
        let layers: Vec<Seen> = scene
            .iter()
            .map(|layer| {
                let triangles = layer.mesh.triangles().to_vec();
                let mut highlighted = vec![false; triangles.len()];
                layer
                    .highlight
                    .iter()
                    .filter(|t| (**t as usize) < triangles.len())
                    .for_each(|t| highlighted[*t as usize] = true);
                let start = first;
                first += triangles.len() as u32;
                Seen {
                    points: layer.mesh.vertices().par_iter().map(project).collect(),
                    normals: layer
                        .mesh
                        .vertex_normals()
                        .par_iter()
                        .map(|n| {
                            [axes[0].dot(n) as f32, axes[1].dot(n) as f32, -axes[2].dot(n) as f32]
                        })
                        .collect(),
                    triangles,
                    highlighted,
                    color: light::decode(layer.color),
                    solid: view.cut.is_some()
                        && Edges::new(layer.mesh).valence.iter().all(|v| *v == 2),
                    first: start,
                }
            })
            .collect();
        let mut cut = None;
        let mut lines = Vec::new();
        if let Some(c) = view.cut {
            let n = unit_or_zero(&c.normal);
            let offset = c.offset - n.dot(&frame.middle.coords);
            let along = axes.map(|a| a.dot(&n));
            let s = frame.scale;
            // n · (right · x + up · y + away · z) with x and y in samples from the middle.
            let plane = [along[0] / s, -along[1] / s, along[2]];
            let at_middle = plane[0] * frame.offset[0] + plane[1] * frame.offset[1];
            cut = Some([plane[0], plane[1], plane[2], offset + at_middle].map(|v| v as f32));
            for layer in &layers {
                lines.extend(crate::render::section::lines(layer, &cut.unwrap_or_default()));
            }
        }
        let shadow = shadow(scene, frame, &axes);
        Self { layers, scale: frame.scale as f32, cut, lines, shadow }
    }

    /// Layer and triangle of a number among the triangles of all layers.
    pub(super) fn triangle(&self, id: u32) -> (&Seen, usize) {
        let layer = &self.layers[self.layers.partition_point(|l| l.first <= id) - 1];
        (layer, (id - layer.first) as usize)
    }
}

/// A soft spot under whatever stands on the floor.
fn shadow(scene: &[RenderLayer], frame: &Frame, axes: &[Vector; 3]) -> Shadow {
    /// Height up to which something stands on the floor, in metres.
    const STANDS: Real = 0.1;
    let feet = scene.iter().flat_map(|l| l.mesh.vertices()).filter(|p| p.y < frame.floor + STANDS);
    let aabb = if_core::aabb::Aabb::from_points(feet);
    if aabb.is_empty() {
        return Shadow { center: [0.0; 2], radii: [0.0; 2] };
    }
    let d = Point::new(aabb.center().x, frame.floor, aabb.center().z) - frame.middle;
    let half = 0.5 * aabb.size() + Vector::repeat(0.09);
    let reach = |a: &Vector| (a.x * half.x).abs() + (a.z * half.z).abs();
    Shadow {
        center: [
            (frame.offset[0] + axes[0].dot(&d) * frame.scale) as f32,
            (frame.offset[1] - axes[1].dot(&d) * frame.scale) as f32,
        ],
        radii: [
            (reach(&axes[0]) * frame.scale) as f32,
            (reach(&axes[1]) * frame.scale).max(0.01 * frame.scale) as f32,
        ],
    }
}
