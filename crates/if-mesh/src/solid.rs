//! The closed clothed-body field: a side for every point, also near collars, lapels and hems.
//!
//! A garment is an open sheet. Signs from its pseudo-normals flip at folded collars and are
//! undefined beyond a hem. A [`ClosedLayer`] closes it first:
//!
//! ```text
//! shadow  = the space between a triangle of the garment and the part of the body nearest to it,
//!           but not through the garment's own sleeve beside it
//! walls   = triangles of the garment and of the body
//!         + curtains: from every boundary edge to the nearest points of the body
//!         + caps: from every boundary edge to the middle of its loop
//! outside = voxels connected to infinity without crossing a wall or a shadow
//! ```
//!
//! The shadow fills the gap between a tight garment and the body, and the pockets under collars and
//! lapels; curtains and caps close openings that are farther away: a coat's hem, a wide skirt.
//! Voxels determine the sign of points away from walls. Nearer, the nearest triangle does: each of
//! its two sides is labelled *outside* or *inside* by the first voxel without a wall along its
//! normal. A side with another triangle of the same garment before that voxel lies in a pocket, and
//! is inside. Beyond a fold, where the outside is on one side of one sheet and on none or the other of
//! the next, the first voxel without a wall on the way away from the fold decides. Distances and
//! nearest points are exact, to the triangles themselves; only the choice of the sign depends on
//! voxels. The sign of a body, which is closed, comes from pseudo-normals alone.
//!
//! # Source
//!
//! The paper takes the sign from the SDF of the clothed body (Appendix C), which its network
//! returns. For garments without a network this is our interpretation (`docs/algorithm.md`).

mod closing;
mod clothed;
mod exposure;
mod labels;
#[cfg(test)]
mod tests;

pub use clothed::ClothedField;
#[doc(hidden)]
pub use exposure::Exposure;

use crate::body_surface::{BodyReport, BodySide, BodySurface};
use crate::index::{Bvh, Nearby, distance_bound};
use crate::pseudo_normals::PseudoNormals;
use crate::voxels::{Voxel, Voxels};
use closing::{CELL, PROBES, closed_voxels};
use if_core::closest::{Closest, ClosestPoint, Feature};
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use labels::{label_sides, vertex_orientations};

/// One layer, closed: a body, or a garment over a body.
#[derive(Clone, Debug)]
pub struct ClosedLayer {
    bvh: Bvh,
    vertices: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    /// +1 if the fronts of a vertex's triangles are outside, −1 if their backs are, else 0.
    vertex_orientations: Vec<Real>,
    normals: PseudoNormals,
    /// Those of a body are used for coarse queries only.
    voxels: Voxels,
    /// `None` for a body: its pseudo-normals are enough.
    closure: Option<Closure>,
    /// The closed surface of a body that is not closed itself.
    surface: Option<Box<BodySurface>>,
}

#[derive(Clone, Debug)]
struct Closure {
    /// For each triangle whether its [front, back] is outside.
    outside: Vec<[bool; 2]>,
    /// The triangles that separate inside from outside, with their indices in the mesh. `None` if
    /// all triangles do.
    interface: Option<(Bvh, Vec<u32>)>,
    /// For each vertex whether its triangles have different sides outside.
    creases: Vec<bool>,
}

/// The position of a point relative to a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sided {
    /// Signed distance, negative inside, in metres. Outside it is the distance to the nearest
    /// triangle; inside, to the nearest one with the outside on its other side.
    pub distance: Real,
    /// The nearest point of that triangle.
    pub point: Point,
    /// Unit direction out of the layer at that point.
    pub normal: Vector,
    /// The triangle.
    pub triangle: u32,
    /// Whether the nearest point lies on the boundary of the surface.
    pub boundary: bool,
}

/// Distance to the garment's triangles, in cells, beyond which a wall voxel belongs to a cap or the
/// body: the diagonal of a voxel is 1.73.
const OTHER_WALL: Real = 1.8;
impl ClosedLayer {
    /// A body. One that is open, in several parts, inside out or of mixed winding is closed first,
    /// without changing its triangles ([`BodySurface`]); of one without an inside nothing is inside
    /// but what its pseudo-normals say.
    pub fn body(mesh: &TriMesh) -> Self {
        let edges = Edges::new(mesh);
        let region = mesh.surface_aabb();
        let close = || {
            let surface = BodySurface::new(mesh, &edges).ok().flatten().map(Box::new);
            let mut voxels = Voxels::new(&region, region.size().max() * CELL * 1.5);
            voxels.add_walls(surface.as_ref().map_or(mesh, |surface| surface.closed()));
            voxels.flood(|_| true);
            (surface, voxels)
        };
        let index = || (Bvh::new(mesh), PseudoNormals::new(mesh, &edges));
        let ((bvh, normals), (surface, voxels)) = rayon::join(index, close);
        Self {
            bvh,
            vertices: mesh.vertices().to_vec(),
            triangles: mesh.triangles().to_vec(),
            vertex_orientations: vec![1.0; mesh.vertices().len()],
            normals,
            voxels,
            closure: None,
            surface,
        }
    }

    /// A garment over `body` (a layer made by [`ClosedLayer::body`] from `body_mesh`).
    pub fn garment(mesh: &TriMesh, body: &ClosedLayer, body_mesh: &TriMesh) -> Self {
        let edges = Edges::new(mesh);
        let index = || (Bvh::new(mesh), PseudoNormals::new(mesh, &edges));
        let ((bvh, normals), voxels) =
            rayon::join(index, || closed_voxels(mesh, &edges, body, body_mesh));
        let outside = label_sides(mesh, &bvh, &normals, &voxels);
        let keep: Vec<u32> = (0..mesh.triangles().len() as u32)
            .filter(|&t| outside[t as usize] != [false; 2])
            .collect();
        let interface = (keep.len() < mesh.triangles().len() && !keep.is_empty()).then(|| {
            let triangles = keep.iter().map(|&t| mesh.triangles()[t as usize]).collect();
            let part = TriMesh::new(mesh.vertices().to_vec(), triangles)
                .expect("a part of a mesh is a mesh");
            (Bvh::new(&part), keep)
        });
        let (vertex_orientations, creases) = vertex_orientations(mesh, &outside);
        Self {
            bvh,
            vertices: mesh.vertices().to_vec(),
            triangles: mesh.triangles().to_vec(),
            vertex_orientations,
            normals,
            voxels,
            closure: Some(Closure { outside, interface, creases }),
            surface: None,
        }
    }

    /// The index over the layer's triangles.
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// Corners of triangle `t`.
    pub fn corners(&self, t: u32) -> [Point; 3] {
        self.triangles[t as usize].map(|v| self.vertices[v as usize])
    }

    /// The layer as given.
    pub fn to_mesh(&self) -> TriMesh {
        let mesh = TriMesh::new(self.vertices.clone(), self.triangles.clone());
        mesh.expect("it was a mesh when the layer was made")
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertices.len()
    }

    /// Position of vertex `v`.
    pub fn vertex(&self, v: usize) -> Point {
        self.vertices[v]
    }

    /// The state of the voxel at `p`: [`Voxel::Inside`] is the inside of a body, or the space
    /// between a garment and the body.
    pub fn voxel(&self, p: &Point) -> Voxel {
        self.voxels.at(p)
    }

    /// Whether this is a closed body, whose distance is continuous everywhere.
    pub(crate) fn is_closed_body(&self) -> bool {
        self.closure.is_none() && self.surface.is_none()
    }

    /// What was assumed of a body that is not closed; `None` of a closed body, and of a garment.
    pub fn body_report(&self) -> Option<&BodyReport> {
        self.surface.as_ref().map(|surface| surface.report())
    }

    /// The surface that distances are measured to: without parts that are hidden in a body.
    pub(crate) fn skin(&self) -> &Bvh {
        self.surface.as_ref().map_or(&self.bvh, |surface| surface.skin())
    }

    /// The closed surface of a body that is not closed itself.
    pub(crate) fn surface(&self) -> Option<&BodySurface> {
        self.surface.as_deref()
    }

    /// The layer's voxels.
    pub(crate) fn voxels(&self) -> &Voxels {
        &self.voxels
    }

    /// Unit direction out of the layer at vertex `v`; zero if its triangles have different sides
    /// outside, or lie in a pocket.
    pub fn vertex_normal(&self, v: usize) -> Vector {
        if let Some(surface) = &self.surface {
            return surface.vertex_normal(v);
        }
        self.normals.vertex(v as u32) * self.vertex_orientations[v]
    }

    /// Whether `p` is certainly outside by the voxels alone, however near a triangle may be; true
    /// for all points of a closed body. While it holds for a moving point, its distance changes by at most
    /// its motion; elsewhere the distance may jump, where the point passes a curtain or a cap.
    pub fn is_outside_by_voxels(&self, p: &Point) -> bool {
        let jumps_outside = self.surface.as_ref().is_some_and(|surface| surface.has_islands());
        self.is_closed_body() || (self.voxels.at(p) == Voxel::Outside && !jumps_outside)
    }

    /// A distance that `p` can move while [`ClosedLayer::is_outside_by_voxels`] holds, in metres: 0
    /// where it does not hold, or ends near `p`.
    pub fn outside_radius(&self, p: &Point) -> Real {
        if self.is_closed_body() {
            return Real::INFINITY;
        }
        let jumps_outside = self.surface.as_ref().is_some_and(|surface| surface.has_islands());
        if jumps_outside { 0.0 } else { self.voxels.outside_radius(p) }
    }

    /// The position of `p`, if it is inside or within `reach` metres of a triangle; else `None`.
    pub fn sided(&self, p: &Point, reach: Real) -> Option<Sided> {
        self.sided_from(p, reach, None)
    }

    /// The same result as [`ClosedLayer::sided`], faster if `hint` is a triangle near `p`, such as
    /// that of a result for a nearby point. `hint` may be any triangle of the layer.
    ///
    /// # Panics
    ///
    /// If there is no such triangle.
    pub fn sided_from(&self, p: &Point, reach: Real, hint: Option<u32>) -> Option<Sided> {
        self.sided_by(p, reach, hint, None)
    }

    /// The same result as [`ClosedLayer::sided_from`], without a search if `nearby` was filled here
    /// by a query close to `p`. Else it is filled if the second one is true
    /// ([`Bvh::closest_nearby`]).
    ///
    /// # Panics
    ///
    /// As [`ClosedLayer::sided_from`].
    pub fn sided_nearby(
        &self,
        p: &Point,
        reach: Real,
        hint: Option<u32>,
        nearby: (&mut Nearby, bool),
    ) -> Option<Sided> {
        self.sided_by(p, reach, hint, Some(nearby))
    }

    fn sided_by(
        &self,
        p: &Point,
        reach: Real,
        hint: Option<u32>,
        mut nearby: Option<(&mut Nearby, bool)>,
    ) -> Option<Sided> {
        let bound = || {
            let corners = hint.and_then(|t| match &self.surface {
                Some(surface) => surface.corners(t).map(|corners| corners.map(|p| *p)),
                None => Some(self.corners(t)),
            });
            corners.map_or(Real::INFINITY, |c| distance_bound(p, c.each_ref()))
        };
        if let Some(surface) = &self.surface {
            return self.sided_of_surface(surface, p, reach, bound());
        }
        let mut closest = |reach: Real| match &mut nearby {
            Some((nearby, fill)) => self.bvh.closest_nearby(p, reach, bound, (nearby, *fill)),
            None => self.bvh.closest(p, reach.min(bound())),
        };
        let Some(closure) = &self.closure else {
            // Beyond `reach` of a closed surface a point may still be deep inside it.
            let near = match closest(reach) {
                Some(near) => near,
                None if self.voxel(p) == Voxel::Outside => return None,
                None => closest(Real::INFINITY)?,
            };
            let side = self.normals.side(p, &near);
            if side >= 0.0 && near.distance > reach {
                return None;
            }
            return Some(self.result(p, &near, side < 0.0, 1.0));
        };
        let voxel = self.voxels.at(p);
        // In a wall voxel a triangle is near, unless the wall is a cap or the body.
        let look = if voxel == Voxel::Wall { reach.max(2.0 * self.voxels.cell()) } else { reach };
        let near = match (closest(look), voxel) {
            (None, Voxel::Outside | Voxel::Core) => return None,
            (None, _) => closest(Real::INFINITY)?,
            (Some(near), _) => near,
        };
        let side = self.normals.side(p, &near);
        let boundary = self.normals.is_boundary(&near);
        let inside = match voxel {
            Voxel::Inside | Voxel::Filled => true,
            Voxel::Outside => false,
            // Inside the body, beyond the boundary of this layer: outside of this layer.
            Voxel::Core if boundary => false,
            // A wall of the body or of a cap, with no triangle of this layer near: the side is that
            // of the neighbouring voxels.
            Voxel::Wall if near.distance > OTHER_WALL * self.voxels.cell() => {
                self.voxels.around(p) == Voxel::Inside
            }
            Voxel::Wall if boundary => self.beyond_rim(p, &near, closure, side < 0.0),
            // Beyond a fold one sheet has the inside there, and the other the outside.
            Voxel::Wall | Voxel::Core if self.is_at_crease(&near, closure) => {
                let face = self.normals.face(near.triangle);
                self.beyond_rim(p, &near, closure, (p - near.point).dot(face) < 0.0)
            }
            Voxel::Wall | Voxel::Core => {
                !closure.outside[near.triangle as usize][usize::from(side < 0.0)]
            }
        };
        if !inside {
            if near.distance > reach {
                return None;
            }
            return Some(self.result(p, &near, false, if side < 0.0 { -1.0 } else { 1.0 }));
        }
        // The exit is the nearest triangle with the outside on one of its sides.
        let exit = match &closure.interface {
            None => near,
            Some((bvh, numbers)) => {
                let leads_out = hint.is_some_and(|t| closure.outside[t as usize] != [false; 2]);
                let mut c = bvh.closest(p, if leads_out { bound() } else { Real::INFINITY })?;
                c.triangle = numbers[c.triangle as usize];
                c
            }
        };
        let [front, back] = closure.outside[exit.triangle as usize];
        let orientation = match (front, back) {
            (false, true) => -1.0,
            _ => 1.0,
        };
        Some(self.result(p, &exit, true, orientation))
    }

    /// As [`ClosedLayer::sided`], of a body that is not closed. `bound` is at least the distance of
    /// `p` from its skin.
    fn sided_of_surface(
        &self,
        surface: &BodySurface,
        p: &Point,
        reach: Real,
        bound: Real,
    ) -> Option<Sided> {
        let found = match surface.side(p, reach.min(bound)) {
            Some(found) => found,
            None if self.voxel(p) == Voxel::Outside => return None,
            None => surface.side(p, bound)?,
        };
        let BodySide { near, inside, behind } = found;
        if !inside && near.distance > reach {
            return None;
        }
        let orientation = if behind && !inside { -1.0 } else { 1.0 };
        let mut sided = self.result_on(surface.normals(), p, &near, inside, orientation);
        sided.triangle = surface.given_triangle(near.triangle);
        Some(sided)
    }

    /// Whether the sides of the triangles at the nearest point `near` differ.
    fn is_at_crease(&self, near: &Closest, closure: &Closure) -> bool {
        let corner = |k: u8| self.triangles[near.triangle as usize][usize::from(k) % 3] as usize;
        match near.feature {
            Feature::Face => false,
            Feature::Edge(k) => closure.creases[corner(k)] && closure.creases[corner(k + 1)],
            Feature::Vertex(k) => closure.creases[corner(k)],
        }
    }

    /// Whether `p`, in a wall voxel beyond the boundary of the surface or the rim of a fold, is
    /// inside: by the first voxel without a wall on the way away from there. `behind` if `p` is at
    /// the back of the nearest triangle.
    fn beyond_rim(&self, p: &Point, near: &Closest, closure: &Closure, behind: bool) -> bool {
        let away = unit_or_zero(&(p - near.point));
        // Close to the rim, above or below the triangle itself, its label is more precise.
        if away.dot(self.normals.face(near.triangle)).abs() > 0.5 {
            return !closure.outside[near.triangle as usize][usize::from(behind)];
        }
        for probe in PROBES {
            match self.voxels.at(&(p + away * (probe * self.voxels.cell()))) {
                Voxel::Outside => return false,
                Voxel::Inside | Voxel::Filled => return true,
                Voxel::Wall | Voxel::Core => {}
            }
        }
        false
    }

    fn result(&self, p: &Point, near: &Closest, inside: bool, orientation: Real) -> Sided {
        self.result_on(&self.normals, p, near, inside, orientation)
    }

    fn result_on(
        &self,
        normals: &PseudoNormals,
        p: &Point,
        near: &Closest,
        inside: bool,
        orientation: Real,
    ) -> Sided {
        let sign = if inside { -1.0 } else { 1.0 };
        let offset = (p - near.point) * sign;
        // On the surface the offset has no direction, and next to it an imprecise one.
        let surface = unit_or_zero(&(normals.at(near) * orientation));
        let tiny = near.distance <= 1e-9 * self.bvh.aabb().diagonal();
        let normal = if tiny { surface } else { offset / near.distance };
        Sided {
            distance: sign * near.distance,
            point: near.point,
            normal,
            triangle: near.triangle,
            boundary: normals.is_boundary(near),
        }
    }
}
