//! Alignment: transfers garments from one body to another.
//!
//! Garments are in the canonical pose of the body that they were made on. A [`BodyMap`] holds sites
//! all over the source body with their positions on the target body, and how the skin turns there. Any point
//! near the body follows the sites nearest to it:
//!
//! ```text
//! y  = Σ gᵢ (tᵢ + s Rᵢ (x − sᵢ)) / Σ gᵢ      over the k sites sᵢ nearest to x
//! gᵢ = exp(−(|x − sᵢ|² − d²) / 2σ²) (1 − |x − sᵢ|² / r²)² (floor + cos(weights of x, weights of sᵢ))
//! σ  = max(least width, growth · d),   d and r: distances of the nearest and of the k-th site
//! ```
//!
//! Near the body a point goes with the skin below, so that tight garments stay tight. Farther away
//! the sum averages over a patch as wide as the distance to the body, so that a coat or skirt
//! follows the body as a whole, without its details. The ease (the gap to the body) grows and shrinks
//! with the whole person, by s, the root of the ratio of the bodies' areas, and turns with the limb, by Rᵢ.
//! The skinning weights keep a sleeve with its arm where the arm is close to the trunk.
//!
//! Between two limbs the nearest sites are those of one and then of the other. What that stretches is
//! relaxed: cloth is as rigid as possible there, and held where the body is near ([`AlignParams::hold`]).
//!
//! The sites come from one [`Method`] of three: the vertices of two bodies with the same topology,
//! else a registration of one surface onto the other, else one similarity for all points.
//!
//! # Source
//!
//! Ours: a smooth field of rigid maps over the nearest sites, with a similarity as the fallback. The
//! paper aligns garments of several videos, but does not describe how.

mod field;
mod heading;
mod measure;
mod params;
mod register;
mod relax;
mod similarity;

pub use field::carried_field;
pub use measure::{AlignReport, inside, measure};
pub use params::{AlignError, AlignParams};
use similarity::Similarity;

use crate::skeleton::Skeleton;
use crate::skin_weights::SkinWeights;
use crate::skinning::Affine;
use crate::surface::{neighbours, turns};
use if_core::closest::ClosestPoint;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, area_vector};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::point_tree::PointTree;
use if_mesh::seams::weld_all;
use nalgebra::UnitQuaternion;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The input of alignment: a body in its canonical pose.
#[derive(Clone, Copy, Debug)]
pub struct BodyShape<'a> {
    /// Its closed surface, in metres.
    pub mesh: &'a TriMesh,
    /// The weights of its vertices.
    pub skin: Option<&'a SkinWeights>,
    /// A mesh of the same body in a topology that other bodies share, such as MakeHuman's, and its
    /// weights.
    pub template: Option<(&'a TriMesh, Option<&'a SkinWeights>)>,
    /// Its joints.
    pub skeleton: Option<&'a Skeleton>,
}

/// How points of one body correspond to points of the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Method {
    /// The bodies are equal: nothing moves.
    Same,
    /// Two meshes with the same topology, vertex by vertex.
    Topology,
    /// Non-rigid registration of the source's surface onto the target's.
    Registered,
    /// One rotation, scale and translation for all points.
    Similarity,
}

/// Maps points near one body to corresponding points near another.
#[derive(Clone, Debug)]
pub struct BodyMap {
    kind: Kind,
    method: Method,
    residual: Real,
    most_turned: Option<(String, Real)>,
    params: AlignParams,
}

#[derive(Clone, Debug)]
enum Kind {
    Same,
    Similar(Similarity),
    Sites(Box<Sites>),
}

#[derive(Clone, Debug)]
struct Sites {
    /// How a point goes with each site.
    maps: Vec<Affine>,
    /// The vertex of the source body that each site is.
    vertices: Vec<u32>,
    skin: Option<SkinWeights>,
    tree: PointTree,
    /// The source body.
    surface: Bvh,
    /// Scale of the bodies.
    scale: Real,
}

impl BodyMap {
    /// The map from the body `from` to the body `to`.
    ///
    /// # Errors
    ///
    /// Parameters out of range, bodies without triangles or height, or weights for another number of
    /// vertices.
    pub fn new(from: &BodyShape, to: &BodyShape, params: &AlignParams) -> Result<Self, AlignError> {
        params.validate()?;
        check_body(from, "source")?;
        check_body(to, "target")?;
        let similarity = Similarity::between(from, to)?;
        let most_turned = similarity::most_turned(from, to, &similarity);
        let params = *params;
        let map = |kind, method, residual| Self { kind, method, residual, most_turned, params };
        // The methods in order: equal bodies, shared topology, registration, similarity.
        if from.mesh == to.mesh {
            return Ok(map(Kind::Same, Method::Same, 0.0));
        }
        let templates = from.template.zip(to.template).map(|((s, skin), (t, _))| (s, skin, t));
        for (source, skin, target) in templates.into_iter().chain([(from.mesh, from.skin, to.mesh)])
        {
            if share_topology(source, target) {
                let kind = sites(source, target.vertices(), skin);
                return Ok(map(kind, Method::Topology, 0.0));
            }
        }
        let similarity = similarity.faced(from, to);
        let start = similarity::start(from, to, &similarity);
        let registered = register::register(from.mesh, to.mesh, start);
        if registered.is_good(&params, to.mesh) {
            let kind = sites(from.mesh, &registered.positions, from.skin);
            return Ok(map(kind, Method::Registered, registered.residual));
        }
        let residual =
            register::residual(from.mesh.vertices().iter().map(|p| similarity.point(p)), to.mesh);
        Ok(map(Kind::Similar(similarity), Method::Similarity, residual))
    }

    /// The fallback: one similarity for all points.
    ///
    /// # Errors
    ///
    /// As [`BodyMap::new`].
    pub fn similar(
        from: &BodyShape,
        to: &BodyShape,
        params: &AlignParams,
    ) -> Result<Self, AlignError> {
        params.validate()?;
        check_body(from, "source")?;
        check_body(to, "target")?;
        let similarity = Similarity::between(from, to)?.faced(from, to);
        let residual =
            register::residual(from.mesh.vertices().iter().map(|p| similarity.point(p)), to.mesh);
        let most_turned = similarity::most_turned(from, to, &similarity);
        Ok(Self {
            kind: Kind::Similar(similarity),
            method: Method::Similarity,
            residual,
            most_turned,
            params: *params,
        })
    }

    /// The name of the bone that points the farthest from where that of the same name on the target does, and the
    /// angle in radians, once both bodies face the same way: large where they stand in different poses.
    /// `None` without skeletons that have long bones in common.
    pub fn most_turned(&self) -> Option<(&str, Real)> {
        self.most_turned.as_ref().map(|(name, angle)| (name.as_str(), *angle))
    }

    /// The method that was used.
    pub fn method(&self) -> Method {
        self.method
    }

    /// Mean distance of the mapped source vertices from the target's surface, in metres; zero for a
    /// shared topology.
    pub fn residual(&self) -> Real {
        self.residual
    }

    /// Maps points near the source body to the target; `skin` are their weights, if known.
    ///
    /// # Errors
    ///
    /// The weights are for another number of points.
    pub fn map_points(
        &self,
        points: &[Point],
        skin: Option<&SkinWeights>,
    ) -> Result<Vec<Point>, AlignError> {
        skin.map_or(Ok(()), |skin| skin.check_len(points.len()))?;
        let one = |found: &mut Vec<(Real, u32)>, (v, p): (usize, &Point)| match &self.kind {
            Kind::Same => *p,
            Kind::Similar(similarity) => similarity.point(p),
            Kind::Sites(sites) => sites.point(p, skin.map(|s| (s, v)), &self.params, found),
        };
        Ok(points.par_iter().enumerate().with_min_len(256).map_init(Vec::new, one).collect())
    }

    /// The garment on the target body, with the same triangles: mapped, then relaxed.
    ///
    /// # Errors
    ///
    /// The weights are for another number of vertices, a position is not finite, or what the map stretches
    /// cannot be relaxed, for lack of memory.
    pub fn align(
        &self,
        garment: &TriMesh,
        skin: Option<&SkinWeights>,
    ) -> Result<TriMesh, AlignError> {
        let mut moved = self.map_points(garment.vertices(), skin)?;
        if let Kind::Sites(sites) = &self.kind {
            let (points, distances) = (&moved[..], &sites.distances(garment.vertices())[..]);
            let mapped = relax::Mapped { points, distances, scale: sites.scale };
            moved = relax::relaxed(garment, &mapped, &self.params)?;
        }
        Ok(garment.with_vertices(moved)?)
    }
}

/// Checks that a body is a surface, and that its weights match it.
fn check_body(body: &BodyShape, which: &'static str) -> Result<(), AlignError> {
    let of_template = body.template.into_iter();
    for (mesh, skin) in of_template.chain([(body.mesh, body.skin)]) {
        if mesh.triangles().is_empty() {
            return Err(AlignError::NoSurface { which });
        }
        skin.map_or(Ok(()), |skin| skin.check_len(mesh.vertices().len()))?;
    }
    Ok(())
}

/// Least share of common edges of two meshes with the same topology. Quads may be split along
/// either diagonal, which leaves 93 % of the edges of MakeHuman's bodies; a mesh with other vertex
/// numbers shares almost none.
const SHARED_EDGES: Real = 0.8;

/// Whether vertex k of one mesh corresponds to vertex k of the other.
fn share_topology(a: &TriMesh, b: &TriMesh) -> bool {
    if a.vertices().len() != b.vertices().len() || a.triangles().is_empty() {
        return false;
    }
    if a.triangles() == b.triangles() {
        return true;
    }
    let sorted = |mesh: &TriMesh| {
        let mut edges = Edges::new(mesh).vertices;
        edges.sort_unstable();
        edges
    };
    let (a, b) = (sorted(a), sorted(b));
    let common = a.iter().filter(|e| b.binary_search(e).is_ok()).count();
    common as Real >= SHARED_EDGES * a.len().max(b.len()) as Real
}

/// Every vertex of the surface `from`, those at one position as one, and the same surface with its vertices at
/// `to`.
fn sites(from: &TriMesh, to: &[Point], skin: Option<&SkinWeights>) -> Kind {
    let welded = weld_all(from);
    let (sewn, vertices) = match &welded {
        Some(welded) => (&welded.mesh, welded.first_of()),
        None => (from, (0..from.vertices().len() as u32).collect()),
    };
    let to: Vec<Point> = vertices.iter().map(|v| to[*v as usize]).collect();
    let neighbours = neighbours(to.len(), &Edges::new(sewn).vertices);
    let scale = scale(sewn, &to);
    let map = |((from, to), turn): ((&Point, &Point), UnitQuaternion<Real>)| {
        Affine::through(turn.to_rotation_matrix().into_inner() * scale, from, to)
    };
    let turns = turns(sewn, &neighbours, &to);
    let maps = sewn.vertices().iter().zip(&to).zip(turns).map(map).collect();
    let (tree, surface) = (PointTree::new(sewn.vertices()), Bvh::new(sewn));
    Kind::Sites(Box::new(Sites { maps, vertices, skin: skin.cloned(), tree, surface, scale }))
}

/// By how much the surface grows when its vertices go to `to`: the root of the ratio of the areas. Limbs that
/// spread do not change it.
fn scale(from: &TriMesh, to: &[Point]) -> Real {
    let area = |x: &[Point]| -> Real {
        let of = |t: &[u32; 3]| t.map(|v| x[v as usize]);
        from.triangles().iter().map(of).map(|[a, b, c]| area_vector(&a, &b, &c).norm()).sum()
    };
    let ratio = area(to) / area(from.vertices());
    if ratio > 0.0 && ratio.is_finite() { ratio.sqrt() } else { 1.0 }
}

impl Sites {
    fn point(
        &self,
        p: &Point,
        skin: Option<(&SkinWeights, usize)>,
        params: &AlignParams,
        found: &mut Vec<(Real, u32)>,
    ) -> Point {
        self.tree.nearest(p, params.neighbours, found);
        let (Some(&(near, nearest)), Some(&(far, _))) = (found.first(), found.last()) else {
            return *p;
        };
        let width = params.least_width.max(params.growth * near.sqrt());
        let (mut sum, mut total) = (Vector::zeros(), 0.0);
        for &(d2, site) in found.iter() {
            let site = site as usize;
            let edge = if far > 0.0 { 1.0 - d2 / far } else { 1.0 };
            let similar = match (&self.skin, skin) {
                (Some(own), Some((skin, v))) => {
                    params.skin_floor + cosine(own, self.vertices[site] as usize, skin, v)
                }
                _ => 1.0,
            };
            let g = (-(d2 - near) / (2.0 * width * width)).exp() * edge * edge * similar;
            sum += self.maps[site].point(p).coords * g;
            total += g;
        }
        // If all sites are at the same distance, the kernel is zero at all of them.
        if total > 0.0 { Point::from(sum / total) } else { self.maps[nearest as usize].point(p) }
    }

    /// Distances of points from the source body, in metres.
    fn distances(&self, points: &[Point]) -> Vec<Real> {
        let of = |p: &Point| self.surface.closest(p, Real::INFINITY).map_or(0.0, |c| c.distance);
        points.par_iter().with_min_len(256).map(of).collect()
    }
}

/// Cosine of two records of weights: 1 for equal weights, 0 if they share no joint.
fn cosine(a: &SkinWeights, i: usize, b: &SkinWeights, j: usize) -> Real {
    let (ja, wa, jb, wb) = (a.joints()[i], a.weights()[i], b.joints()[j], b.weights()[j]);
    let square = |w: [f32; 4]| w.iter().map(|x| Real::from(x * x)).sum::<Real>();
    let mut dot = 0.0;
    for p in 0..4 {
        for q in 0..4 {
            if ja[p] == jb[q] {
                dot += Real::from(wa[p] * wb[q]);
            }
        }
    }
    let scale = (square(wa) * square(wb)).sqrt();
    if scale > 0.0 { (dot / scale).min(1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests;
