//! Openings by the rest of the clothed body.

use super::components::components;
use super::edit_mesh::EditMesh;
use super::half_edges::{HalfEdges, ends, previous};
use super::openings::Complement;
use crate::index::Bvh;
use if_core::closest::ClosestPoint;
use if_core::math::{Point, unit_or_zero};
use if_core::mesh::TriMesh;
use rayon::prelude::*;

impl Complement {
    /// For each loop, whether it is an opening.
    pub(super) fn classify(&self, work: &EditMesh, loops: &[Vec<u32>]) -> Vec<bool> {
        let garment = work.clone().finish().mesh;
        if garment.triangles().is_empty() {
            return vec![false; loops.len()];
        }
        let tree = Bvh::new(&garment);
        let normals = garment.face_normals();
        let coverage = self.coverage.unwrap_or_else(|| 1.5 * garment.mean_edge());
        // Covered: near the garment, with a normal on the same side.
        let body_normals = self.body.face_normals();
        let covered: Vec<bool> = (0..self.body.triangles().len())
            .into_par_iter()
            .map(|t| {
                tree.closest(&center(&self.body, t), coverage)
                    .is_some_and(|c| normals[c.triangle as usize].dot(&body_normals[t]) > 0.0)
            })
            .collect();
        let mut rest = EditMesh::new(&self.body);
        let mut t = 0..;
        rest.triangles.retain(|_| t.next().is_some_and(|t: usize| !covered[t]));
        if rest.triangles.is_empty() {
            return vec![false; loops.len()];
        }
        let (part_of, parts) =
            components(&rest, &HalfEdges::new(rest.points.len(), &rest.triangles));
        let least = self.least_share * garment.area();
        // Votes of foreign vertices, and of all, for each component.
        let mut foreign = vec![(0usize, 0usize); parts.len()];
        if !self.foreign.is_empty() {
            for (t, tri) in rest.triangles.iter().enumerate() {
                let f = &mut foreign[part_of[t] as usize];
                f.0 += tri.iter().filter(|v| self.foreign[**v as usize]).count();
                f.1 += 3;
            }
        }
        let open: Vec<bool> =
            parts.iter().zip(&foreign).map(|(p, f)| p.area >= least || 2 * f.0 > f.1).collect();
        let rest_mesh = rest.finish().mesh;
        let rest_tree = Bvh::new(&rest_mesh);
        // A loop bounds a component if that lies just beyond most of the loop's length.
        loops
            .par_iter()
            .map(|boundary| {
                let (mut yes, mut all) = (0.0, 0.0);
                for &h in boundary {
                    let [a, b] = ends(&work.triangles, h).map(|v| work.points[v as usize]);
                    let c = work.points[ends(&work.triangles, previous(h))[0] as usize];
                    let along = unit_or_zero(&(b - a));
                    let inward = (c - a) - along * along.dot(&(c - a));
                    let middle = nalgebra::center(&a, &b) - unit_or_zero(&inward) * coverage;
                    let length = (b - a).norm();
                    all += length;
                    if let Some(c) = rest_tree.closest(&middle, coverage)
                        && open[part_of[c.triangle as usize] as usize]
                    {
                        yes += length;
                    }
                }
                2.0 * yes > all
            })
            .collect()
    }
}

fn center(mesh: &TriMesh, t: usize) -> Point {
    let [a, b, c] = mesh.corners(t);
    Point::from((a.coords + b.coords + c.coords) / 3.0)
}
