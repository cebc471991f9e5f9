//! How the surface turns around each vertex between two states of the target.

use super::scene::Scene;
use if_core::math::{Point, Real, triangle_frame};
use nalgebra::Matrix3;
use rayon::prelude::*;

/// For each vertex the mean of the rotations of its triangles from the positions `from` to `to`.
/// Only its action on directions counts, after which they are normalised. Identity for a vertex of
/// no proper triangle.
pub(super) fn turns(scene: &Scene, from: &[Point], to: &[Point]) -> Vec<Matrix3<Real>> {
    let triangles = scene.mesh.triangles();
    let rotations: Vec<Option<Matrix3<Real>>> = triangles
        .par_iter()
        .with_min_len(1024)
        .map(|t| {
            let frame = |x: &[Point]| triangle_frame(t.map(|v| &x[v as usize]));
            Some(frame(to)? * frame(from)?.transpose())
        })
        .collect();
    let mut sums = vec![Matrix3::zeros(); scene.mesh.vertices().len()];
    for (t, rotation) in triangles.iter().zip(&rotations) {
        for v in t {
            if let Some(rotation) = rotation {
                sums[*v as usize] += rotation;
            }
        }
    }
    for sum in &mut sums {
        if *sum == Matrix3::zeros() {
            *sum = Matrix3::identity();
        }
    }
    for [v, kept] in &scene.doubled {
        sums[*v as usize] = sums[*kept as usize];
    }
    sums
}
