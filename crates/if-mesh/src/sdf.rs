//! Signed distance of a mesh: the distance to the nearest triangle, with the sign of its
//! pseudo-normal.

use crate::body_surface::BodySurface;
use crate::index::Bvh;
use crate::intersections::own_pairs;
use crate::inverted::{InvertedPart, inverted_part, without_inner_parts};
use crate::pseudo_normals::PseudoNormals;
use crate::seams::weld;
use if_core::aabb::Aabb;
use if_core::closest::{Closest, ClosestPoint, Feature};
use if_core::edges::Edges;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;

/// Nearer to the surface than this share of the mesh's size, the direction to the nearest point is
/// lost to rounding (1e-16 of the size) and the pseudo-normal is the gradient. A thousand times more
/// gives wrong gradients beside creases.
const TOUCHING: Real = 1e-12;

/// Why a [`MeshSdf`] cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SdfError {
    /// The mesh has no triangles.
    #[error("a mesh without triangles has no distance")]
    Empty,
    /// An edge does not have two triangles, so that there is no inside. [`MeshSdf::open`] is for
    /// garments.
    #[error(
        "{triangles} triangles meet in the edge from vertex {} to vertex {} (and {others} more edges are not shared by two): the mesh \
         is not closed, and has no inside; close its holes",
        edge[0], edge[1]
    )]
    NotClosed {
        /// The ends of the first such edge.
        edge: [u32; 2],
        /// Number of triangles at it.
        triangles: u32,
        /// Number of further such edges.
        others: usize,
    },
    /// Two neighbours wind in opposite senses.
    #[error(
        "triangles {} and {} run through their edge in the same direction ({others} more pairs do): turn triangles until all are \
         counter-clockwise seen from outside",
        triangles[0], triangles[1]
    )]
    Winding {
        /// The two triangles.
        triangles: [u32; 2],
        /// Number of further such edges.
        others: usize,
    },
    /// The whole mesh faces inwards, or encloses nothing.
    #[error(
        "the mesh encloses {volume} m³: it is inside out or flat; triangles must be counter-clockwise seen from outside"
    )]
    InsideOut {
        /// Signed volume, in cubic metres.
        volume: Real,
    },
    /// A part of the mesh faces inwards, and is not a cavity of another.
    #[error(
        "the part of {} triangles from triangle {} on is inside out (it encloses {} m³): its triangles must be \
         counter-clockwise seen from outside", part.triangles, part.triangle, part.volume
    )]
    PartInsideOut {
        /// The part.
        part: InvertedPart,
    },
    /// The reach is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
}

/// The signed distance of a closed mesh, or of an open garment where its side is defined.
///
/// An open surface has no side beyond its rim: if the nearest point lies on a boundary edge, on one
/// of more than two triangles, or on one whose triangles wind in opposite senses,
/// [`MeshSdf::signed`] returns `None`, and the field means *no constraint*: distance +∞, gradient
/// zero. The same holds farther away than its reach.
///
/// # Source
///
/// Bærentzen and Aanæs 2005, *Signed distance computation using the angle weighted pseudonormal*:
/// exact for closed surfaces without self-intersections.
///
/// # Examples
///
/// ```
/// use if_core::{field::SignedDistance, math::Point, shapes::meshes};
/// let ball = if_mesh::sdf::MeshSdf::closed(&meshes::icosphere(1.0, 4))?;
/// assert!((ball.distance(&Point::new(0.0, 0.0, 3.0)) - 2.0).abs() < 1e-2);
/// # Ok::<(), if_mesh::sdf::SdfError>(())
/// ```
#[derive(Clone, Debug)]
pub struct MeshSdf {
    surface: Bvh,
    normals: PseudoNormals,
    edge_of: Vec<[u32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// Edges and vertices where the surface has no side; `None` for closed meshes.
    sideless: Option<[Vec<bool>; 2]>,
    reach: Real,
    touching: Real,
    inner_parts: usize,
    /// Of a mesh that intersects itself.
    union: Option<Box<BodySurface>>,
}

impl MeshSdf {
    /// [`Self::closed`] of a mesh that is closed, or closed once its seams are welded ([`weld`]): as exporters
    /// write bodies, with vertices of their own on both sides of a seam. Parts that lie inside of others,
    /// such as eyes in a head, are left out ([`Self::inner_parts`]): they would make cavities of it. Of one that
    /// intersects itself ([`Self::own_pairs`]) what any of its parts encloses is inside. There distances are to
    /// triangles that lie inside in part, too, and so may be too small, never too large.
    ///
    /// # Errors
    ///
    /// Those of [`Self::closed`].
    pub fn sewn(mesh: &TriMesh) -> Result<Self, SdfError> {
        let open = match Self::solid(mesh) {
            Err(open @ SdfError::NotClosed { .. }) => open,
            other => return other,
        };
        let Some(welded) = weld(mesh).filter(|welded| welded.edges > 0) else { return Err(open) };
        Self::solid(&welded.mesh).map_err(|error| match error {
            SdfError::NotClosed { edge, triangles, others } => {
                let given = welded.first_of();
                let edge = edge.map(|v| given[v as usize]);
                SdfError::NotClosed { edge, triangles, others }
            }
            other => other,
        })
    }

    /// [`Self::closed`] without the parts that lie inside of others, and with the union of what intersects itself.
    fn solid(mesh: &TriMesh) -> Result<Self, SdfError> {
        let edges = checked(mesh)?;
        match without_inner_parts(mesh) {
            Some((outer, inner_parts)) => {
                Ok(Self { inner_parts, ..Self::closed(&outer)?.united(&outer) })
            }
            None => Ok(Self::with(mesh, edges, None, Real::INFINITY).united(mesh)),
        }
    }

    /// The field of the union, if `mesh`, whose field this is, intersects itself.
    fn united(self, mesh: &TriMesh) -> Self {
        if own_pairs(mesh, &self.surface).is_empty() {
            return self;
        }
        let union = BodySurface::new(mesh, &Edges::new(mesh)).ok().flatten();
        Self { union: union.map(Box::new), ..self }
    }

    /// The field of a closed mesh that faces outwards, everywhere.
    ///
    /// # Errors
    ///
    /// A mesh that is empty, open or non-manifold at an edge, of inconsistent winding, or inside
    /// out, as a whole or in a part.
    pub fn closed(mesh: &TriMesh) -> Result<Self, SdfError> {
        Ok(Self::with(mesh, checked(mesh)?, None, Real::INFINITY))
    }

    /// The field of an open surface, within `reach` metres of it.
    ///
    /// # Errors
    ///
    /// A mesh without triangles, or a reach that is not positive.
    pub fn open(mesh: &TriMesh, reach: Real) -> Result<Self, SdfError> {
        if mesh.triangles().is_empty() {
            return Err(SdfError::Empty);
        }
        ParameterError::check("reach", reach, reach > 0.0, "positive (m)")?;
        let edges = Edges::new(mesh);
        let sideless: Vec<bool> = (0..edges.valence.len())
            .map(|e| edges.valence[e] != 2 || is_turned(mesh, &edges, e))
            .collect();
        let mut ends = vec![false; mesh.vertices().len()];
        for (e, _) in sideless.iter().enumerate().filter(|(_, sideless)| **sideless) {
            edges.vertices[e].iter().for_each(|v| ends[*v as usize] = true);
        }
        Ok(Self::with(mesh, edges, Some([sideless, ends]), reach))
    }

    fn with(mesh: &TriMesh, edges: Edges, sideless: Option<[Vec<bool>; 2]>, reach: Real) -> Self {
        let surface = Bvh::new(mesh);
        let touching = TOUCHING * surface.aabb().diagonal();
        let normals = PseudoNormals::new(mesh, &edges);
        Self {
            surface,
            normals,
            edge_of: edges.of_triangle,
            triangles: mesh.triangles().to_vec(),
            sideless,
            reach,
            touching,
            inner_parts: 0,
            union: None,
        }
    }

    /// Distance and gradient at `p`; `None` if the surface has no side there, or is out of reach.
    pub fn signed(&self, p: &Point) -> Option<FieldSample> {
        self.signed_within(p, self.reach)
    }

    /// The same, and `None` also if the surface is farther than `limit` metres: a smaller limit is
    /// faster.
    pub fn signed_within(&self, p: &Point, limit: Real) -> Option<FieldSample> {
        let reach = limit.min(self.reach);
        let (c, inside, normals) = match &self.union {
            Some(union) => {
                let (near, inside, _) = union.nearest(p, reach)?;
                (near, inside, union.normals())
            }
            None => {
                let near = self.surface.closest(p, reach)?;
                if self.is_sideless(&near) {
                    return None;
                }
                (near, self.normals.side(p, &near) < 0.0, &self.normals)
            }
        };
        let side = if inside { -1.0 } else { 1.0 };
        let gradient = if c.distance > self.touching {
            (p - c.point) * (side / c.distance)
        } else {
            unit_or_zero(&normals.at(&c))
        };
        Some(FieldSample { distance: side * c.distance, gradient })
    }

    fn is_sideless(&self, c: &Closest) -> bool {
        let Some([edges, vertices]) = &self.sideless else { return false };
        match c.feature {
            Feature::Face => false,
            Feature::Edge(k) => edges[self.edge_of[c.triangle as usize][k as usize] as usize],
            Feature::Vertex(k) => {
                vertices[self.triangles[c.triangle as usize][k as usize] as usize]
            }
        }
    }

    /// Number of parts that were left out because they lie inside of others ([`Self::sewn`]).
    pub fn inner_parts(&self) -> usize {
        self.inner_parts
    }

    /// Number of pairs of triangles by which the mesh intersects itself ([`Self::sewn`]).
    pub fn own_pairs(&self) -> usize {
        self.union.as_ref().map_or(0, |union| union.report().own_pairs)
    }

    /// The surface itself.
    pub fn surface(&self) -> &Bvh {
        &self.surface
    }
}

/// The edges of a mesh that is closed and faces outwards.
fn checked(mesh: &TriMesh) -> Result<Edges, SdfError> {
    if mesh.triangles().is_empty() {
        return Err(SdfError::Empty);
    }
    let edges = Edges::new(mesh);
    let unshared: Vec<usize> =
        (0..edges.valence.len()).filter(|e| edges.valence[*e] != 2).collect();
    if let Some(e) = unshared.first() {
        let (edge, triangles) = (edges.vertices[*e], edges.valence[*e]);
        return Err(SdfError::NotClosed { edge, triangles, others: unshared.len() - 1 });
    }
    let turned: Vec<usize> =
        (0..edges.valence.len()).filter(|e| is_turned(mesh, &edges, *e)).collect();
    if let Some(e) = turned.first() {
        return Err(SdfError::Winding { triangles: edges.triangles[*e], others: turned.len() - 1 });
    }
    let volume = mesh.signed_volume();
    if volume.is_nan() || volume <= 0.0 {
        return Err(SdfError::InsideOut { volume });
    }
    if let Some(part) = inverted_part(mesh) {
        return Err(SdfError::PartInsideOut { part });
    }
    Ok(edges)
}

/// Whether both triangles of an edge run through it in the same direction.
fn is_turned(mesh: &TriMesh, edges: &Edges, e: usize) -> bool {
    if edges.valence[e] != 2 {
        return false;
    }
    let from = |t: u32| {
        let k = edges.of_triangle[t as usize].iter().position(|other| *other as usize == e)?;
        Some(mesh.triangles()[t as usize][k])
    };
    from(edges.triangles[e][0]) == from(edges.triangles[e][1])
}

impl SignedDistance for MeshSdf {
    fn distance(&self, p: &Point) -> Real {
        self.sample(p).distance
    }

    fn sample(&self, p: &Point) -> FieldSample {
        self.signed(p)
            .unwrap_or(FieldSample { distance: Real::INFINITY, gradient: Vector::zeros() })
    }

    /// The box of a closed mesh; that of an open one, enlarged by its reach.
    fn bounds(&self) -> Option<Aabb> {
        match self.sideless {
            None => Some(self.surface.aabb()),
            Some(_) if self.reach.is_finite() => Some(self.surface.aabb().inflated(self.reach)),
            Some(_) => None,
        }
    }

    /// 1 for a closed mesh, +∞ for an open one, whose field may jump.
    fn lipschitz(&self) -> Real {
        if self.sideless.is_none() { 1.0 } else { Real::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::conformance::{FieldTolerances, check_closest_point, check_signed_distance};
    use if_core::random::SplitMix64;
    use if_core::shapes::{Cuboid, Sphere, Torus, meshes};

    fn points(n: usize, half: Real) -> Vec<Point> {
        let mut random = SplitMix64::new(9);
        let mut next = move || (random.unit() * 2.0 - 1.0) * half;
        (0..n).map(|_| Point::new(next(), next(), next())).collect()
    }

    #[test]
    fn closed_meshes_conform_and_agree_with_their_closed_forms() {
        let o = Point::origin();
        let half = Vector::new(0.3, 0.5, 0.4);
        let cases: [(TriMesh, &dyn SignedDistance, Real); 3] = [
            (meshes::cuboid(half), &Cuboid { center: o, half }, 1e-14),
            // Chords of 0.07 m lie up to 0.07² / (8 · 0.5) inside the sphere.
            (meshes::icosphere(0.5, 3), &Sphere { center: o, radius: 0.5 }, 2.5e-3),
            (meshes::torus(0.5, 0.2, 64, 32), &Torus { center: o, major: 0.5, minor: 0.2 }, 2.5e-3),
        ];
        for (mesh, truth, error) in &cases {
            let field = MeshSdf::closed(mesh).unwrap();
            let points = points(400, 0.8);
            check_signed_distance(
                &field,
                &points,
                &FieldTolerances { kinks: 0.2, ..FieldTolerances::default() },
            )
            .unwrap();
            check_closest_point(field.surface(), mesh, &points[..50], 1e-13).unwrap();
            for p in &points {
                approx::assert_relative_eq!(field.distance(p), truth.distance(p), epsilon = *error);
            }
            for (v, n) in mesh.vertices().iter().zip(mesh.vertex_normals()) {
                let on = field.sample(v);
                assert_eq!(on.distance, 0.0);
                approx::assert_relative_eq!(on.gradient.norm(), 1.0, epsilon = 1e-12);
                // Which of the faces at the vertex answers is open, but all face its way.
                assert!(on.gradient.dot(&n) > 0.3);
            }
        }
    }

    #[test]
    fn what_any_of_two_overlapping_parts_encloses_is_inside() {
        let ball = meshes::icosphere(0.3, 3);
        let n = ball.vertices().len() as u32;
        let beside = ball.vertices().iter().map(|p| p + Vector::x() * 0.35);
        let vertices = ball.vertices().iter().copied().chain(beside).collect();
        let others = ball.triangles().iter().map(|t| t.map(|v| v + n));
        let both = TriMesh::new(vertices, ball.triangles().iter().copied().chain(others).collect());
        let field = MeshSdf::sewn(&both.unwrap()).unwrap();
        assert!(field.own_pairs() > 40, "{}", field.own_pairs());
        let one = MeshSdf::closed(&ball).unwrap();
        assert_eq!(MeshSdf::sewn(&ball).unwrap().own_pairs(), 0);
        let points = points(3000, 0.8);
        // The surface of the union, at the vertices of each ball that the other one does not enclose.
        let right = ball.vertices().iter().map(|p| p + Vector::x() * 0.35);
        let left =
            ball.vertices().iter().filter(|p| one.distance(&(*p - Vector::x() * 0.35)) > 0.0);
        let right = right.filter(|p| one.distance(p) > 0.0);
        let surface: Vec<Point> = left.copied().chain(right).collect();
        for p in &points {
            let truth = one.distance(p).min(one.distance(&(p - Vector::x() * 0.35)));
            let found = field.distance(p);
            if truth > 0.0 {
                assert!((found - truth).abs() < 1e-12, "exact outside: {found} {truth}");
            } else {
                let nearest =
                    surface.iter().map(|q| (p - q).norm()).fold(Real::INFINITY, Real::min);
                assert!(found <= 0.0 && -found <= nearest + 1e-12, "{p}: {found} {nearest}");
            }
        }
        let tolerances = FieldTolerances { kinks: 0.2, ..FieldTolerances::default() };
        check_signed_distance(&field, &points, &tolerances).unwrap();
    }

    #[test]
    fn an_open_tube_has_sides_up_to_its_rims_and_no_farther() {
        let tube = meshes::tube(0.5, 1.0, 48, 12, false);
        let field = MeshSdf::open(&tube, 0.3).unwrap();
        let at = |r: Real, y: Real| field.signed(&Point::new(r, y, 0.01));
        assert!(at(0.45, 0.5).unwrap().distance < 0.0 && at(0.55, 0.5).unwrap().distance > 0.0);
        assert!(at(0.45, 0.01).unwrap().distance < 0.0);
        assert_eq!(at(0.45, -0.01), None, "beyond the rim");
        assert_eq!(at(0.55, 1.2), None, "beyond the rim");
        assert_eq!(at(0.1, 0.5), None, "out of reach");
        let none = field.sample(&Point::new(0.45, -0.01, 0.0));
        assert_eq!(none, FieldSample { distance: Real::INFINITY, gradient: Vector::zeros() });
        check_signed_distance(
            &field,
            &points(400, 0.9),
            &FieldTolerances { kinks: 0.2, ..FieldTolerances::default() },
        )
        .unwrap();
    }

    #[test]
    fn meshes_without_a_side_are_refused_with_a_reason() {
        let ball = meshes::icosphere(1.0, 1);
        let with = |t: Vec<[u32; 3]>| TriMesh::new(ball.vertices().to_vec(), t).unwrap();
        let turned: Vec<[u32; 3]> = ball.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        assert!(
            matches!(MeshSdf::closed(&with(turned.clone())), Err(SdfError::InsideOut { volume }) if volume < -3.0)
        );
        let mut one = ball.triangles().to_vec();
        one[7] = turned[7];
        assert!(matches!(MeshSdf::closed(&with(one)), Err(SdfError::Winding { others: 2, .. })));
        let holed = with(ball.triangles()[1..].to_vec());
        let error = MeshSdf::closed(&holed).unwrap_err();
        assert!(matches!(error, SdfError::NotClosed { triangles: 1, others: 2, .. }), "{error}");
        assert!(MeshSdf::open(&holed, 0.5).is_ok());
        assert!(matches!(MeshSdf::open(&holed, Real::NAN), Err(SdfError::Parameter(_))));
        assert_eq!(MeshSdf::closed(&TriMesh::default()).unwrap_err(), SdfError::Empty);
        assert_eq!(MeshSdf::open(&TriMesh::default(), 1.0).unwrap_err(), SdfError::Empty);
        let flat = TriMesh::new(ball.vertices().to_vec(), vec![[0, 1, 2], [0, 2, 1]]).unwrap();
        assert!(matches!(MeshSdf::closed(&flat), Err(SdfError::InsideOut { volume: 0.0 })));
        // A small ball beside it that faces inwards.
        let beside =
            ball.vertices().iter().map(|p| Point::new(0.1 * p.x + 2.0, 0.1 * p.y, 0.1 * p.z));
        let both: Vec<Point> = ball.vertices().iter().copied().chain(beside).collect();
        let first = ball.vertices().len() as u32;
        let triangles = ball
            .triangles()
            .iter()
            .copied()
            .chain(turned.iter().map(|t| t.map(|v| v + first)))
            .collect();
        let error = MeshSdf::closed(&TriMesh::new(both, triangles).unwrap()).unwrap_err();
        assert!(
            matches!(error, SdfError::PartInsideOut { part } if part.triangle == turned.len()),
            "{error}"
        );
    }

    #[test]
    fn edges_of_three_triangles_and_turned_neighbours_have_no_side() {
        let v = vec![
            Point::origin(),
            Point::new(1.0, 0.0, 0.0),
            Point::new(0.5, 1.0, 0.0),
            Point::new(0.5, -1.0, 0.0),
            Point::new(0.5, 0.0, -1.0),
        ];
        let above = Point::new(0.5, 0.0, 0.1);
        let sheet = TriMesh::new(v.clone(), vec![[0, 1, 2], [1, 0, 3]]).unwrap();
        approx::assert_relative_eq!(
            MeshSdf::open(&sheet, 1.0).unwrap().signed(&above).unwrap().distance,
            0.1
        );
        let fin = TriMesh::new(v.clone(), vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]]).unwrap();
        assert_eq!(MeshSdf::open(&fin, 1.0).unwrap().signed(&above), None);
        let turned = TriMesh::new(v, vec![[0, 1, 2], [0, 1, 3]]).unwrap();
        assert_eq!(MeshSdf::open(&turned, 1.0).unwrap().signed(&above), None);
    }
}
