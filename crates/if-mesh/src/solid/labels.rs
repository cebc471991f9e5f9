//! Sides of triangles: outside or inside.

use super::closing::PROBES;
use crate::index::Bvh;
use crate::pseudo_normals::PseudoNormals;
use crate::voxels::{Voxel, Voxels};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use rayon::prelude::*;

/// For each vertex +1 if the fronts of all its triangles are outside, −1 if their backs are, else 0; and
/// whether the sides of its triangles differ: at a fold, or at the edge of what covers others.
pub(super) fn vertex_orientations(mesh: &TriMesh, outside: &[[bool; 2]]) -> (Vec<Real>, Vec<bool>) {
    let mut first: Vec<Option<Real>> = vec![None; mesh.vertices().len()];
    let mut creases = vec![false; mesh.vertices().len()];
    for (tri, [front, back]) in mesh.triangles().iter().zip(outside) {
        let here = Real::from(u8::from(*front)) - Real::from(u8::from(*back));
        for v in tri.map(|v| v as usize) {
            creases[v] |= *first[v].get_or_insert(here) != here;
        }
    }
    let agreed = |(first, differ): (Option<Real>, &bool)| first.filter(|_| !differ).unwrap_or(0.0);
    (first.into_iter().zip(&creases).map(agreed).collect(), creases)
}

/// For each triangle whether its [front, back] is outside.
pub(super) fn label_sides(
    mesh: &TriMesh,
    bvh: &Bvh,
    normals: &PseudoNormals,
    voxels: &Voxels,
) -> Vec<[bool; 2]> {
    (0..mesh.triangles().len())
        .into_par_iter()
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            let middle = Point::from((a.coords + b.coords + c.coords) / 3.0);
            let normal = normals.face(t as u32);
            let own = mesh.triangles()[t];
            let probe = |direction: Vector| {
                for distance in PROBES {
                    let to = middle + direction * (distance * voxels.cell());
                    let found = voxels.at(&to);
                    if found == Voxel::Wall {
                        continue;
                    }
                    let covered = bvh.first_hit(&middle, &to, |other| {
                        !mesh.triangles()[other as usize].iter().any(|v| own.contains(v))
                    });
                    return if covered.is_some() { None } else { Some(found) };
                }
                None
            };
            let (front, back) = (probe(*normal), probe(-normal));
            match (front, back) {
                (Some(Voxel::Outside), Some(Voxel::Outside)) => [true, false],
                (Some(Voxel::Outside), _) => [true, false],
                (_, Some(Voxel::Outside)) => [false, true],
                // No side is outside: a pocket, unless no probe found a voxel without a wall.
                (None, None) => [true, false],
                _ => [false, false],
            }
        })
        .collect()
}
