//! The motion of the fitted surface, transferred to another mesh of the person.

use super::report::Motion;
use if_core::closest::ClosestPoint;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use rayon::prelude::*;

/// d of each frame at the vertices of a mesh near the fitted surface, such as the canonical mesh:
/// that of the nearest point of the surface.
#[derive(Clone, Debug)]
pub struct MeshMotion {
    motion: Motion,
    /// The corners of the nearest triangle of each vertex, and their barycentric coordinates; `None`
    /// if the motion is of the vertices themselves.
    places: Option<Vec<([u32; 3], [Real; 3])>>,
}

impl MeshMotion {
    /// Transfers the motion of a `surface` to `points`.
    ///
    /// # Panics
    ///
    /// If the surface has no triangles, or is not the motion's.
    pub fn new(motion: Motion, surface: &TriMesh, points: &[Point]) -> Self {
        let n = surface.vertices().len();
        assert!(
            motion.offsets.iter().all(|d| d.is_empty() || d.len() == n),
            "one offset for each vertex of the surface"
        );
        let tree = Bvh::new(surface);
        let place = |p: &Point| {
            let near = tree
                .closest(p, Real::INFINITY)
                .expect("a surface with triangles has a nearest point");
            (surface.triangles()[near.triangle as usize], near.barycentric)
        };
        let places = points.par_iter().with_min_len(256).map(place).collect();
        Self { places: Some(places), motion }
    }

    /// A motion of the mesh's own vertices, such as that of a network
    /// ([`Fields::motion`](crate::reconstruct::Fields::motion)).
    pub fn of_vertices(motion: Motion) -> Self {
        Self { places: None, motion }
    }

    /// d of a frame of the capture at each vertex, in metres of canonical space; empty if zero.
    ///
    /// # Panics
    ///
    /// If `frame` is out of range.
    pub fn offsets(&self, frame: usize) -> Vec<Vector> {
        let of = &self.motion.offsets[frame];
        let Some(places) = &self.places else { return of.clone() };
        if of.is_empty() {
            return Vec::new();
        }
        let at = |(on, parts): &([u32; 3], [Real; 3])| -> Vector {
            (0..3).map(|k| of[on[k] as usize] * parts[k]).sum()
        };
        places.iter().map(at).collect()
    }

    /// The motion at the surface's own vertices, or, of a network, at those of the mesh.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::MotionReport;
    use if_core::shapes::meshes;

    #[test]
    fn a_point_near_the_surface_moves_as_its_nearest_point_does() {
        let sheet = meshes::cloth(1.0, 1.0, 5, 5);
        let normal = sheet.vertex_normals()[0];
        // Linear over the sheet, so that barycentric parts give it exactly.
        let d = |p: &Point| Vector::new(0.01 * p.x, 0.02 * p.y - 0.03 * p.z, 0.001);
        let motion = Motion {
            offsets: vec![sheet.vertices().iter().map(d).collect(), Vec::new()],
            report: MotionReport::default(),
        };
        let feet: Vec<Point> = (0..sheet.triangles().len())
            .map(|t| {
                let [a, b, c] = sheet.corners(t);
                Point::from(a.coords * 0.2 + b.coords * 0.5 + c.coords * 0.3)
            })
            .collect();
        let points: Vec<Point> = feet
            .iter()
            .enumerate()
            .map(|(k, p)| p + normal * (0.01 * (k % 3) as Real - 0.01))
            .collect();
        let carried = MeshMotion::new(motion, &sheet, &points);
        for (foot, at) in feet.iter().zip(carried.offsets(0)) {
            approx::assert_relative_eq!(d(foot), at, epsilon = 1e-12);
        }
        assert!(carried.offsets(1).is_empty());
    }
}
