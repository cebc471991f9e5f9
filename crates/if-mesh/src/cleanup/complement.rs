//! Openings by what is not the garment.

use super::components::components;
use super::twins::{Twins, ends, previous};
use super::work::Work;
use crate::index::Bvh;
use if_core::closest::ClosestPoint;
use if_core::math::{Point, Real, unit_or_zero};
use if_core::mesh::TriMesh;
use rayon::prelude::*;

/// The clothed body that a garment was cut from.
///
/// The garment is a part of its surface; the rest, the complement, falls into parts: head, hands,
/// legs, and patches that belong to the garment but were not given to it. A loop that bounds a
/// large part is an opening.
#[derive(Clone, Debug)]
pub struct Complement {
    /// The clothed body's surface: closed, or what was scanned of it; where it is missing, nothing
    /// is bounded.
    pub body: TriMesh,
    /// A part of the complement with less than this share of the garment's area is a patch of the
    /// garment.
    pub least_share: Real,
    /// For each vertex of the body, whether it surely belongs to something else (skin, another
    /// garment). A small part most of whose vertices do is an opening all the same. Empty where
    /// nothing is known.
    pub foreign: Vec<bool>,
    /// Distance up to which the body is covered by the garment, in metres; `None` for 1.5 mean
    /// edges of the garment.
    pub reach: Option<Real>,
}

impl Complement {
    /// Of this clothed body; parts from 1.5 % of the garment's area are openings: a hand without
    /// its cuff has 3 to 4 %, the largest armpit hole of `data/clothed/*_raw.ply` 0.5 %.
    pub fn new(body: TriMesh) -> Self {
        Self { body, least_share: 0.015, foreign: Vec::new(), reach: None }
    }
}

/// Why a clothed body tells nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum ComplementError {
    /// Nothing is there.
    #[error("the clothed body has no triangles; give the surface that the garment was cut from")]
    NoBody,
    /// Marks for other vertices.
    #[error(
        "{got} marks of foreign vertices for a clothed body of {vertices}; give one for each, or none"
    )]
    Foreign { got: usize, vertices: usize },
    /// A number out of range.
    #[error("{name} of the complement is {value}; give a number of at least 0")]
    Negative { name: &'static str, value: Real },
}

impl Complement {
    pub(super) fn validate(&self) -> Result<(), ComplementError> {
        let vertices = self.body.vertices().len();
        if self.body.triangles().is_empty() {
            return Err(ComplementError::NoBody);
        }
        if !self.foreign.is_empty() && self.foreign.len() != vertices {
            return Err(ComplementError::Foreign { got: self.foreign.len(), vertices });
        }
        for (name, value) in
            [("the least share", self.least_share), ("the reach", self.reach.unwrap_or(0.0))]
        {
            if !value.is_finite() || value < 0.0 {
                return Err(ComplementError::Negative { name, value });
            }
        }
        Ok(())
    }

    /// For each loop, whether it is an opening.
    pub(super) fn judge(&self, work: &Work, rims: &[Vec<u32>]) -> Vec<bool> {
        let garment = work.clone().finish().mesh;
        if garment.triangles().is_empty() {
            return vec![false; rims.len()];
        }
        let tree = Bvh::new(&garment);
        let normals = garment.face_normals();
        let reach = self.reach.unwrap_or_else(|| 1.5 * mean_edge(&garment));
        // Covered: near the garment, and looking the same way.
        let body_normals = self.body.face_normals();
        let covered: Vec<bool> = (0..self.body.triangles().len())
            .into_par_iter()
            .map(|t| {
                tree.closest(&center(&self.body, t), reach)
                    .is_some_and(|c| normals[c.triangle as usize].dot(&body_normals[t]) > 0.0)
            })
            .collect();
        let mut rest = Work::new(&self.body);
        let mut t = 0..;
        rest.triangles.retain(|_| t.next().is_some_and(|t: usize| !covered[t]));
        if rest.triangles.is_empty() {
            return vec![false; rims.len()];
        }
        let (part_of, parts) = components(&rest, &Twins::new(rest.points.len(), &rest.triangles));
        let least = self.least_share * garment.area();
        let mut foreign = vec![(0usize, 0usize); parts.len()];
        if !self.foreign.is_empty() {
            for (t, tri) in rest.triangles.iter().enumerate() {
                let f = &mut foreign[part_of[t] as usize];
                f.0 += tri.iter().filter(|v| self.foreign[**v as usize]).count();
                f.1 += 3;
            }
        }
        let open: Vec<bool> =
            parts.iter().zip(&foreign).map(|(p, f)| p.area >= least || 2 * f.0 > f.1).collect();
        let rest_mesh = rest.finish().mesh;
        let rest_tree = Bvh::new(&rest_mesh);
        // A loop bounds what lies just beyond most of its length.
        rims.par_iter()
            .map(|rim| {
                let (mut yes, mut all) = (0.0, 0.0);
                for &h in rim {
                    let [a, b] = ends(&work.triangles, h).map(|v| work.points[v as usize]);
                    let c = work.points[ends(&work.triangles, previous(h))[0] as usize];
                    let along = unit_or_zero(&(b - a));
                    let inward = (c - a) - along * along.dot(&(c - a));
                    let middle = nalgebra::center(&a, &b) - unit_or_zero(&inward) * reach;
                    let length = (b - a).norm();
                    all += length;
                    if let Some(c) = rest_tree.closest(&middle, reach)
                        && open[part_of[c.triangle as usize] as usize]
                    {
                        yes += length;
                    }
                }
                2.0 * yes > all
            })
            .collect()
    }
}

fn center(mesh: &TriMesh, t: usize) -> Point {
    let [a, b, c] = mesh.corners(t);
    Point::from((a.coords + b.coords + c.coords) / 3.0)
}

/// Mean length of the edges, in metres; those between two triangles count twice.
pub(super) fn mean_edge(mesh: &TriMesh) -> Real {
    let mut sum = 0.0;
    for t in 0..mesh.triangles().len() {
        let [a, b, c] = mesh.corners(t);
        sum += (b - a).norm() + (c - b).norm() + (a - c).norm();
    }
    sum / (3 * mesh.triangles().len()).max(1) as Real
}
