//! The canonical mesh: signed distance of a self-intersecting surface, weights, largest piece.

use if_body::SkinWeights;
use if_core::aabb::Aabb;
use if_core::closest::ClosestPoint;
use if_core::edges::parts;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::sdf::{MeshSdf, SdfError};
use if_mesh::voxels::{Voxel, Voxels};
use rayon::prelude::*;

/// Size of the voxels that classify the outside, as a share of the mesh's size: 4 mm for a person.
/// On the two sample captures twice as much doubles the tunnels of the canonical mesh (24 and 19
/// instead of 12 and 8) and increases its error by 0.1 mm; half as much needs eight times the memory
/// and 2.6 s instead of 0.7 s, reduces the error by 0.05 mm, but loses more thin parts (error up to
/// 62 mm instead of 35).
const VOXEL: Real = 1.0 / 420.0;

/// The signed distance of a closed mesh that may intersect itself, such as a fitted surface.
///
/// Signs by pseudo-normals are wrong inside folds. Here a flood fill of voxels decides: what is
/// connected to infinity without crossing the surface is outside, everything else is inside. Only in
/// voxels that contain a triangle the pseudo-normal of the nearest triangle decides. Distances are
/// those from the nearest triangle, even if it lies inside.
#[derive(Clone, Debug)]
pub struct FloodedField {
    exact: MeshSdf,
    voxels: Voxels,
    bounds: Aabb,
}

impl FloodedField {
    /// The field of a closed mesh.
    ///
    /// # Errors
    ///
    /// The mesh is empty, open, of inconsistent winding, or inside out.
    pub fn new(mesh: &TriMesh) -> Result<Self, SdfError> {
        let exact = MeshSdf::closed(mesh)?;
        let bounds = mesh.aabb();
        let cell = bounds.size().max() * VOXEL;
        let mut voxels = Voxels::new(&bounds.inflated(2.0 * cell), cell);
        voxels.add_walls(mesh);
        voxels.flood(|_| true);
        Ok(Self { exact, voxels, bounds })
    }
}

impl FloodedField {
    /// Whether a point lies inside: the sign of [`SignedDistance::distance`], without computing the
    /// distance where voxels decide.
    pub fn contains(&self, p: &Point) -> bool {
        match self.voxels.at(p) {
            Voxel::Wall => self.exact.distance(p) < 0.0,
            Voxel::Outside => false,
            _ => true,
        }
    }
}

impl SignedDistance for FloodedField {
    fn distance(&self, p: &Point) -> Real {
        self.sample(p).distance
    }

    fn sample(&self, p: &Point) -> FieldSample {
        let s = self.exact.sample(p);
        let inside = match self.voxels.at(p) {
            Voxel::Wall => return s,
            Voxel::Outside => false,
            _ => true,
        };
        if inside == (s.distance < 0.0) {
            s
        } else {
            FieldSample { distance: -s.distance, gradient: -s.gradient }
        }
    }

    fn bounds(&self) -> Option<Aabb> {
        Some(self.bounds)
    }

    fn lipschitz(&self) -> Real {
        1.0
    }
}

/// Skinning weights for `points`, interpolated at the nearest point of a skinned surface; the four
/// largest are kept.
///
/// # Panics
///
/// If the surface has no triangles, or not one record of weights for each vertex.
pub fn carried_weights(
    surface: &TriMesh,
    skin: &SkinWeights,
    joints: usize,
    points: &[Point],
) -> SkinWeights {
    assert_eq!(surface.vertices().len(), skin.len(), "one record for each vertex");
    let tree = Bvh::new(surface);
    let of = |p: &Point| four_largest(nearest_weights(&tree, surface, skin, p).1);
    let (on, weights) = points.par_iter().with_min_len(256).map(of).unzip();
    SkinWeights::new(on, weights, joints)
        .expect("the four largest parts of weights are positive, and were divided by their sum")
}

/// Joints and their weights at a point.
pub(super) type Shares = Vec<(u16, Real)>;

/// The distance of each of `points` from a skinned surface, and the weights at the nearest point.
pub(super) fn carried_to(
    surface: &TriMesh,
    skin: &SkinWeights,
    points: &[Point],
) -> Vec<(Real, Shares)> {
    let tree = Bvh::new(surface);
    points.par_iter().with_min_len(256).map(|p| nearest_weights(&tree, surface, skin, p)).collect()
}

fn nearest_weights(tree: &Bvh, surface: &TriMesh, skin: &SkinWeights, p: &Point) -> (Real, Shares) {
    let near =
        tree.closest(p, Real::INFINITY).expect("a surface with triangles has a nearest point");
    let mut sums = Shares::with_capacity(12);
    for (v, b) in surface.triangles()[near.triangle as usize].iter().zip(near.barycentric) {
        let v = *v as usize;
        for (j, w) in skin.joints()[v].iter().zip(skin.weights()[v]) {
            let w = b * Real::from(w);
            match sums.iter_mut().find(|s| s.0 == *j) {
                Some(sum) => sum.1 += w,
                None => sums.push((*j, w)),
            }
        }
    }
    ((near.point - p).norm(), sums)
}

/// The four largest weights, normalised.
pub(super) fn four_largest(mut sums: Shares) -> ([u16; 4], [f32; 4]) {
    sums.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    sums.truncate(4);
    let total: Real = sums.iter().map(|s| s.1).sum();
    let (mut on, mut weights) = ([0u16; 4], [0f32; 4]);
    for (slot, (j, w)) in sums.iter().enumerate() {
        (on[slot], weights[slot]) = (*j, (w / total) as f32);
    }
    (on, weights)
}

/// The connected component of a mesh with the largest area. Other components of an extraction are
/// bubbles in folds of the surface.
pub fn largest_piece(mesh: &TriMesh) -> TriMesh {
    let part = parts(mesh);
    let mut areas = vec![0.0; mesh.vertices().len()];
    for (t, tri) in mesh.triangles().iter().enumerate() {
        let [a, b, c] = mesh.corners(t);
        areas[part[tri[0] as usize] as usize] += if_core::math::area_vector(a, b, c).norm();
    }
    let Some(best) = (0..areas.len()).max_by(|a, b| areas[*a].total_cmp(&areas[*b]).then(b.cmp(a)))
    else {
        return mesh.clone();
    };
    let mut number = vec![u32::MAX; mesh.vertices().len()];
    let mut vertices = Vec::new();
    for v in 0..mesh.vertices().len() as u32 {
        if part[v as usize] == best as u32 {
            number[v as usize] = vertices.len() as u32;
            vertices.push(mesh.vertices()[v as usize]);
        }
    }
    let kept = mesh.triangles().iter().filter(|t| number[t[0] as usize] != u32::MAX);
    let triangles = kept.map(|t| t.map(|v| number[v as usize])).collect();
    TriMesh::new(vertices, triangles).expect("a piece of a mesh is a mesh")
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;
    use if_core::shapes::meshes;

    #[test]
    fn weights_are_those_of_the_nearest_point() {
        let sheet = meshes::cloth(1.0, 1.0, 4, 4);
        let low = sheet.aabb().min;
        // The weight of joint 1 grows along the first axis in which the sheet has a size.
        let axis = (0..3).find(|k| sheet.aabb().size()[*k] > 0.5).unwrap();
        let part = |p: &Point| (p[axis] - low[axis]) as f32;
        let weights: Vec<[f32; 4]> =
            sheet.vertices().iter().map(|p| [1.0 - part(p), part(p), 0.0, 0.0]).collect();
        let skin = SkinWeights::new(vec![[2, 5, 0, 0]; weights.len()], weights, 6).unwrap();
        let normal = sheet.vertex_normals()[0];
        let points: Vec<Point> = [0.1, 0.37, 0.9]
            .iter()
            .map(|s| {
                let mut p = sheet.aabb().center() + normal * 0.02;
                p[axis] = low[axis] + s;
                p
            })
            .collect();
        let carried = carried_weights(&sheet, &skin, 6, &points);
        for (v, s) in [0.1f32, 0.37, 0.9].iter().enumerate() {
            let slot = carried.joints()[v].iter().position(|j| *j == 5).unwrap();
            assert!((carried.weights()[v][slot] - s).abs() < 1e-5, "{:?}", carried.weights()[v]);
        }
    }

    #[test]
    fn a_self_intersecting_body_stays_solid() {
        // A ball whose cap was pushed down, through the bottom: pseudo-normals call what is beside
        // the cap there inside.
        let ball = meshes::icosphere(0.5, 4);
        let pushed = ball
            .vertices()
            .iter()
            .map(|p| if p.y > 0.42 { Point::new(p.x, -0.3 - p.y, p.z) } else { *p });
        let folded = ball.with_vertices(pushed.collect()).unwrap();
        let field = FloodedField::new(&folded).unwrap();
        let exact = MeshSdf::closed(&folded).unwrap();
        let below = Point::new(0.4, -0.65, 0.0);
        assert!(exact.distance(&below) < 0.0 && field.distance(&below) > 0.0);
        for p in [
            Point::new(0.35, 0.0, 0.0),
            Point::new(-0.35, -0.1, 0.1),
            Point::new(0.7, 0.0, 0.0),
            below,
        ] {
            let (s, e) = (field.sample(&p), exact.sample(&p));
            assert_eq!(s.distance.abs(), e.distance.abs());
            assert_eq!(field.contains(&p), s.distance < 0.0);
            assert_eq!(s.distance < 0.0, p.coords.norm() < 0.5, "{p}: {}", s.distance);
            let h = 1e-6;
            let along =
                field.distance(&(p + s.gradient * h)) - field.distance(&(p - s.gradient * h));
            assert!((along / (2.0 * h) - 1.0).abs() < 1e-4, "{along}");
        }
        assert!(FloodedField::new(&TriMesh::default()).is_err());
    }

    #[test]
    fn bubbles_are_removed() {
        let (ball, bubble) = (meshes::icosphere(0.5, 2), meshes::icosphere(0.05, 1));
        let n = bubble.vertices().len() as u32;
        let mut vertices: Vec<Point> =
            bubble.vertices().iter().map(|p| p + Vector::new(2.0, 0.0, 0.0)).collect();
        vertices.extend(ball.vertices());
        let mut triangles = bubble.triangles().to_vec();
        triangles.extend(ball.triangles().iter().map(|t| t.map(|v| v + n)));
        assert_eq!(largest_piece(&TriMesh::new(vertices, triangles).unwrap()), ball);
        assert_eq!(largest_piece(&TriMesh::default()), TriMesh::default());
    }
}
