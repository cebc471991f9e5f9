//! Layers below that step back and return, so that a garment that starts inside them is pushed out
//! the way it went in.
//!
//! From deep inside, the nearest way out of a layer is often the wrong one: at an armpit, in a
//! sleeve, under a lapel, neighbouring vertices leave through different walls and the garment folds.
//! So a layer below is first drawn back towards the body, by more than the garment's greatest depth
//! in it: the garment is then outside. The layer returns in small steps, each of which pushes the
//! garment by no more than that step. What is outside is known throughout, and no sign is needed.

use if_core::closest::ClosestPoint;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::pseudo_normals::PseudoNormals;
use if_mesh::solid::{ClosedLayer, Sided};
use rayon::prelude::*;

/// A layer on its way back to its place.
pub(crate) struct RetractedLayer {
    place: Vec<Point>,
    /// Unit direction to the nearest point of the body, and how far that is.
    inward: Vec<(Vector, Real)>,
    mesh: TriMesh,
    tree: Bvh,
    normals: PseudoNormals,
    /// Which side of each kept triangle is outside: +1 front, −1 back.
    orientations: Vec<Real>,
    /// The same for vertices; 0 where the triangles do not agree.
    vertex_orientation: Vec<Real>,
    /// Deeper than this a point is not taken for one that was pushed in.
    depth: Real,
}

impl RetractedLayer {
    /// `layer` with `triangles`, over `body`, drawn back by `distance` metres at most.
    pub(crate) fn new(layer: &ClosedLayer, triangles: &[[u32; 3]], body: &ClosedLayer, distance: Real, depth: Real) -> Self {
        let place: Vec<Point> = (0..layer.vertex_count()).map(|v| layer.vertex(v)).collect();
        let inward = place
            .par_iter()
            .map(|p| {
                let foot = body.bvh().closest(p, Real::INFINITY).map_or(*p, |c| c.point);
                (unit_or_zero(&(foot - p)), (foot - p).norm())
            })
            .collect();
        let all = layer.orientations();
        let kept: Vec<usize> = (0..triangles.len()).filter(|t| all[*t] != 0.0).collect();
        let part = kept.iter().map(|t| triangles[*t]).collect();
        let mesh = TriMesh::new(place.clone(), part).expect("a part of a mesh is a mesh");
        let normals = PseudoNormals::new(&mesh, &Edges::new(&mesh));
        let tree = Bvh::new(&mesh);
        let orientations = kept.iter().map(|t| all[*t]).collect();
        let vertex_orientation = vertex_orientations(place.len(), triangles, &all);
        let mut this = Self { place, inward, mesh, tree, normals, orientations, vertex_orientation, depth };
        this.stand_back(distance);
        this
    }

    /// Moves the layer to `distance` metres behind its place, or onto the body where that is nearer.
    pub(crate) fn stand_back(&mut self, distance: Real) {
        let positions: Vec<Point> =
            self.place.iter().zip(&self.inward).map(|(p, (d, far))| p + d * distance.min(*far)).collect();
        self.tree.refit(&positions);
        self.mesh = self.mesh.with_vertices(positions).expect("steps along unit directions are finite");
        self.normals.update(&self.mesh);
    }

    pub(crate) fn vertex_count(&self) -> usize {
        self.place.len()
    }

    pub(crate) fn vertex(&self, v: usize) -> Point {
        self.mesh.vertices()[v]
    }

    /// Where the way from `p`, a point inside, along unit vector `direction` first meets the layer.
    pub(crate) fn way_out(&self, p: &Point, direction: &Vector, limit: Real) -> Option<Real> {
        self.tree.first_hit(p, &(p + direction * limit), |_| true).map(|h| h.parameter * limit)
    }

    /// Unit direction out of the layer at vertex `v`; zero where it has none.
    pub(crate) fn vertex_normal(&self, v: usize) -> Vector {
        self.normals.vertex(v as u32) * self.vertex_orientation[v]
    }

    pub(crate) fn sided(&self, p: &Point, reach: Real) -> Option<Sided> {
        let near = self.tree.closest(p, reach)?;
        let surface = unit_or_zero(&(self.normals.at(&near) * self.orientations[near.triangle as usize]));
        let offset = p - near.point;
        let inside = offset.dot(&surface) < 0.0;
        let boundary = self.normals.is_boundary(&near);
        if inside && (boundary || near.distance > self.depth) {
            return None;
        }
        let sign = if inside { -1.0 } else { 1.0 };
        let tiny = near.distance <= 1e-6;
        let normal = if tiny { surface } else { offset * (sign / near.distance) };
        Some(Sided { distance: sign * near.distance, point: near.point, normal, triangle: near.triangle, boundary })
    }
}

/// For each vertex the orientation on which its triangles agree, or 0.
pub(crate) fn vertex_orientations(vertices: usize, triangles: &[[u32; 3]], orientations: &[Real]) -> Vec<Real> {
    let mut seen: Vec<Option<Real>> = vec![None; vertices];
    for (tri, o) in triangles.iter().zip(orientations) {
        for v in tri {
            let slot = &mut seen[*v as usize];
            *slot = Some(match *slot {
                None => *o,
                Some(before) if before == *o => *o,
                Some(_) => 0.0,
            });
        }
    }
    seen.into_iter().map(|o| o.unwrap_or(0.0)).collect()
}
