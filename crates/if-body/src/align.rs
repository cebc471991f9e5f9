//! Garments from one body onto another.
//!
//! All garments hang in the canonical pose of the body that they were made on (one that was seen in
//! another pose is brought there by [`unposed`]). What differs is the body. A [`BodyMap`] knows for
//! sites all over the source body where they are on the target body, and carries any point near it
//! along:
//!
//! ```text
//! y = x + u(x),   u(x) = Σ gᵢ (tᵢ − sᵢ) / Σ gᵢ      over the k sites sᵢ nearest to x
//! gᵢ = exp(−(|x − sᵢ|² − d²) / 2σ²) (1 − |x − sᵢ|² / r²)² (floor + cos(weights of x, weights of sᵢ))
//! σ  = max(least width, growth · d),   d and r: distances of the nearest and of the k-th site
//! ```
//!
//! Near the body u is that of the skin below, so that what is tight stays as tight. Farther off the
//! sum runs over a patch as wide as the garment stands off, so that a coat or a skirt follows the
//! body as a whole and is not crumpled by its details. The ease (the gap to the body) is kept in
//! metres and not scaled. The skinning weights keep a sleeve to its arm where that is close to the
//! trunk.
//!
//! Where the sites come from is a [`Method`]: the same vertices of two bodies of one topology, else
//! a registration of one surface onto the other, else one similarity for all.
//!
//! # Source
//!
//! Ours: a smooth field of offsets over the nearest sites, with a similarity as the fallback. The
//! paper says that garments of several videos are aligned, and not how.

mod field;
mod measure;
mod params;
mod register;
mod similarity;

pub use field::carried_field;
pub use measure::{AlignReport, inside, measure};
pub use params::{AlignError, AlignParams};
pub use similarity::Similarity;

use crate::skeleton::Skeleton;
use crate::skin_weights::SkinWeights;
use crate::skinning::{blends, unpose_points};
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_mesh::point_tree::PointTree;
use nalgebra::Isometry3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// A body as alignment needs it, in its canonical pose.
#[derive(Clone, Copy, Debug)]
pub struct BodyShape<'a> {
    /// Its closed surface, in metres.
    pub mesh: &'a TriMesh,
    /// The weights of its vertices.
    pub skin: Option<&'a SkinWeights>,
    /// A mesh of the same body whose vertices mean the same on every body, such as MakeHuman's, and
    /// its weights.
    pub template: Option<(&'a TriMesh, Option<&'a SkinWeights>)>,
    /// Its joints.
    pub skeleton: Option<&'a Skeleton>,
}

/// How it is known where the points of one body are on the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The bodies are the same: nothing moves.
    Same,
    /// Two meshes of one topology: vertex by vertex.
    Topology,
    /// The source's surface was bent onto the target's.
    Registered,
    /// One rotation, scale and translation for all points.
    Similarity,
}

/// Carries points near one body to where they are on another.
#[derive(Clone, Debug)]
pub struct BodyMap {
    kind: Kind,
    method: Method,
    residual: Real,
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
    offsets: Vec<Vector>,
    skin: Option<SkinWeights>,
    tree: PointTree,
}

impl BodyMap {
    /// Finds out where the points of `from` are on `to`.
    ///
    /// # Errors
    ///
    /// Parameters out of range, bodies without triangles or extent, or with weights for another
    /// number of vertices.
    pub fn new(from: &BodyShape, to: &BodyShape, params: &AlignParams) -> Result<Self, AlignError> {
        params.validate()?;
        checked(from, "source")?;
        checked(to, "target")?;
        let map = |kind, method, residual| Self { kind, method, residual, params: *params };
        if from.mesh == to.mesh {
            return Ok(map(Kind::Same, Method::Same, 0.0));
        }
        let templates = from.template.zip(to.template).map(|((s, skin), (t, _))| (s, skin, t));
        for (source, skin, target) in templates.into_iter().chain([(from.mesh, from.skin, to.mesh)])
        {
            if share_topology(source, target) {
                let kind = sites(source.vertices(), target.vertices(), skin);
                return Ok(map(kind, Method::Topology, 0.0));
            }
        }
        let similarity = Similarity::between(from, to)?;
        let start = similarity::start(from, to, &similarity);
        let registered = register::register(from.mesh, to.mesh, start);
        if registered.is_good(params, to.mesh) {
            let kind = sites(from.mesh.vertices(), &registered.positions, from.skin);
            return Ok(map(kind, Method::Registered, registered.residual));
        }
        let residual =
            register::residual(from.mesh.vertices().iter().map(|p| similarity.point(p)), to.mesh);
        Ok(map(Kind::Similar(similarity), Method::Similarity, residual))
    }

    /// The fallback alone: one similarity for all points.
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
        checked(from, "source")?;
        checked(to, "target")?;
        let similarity = Similarity::between(from, to)?;
        let residual =
            register::residual(from.mesh.vertices().iter().map(|p| similarity.point(p)), to.mesh);
        Ok(Self {
            kind: Kind::Similar(similarity),
            method: Method::Similarity,
            residual,
            params: *params,
        })
    }

    /// How it knows.
    pub fn method(&self) -> Method {
        self.method
    }

    /// Mean distance of the source's vertices, where they are taken, from the target's surface, in
    /// metres. Zero where they are its vertices.
    pub fn residual(&self) -> Real {
        self.residual
    }

    /// Where points near the source body are on the target; `skin` are their weights, where they
    /// have some.
    ///
    /// # Errors
    ///
    /// Weights for another number of points.
    pub fn carry(
        &self,
        points: &[Point],
        skin: Option<&SkinWeights>,
    ) -> Result<Vec<Point>, AlignError> {
        if let Some(skin) = skin
            && skin.len() != points.len()
        {
            return Err(AlignError::SkinCount { points: points.len(), records: skin.len() });
        }
        let one = |found: &mut Vec<(Real, u32)>, (v, p): (usize, &Point)| match &self.kind {
            Kind::Same => *p,
            Kind::Similar(similarity) => similarity.point(p),
            Kind::Sites(sites) => p + sites.offset(p, skin.map(|s| (s, v)), &self.params, found),
        };
        Ok(points.par_iter().enumerate().with_min_len(256).map_init(Vec::new, one).collect())
    }

    /// The garment on the target body: the same triangles.
    ///
    /// # Errors
    ///
    /// Weights for another number of vertices, or a position that is no number.
    pub fn align(
        &self,
        garment: &TriMesh,
        skin: Option<&SkinWeights>,
    ) -> Result<TriMesh, AlignError> {
        let moved = self.carry(garment.vertices(), skin)?;
        garment.with_vertices(moved).map_err(AlignError::Mesh)
    }
}

/// Refuses a body that is no surface, or whose weights are those of another one.
fn checked(body: &BodyShape, which: &'static str) -> Result<(), AlignError> {
    let of_template = body.template.into_iter();
    for (mesh, skin) in of_template.chain([(body.mesh, body.skin)]) {
        if mesh.triangles().is_empty() {
            return Err(AlignError::NoSurface { which });
        }
        if let Some(skin) = skin
            && skin.len() != mesh.vertices().len()
        {
            return Err(AlignError::SkinCount {
                points: mesh.vertices().len(),
                records: skin.len(),
            });
        }
    }
    Ok(())
}

/// Share of edges that two meshes of as many vertices have in common at least to be taken for one
/// topology: quads are parted along either diagonal, which leaves 93 % of the edges of MakeHuman's
/// bodies, and a mesh whose vertices are numbered otherwise shares next to none.
const SHARED_EDGES: Real = 0.8;

/// Whether vertex k of one mesh means what vertex k of the other does.
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

fn sites(from: &[Point], to: &[Point], skin: Option<&SkinWeights>) -> Kind {
    let offsets = from.iter().zip(to).map(|(a, b)| b - a).collect();
    Kind::Sites(Box::new(Sites { offsets, skin: skin.cloned(), tree: PointTree::new(from) }))
}

impl Sites {
    fn offset(
        &self,
        p: &Point,
        skin: Option<(&SkinWeights, usize)>,
        params: &AlignParams,
        found: &mut Vec<(Real, u32)>,
    ) -> Vector {
        self.tree.nearest(p, params.neighbours, found);
        let (Some(&(near, nearest)), Some(&(far, _))) = (found.first(), found.last()) else {
            return Vector::zeros();
        };
        let width = params.least_width.max(params.growth * near.sqrt());
        let (mut sum, mut total) = (Vector::zeros(), 0.0);
        for &(d2, site) in found.iter() {
            let edge = if far > 0.0 { 1.0 - d2 / far } else { 1.0 };
            let alike = match (&self.skin, skin) {
                (Some(own), Some((skin, v))) => {
                    params.skin_floor + alike(own, site as usize, skin, v)
                }
                _ => 1.0,
            };
            let g = (-(d2 - near) / (2.0 * width * width)).exp() * edge * edge * alike;
            sum += self.offsets[site as usize] * g;
            total += g;
        }
        // All sites at one distance: the rim takes the weight from all of them.
        if total > 0.0 { sum / total } else { self.offsets[nearest as usize] }
    }
}

/// Cosine of two records of weights: 1 where the same joints carry both in the same shares, 0 where
/// they share none.
fn alike(a: &SkinWeights, i: usize, b: &SkinWeights, j: usize) -> Real {
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

/// A posed garment back in the canonical pose of its body, by inverse skinning: `transforms` are
/// those of the pose's joints.
///
/// # Errors
///
/// Weights for another number of vertices or for joints that have no transform, or a vertex whose
/// blend of transforms has no inverse.
pub fn unposed(
    garment: &TriMesh,
    skin: &SkinWeights,
    transforms: &[Isometry3<Real>],
) -> Result<TriMesh, AlignError> {
    let points = garment.vertices().len();
    if skin.len() != points {
        return Err(AlignError::SkinCount { points, records: skin.len() });
    }
    let named = skin.joints().iter().zip(skin.weights()).flat_map(|(j, w)| j.iter().zip(w));
    if let Some((joint, _)) =
        named.filter(|(_, w)| **w != 0.0).find(|(j, _)| usize::from(**j) >= transforms.len())
    {
        return Err(AlignError::Joint { joint: usize::from(*joint), joints: transforms.len() });
    }
    let back = unpose_points(garment.vertices(), &blends(skin, transforms))
        .map_err(|vertex| AlignError::Singular { vertex })?;
    garment.with_vertices(back).map_err(AlignError::Mesh)
}

#[cfg(test)]
mod tests;
