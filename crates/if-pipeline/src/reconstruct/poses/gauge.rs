//! Where the surface is the template: at vertices whose label is skin.

use crate::reconstruct::figure::Figure;
use if_core::math::{Point, Vector};
use if_core::mesh::TriMesh;
use if_mesh::raster::NOTHING;

/// Votes of label images for the vertices of a surface.
pub(super) struct SkinVotes {
    /// For each vertex the votes for skin, and all.
    votes: Vec<[u32; 2]>,
}

/// Least votes of a vertex: fewer are noise.
const LEAST: u32 = 5;

impl SkinVotes {
    /// No votes.
    pub(super) fn new(vertices: usize) -> Self {
        Self { votes: vec![[0; 2]; vertices] }
    }

    /// Adds the votes of a frame's label image: each labelled pixel of the person votes for the
    /// corners of the triangle that it sees.
    pub(super) fn add(&mut self, figure: &Figure, labels: &[u8]) {
        use crate::capture::{BACKGROUND, SKIN};
        for (t, label) in figure.seen.triangle.iter().zip(labels) {
            if *t == NOTHING || *label == BACKGROUND {
                continue;
            }
            for v in figure.mesh.triangles()[*t as usize] {
                let votes = &mut self.votes[v as usize];
                *votes = [votes[0] + u32::from(*label == SKIN), votes[1] + 1];
            }
        }
    }

    /// The votes of both.
    pub(super) fn joined(mut self, other: Self) -> Self {
        for (a, b) in self.votes.iter_mut().zip(other.votes) {
            *a = [a[0] + b[0], a[1] + b[1]];
        }
        self
    }

    /// Whether at least `share` of each vertex's votes are for skin.
    pub(super) fn skin(&self, share: f64) -> Vec<bool> {
        let is =
            |[skin, all]: &[u32; 2]| *all >= LEAST && f64::from(*skin) >= share * f64::from(*all);
        self.votes.iter().map(is).collect()
    }
}

/// The surface for the poses: the template where `skin`, `mesh` elsewhere; with normals of the one
/// and of the other beside the step between them, so that it has none.
pub(super) fn tied(
    template: &TriMesh,
    mesh: &TriMesh,
    skin: &[bool],
) -> (TriMesh, Vec<Option<Vector>>) {
    let pick = |v: usize, a: &[Point], b: &[Point]| if skin[v] { a[v] } else { b[v] };
    let points = (0..skin.len()).map(|v| pick(v, template.vertices(), mesh.vertices())).collect();
    let (a, b) = (template.vertex_normals(), mesh.vertex_normals());
    let mut normals = vec![None; skin.len()];
    for corners in mesh.triangles().iter().map(|t| t.map(|v| v as usize)) {
        if corners.iter().any(|v| skin[*v] != skin[corners[0]]) {
            corners.iter().for_each(|&v| normals[v] = Some(if skin[v] { a[v] } else { b[v] }));
        }
    }
    let mixed = mesh.with_vertices(points).expect("vertices of two meshes of the same triangles");
    (mixed, normals)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertex_is_skin_by_its_share_of_enough_votes() {
        let votes = SkinVotes { votes: vec![[4, 4], [7, 10], [6, 10], [0, 0]] };
        assert_eq!(votes.skin(0.7), [false, true, false, false]);
    }

    #[test]
    fn the_tied_surface_is_the_template_at_skin_with_its_normals() {
        let template = if_core::shapes::meshes::icosphere(1.0, 1);
        let points = template.vertices().iter().map(|p| Point::from(p.coords * 1.1)).collect();
        let mesh = template.with_vertices(points).unwrap();
        let skin: Vec<bool> = template.vertices().iter().map(|p| p.y > 0.0).collect();
        let (mixed, normals) = tied(&template, &mesh, &skin);
        for v in 0..skin.len() {
            let radius = if skin[v] { 1.0 } else { 1.1 };
            approx::assert_relative_eq!(mixed.vertices()[v].coords.norm(), radius, epsilon = 1e-12);
            // Without the step between them: as on a sphere.
            let own = mixed.vertex_normals()[v];
            let normal = normals[v].unwrap_or(own);
            assert!(normal.dot(&mixed.vertices()[v].coords.normalize()) > 0.999);
            assert_eq!(normals[v].is_some(), own.dot(&normal) < 0.999, "vertex {v}");
        }
    }
}
