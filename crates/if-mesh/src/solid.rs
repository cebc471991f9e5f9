//! The closed clothed-body field: one side for every point, whatever collars, lapels and hems do.
//!
//! A garment is an open sheet. Signs from its pseudo-normals flip at folded collars and mean
//! nothing beyond a hem. A [`ClosedLayer`] closes it first:
//!
//! ```text
//! shadow  = what lies between a triangle of the garment and the part of the body nearest to it
//! walls   = triangles of the garment and of the body
//!         + curtains: from every boundary edge to the nearest points of the body
//!         + caps: from every boundary edge to the middle of its loop
//! outside = voxels that infinity reaches without crossing a wall or a shadow
//! ```
//!
//! The shadow fills the gap between a tight garment and the body, and the pockets under collars and
//! lapels; curtains and caps shut what hangs further away: a coat's hem, a wide skirt. Voxels
//! settle the sign of points away from walls. Nearer, the nearest triangle does: each of its two
//! sides was labelled *outside* or *inside* beforehand, by looking along its normal for the first
//! voxel without a wall. A side that sees another triangle of the same garment first lies in a
//! pocket, and is inside. Distances and nearest points are exact, to the triangles themselves; only
//! the choice of the sign goes through voxels. The body, closed by itself, takes its sign from
//! pseudo-normals alone.
//!
//! # Source
//!
//! The paper takes its sign from the SDF of the clothed body (Appendix C), which its network gives.
//! For garments without a network this is our reading (`docs/algorithm.md`).

use crate::index::Bvh;
use crate::pseudo_normals::PseudoNormals;
use crate::voxels::{Voxel, Voxels};
use if_core::aabb::Aabb;
use if_core::closest::{Closest, ClosestPoint, closest_on_triangle};
use if_core::edges::Edges;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector, barycentric_point, unit_or_zero};
use if_core::mesh::TriMesh;
use rayon::prelude::*;

/// One layer, closed: a body, or a garment over a body.
#[derive(Clone, Debug)]
pub struct ClosedLayer {
    bvh: Bvh,
    vertices: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    /// +1 where the fronts of a vertex's triangles are outside, −1 their backs, 0 neither or both.
    vertex_orientations: Vec<Real>,
    normals: PseudoNormals,
    /// Of a body they give rough answers only.
    voxels: Voxels,
    /// None for a body: its pseudo-normals are enough.
    closure: Option<Closure>,
}

#[derive(Clone, Debug)]
struct Closure {
    /// For each triangle whether its [front, back] is outside.
    outside: Vec<[bool; 2]>,
    /// The triangles that part inside from outside, with their numbers in the mesh. None where all
    /// do.
    interface: Option<(Bvh, Vec<u32>)>,
}

/// Where a point lies against a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sided {
    /// Signed distance, negative inside, in metres. Outside it is the distance to the nearest
    /// triangle; inside, to the nearest one that has the outside on its other side.
    pub distance: Real,
    /// The nearest point of that triangle.
    pub point: Point,
    /// Unit direction that leads out of the layer at that point.
    pub normal: Vector,
    /// The triangle.
    pub triangle: u32,
    /// Whether the nearest point lies where the surface ends.
    pub boundary: bool,
}

/// Side of the voxels, as a share of the body's height: 4 mm for a person. Halving it costs eight
/// times the memory and changes no sign on the test data; doubling it merges sleeves with the
/// torso.
const CELL: Real = 1.0 / 420.0;
/// A triangle casts a shadow on a body that is no further than this share of the body's height
/// away: 50 mm for a person, more than a collar stands off a neck.
const SHADOW: Real = 1.0 / 34.0;
/// Looks along a normal for a free voxel at these multiples of a voxel.
const PROBES: [Real; 5] = [0.8, 1.2, 1.7, 2.2, 2.8];
/// A wall's voxel further than this many cells from the garment's triangles is a wall of something
/// else: its diagonal is 1.73.
const NOT_OURS: Real = 1.8;
/// Curtains reach this far, as a share of the body's height; a loop further away keeps its cap
/// only.
const CURTAIN: Real = 0.25;

impl ClosedLayer {
    /// A closed mesh, such as a body. It is not checked for being closed.
    pub fn body(mesh: &TriMesh) -> Self {
        let bvh = Bvh::new(mesh);
        let mut voxels = Voxels::new(&bvh.aabb(), bvh.aabb().size().max() * CELL * 1.5);
        for t in 0..mesh.triangles().len() {
            voxels.add_wall(mesh.corners(t));
        }
        voxels.flood(|_| true);
        Self {
            bvh,
            vertices: mesh.vertices().to_vec(),
            triangles: mesh.triangles().to_vec(),
            vertex_orientations: vec![1.0; mesh.vertices().len()],
            normals: PseudoNormals::new(mesh, &Edges::new(mesh)),
            voxels,
            closure: None,
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
        Self {
            bvh,
            vertices: mesh.vertices().to_vec(),
            triangles: mesh.triangles().to_vec(),
            vertex_orientations: vertex_orientations(mesh, &outside),
            normals,
            voxels,
            closure: Some(Closure { outside, interface }),
        }
    }

    /// The index over the layer's triangles.
    pub fn bvh(&self) -> &Bvh {
        &self.bvh
    }

    /// Pseudo-normals of the layer.
    pub fn normals(&self) -> &PseudoNormals {
        &self.normals
    }

    /// Corners of triangle `t`.
    pub fn corners(&self, t: u32) -> [Point; 3] {
        self.triangles[t as usize].map(|v| self.vertices[v as usize])
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertices.len()
    }

    /// Position of vertex `v`.
    pub fn vertex(&self, v: usize) -> Point {
        self.vertices[v]
    }

    /// What the layer's voxels say of `p`: for a body [`Voxel::Inside`] where it is inside, for a
    /// garment between it and the body.
    pub fn voxel(&self, p: &Point) -> Voxel {
        self.voxels.at(p)
    }

    /// The layer's voxels.
    pub(crate) fn voxels(&self) -> &Voxels {
        &self.voxels
    }

    /// Unit direction out of the layer at vertex `v`; zero where the triangles round it do not
    /// agree, or lie in a pocket.
    pub fn vertex_normal(&self, v: usize) -> Vector {
        self.normals.vertex(v as u32) * self.vertex_orientations[v]
    }

    /// How many sides of triangles lie in pockets: both sides of a triangle inside.
    pub fn covered_triangles(&self) -> usize {
        self.closure.as_ref().map_or(0, |c| c.outside.iter().filter(|o| **o == [false; 2]).count())
    }

    /// Whether `p` is surely outside and further than `reach` from every triangle and closed part.
    pub fn is_far(&self, p: &Point, reach: Real) -> bool {
        self.bvh.aabb().distance_squared(p) > reach * reach
    }

    /// Whether `p` is surely outside by the voxels alone, however near a triangle may be. Of a
    /// closed body nothing is needed: true. While a point stays where this holds, its distance
    /// changes by no more than it moves; elsewhere it can jump, where it passes a part of the
    /// closure that is no surface of the garment.
    pub fn is_outside_by_voxels(&self, p: &Point) -> bool {
        self.closure.is_none() || self.voxels.at(p) == Voxel::Outside
    }

    /// Where `p` lies, if it is inside or within `reach` (metres) of a triangle. `None` is outside.
    pub fn sided(&self, p: &Point, reach: Real) -> Option<Sided> {
        self.sided_from(p, reach, None)
    }

    /// The same answer as [`ClosedLayer::sided`], sooner where `hint` is a triangle near `p`: that
    /// of the answer to a point near by, say. Any triangle of the layer may be named.
    ///
    /// # Panics
    ///
    /// If there is no such triangle.
    pub fn sided_from(&self, p: &Point, reach: Real, hint: Option<u32>) -> Option<Sided> {
        // What is further than the hint need not be looked at. The slack is more than rounding, of
        // distances and of coordinates, so that nothing as near is lost.
        let bound = hint.map_or(Real::INFINITY, |t| {
            let [a, b, c] = &self.corners(t);
            let (w, _) = closest_on_triangle(p, a, b, c);
            let distance = (p - barycentric_point([a, b, c], w)).norm();
            distance * (1.0 + 1e-9)
                + 1e-12 * (p.coords.amax() + a.coords.amax() + b.coords.amax() + c.coords.amax())
        });
        let Some(closure) = &self.closure else {
            // Beyond `reach` of a closed surface a point may still be deep inside it.
            let near = match self.bvh.closest(p, reach.min(bound)) {
                Some(near) => near,
                None if self.voxel(p) == Voxel::Outside => return None,
                None => self.bvh.closest(p, bound)?,
            };
            let side = self.normals.side(p, &near);
            if side >= 0.0 && near.distance > reach {
                return None;
            }
            return Some(self.answer(p, &near, side < 0.0, 1.0));
        };
        let voxel = self.voxels.at(p);
        // In a wall's voxel the wall is near, unless it is a cap's or the body's.
        let look = if voxel == Voxel::Wall { reach.max(2.0 * self.voxels.cell()) } else { reach };
        let near = match (self.bvh.closest(p, look.min(bound)), voxel) {
            (None, Voxel::Outside | Voxel::Core) => return None,
            (None, _) => self.bvh.closest(p, bound)?,
            (Some(near), _) => near,
        };
        let side = self.normals.side(p, &near);
        let boundary = self.normals.is_boundary(&near);
        let inside = match voxel {
            Voxel::Inside | Voxel::Filled => true,
            Voxel::Outside => false,
            // Inside the body, and beyond where this layer ends: no matter of this layer.
            Voxel::Core if boundary => false,
            // A wall of the body or of a cap: this layer does not come near, so the side is that of
            // the voxels round about.
            Voxel::Wall if near.distance > NOT_OURS * self.voxels.cell() => {
                self.voxels.around(p) == Voxel::Inside
            }
            Voxel::Wall if boundary => self.beyond_boundary(p, &near, closure),
            Voxel::Wall | Voxel::Core => {
                !closure.outside[near.triangle as usize][usize::from(side < 0.0)]
            }
        };
        if !inside {
            if near.distance > reach {
                return None;
            }
            return Some(self.answer(p, &near, false, if side < 0.0 { -1.0 } else { 1.0 }));
        }
        // The way out leads through a triangle with the outside on one of its sides.
        let exit = match &closure.interface {
            None => near,
            Some((bvh, numbers)) => {
                let leads_out = hint.is_some_and(|t| closure.outside[t as usize] != [false; 2]);
                let mut c = bvh.closest(p, if leads_out { bound } else { Real::INFINITY })?;
                c.triangle = numbers[c.triangle as usize];
                c
            }
        };
        let [front, back] = closure.outside[exit.triangle as usize];
        let orientation = match (front, back) {
            (false, true) => -1.0,
            _ => 1.0,
        };
        Some(self.answer(p, &exit, true, orientation))
    }

    /// In a wall voxel beyond the end of the surface: the first free voxel further on tells.
    fn beyond_boundary(&self, p: &Point, near: &Closest, closure: &Closure) -> bool {
        let side = self.normals.side(p, near);
        let away = unit_or_zero(&(p - near.point));
        // Close to the rim, above or below the triangle itself, its label is the better answer.
        if away.dot(self.normals.face(near.triangle)).abs() > 0.5 {
            return !closure.outside[near.triangle as usize][usize::from(side < 0.0)];
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

    fn answer(&self, p: &Point, near: &Closest, inside: bool, orientation: Real) -> Sided {
        let sign = if inside { -1.0 } else { 1.0 };
        let offset = (p - near.point) * sign;
        // On the surface itself the offset has no direction, and next to it a doubtful one.
        let surface = unit_or_zero(&(self.normals.at(near) * orientation));
        let tiny = near.distance <= 1e-9 * self.bvh.aabb().diagonal();
        let normal = if tiny { surface } else { offset / near.distance };
        Sided {
            distance: sign * near.distance,
            point: near.point,
            normal,
            triangle: near.triangle,
            boundary: self.normals.is_boundary(near),
        }
    }
}

/// Voxels whose walls are the garment, its shadow, the body, curtains and caps, flooded from
/// outside.
fn closed_voxels(mesh: &TriMesh, edges: &Edges, body: &ClosedLayer, body_mesh: &TriMesh) -> Voxels {
    let height = body.bvh.aabb().size().max();
    let extent =
        Aabb::from_points(mesh.triangles().iter().flatten().map(|v| &mesh.vertices()[*v as usize]));
    let mut voxels =
        Voxels::new(&extent.inflated(height * CELL * PROBES[PROBES.len() - 1]), height * CELL);
    for t in 0..mesh.triangles().len() {
        voxels.add_wall(mesh.corners(t));
    }
    cast_shadow(&mut voxels, mesh, &body.bvh, height * SHADOW);
    for t in 0..body_mesh.triangles().len() {
        voxels.add_wall(body_mesh.corners(t));
    }
    for walk in edges.boundary_loops(mesh) {
        close_loop(&mut voxels, mesh, &walk, &body.bvh, height * CURTAIN);
    }
    voxels.flood(|p| body.sided(p, Real::INFINITY).is_none_or(|s| s.distance > 0.0));
    voxels
}

/// Fills what lies between each triangle and the body.
fn cast_shadow(voxels: &mut Voxels, mesh: &TriMesh, body: &Bvh, reach: Real) {
    let feet: Vec<Option<Point>> =
        mesh.vertices().par_iter().map(|p| body.closest(p, reach).map(|c| c.point)).collect();
    let cell = voxels.cell();
    let longest =
        |p: [&Point; 3]| (0..3).map(|k| (p[k] - p[(k + 1) % 3]).norm()).fold(0.0, Real::max);
    // Each triangle that casts a shadow, where it falls, and into how many strips its sides are
    // cut.
    let mut casting: Vec<(usize, [Point; 3], usize)> = Vec::new();
    let mut segments = 0;
    for (t, tri) in mesh.triangles().iter().enumerate() {
        let [Some(a), Some(b), Some(c)] = tri.map(|v| feet[v as usize]) else { continue };
        let size = longest(mesh.corners(t));
        // Feet on two legs, or on an arm and the torso, have no common shadow.
        if longest([&a, &b, &c]) > 2.0 * size + 2.0 * cell {
            continue;
        }
        let steps = (1.5 * size / cell).ceil().max(1.0) as usize;
        casting.push((t, [a, b, c], steps));
        segments += (steps + 1) * (steps + 2) / 2;
        if segments > BATCH {
            fill_shadows(voxels, mesh, &casting);
            casting.clear();
            segments = 0;
        }
    }
    fill_shadows(voxels, mesh, &casting);
}

/// Segments of shadows made before they are filled: 6 MB, and twice that while threads gather them.
const BATCH: usize = 1 << 17;

/// Fills what lies between triangles and their feet, on segments from the one to the other.
fn fill_shadows(voxels: &mut Voxels, mesh: &TriMesh, casting: &[(usize, [Point; 3], usize)]) {
    let of_triangle = |(t, feet, steps): &(usize, [Point; 3], usize)| {
        let (top, feet, steps) = (mesh.corners(*t), *feet, *steps);
        let places = (0..=steps).flat_map(move |i| (0..=steps - i).map(move |j| (i, j)));
        places.map(move |(i, j)| {
            let (u, v) = (i as Real / steps as Real, j as Real / steps as Real);
            let w = [1.0 - u - v, u, v];
            [barycentric_point(top, w), barycentric_point(feet.each_ref(), w)]
        })
    };
    let segments: Vec<[Point; 2]> = casting.par_iter().flat_map_iter(of_triangle).collect();
    voxels.fill(&segments);
}

/// Curtains from the loop to the body, and a cap over the loop.
fn close_loop(voxels: &mut Voxels, mesh: &TriMesh, walk: &[u32], body: &Bvh, reach: Real) {
    let rim: Vec<Point> = walk.iter().map(|v| mesh.vertices()[*v as usize]).collect();
    let middle = Point::from(rim.iter().map(|p| p.coords).sum::<Vector>() / rim.len() as Real);
    let feet: Vec<Option<Point>> =
        rim.par_iter().map(|p| body.closest(p, reach).map(|c| c.point)).collect();
    for k in 0..rim.len() {
        let next = (k + 1) % rim.len();
        voxels.add_wall([&rim[k], &rim[next], &middle]);
        if let (Some(a), Some(b)) = (&feet[k], &feet[next]) {
            voxels.add_wall([&rim[k], &rim[next], b]);
            voxels.add_wall([&rim[k], b, a]);
        }
    }
}

/// For each vertex the side on whose being outside all its triangles agree.
fn vertex_orientations(mesh: &TriMesh, outside: &[[bool; 2]]) -> Vec<Real> {
    let mut agreed: Vec<Option<Real>> = vec![None; mesh.vertices().len()];
    for (tri, [front, back]) in mesh.triangles().iter().zip(outside) {
        let here = Real::from(u8::from(*front)) - Real::from(u8::from(*back));
        for v in tri {
            let slot = &mut agreed[*v as usize];
            *slot = Some(slot.map_or(here, |before| if before == here { here } else { 0.0 }));
        }
    }
    agreed.into_iter().map(|o| o.unwrap_or(0.0)).collect()
}

/// For each triangle whether its front and its back are outside.
fn label_sides(
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
            let look = |direction: Vector| {
                for probe in PROBES {
                    let to = middle + direction * (probe * voxels.cell());
                    let seen = voxels.at(&to);
                    if seen == Voxel::Wall {
                        continue;
                    }
                    let covered = bvh.first_hit(&middle, &to, |other| {
                        !mesh.triangles()[other as usize].iter().any(|v| own.contains(v))
                    });
                    return if covered.is_some() { None } else { Some(seen) };
                }
                None
            };
            let (front, back) = (look(*normal), look(-normal));
            match (front, back) {
                (Some(Voxel::Outside), Some(Voxel::Outside)) => [true, false],
                (Some(Voxel::Outside), _) => [true, false],
                (_, Some(Voxel::Outside)) => [false, true],
                // Neither side sees the open: a pocket, unless nothing at all was seen.
                (None, None) => [true, false],
                _ => [false, false],
            }
        })
        .collect()
}

/// The union of closed layers, as one field: the clothed body that Appendix C corrects against.
///
/// The distance is exact outside; inside, it is the largest depth in any one layer, which is a
/// lower bound of the way out. It jumps across the caps that close a garment's openings.
#[derive(Debug)]
pub struct ClothedField<'a> {
    layers: Vec<&'a ClosedLayer>,
}

impl<'a> ClothedField<'a> {
    /// The union of `layers`.
    pub fn new(layers: Vec<&'a ClosedLayer>) -> Self {
        Self { layers }
    }
}

impl SignedDistance for ClothedField<'_> {
    fn distance(&self, p: &Point) -> Real {
        self.sample(p).distance
    }

    fn sample(&self, p: &Point) -> FieldSample {
        let mut best = FieldSample { distance: Real::INFINITY, gradient: Vector::zeros() };
        for layer in &self.layers {
            let reach =
                if best.distance.is_finite() { best.distance.max(0.0) } else { Real::INFINITY };
            if let Some(s) = layer.sided(p, reach)
                && s.distance < best.distance
            {
                best = FieldSample { distance: s.distance, gradient: s.normal };
            }
        }
        best
    }

    fn bounds(&self) -> Option<Aabb> {
        Some(self.layers.iter().fold(Aabb::EMPTY, |b, l| b.merged(&l.bvh.aabb())))
    }

    /// 1 where all layers are bodies; across the caps of garments the field jumps, and nothing
    /// bounds that.
    fn lipschitz(&self) -> Real {
        if self.layers.iter().all(|l| l.closure.is_none()) { 1.0 } else { Real::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ring of `n` quads between two profiles of (radius, height), front side outwards.
    fn lathe(profile: &[(Real, Real)], n: u32) -> TriMesh {
        let mut v = Vec::new();
        for &(r, y) in profile {
            for k in 0..n {
                let a = Real::from(k) / Real::from(n) * std::f64::consts::TAU;
                v.push(Point::new(r * a.sin(), y, r * a.cos()));
            }
        }
        let mut t = Vec::new();
        for row in 0..profile.len() as u32 - 1 {
            for k in 0..n {
                let (a, b) = (row * n + k, row * n + (k + 1) % n);
                t.push([a, b, b + n]);
                t.push([a, b + n, a + n]);
            }
        }
        TriMesh::new(v, t).unwrap()
    }

    /// A closed spindle of radius 0.1 and height 1.6.
    fn body() -> TriMesh {
        let rows: Vec<(Real, Real)> = (0..=40)
            .map(|k| {
                let u = Real::from(k) / 40.0;
                ((0.1 * (1.0 - (2.0 * u - 1.0).powi(8))).max(1e-4), 1.6 * u)
            })
            .collect();
        let open = lathe(&rows, 48);
        let (mut v, mut t) = (open.vertices().to_vec(), open.triangles().to_vec());
        let last = 40 * 48;
        v.push(Point::new(0.0, 0.0, 0.0));
        v.push(Point::new(0.0, 1.6, 0.0));
        let (bottom, top) = (v.len() as u32 - 2, v.len() as u32 - 1);
        for k in 0..48 {
            t.push([bottom, (k + 1) % 48, k]);
            t.push([top, last + k, last + (k + 1) % 48]);
        }
        let mesh = TriMesh::new(v, t).unwrap();
        assert!(mesh.signed_volume() > 0.0);
        mesh
    }

    fn check(layer: &ClosedLayer, cases: &[(Real, Real, Real)]) {
        for &(r, y, expected) in cases {
            for a in [0.1, 1.7, 4.0] {
                let p = Point::new(r * f64::sin(a), y, r * f64::cos(a));
                let got = layer.sided(&p, 0.5).map_or(Real::INFINITY, |s| s.distance);
                if expected < 0.0 {
                    assert!(got < 0.0, "({r}, {y}) should be inside, got {got}");
                } else {
                    assert!(got > 0.0, "({r}, {y}) should be outside, got {got}");
                }
            }
        }
    }

    #[test]
    fn a_flared_skirt_has_an_inside_down_to_its_hem() {
        let mesh = body();
        let solid = ClosedLayer::body(&mesh);
        let skirt = lathe(&[(0.32, 0.5), (0.25, 0.7), (0.18, 0.9), (0.12, 1.0)], 64);
        let layer = ClosedLayer::garment(&skirt, &solid, &mesh);
        check(
            &layer,
            &[
                (0.2, 0.6, -1.0),
                (0.15, 0.52, -1.0),
                (0.29, 0.6, 1.0),
                (0.2, 0.95, 1.0),
                (0.2, 0.4, 1.0),
                (0.11, 1.05, 1.0),
                (0.11, 0.99, -1.0),
                // Within a voxel of the sheet the triangle's label decides.
                (0.2833, 0.6, -1.0),
                (0.2867, 0.6, 1.0),
            ],
        );
        let s = layer.sided(&Point::new(0.0, 0.6, 0.28), 0.1).unwrap();
        assert!(s.normal.z > 0.8 && s.distance < -1e-3 && s.distance > -0.01);
    }

    #[test]
    fn a_folded_collar_is_part_of_the_inside_and_its_top_side_the_way_out() {
        let mesh = body();
        let solid = ClosedLayer::body(&mesh);
        // Up along the body, over a crease, and down again outside, 10 mm away: front becomes back.
        let collar = lathe(
            &[(0.12, 0.8), (0.115, 1.0), (0.112, 1.1), (0.117, 1.105), (0.122, 1.1), (0.128, 1.02)],
            64,
        );
        let layer = ClosedLayer::garment(&collar, &solid, &mesh);
        check(
            &layer,
            &[
                (0.14, 1.06, 1.0),
                (0.127, 1.06, 1.0),
                (0.118, 1.06, -1.0), // in the pocket
                (0.1145, 1.06, -1.0),
                (0.108, 1.05, -1.0), // between body and collar
                (0.13, 0.9, 1.0),
            ],
        );
        let s = layer.sided(&Point::new(0.0, 1.06, 0.118), 0.1).unwrap();
        assert!(
            s.normal.z > 0.9,
            "the way out of the pocket leads through the flap: {:?}",
            s.normal
        );
        assert!(layer.covered_triangles() > 0);
    }

    #[test]
    fn across_the_cap_of_a_skirt_the_field_jumps_and_says_so() {
        let mesh = body();
        let solid = ClosedLayer::body(&mesh);
        let skirt = lathe(&[(0.32, 0.5), (0.25, 0.7), (0.18, 0.9), (0.12, 1.0)], 64);
        let layer = ClosedLayer::garment(&skirt, &solid, &mesh);
        assert_eq!(ClothedField::new(vec![&solid]).lipschitz(), 1.0);
        let field = ClothedField::new(vec![&solid, &layer]);
        let [below, above] = [0.46, 0.54].map(|y| field.distance(&Point::new(0.2, y, 0.0)));
        assert!(below > 0.0 && above < 0.0 && below - above > 1.5 * 0.08, "{below} {above}");
        assert_eq!(field.lipschitz(), Real::INFINITY);
    }

    #[test]
    fn a_vertex_just_inside_is_found_whatever_the_reach() {
        let mesh = body();
        let solid = ClosedLayer::body(&mesh);
        let skirt = lathe(&[(0.32, 0.5), (0.25, 0.7), (0.18, 0.9), (0.12, 1.0)], 64);
        let layer = ClosedLayer::garment(&skirt, &solid, &mesh);
        for reach in [0.0, 1e-4, 0.01, 1.0] {
            let inside = layer.sided(&Point::new(0.0, 0.6, 0.2840), reach);
            assert!(inside.is_some_and(|s| s.distance < 0.0), "{reach}: {inside:?}");
            let outside = layer.sided(&Point::new(0.0, 0.6, 0.2865), reach);
            assert!(outside.is_none_or(|s| s.distance > 0.0), "{reach}: {outside:?}");
            let in_body = solid.sided(&Point::new(0.0, 0.8, 0.0995), reach);
            assert!(in_body.is_some_and(|s| s.distance < 0.0));
        }
    }

    #[test]
    fn the_union_of_layers_is_the_smaller_distance() {
        let mesh = body();
        let solid = ClosedLayer::body(&mesh);
        let skirt = lathe(&[(0.32, 0.5), (0.12, 1.0)], 64);
        let layer = ClosedLayer::garment(&skirt, &solid, &mesh);
        let both = ClothedField::new(vec![&solid, &layer]);
        let p = Point::new(0.0, 0.7, 0.4);
        assert_eq!(both.distance(&p), layer.sided(&p, 1.0).unwrap().distance);
        let q = Point::new(0.0, 1.3, 0.2);
        assert!(both.distance(&q) <= solid.sided(&q, 1.0).unwrap().distance);
        assert!(both.distance(&Point::new(0.0, 1.2, 0.0)) < 0.0);
    }

    #[test]
    fn a_point_deep_inside_a_body_is_inside_whatever_the_reach() {
        let solid = ClosedLayer::body(&body());
        let s = solid.sided(&Point::new(0.0, 0.8, 0.0), 1e-3).unwrap();
        assert!(s.distance < -0.09 && s.distance > -0.11);
        assert!(solid.sided(&Point::new(0.0, 0.8, 0.5), 0.1).is_none());
    }
}
