//! A surface while it is being mended.

use super::twins::{Twins, next, previous};
use crate::attributes::Source;
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;

/// A mesh, and where each of its vertices comes from.
#[derive(Clone, Debug, PartialEq)]
pub struct Derived {
    /// The mesh.
    pub mesh: TriMesh,
    /// For each of its vertices, what it was made of: what [`VertexAttributes::derive`](crate::attributes::VertexAttributes::derive)
    /// asks for.
    pub sources: Vec<Source>,
}

/// Positions, triangles and origins that a step changes.
#[derive(Clone, Debug)]
pub(crate) struct Work {
    pub(crate) points: Vec<Point>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) sources: Vec<Source>,
}

impl Work {
    pub(crate) fn new(mesh: &TriMesh) -> Self {
        let sources = (0..mesh.vertices().len() as u32).map(Source::Vertex).collect();
        Self { points: mesh.vertices().to_vec(), triangles: mesh.triangles().to_vec(), sources }
    }

    /// Drops vertices of no triangle, keeping the order of the others; says how many.
    pub(crate) fn compact(&mut self) -> usize {
        let mut used = vec![false; self.points.len()];
        self.triangles.as_flattened().iter().for_each(|&v| used[v as usize] = true);
        let unused = used.iter().filter(|u| !**u).count();
        if unused == 0 {
            return 0;
        }
        let mut name = 0..;
        let names: Vec<u32> = used.iter().map(|u| if *u { name.next().unwrap_or(0) } else { 0 }).collect();
        self.triangles.as_flattened_mut().iter_mut().for_each(|v| *v = names[*v as usize]);
        let mut k = 0..;
        self.points.retain(|_| k.next().is_some_and(|k| used[k]));
        let mut k = 0..;
        self.sources.retain(|_| k.next().is_some_and(|k: usize| used[k]));
        unused
    }

    pub(crate) fn finish(self) -> Derived {
        let mesh = TriMesh::new(self.points, self.triangles).expect("each step keeps positions finite and triangles proper");
        Derived { mesh, sources: self.sources }
    }

    /// Area of triangle `t`, in square metres.
    pub(crate) fn area(&self, t: usize) -> Real {
        0.5 * self.area_vector(t).norm()
    }

    pub(crate) fn area_vector(&self, t: usize) -> Vector {
        let [a, b, c] = self.triangles[t].map(|v| &self.points[v as usize]);
        area_vector(a, b, c)
    }

    /// Unit normal of the vertex that half-edge `h` leaves, weighted by the triangles' areas; zero where there is none.
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
