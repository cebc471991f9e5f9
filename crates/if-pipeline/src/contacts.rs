//! Where a garment must give way: samples on its triangles against the closed layers below.
//!
//! Two kinds of samples are looked at. *Own samples* are fixed on the garment: its vertices, the
//! middles of long edges and of the triangles at them, and places where the exact verification found an
//! intersection. *Foreign samples* follow the vertices of the layers below: each has a nearest point
//! on the garment, and where a fine mesh pokes through a coarse triangle that point is the place to push.
//!
//! A sample that is further from a layer than it can move is not looked at again before it has moved
//! that far: the distance has Lipschitz bound 1.

use if_core::aabb::Aabb;
use if_core::closest::ClosestPoint;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, area_vector, barycentric_point, unit_or_zero};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::outward::Outward;
use crate::retract::RetractedLayer;
use if_mesh::solid::{ClosedLayer, Sided};
use if_xpbd::half_space::HalfSpaces;
use rayon::prelude::*;

/// A point of the garment by the vertices it depends on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample {
    pub(crate) vertices: [u32; 3],
    pub(crate) weights: [Real; 3],
}

impl Sample {
    pub(crate) fn at(&self, x: &[Point]) -> Point {
        barycentric_point(self.vertices.map(|v| &x[v as usize]), self.weights)
    }

    fn normal(&self, normals: &[Vector]) -> Vector {
        unit_or_zero(&(0..3).map(|k| normals[self.vertices[k] as usize] * self.weights[k]).sum())
    }
}

/// What a sample knows of one layer below.
#[derive(Clone, Copy, Debug)]
struct Memory {
    /// Where the sample was when it last looked.
    seen_from: Point,
    /// How far it can move before it must look again.
    free: Real,
    /// How far the layers below had moved then.
    drift: Real,
}

/// The half-space that a contact keeps a sample in.
struct Plane {
    normal: Vector,
    point: Point,
    gap: Real,
}

/// A layer below, where it is or on its way there.
pub(crate) enum Obstacle<'a> {
    Closed(&'a ClosedLayer, Vec<Real>),
    Retracted(RetractedLayer),
}

impl Obstacle<'_> {
    fn sided(&self, p: &Point, reach: Real) -> Option<Sided> {
        match self {
            Self::Closed(l, _) => l.sided(p, reach),
            Self::Retracted(l) => l.sided(p, reach),
        }
    }

    fn way_out(&self, p: &Point, direction: &Vector, limit: Real) -> Option<Real> {
        match self {
            Self::Closed(l, _) => l.way_out(p, direction, limit),
            Self::Retracted(l) => l.way_out(p, direction, limit),
        }
    }

    fn vertex_normal(&self, v: usize) -> Vector {
        match self {
            Self::Closed(l, o) => l.normals().vertex(v as u32) * o[v],
            Self::Retracted(l) => l.vertex_normal(v),
        }
    }

    fn vertex_count(&self) -> usize {
        match self {
            Self::Closed(l, _) => l.vertex_count(),
            Self::Retracted(l) => l.vertex_count(),
        }
    }

    fn vertex(&self, v: usize) -> Point {
        match self {
            Self::Closed(l, _) => l.vertex(v),
            Self::Retracted(l) => l.vertex(v),
        }
    }
}

/// How far around a sample is looked, beyond the clearance: what one round may move, and a reserve
/// that spares later queries. Tuned on the outfits of `docs/accuracy.md`.
const RESERVE: Real = 0.012;
/// Foreign samples this close to a corner of their triangle are left to the corner's own sample.
const CORNER: Real = 0.97;

pub(crate) struct Contacts<'a> {
    below: Vec<Obstacle<'a>>,
    samples: Vec<Sample>,
    memory: Vec<Memory>,
    /// For each layer and vertex of it, the garment's path length before which it need not look.
    foreign: Vec<Vec<Real>>,
    /// Sum over the rounds of the largest motion of any vertex.
    path: Real,
    /// Sum of the motions of the layers below.
    drift: Real,
    /// The way out where walls are close together.
    pub(crate) outward: Option<&'a Outward>,
    pub(crate) queries: usize,
    pub(crate) spared: usize,
    /// Vertices whose contacts are left to the sheet of the fold below them.
    pub(crate) skip: Vec<bool>,
    pub(crate) step: Real,
    pub(crate) margin: Real,
}

impl<'a> Contacts<'a> {
    pub(crate) fn new(mesh: &TriMesh, edges: &Edges, below: Vec<Obstacle<'a>>, long_edge: Real) -> Self {
        let x = mesh.vertices();
        let mut samples = Vec::new();
        let mut used = vec![false; x.len()];
        mesh.triangles().iter().flatten().for_each(|v| used[*v as usize] = true);
        for v in (0..x.len() as u32).filter(|v| used[*v as usize]) {
            samples.push(Sample { vertices: [v; 3], weights: [1.0, 0.0, 0.0] });
        }
        let is_long = |e: usize| {
            let [a, b] = edges.vertices[e];
            (x[a as usize] - x[b as usize]).norm() > long_edge
        };
        for (e, &[a, b]) in edges.vertices.iter().enumerate() {
            if is_long(e) {
                samples.push(Sample { vertices: [a, b, b], weights: [0.5, 0.5, 0.0] });
            }
        }
        for (t, tri) in mesh.triangles().iter().enumerate() {
            if edges.of_triangle[t].iter().any(|e| is_long(*e as usize)) {
                samples.push(Sample { vertices: *tri, weights: [1.0 / 3.0; 3] });
            }
        }
        let foreign = below.iter().map(|l| vec![0.0; l.vertex_count()]).collect();
        let mut this = Self {
            below,
            samples: Vec::new(),
            memory: Vec::new(),
            foreign,
            path: 0.0,
            drift: 0.0,
            outward: None,
            queries: 0,
            spared: 0,
            skip: vec![false; x.len()],
            step: 4e-3,
            margin: 2e-3,
        };
        for s in samples {
            this.add(s);
        }
        this
    }

    /// Looks at one more place of the garment from now on.
    pub(crate) fn add(&mut self, sample: Sample) {
        self.samples.push(sample);
        let blank = Memory { seen_from: Point::origin(), free: -1.0, drift: 0.0 };
        self.memory.extend(std::iter::repeat_n(blank, self.below.len()));
    }

    /// Brings layers that were drawn back to `distance` metres behind their places; they move by
    /// `by` metres at most.
    pub(crate) fn stand_back(&mut self, distance: Real, by: Real) {
        for layer in &mut self.below {
            if let Obstacle::Retracted(l) = layer {
                l.stand_back(distance);
            }
        }
        self.drift += by;
        self.path += by;
    }

    /// Tells how far the garment moved at most since the last [`Contacts::detect`].
    pub(crate) fn moved(&mut self, most: Real) {
        self.path += most;
    }

    /// Fills `out` with the contacts of the garment at `x`. `tree` holds the garment at `x`; `gap` is
    /// the clearance of each vertex, in metres.
    pub(crate) fn detect(&mut self, x: &[Point], triangles: &[[u32; 3]], tree: &Bvh, gap: &[Real], out: &mut HalfSpaces) {
        out.clear();
        let normals = vertex_normals(x, triangles);
        let normals = &normals;
        let (below, step, margin, drift) = (&self.below, self.step, self.margin, self.drift);
        let outward = self.outward;
        let skip = &self.skip;
        let layers = below.len();
        let gap_of = |s: &Sample| (0..3).map(|k| s.weights[k] * gap[s.vertices[k] as usize]).sum::<Real>();
        const CHUNK: usize = 256;
        let found: Vec<(Vec<(u32, Plane)>, usize, usize)> = self
            .samples
            .par_chunks(CHUNK)
            .zip(self.memory.par_chunks_mut(CHUNK * layers))
            .enumerate()
            .map(|(chunk, (samples, memory))| {
                let mut planes = Vec::new();
                let (mut queries, mut spared) = (0, 0);
                for (k, s) in samples.iter().enumerate() {
                    if s.vertices.iter().any(|v| skip[*v as usize]) {
                        continue;
                    }
                    let p = s.at(x);
                    let g = gap_of(s);
                    for (j, layer) in below.iter().enumerate() {
                        let m = &mut memory[k * layers + j];
                        if m.free > 0.0 && (p - m.seen_from).norm() + (drift - m.drift) < m.free {
                            spared += 1;
                            continue;
                        }
                        queries += 1;
                        m.drift = drift;
                        if let Some(plane) = look(&p, &s.normal(normals), g, layer, outward, m, step, margin) {
                            planes.push(((chunk * CHUNK + k) as u32, plane));
                        }
                    }
                }
                (planes, queries, spared)
            })
            .collect();
        for (planes, queries, spared) in found {
            self.queries += queries;
            self.spared += spared;
            for (k, plane) in planes {
                let s = &self.samples[k as usize];
                out.push(s.vertices, s.weights, plane.normal, &plane.point, plane.gap);
            }
        }
        let largest = gap.iter().copied().fold(0.0, Real::max);
        self.foreign_samples(x, triangles, tree, &gap_of, largest, out);
    }

    fn foreign_samples(
        &mut self,
        x: &[Point],
        triangles: &[[u32; 3]],
        tree: &Bvh,
        gap_of: &(impl Fn(&Sample) -> Real + Sync),
        largest: Real,
        out: &mut HalfSpaces,
    ) {
        let (path, step, margin) = (self.path, self.step, self.margin);
        let reach = largest + margin;
        let region: Aabb = tree.aabb();
        let skip = &self.skip;
        for (j, layer) in self.below.iter().enumerate() {
            let found: Vec<(Vec<(Sample, Plane)>, usize, usize)> = self.foreign[j]
                .par_chunks_mut(256)
                .enumerate()
                .map(|(chunk, next)| {
                    let mut planes = Vec::new();
                    let (mut queries, mut spared) = (0, 0);
                    for (k, next) in next.iter_mut().enumerate() {
                        if path < *next {
                            spared += 1;
                            continue;
                        }
                        let v = layer.vertex(chunk * 256 + k);
                        let away = region.distance_squared(&v).sqrt();
                        if away > reach {
                            *next = path + away - reach;
                            spared += 1;
                            continue;
                        }
                        queries += 1;
                        let Some(c) = tree.closest(&v, reach + RESERVE) else {
                            *next = path + RESERVE;
                            continue;
                        };
                        if c.distance > reach {
                            *next = path + c.distance - reach;
                            continue;
                        }
                        if c.barycentric.iter().any(|b| *b > CORNER) {
                            continue;
                        }
                        let sample = Sample { vertices: triangles[c.triangle as usize], weights: c.barycentric };
                        if sample.vertices.iter().any(|v| skip[*v as usize]) {
                            continue;
                        }
                        // A vertex that points where the triangle points pokes at it from below.
                        let [a, b, c3] = triangles[c.triangle as usize].map(|v| &x[v as usize]);
                        let face = unit_or_zero(&area_vector(a, b, c3));
                        if face.dot(&layer.vertex_normal(chunk * 256 + k)) < 0.3 {
                            continue;
                        }
                        let over = face.dot(&(c.point - v));
                        if over < -4.0 * step {
                            continue;
                        }
                        let gap = gap_of(&sample).min(over + step);
                        planes.push((sample, Plane { normal: face, point: v, gap }));
                    }
                    (planes, queries, spared)
                })
                .collect();
            for (planes, queries, spared) in found {
                self.queries += queries;
                self.spared += spared;
                for (s, plane) in planes {
                    out.push(s.vertices, s.weights, plane.normal, &plane.point, plane.gap);
                }
            }
        }
    }
}

/// The plane that parts triangle `t` from triangle `o` with the least motion of `t` towards `out`:
/// its unit normal n and the level that n·x must reach at all corners of `t`.
///
/// The candidates are the separating axes of the two, turned towards `out`, and `out` itself.
pub(crate) fn parting(t: &[Point; 3], o: &[Point; 3], out: &Vector) -> Option<(Vector, Real)> {
    const TOWARDS: Real = 0.3;
    let mut axes = vec![*out, area_vector(&t[0], &t[1], &t[2]), area_vector(&o[0], &o[1], &o[2])];
    for i in 0..3 {
        for j in 0..3 {
            axes.push((t[(i + 1) % 3] - t[i]).cross(&(o[(j + 1) % 3] - o[j])));
        }
    }
    let mut best: Option<(Real, Vector, Real)> = None;
    for axis in axes {
        let mut n = unit_or_zero(&axis);
        if n.dot(out) < 0.0 {
            n = -n;
        }
        if n.dot(out) < TOWARDS {
            continue;
        }
        let level = o.iter().map(|p| n.dot(&p.coords)).fold(Real::NEG_INFINITY, Real::max);
        let low = t.iter().map(|p| n.dot(&p.coords)).fold(Real::INFINITY, Real::min);
        if best.is_none_or(|(depth, _, _)| level - low < depth) {
            best = Some((level - low, n, level));
        }
    }
    best.map(|(_, n, level)| (n, level))
}

/// Area-weighted unit normals of the vertices.
fn vertex_normals(x: &[Point], triangles: &[[u32; 3]]) -> Vec<Vector> {
    let mut sums = vec![Vector::zeros(); x.len()];
    for tri in triangles {
        let [a, b, c] = tri.map(|v| &x[v as usize]);
        let n = area_vector(a, b, c);
        for v in tri {
            sums[*v as usize] += n;
        }
    }
    sums.iter().map(unit_or_zero).collect()
}

/// The contact of a sample at `p` with the garment's normal `own` there, to be kept `gap` away, with
/// one layer.
fn look(p: &Point, own: &Vector, gap: Real, layer: &Obstacle, outward: Option<&Outward>, m: &mut Memory, step: Real, margin: Real) -> Option<Plane> {
    let reach = gap + margin;
    m.seen_from = *p;
    m.free = 0.0;
    let Some(s) = layer.sided(p, reach + RESERVE) else {
        m.free = RESERVE;
            return None;
    };
    if s.distance > reach {
        m.free = s.distance - reach;
            return None;
    }
    let target = gap.min(s.distance + step);
    if s.distance < gap
        && let Some(n) = outward.and_then(|o| o.direction(p))
        && s.normal.dot(&n) < 0.5
    {
        // The nearest way out leads sideways, through the wall of a fold.
        if s.distance > 0.0 {
            return None;
        }
        return Some(Plane { normal: n, point: *p, gap: (gap - s.distance).min(step) });
    }
    let _ = own;
    Some(Plane { normal: s.normal, point: s.point, gap: target })
}

