//! A closed surface from a body as it comes: open at the neck or under the clothes, with pinholes,
//! in several parts, inside out, or intersecting itself.
//!
//! The given triangles stay what distances are measured to. Only the *side* of a point needs a
//! closed surface:
//!
//! ```text
//! merge   vertices at one place along boundaries; drop repeated triangles
//! turn    triangles that wind against their neighbours, then parts of negative volume
//! sheets  open parts whose openings are as large as they are (lashes, hair) have no inside
//! holes   up to 1/50 of the height are filled with smooth patches, which count as skin
//! caps    close larger openings, and only bound the inside
//! islands pieces of skin without an inside beside an opening have a front, and a shallow inside
//! union   of all parts: triangles with the inside on both sides are hidden
//!
//! side(p) = inside if the nearest skin faces away from p, and no cap is nearer than that skin;
//!           near intersections of the body with itself, if the winding number of p is 1/2 or more
//! ```
//!
//! So a cap never attracts or pushes anything: a point that is nearer to a cap than to the skin is
//! outside, at its distance from the skin. A boundary edge of an opening is an obstacle like a hem,
//! not a side.
//!
//! # Source
//!
//! Winding numbers of triangle soups: Jacobson et al. 2013, Barill et al. 2018. Patches: Liepa
//! 2003. Pseudo-normals: Bærentzen and Aanæs 2005.

mod boundary;
mod lids;
mod merge;
mod report;
mod survey;
#[cfg(test)]
mod tests;
mod union;

pub(crate) use merge::with_triangles;
pub use report::{BodyReport, Hole, NoInside};

use crate::index::Bvh;
use crate::intersections::own_pairs;
use crate::inverted::NO_VOLUME;
use crate::pseudo_normals::PseudoNormals;
use crate::winding::Winding;
use if_core::closest::{Closest, ClosestPoint};
use if_core::edges::{Edges, parts};
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;
use lids::{Surroundings, add, fan};
use survey::{Part, Survey};
use union::{INSIDE, Union};

/// The closed surface of a body that is not one closed part itself, or intersects itself.
#[derive(Clone, Debug)]
pub struct BodySurface {
    /// Skin, then caps.
    closed: TriMesh,
    /// Of all triangles.
    winding: Winding,
    /// Of the skin with its hidden parts.
    normals: PseudoNormals,
    /// Skin that is not hidden, with the numbers of its triangles.
    skin: (Bvh, Vec<u32>),
    /// Caps that are not hidden, with the numbers of their triangles.
    caps: (Bvh, Vec<u32>),
    union: Option<SelfIntersecting>,
    /// The first triangle of the skin that is of an island.
    islands_from: usize,
    /// Depth up to which a point behind an island is inside, in metres.
    island_depth: Real,
    /// For each triangle of the skin a given one: itself, or one at the hole that it fills.
    given_of: Vec<u32>,
    /// For each given triangle one of the skin; `None` if it is hidden or of a sheet.
    skin_of: Vec<Option<u32>>,
    /// For each given vertex its unit normal; zero if it is hidden or of a sheet.
    vertex_normals: Vec<Vector>,
    report: BodyReport,
}

/// A body that intersects itself.
#[derive(Clone, Debug)]
struct SelfIntersecting {
    /// Triangles of the skin where pseudo-normals may err.
    unsure: Vec<bool>,
    /// The others, with their numbers.
    sure: (Bvh, Vec<u32>),
}

/// Where a point lies relative to a [`BodySurface`].
pub(crate) struct BodySide {
    /// The nearest point of the skin, or of the skin that leads out, with a triangle of the skin.
    pub(crate) near: Closest,
    pub(crate) inside: bool,
    /// Whether the point lies on the back of that triangle.
    pub(crate) behind: bool,
}

/// Whether the mesh is a body without any assumption: one closed part, wound outwards, that encloses more
/// than rounding does between the two copies of a sheet.
pub fn is_closed(mesh: &TriMesh, edges: &Edges) -> bool {
    let least = NO_VOLUME * mesh.area().powf(1.5);
    if edges.balance(mesh).iter().any(|b| *b != 0) || mesh.signed_volume() <= least {
        return false;
    }
    is_one_part(mesh, &parts(mesh))
}

/// Whether all triangles are of one part; `part_of` is that of each vertex.
fn is_one_part(mesh: &TriMesh, part_of: &[u32]) -> bool {
    let mut roots = mesh.triangles().iter().map(|t| part_of[t[0] as usize]);
    let first = roots.next();
    roots.all(|root| Some(root) == first)
}

/// The body with all triangles wound outwards, each in its place. `None` if they are, and for what has
/// no inside. Triangles that repeat others, and sheets, stay as they are.
pub fn turned_outwards(mesh: &TriMesh) -> Option<TriMesh> {
    if is_closed(mesh, &Edges::new(mesh)) {
        return None;
    }
    let survey = Survey::new(mesh).ok()?;
    if survey.report.turned_triangles == 0 && survey.report.turned_parts == 0 {
        return None;
    }
    let mut triangles = mesh.triangles().to_vec();
    for (turned, given) in survey.mesh.triangles().iter().zip(&survey.given) {
        let corners = &mut triangles[*given as usize];
        let [a, b, c] = corners.map(|v| survey.first[v as usize]);
        if ![[a, b, c], [b, c, a], [c, a, b]].contains(turned) {
            corners.swap(1, 2);
        }
    }
    Some(merge::with_triangles(mesh, triangles))
}

/// Numbers of the triangles of `mesh`, without the parts that are hidden in others, such as eyes in a head, and
/// without sheets, such as lashes; ascending. `None` if there are none, and for what has no inside.
pub fn without_hidden_parts(mesh: &TriMesh) -> Option<Vec<u32>> {
    let part_of = parts(mesh);
    if is_one_part(mesh, &part_of) {
        return None;
    }
    let part = |t: &[u32; 3]| part_of[t[0] as usize] as usize;
    let surface = BodySurface::new(mesh, &Edges::new(mesh)).ok()??;
    let mut is_skin = vec![false; part_of.len()];
    for (t, skin) in mesh.triangles().iter().zip(&surface.skin_of) {
        is_skin[part(t)] |= skin.is_some();
    }
    let kept = (0..).zip(mesh.triangles()).filter(|(_, t)| is_skin[part(t)]);
    let kept: Vec<u32> = kept.map(|(t, _)| t).collect();
    (kept.len() < mesh.triangles().len()).then_some(kept)
}

/// Checks that a mesh can be a body.
///
/// # Errors
///
/// It has no inside, such as a plane, a folded sheet, or a garment.
pub fn check(mesh: &TriMesh) -> Result<(), NoInside> {
    if is_closed(mesh, &Edges::new(mesh)) { Ok(()) } else { Survey::new(mesh).map(drop) }
}

impl BodySurface {
    /// Closes `mesh`, whose edges are `edges`. `None` if it is closed ([`is_closed`]) and does not
    /// intersect itself: its own normals tell sides then.
    ///
    /// # Errors
    ///
    /// It has no inside.
    pub fn new(mesh: &TriMesh, edges: &Edges) -> Result<Option<Self>, NoInside> {
        if is_closed(mesh, edges) && own_pairs(mesh, &Bvh::new(mesh)).is_empty() {
            return Ok(None);
        }
        Survey::new(mesh).map(|s| Some(s.close()))
    }

    /// What was assumed.
    pub fn report(&self) -> &BodyReport {
        &self.report
    }

    /// The closed surface: given triangles, patches and caps. Its first vertices are the given ones.
    pub fn closed(&self) -> &TriMesh {
        &self.closed
    }

    /// The skin: what distances are measured to.
    pub fn skin(&self) -> &Bvh {
        &self.skin.0
    }

    /// Whether parts of the body are not there: an opening is not filled.
    pub fn is_incomplete(&self) -> bool {
        self.report.openings().next().is_some()
    }

    /// Whether `p` is inside, caps included.
    pub fn contains(&self, p: &Point) -> bool {
        self.winding.at(p) >= INSIDE
    }

    /// Normals of the skin.
    pub(crate) fn normals(&self) -> &PseudoNormals {
        &self.normals
    }

    /// Unit normal of the given vertex `v`; zero if it is hidden or of a sheet.
    pub(crate) fn vertex_normal(&self, v: usize) -> Vector {
        self.vertex_normals[v]
    }

    /// The given triangle that stands for triangle `t` of the skin.
    pub(crate) fn given_triangle(&self, t: u32) -> u32 {
        self.given_of[t as usize]
    }

    /// Corners of a triangle of the skin for the given triangle `t`, if there is one.
    pub(crate) fn corners(&self, t: u32) -> Option<[&Point; 3]> {
        self.skin_of[t as usize].map(|t| self.closed.corners(t as usize))
    }

    /// The nearest point of the skin to `p` within `reach`, whether `p` is inside of what any part encloses, caps
    /// left out, and whether it lies on the back of the triangle there.
    pub(crate) fn nearest(&self, p: &Point, reach: Real) -> Option<(Closest, bool, bool)> {
        let near = closest(&self.skin, p, reach)?;
        let behind = self.normals.side(p, &near) < 0.0;
        let inside = match self.unsure_at(&near) {
            Some(_) => self.contains(p),
            None => behind && !self.normals.is_boundary(&near),
        };
        Some((near, inside, behind))
    }

    /// The union, if pseudo-normals may err at this point of the skin.
    fn unsure_at(&self, near: &Closest) -> Option<&SelfIntersecting> {
        let union = self.union.as_ref()?;
        let is_unsure = union.unsure[near.triangle as usize] || self.normals.is_boundary(near);
        is_unsure.then_some(union)
    }

    /// The side of `p`, if skin is within `reach`.
    pub(crate) fn side(&self, p: &Point, reach: Real) -> Option<BodySide> {
        let reach = if self.has_islands() { reach.max(self.island_depth) } else { reach };
        let (near, inside, behind) = self.nearest(p, reach)?;
        let is_island = near.triangle as usize >= self.islands_from;
        let is_open = || match is_island {
            true => near.distance > self.island_depth,
            false => self.is_nearer_to_cap(p, near.distance),
        };
        if !inside || is_open() {
            return Some(BodySide { near, inside: false, behind });
        }
        let out = match self.unsure_at(&near) {
            // Inside one part the nearest skin may be that of another part, and lead nowhere.
            Some(union) if !behind || self.is_covered(&near) => {
                closest(&union.sure, p, Real::INFINITY).unwrap_or(near)
            }
            _ => near,
        };
        Some(BodySide { near: out, inside: true, behind })
    }

    /// Whether a cap is within `distance` of `p`, where it separates the inside from the outside.
    fn is_nearer_to_cap(&self, p: &Point, distance: Real) -> bool {
        let Some(cap) = self.caps.0.closest(p, distance) else { return false };
        if self.union.is_none() {
            return true;
        }
        let [a, b, c] = self.closed.corners(self.caps.1[cap.triangle as usize] as usize);
        let front = unit_or_zero(&area_vector(a, b, c)) * self.beside();
        !self.contains(&(cap.point + front))
    }

    /// Whether there are pieces of skin beside openings.
    pub(crate) fn has_islands(&self) -> bool {
        self.report.islands > 0
    }

    fn beside(&self) -> Real {
        BESIDE * self.skin.0.aabb().size().max()
    }

    /// Whether the inside is on both sides of a nearest point.
    fn is_covered(&self, near: &Closest) -> bool {
        self.contains(&(near.point + self.normals.face(near.triangle) * self.beside()))
    }
}

/// Distance beyond a nearest point at which its front is evaluated, as a share of the longest side:
/// 2 µm for a person.
const BESIDE: Real = 1e-6;

/// Depth up to which a point behind an island is inside, as a share of the longest side: 16 mm for
/// a person, as deep as tight clothes lie in the skin.
const ISLAND_DEPTH: Real = 0.01;

fn closest((bvh, numbers): &(Bvh, Vec<u32>), p: &Point, reach: Real) -> Option<Closest> {
    let mut near = bvh.closest(p, reach)?;
    near.triangle = numbers[near.triangle as usize];
    Some(near)
}

/// The triangles of `mesh` that are kept, with their numbers.
fn index(mesh: &TriMesh, keep: impl Fn(usize) -> bool) -> (Bvh, Vec<u32>) {
    let numbers: Vec<u32> =
        (0..mesh.triangles().len() as u32).filter(|t| keep(*t as usize)).collect();
    let triangles = numbers.iter().map(|t| mesh.triangles()[*t as usize]).collect();
    (Bvh::new(&merge::with_triangles(mesh, triangles)), numbers)
}

/// Counts what the `union` of closed parts hides: whole parts, or triangles of others. `kept` are the
/// triangles of parts with an inside.
fn count_hidden(
    union: &Union,
    kept: &[usize],
    (parts, part_of): (&[Part], &[u32]),
    report: &mut BodyReport,
) {
    report.own_pairs = union.own_pairs;
    let mut hidden_in = vec![0; parts.len()];
    for (k, t) in kept.iter().enumerate() {
        hidden_in[part_of[*t] as usize] += usize::from(union.hidden[k]);
    }
    for (part, hidden) in parts.iter().zip(hidden_in).filter(|(part, _)| part.has_inside) {
        if hidden == part.triangles {
            report.inner_parts += 1;
        } else {
            report.hidden_triangles += hidden;
        }
    }
}

impl Survey {
    /// Closes all parts with an inside.
    fn close(self) -> BodySurface {
        let Self { mesh, given, given_count, first, parts, part_of, loops, mut report } = self;
        let solid = |t: &usize| parts[part_of[*t] as usize].has_inside;
        let kept: Vec<usize> = (0..mesh.triangles().len()).filter(solid).collect();
        let mut given_of: Vec<u32> = kept.iter().map(|t| given[*t]).collect();
        let mut skin: Vec<[u32; 3]> = kept.iter().map(|t| mesh.triangles()[*t]).collect();
        let mut vertices = mesh.vertices().to_vec();
        let surroundings = Surroundings::new(&mesh);
        let mut caps: Vec<[u32; 3]> = Vec::new();
        for l in &loops {
            let rim = surroundings.rim(&l.vertices);
            let lid = if l.is_hole { rim.smooth_lid() } else { rim.plain_lid() };
            let lid = lid.unwrap_or_else(|| fan(&rim.points));
            let added = add(&mut vertices, &l.vertices, &lid);
            if l.is_hole {
                let beside = given[surroundings.triangle_beside(&l.vertices) as usize];
                given_of.resize(given_of.len() + added.len(), beside);
                skin.extend(added);
            } else {
                caps.extend(added);
            }
        }
        let islands_from = skin.len();
        let solid = [&skin[..], &caps].concat();
        for t in (0..mesh.triangles().len()).filter(|t| parts[part_of[*t] as usize].is_island) {
            skin.push(mesh.triangles()[t]);
            given_of.push(given[t]);
        }
        let n = skin.len();
        let all = [&skin[..], &caps].concat();
        let mesh_of = |triangles| {
            TriMesh::new(vertices.clone(), triangles).expect("corners of lids are distinct")
        };
        let (closed, skin) = (mesh_of(all), mesh_of(skin));
        let winding = Winding::new(&mesh_of(solid));
        let edges = Edges::new(&skin);
        let boxes: Vec<_> = parts.iter().filter(|p| p.has_inside).map(|p| p.aabb).collect();
        let union = Union::new(&closed, &skin, &edges, &winding, &boxes);
        let hidden = |t: usize| union.as_ref().is_some_and(|u| u.hidden[t]);
        if let Some(union) = &union {
            count_hidden(union, &kept, (&parts, &part_of), &mut report);
        }
        let normals = PseudoNormals::new(&skin, &edges);
        let mut skin_of = vec![None; given_count];
        let mut is_skin = vec![false; vertices.len()];
        for t in (0..n).filter(|t| !hidden(*t)) {
            skin.triangles()[t].iter().for_each(|v| is_skin[*v as usize] = true);
            skin_of[given_of[t] as usize].get_or_insert(t as u32);
        }
        let normal = |v: &u32| {
            if is_skin[*v as usize] { *normals.vertex(*v) } else { Vector::zeros() }
        };
        let vertex_normals = first.iter().map(normal).collect();
        BodySurface {
            skin: index(&skin, |t| !hidden(t)),
            caps: index(&closed, |t| t >= n && !hidden(t)),
            islands_from,
            island_depth: ISLAND_DEPTH * mesh.surface_aabb().size().max(),
            union: union.as_ref().map(|u| SelfIntersecting {
                sure: index(&skin, |t| !u.hidden[t] && !u.unsure[t]),
                unsure: u.unsure.clone(),
            }),
            closed,
            winding,
            normals,
            given_of,
            skin_of,
            vertex_normals,
            report,
        }
    }
}
