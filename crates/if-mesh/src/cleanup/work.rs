//! A surface while it is being mended.

use super::twins::{Twins, next, previous};
use super::vicinity::Vicinity;
use crate::attributes::Source;
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;

/// A mesh, and where each of its vertices comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Derived {
    /// The mesh.
    pub mesh: TriMesh,
    /// For each of its vertices, what it was made of: what
    /// [`VertexAttributes::derive`](crate::attributes::VertexAttributes::derive) asks for.
    pub sources: Vec<Source>,
}

/// Positions, triangles and origins that a step changes.
#[derive(Debug)]
pub(crate) struct Work {
    pub(crate) points: Vec<Point>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// For each vertex that of the mesh before, or `before` more than the number of its blend.
    origins: Vec<u32>,
    blends: Vec<Vec<(u32, Real)>>,
    before: u32,
    /// Where rims are: kept while triangles go by [`Work::remove`] and [`Work::truncate`], or are
    /// added at the end.
    pub(super) vicinity: Vicinity,
}

/// Clones have room for this share more, so that what a step adds does not copy all again.
const ROOM: usize = 16;

/// A clone with room to grow.
pub(super) fn roomy<T: Copy>(of: &[T]) -> Vec<T> {
    let mut clone = Vec::with_capacity(of.len() + of.len() / ROOM);
    clone.extend_from_slice(of);
    clone
}

impl Clone for Work {
    fn clone(&self) -> Self {
        Self {
            points: roomy(&self.points),
            triangles: roomy(&self.triangles),
            origins: roomy(&self.origins),
            blends: self.blends.clone(),
            before: self.before,
            vicinity: self.vicinity.clone(),
        }
    }
}

impl Work {
    pub(crate) fn new(mesh: &TriMesh) -> Self {
        let before = mesh.vertices().len() as u32;
        Self {
            points: roomy(mesh.vertices()),
            triangles: roomy(mesh.triangles()),
            origins: (0..before).collect(),
            blends: Vec::new(),
            before,
            vicinity: Vicinity::default(),
        }
    }

    /// What vertex `v` is made of: vertices of the mesh before, with weights.
    pub(super) fn parts(&self, v: u32) -> impl Iterator<Item = (u32, Real)> {
        let origin = self.origins[v as usize];
        let (alone, parts) = match origin.checked_sub(self.before) {
            None => (Some((origin, 1.0)), &[][..]),
            Some(blend) => (None, &self.blends[blend as usize][..]),
        };
        alone.into_iter().chain(parts.iter().copied())
    }

    /// Adds a vertex, which is a copy of `v`.
    pub(super) fn copy(&mut self, v: u32) -> u32 {
        self.points.push(self.points[v as usize]);
        self.origins.push(self.origins[v as usize]);
        self.points.len() as u32 - 1
    }

    /// Adds a vertex that is made of others.
    pub(super) fn add(&mut self, point: Point, parts: Vec<(u32, Real)>) {
        self.points.push(point);
        self.origins.push(self.before + self.blends.len() as u32);
        self.blends.push(parts);
    }

    /// Takes back what was added last: only the first `points` and `triangles` are left.
    pub(super) fn truncate(&mut self, points: usize, triangles: usize) {
        self.points.truncate(points);
        self.origins.truncate(points);
        self.triangles.truncate(triangles);
        self.vicinity.truncate(triangles);
    }

    /// Drops triangles; `gone` is ascending.
    pub(super) fn remove(&mut self, gone: &[u32]) {
        let Some(&first) = gone.first() else { return };
        let mut to = first as usize;
        for (k, &t) in gone.iter().enumerate() {
            let (from, until) =
                (t as usize + 1, gone.get(k + 1).map_or(self.triangles.len(), |t| *t as usize));
            self.triangles.copy_within(from..until, to);
            to += until - from;
        }
        self.triangles.truncate(to);
        self.vicinity.without(gone);
    }

    /// Drops vertices of no triangle, keeping the order of the others; says how many.
    pub(crate) fn compact(&mut self) -> usize {
        let before = self.points.len();
        let mut used = vec![0u32; before];
        self.triangles.as_flattened().iter().for_each(|&v| used[v as usize] = 1);
        let Some(first) = used.iter().position(|u| *u == 0) else { return 0 };
        // All before the first that is not used stay where they are.
        let mut to = first;
        for (v, name) in used.iter_mut().enumerate().skip(first) {
            if std::mem::replace(name, to as u32) == 1 {
                self.points[to] = self.points[v];
                self.origins[to] = self.origins[v];
                to += 1;
            }
        }
        let names = &used[first..];
        for v in self.triangles.as_flattened_mut().iter_mut().filter(|v| **v as usize >= first) {
            *v = names[*v as usize - first];
        }
        self.points.truncate(to);
        self.origins.truncate(to);
        before - to
    }

    pub(crate) fn finish(self) -> Derived {
        let (before, mut blends) = (self.before, self.blends);
        // A copy of a blend, as a rim cut open has it, is one of its own.
        let mut count = vec![0; blends.len()];
        self.origins
            .iter()
            .filter(|o| **o >= before)
            .for_each(|o| count[(o - before) as usize] += 1);
        let source = |origin: u32| match origin.checked_sub(before) {
            None => Source::Vertex(origin),
            Some(k) => {
                let k = k as usize;
                count[k] -= 1;
                Source::Blend(if count[k] == 0 {
                    std::mem::take(&mut blends[k])
                } else {
                    blends[k].clone()
                })
            }
        };
        let sources = self.origins.into_iter().map(source).collect();
        let mesh = TriMesh::new(self.points, self.triangles)
            .expect("each step keeps positions finite and triangles proper");
        Derived { mesh, sources }
    }

    /// Area of triangle `t`, in square metres.
    #[inline]
    pub(crate) fn area(&self, t: usize) -> Real {
        0.5 * self.area_vector(t).norm()
    }

    #[inline]
    pub(crate) fn area_vector(&self, t: usize) -> Vector {
        let [a, b, c] = self.triangles[t].map(|v| &self.points[v as usize]);
        area_vector(a, b, c)
    }

    /// Unit normal of the vertex that half-edge `h` leaves, weighted by the triangles' areas; zero
    /// where there is none.
    pub(crate) fn normal_at(&self, twins: &Twins, h: u32) -> Vector {
        let mut sum = Vector::zeros();
        twins.around(h, |h| sum += self.area_vector(h as usize / 3));
        unit_or_zero(&sum)
    }

    /// Mean length of the edges at the vertex that half-edge `h` leaves, in metres.
    pub(crate) fn edge_length_at(&self, twins: &Twins, h: u32) -> Real {
        let (mut sum, mut count) = (0.0, 0);
        twins.around(h, |h| {
            let at = |h: u32| self.points[self.triangles[h as usize / 3][h as usize % 3] as usize];
            sum += (at(next(h)) - at(h)).norm() + (at(previous(h)) - at(h)).norm();
            count += 2;
        });
        sum / Real::from(count.max(1))
    }
}
