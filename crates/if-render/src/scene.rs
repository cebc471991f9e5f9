//! The scene in view coordinates: x to the right and y down in samples, z away from the eye in
//! metres.

use crate::backdrop::{Backdrop, Shadow};
use crate::color;
use crate::section::{self, Line};
use crate::view::{RenderLayer, View};
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use rayon::prelude::*;

/// Empty margin on each side, as a share of the picture.
const MARGIN: Real = 0.04;

/// The common scale and place of several views.
pub(crate) struct Frame {
    /// Centre of rotation and of the picture.
    middle: Point,
    /// Samples a metre.
    pub(crate) scale: Real,
    /// Samples to the middle of the picture.
    offset: [Real; 2],
    /// Height of the floor, in metres.
    floor: Real,
}

impl Frame {
    pub(crate) fn new(scene: &[RenderLayer], views: &[View], width: usize, height: usize) -> Self {
        let aabb =
            scene.iter().fold(if_core::aabb::Aabb::EMPTY, |b, l| b.merged(&l.mesh.surface_aabb()));
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
        // The largest extent over all views, so that they have one scale.
        let mut extent = [0.0f64; 2];
        for axes in views.iter().map(axes) {
            for p in scene.iter().flat_map(|l| l.mesh.surface_vertices()) {
                (0..2).for_each(|k| {
                    extent[k] = extent[k].max(axes[k].dot(&(p - frame.middle)).abs())
                });
            }
        }
        let fits = |k: usize| (1.0 - 2.0 * MARGIN) * frame.offset[k] / extent[k];
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

/// A layer in view coordinates.
pub(crate) struct Seen {
    /// Vertices: samples to the right, samples down, metres away.
    pub(crate) points: Vec<[f32; 3]>,
    /// Vertex normals in axes right, up, towards the eye.
    pub(crate) normals: Vec<[f32; 3]>,
    /// Corners.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Whether each triangle is highlighted.
    pub(crate) highlighted: Vec<bool>,
    /// Linear red, green and blue.
    pub(crate) color: [f32; 3],
    /// Whether a cut shows the inside of a solid.
    pub(crate) solid: bool,
    /// Index of its first triangle among those of all layers.
    pub(crate) first: u32,
}

/// All layers in view coordinates.
pub(crate) struct Scene {
    pub(crate) layers: Vec<Seen>,
    /// Samples a metre.
    pub(crate) scale: f32,
    /// The half-space that is cut away: points in the coordinates of [`Seen::points`] with
    /// `n · p > n[3]`.
    pub(crate) cut: Option<[f32; 4]>,
    /// Intersections of the layers with the plane of the cut.
    pub(crate) lines: Vec<Line>,
    /// What is behind it.
    pub(crate) backdrop: Backdrop,
}

impl Scene {
    /// `normals` are those of the vertices of each layer.
    pub(crate) fn new(
        (scene, normals): (&[RenderLayer], &[Vec<Vector>]),
        view: &View,
        frame: &Frame,
    ) -> Self {
        let axes = axes(view);
        let project = |p: &Point| {
            let d = p - frame.middle;
            let (x, y) = (axes[0].dot(&d) * frame.scale, axes[1].dot(&d) * frame.scale);
            [(frame.offset[0] + x) as f32, (frame.offset[1] - y) as f32, axes[2].dot(&d) as f32]
        };
        let mut first = 0;
        let layers: Vec<Seen> = scene
            .iter()
            .zip(normals)
            .map(|(layer, normals)| {
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
                    normals: normals
                        .par_iter()
                        .map(|n| {
                            [axes[0].dot(n) as f32, axes[1].dot(n) as f32, -axes[2].dot(n) as f32]
                        })
                        .collect(),
                    triangles,
                    highlighted,
                    color: color::decode(layer.color),
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
            let offset = c.offset.map_or(0.0, |offset| offset - n.dot(&frame.middle.coords));
            let along = axes.map(|a| a.dot(&n));
            let s = frame.scale;
            // n · (right · x + up · y + away · z) with x and y in samples from the middle.
            let plane = [along[0] / s, -along[1] / s, along[2]];
            let at_middle = plane[0] * frame.offset[0] + plane[1] * frame.offset[1];
            let plane = [plane[0], plane[1], plane[2], offset + at_middle].map(|v| v as f32);
            cut = Some(plane);
            for layer in &layers {
                lines.extend(section::lines(&layer.points, &layer.triangles, layer.color, &plane));
            }
        }
        let rows = 2.0 * frame.offset[1] as f32;
        let backdrop = Backdrop { rows, shadow: shadow(scene, frame, &axes) };
        Self { layers, scale: frame.scale as f32, cut, lines, backdrop }
    }

    /// Layer and triangle of a number among the triangles of all layers.
    pub(crate) fn triangle(&self, id: u32) -> (&Seen, usize) {
        let layer = &self.layers[self.layers.partition_point(|l| l.first <= id) - 1];
        (layer, (id - layer.first) as usize)
    }
}

/// A soft shadow under everything that stands on the floor.
fn shadow(scene: &[RenderLayer], frame: &Frame, axes: &[Vector; 3]) -> Option<Shadow> {
    /// Height up to which something stands on the floor, in metres.
    const STANDS: Real = 0.1;
    let all = scene.iter().flat_map(|l| l.mesh.surface_vertices());
    let feet = all.filter(|p| p.y < frame.floor + STANDS);
    let aabb = if_core::aabb::Aabb::from_points(feet);
    if aabb.is_empty() {
        return None;
    }
    let d = Point::new(aabb.center().x, frame.floor, aabb.center().z) - frame.middle;
    let half = 0.5 * aabb.size() + Vector::repeat(0.09);
    let extent = |a: &Vector| (a.x * half.x).abs() + (a.z * half.z).abs();
    let shadow = Shadow {
        center: [
            (frame.offset[0] + axes[0].dot(&d) * frame.scale) as f32,
            (frame.offset[1] - axes[1].dot(&d) * frame.scale) as f32,
        ],
        radii: [
            (extent(&axes[0]) * frame.scale) as f32,
            (extent(&axes[1]) * frame.scale).max(0.01 * frame.scale) as f32,
        ],
    };
    (shadow.radii[0] > 0.0).then_some(shadow)
}
