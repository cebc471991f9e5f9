//! Surface normals before the clean-up, from which those of a file turn with the surface.

use super::edit_mesh::{Derived, EditMesh};
use crate::attributes::Source;
use crate::normals::Turns;
use if_core::math::{Vector, unit_or_zero};
use if_core::mesh::TriMesh;

/// The surface normal at each vertex of a mesh, by the winding of its manifold version.
pub(super) struct NormalsBefore(Vec<Vector>);

impl NormalsBefore {
    /// Those of a mesh, whose manifold version is `work`.
    pub(super) fn of(mesh: &TriMesh, work: &EditMesh) -> Self {
        let given = |v: u32| work.sources_of(v).next().map_or(v, |(v, _)| v);
        let triangles = work.triangles.iter().map(|t| t.map(given)).collect();
        let wound = TriMesh::new(mesh.vertices().to_vec(), triangles)
            .expect("copies of one vertex are in different triangles");
        Self(wound.vertex_normals())
    }

    /// The turns from there to the normals of what was derived. A new vertex starts from the blend of its
    /// sources.
    pub(super) fn turns_to(&self, derived: &Derived) -> Turns {
        let before = |source: &Source| match source {
            Source::Vertex(v) => self.0[*v as usize],
            Source::Blend(parts) => {
                unit_or_zero(&parts.iter().map(|(v, w)| self.0[*v as usize] * *w).sum())
            }
        };
        let before = derived.sources.iter().map(before).collect();
        Turns::between(before, derived.mesh.vertex_normals())
    }
}

#[cfg(test)]
mod tests {
    use crate::attributes::{Column, Property, VertexAttributes};
    use crate::cleanup::{Cleaned, CleanupParams, Openings, SmoothParams, cleanup};
    use if_core::math::{Point, Real, Vector};
    use if_core::mesh::TriMesh;
    use if_core::monitor::Silent;
    use if_core::random::SplitMix64;
    use if_core::shapes::meshes::{icosphere, tube};

    fn with_normals(mesh: &TriMesh, normals: &[Vector]) -> VertexAttributes {
        let column = |axis: usize| Column::F64(normals.iter().map(|n| n[axis]).collect());
        let properties = [("nx", 0), ("ny", 1), ("nz", 2)];
        let properties = properties.map(|(name, axis)| Property::new(name, column(axis))).into();
        VertexAttributes::new(mesh.vertices().len(), properties).unwrap()
    }

    /// The largest angle between a stored normal and that of the surface, times `side`, in degrees.
    fn farthest(made: &Cleaned, side: Real) -> Real {
        let stored = [0, 1, 2].map(|k| made.attributes.properties()[k].values.to_f64());
        let angle = |(v, n): (usize, &Vector)| {
            let stored = Vector::new(stored[0][v], stored[1][v], stored[2][v]);
            (side * stored.dot(n)).clamp(-1.0, 1.0).acos().to_degrees()
        };
        made.mesh.vertex_normals().iter().enumerate().map(angle).fold(0.0, Real::max)
    }

    #[test]
    fn normals_follow_a_smoothed_surface_on_their_own_side() {
        let tube = tube(0.1, 0.4, 60, 30, false);
        let mut random = SplitMix64::new(3);
        let mut off = || Vector::from([0; 3].map(|_| 0.004 * (random.unit() - 0.5)));
        let noisy: Vec<Point> = tube.vertices().iter().map(|p| p + off()).collect();
        let mesh = tube.with_vertices(noisy).unwrap();
        let smooth = SmoothParams { surface_passes: 20, ..SmoothParams::default() };
        let params = CleanupParams { smooth: Some(smooth), ..CleanupParams::default() };
        for side in [1.0, -1.0] {
            let normals: Vec<Vector> = mesh.vertex_normals().iter().map(|n| n * side).collect();
            let made =
                cleanup(&mesh, &with_normals(&mesh, &normals), None, &params, &mut Silent).unwrap();
            assert!(farthest(&made, side) < 1e-5, "{}", farthest(&made, side));
        }
    }

    #[test]
    fn patches_have_the_normals_of_their_surface_and_others_keep_theirs() {
        // A ball without its cap, some triangles of which are turned over.
        let ball = icosphere(0.1, 3);
        let is_kept = |t: &&[u32; 3]| ball.vertices()[t[0] as usize].y < 0.03;
        let turned_over = |(k, t): (usize, &[u32; 3])| match k % 10 {
            0 => [t[0], t[2], t[1]],
            _ => *t,
        };
        let kept = ball.triangles().iter().filter(is_kept).enumerate().map(turned_over).collect();
        let mesh = TriMesh::new(ball.vertices().to_vec(), kept).unwrap();
        let normals: Vec<Vector> = ball.vertices().iter().map(|p| p.coords.normalize()).collect();
        let params = CleanupParams { openings: Openings::Count(0), ..CleanupParams::default() };
        let given = with_normals(&mesh, &normals);
        let made = cleanup(&mesh, &given, None, &params, &mut Silent).unwrap();
        assert_eq!(made.report.holes.filled.len(), 1);
        assert!(farthest(&made, 1.0) < 12.0, "{}", farthest(&made, 1.0));
        let bits = |a: &VertexAttributes, v: usize| {
            [0, 1, 2].map(|k| a.properties()[k].values.to_f64()[v].to_bits())
        };
        for (v, p) in made.mesh.vertices().iter().enumerate().filter(|(_, p)| p.y < -0.02) {
            let was = ball.vertices().iter().position(|q| q == p).unwrap();
            assert_eq!(bits(&made.attributes, v), bits(&given, was));
        }
    }
}
