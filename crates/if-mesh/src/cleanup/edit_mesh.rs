//! A mesh under editing: positions, triangles, and what each vertex was made of.

use super::broad_phase::BroadPhase;
use super::half_edges::{HalfEdges, clone_with_spare, next, previous};
use crate::attributes::Source;
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;

/// A mesh derived from another one.
#[derive(Clone, Debug, PartialEq)]
pub struct Derived {
    /// The mesh.
    pub mesh: TriMesh,
    /// For each vertex its sources in the mesh before, for
    /// [`VertexAttributes::derive`](crate::attributes::VertexAttributes::derive).
    pub sources: Vec<Source>,
}

/// Positions, triangles and sources, changed in place by the steps of the clean-up.
#[derive(Debug)]
pub(crate) struct EditMesh {
    pub(crate) points: Vec<Point>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// For each vertex its vertex in the mesh before, or `before` plus the index of its blend.
    origins: Vec<u32>,
    blends: Vec<Vec<(u32, Real)>>,
    /// Number of vertices of the mesh before.
    before: u32,
    /// Follows removals and truncations; triangles may also be added at the end.
    pub(super) broad_phase: BroadPhase,
}

impl Clone for EditMesh {
    fn clone(&self) -> Self {
        Self {
            points: clone_with_spare(&self.points),
            triangles: clone_with_spare(&self.triangles),
            origins: clone_with_spare(&self.origins),
            blends: self.blends.clone(),
            before: self.before,
            broad_phase: self.broad_phase.clone(),
        }
    }
}

impl EditMesh {
    pub(crate) fn new(mesh: &TriMesh) -> Self {
        let before = mesh.vertices().len() as u32;
        Self {
            points: clone_with_spare(mesh.vertices()),
            triangles: clone_with_spare(mesh.triangles()),
            origins: (0..before).collect(),
            blends: Vec::new(),
            before,
            broad_phase: BroadPhase::default(),
        }
    }

    /// The sources of vertex `v`: vertices of the mesh before, with weights.
    pub(super) fn sources_of(&self, v: u32) -> impl Iterator<Item = (u32, Real)> {
        let origin = self.origins[v as usize];
        let (alone, parts) = match origin.checked_sub(self.before) {
            None => (Some((origin, 1.0)), &[][..]),
            Some(blend) => (None, &self.blends[blend as usize][..]),
        };
        alone.into_iter().chain(parts.iter().copied())
    }

    /// Adds a copy of vertex `v` and returns its number.
    pub(super) fn add_copy(&mut self, v: u32) -> u32 {
        self.points.push(self.points[v as usize]);
        self.origins.push(self.origins[v as usize]);
        self.points.len() as u32 - 1
    }

    /// Adds a vertex that is a blend of vertices of the mesh before.
    pub(super) fn add_blend(&mut self, point: Point, parts: Vec<(u32, Real)>) {
        self.points.push(point);
        self.origins.push(self.before + self.blends.len() as u32);
        self.blends.push(parts);
    }

    /// Removes the last additions: only the first `points` and `triangles` remain.
    pub(super) fn truncate(&mut self, points: usize, triangles: usize) {
        self.points.truncate(points);
        self.origins.truncate(points);
        self.triangles.truncate(triangles);
        self.broad_phase.truncate(triangles);
    }

    /// Removes triangles; `gone` is ascending.
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
        self.broad_phase.remove(gone);
    }

    /// Removes vertices of no triangle, keeping the order of the others, and returns their number.
    pub(crate) fn compact(&mut self) -> usize {
        let before = self.points.len();
        let mut used = vec![0u32; before];
        self.triangles.as_flattened().iter().for_each(|&v| used[v as usize] = 1);
        let Some(first) = used.iter().position(|u| *u == 0) else { return 0 };
        // Vertices before the first unused one keep their numbers.
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

    /// The finished mesh and the sources of its vertices.
    pub(crate) fn finish(self) -> Derived {
        let (before, mut blends) = (self.before, self.blends);
        // Vertices of the same blend (copies at cut edges) share it; the last one takes it.
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

    /// Normal of triangle `t`, with twice its area as length.
    #[inline]
    pub(crate) fn area_vector(&self, t: usize) -> Vector {
        let [a, b, c] = self.triangles[t].map(|v| &self.points[v as usize]);
        area_vector(a, b, c)
    }

    /// Area-weighted unit normal at the vertex that half-edge `h` leaves; zero if undefined.
    pub(crate) fn normal_at(&self, half_edges: &HalfEdges, h: u32) -> Vector {
        let mut sum = Vector::zeros();
        half_edges.around(h, |h| sum += self.area_vector(h as usize / 3));
        unit_or_zero(&sum)
    }

    /// Mean length of the edges at the vertex that half-edge `h` leaves, in metres.
    pub(crate) fn edge_length_at(&self, half_edges: &HalfEdges, h: u32) -> Real {
        let (mut sum, mut count) = (0.0, 0);
        half_edges.around(h, |h| {
            let at = |h: u32| self.points[self.triangles[h as usize / 3][h as usize % 3] as usize];
            sum += (at(next(h)) - at(h)).norm() + (at(previous(h)) - at(h)).norm();
            count += 2;
        });
        sum / Real::from(count.max(1))
    }
}
