//! A hole, and the patches for it.

use super::edit_mesh::EditMesh;
use super::fair::fair;
use super::half_edges::{HalfEdges, ends, next, previous};
use super::loop_triangulation::{Chords, LoopPolygon};
use super::params::FillParams;
use super::patch::{Patch, refine};
use super::project::project;
use super::report::PatchShape;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};

/// A hole with its surroundings.
pub(super) struct Hole {
    /// The boundary's vertices, in the direction of the patch's triangles.
    vertices: Vec<u32>,
    pub(super) points: Vec<Point>,
    /// Unit normals of the triangles beyond the edges.
    outside: Vec<Vector>,
    /// Wanted edge length at each vertex, in metres.
    lengths: Vec<Real>,
    /// Neighbours of each vertex that are not its neighbours on the boundary.
    around: Vec<Vec<Point>>,
    /// Pairs of boundary vertices that are joined by an edge already.
    forbidden: Chords,
    /// Whether the boundary is that of one separate triangle.
    is_scrap: bool,
}

/// Rounds of averaging wanted lengths along the boundary: single short edges, left by cutting, must
/// not attract many vertices.
const AVERAGING: usize = 8;
/// Wanted lengths are kept between the mean over the boundary divided and multiplied by this.
const SPREAD: Real = 2.0;

impl Hole {
    pub(super) fn new(work: &EditMesh, half_edges: &HalfEdges, boundary: &[u32]) -> Self {
        let n = boundary.len();
        let backwards: Vec<u32> = boundary.iter().rev().copied().collect();
        let start = |h: u32| ends(&work.triangles, h)[0];
        let vertices: Vec<u32> = backwards.iter().map(|&h| start(h)).collect();
        let points: Vec<Point> = vertices.iter().map(|v| work.points[*v as usize]).collect();
        // The half-edge between places k and k + 1 starts at place k + 1.
        let outside = (0..n)
            .map(|k| unit_or_zero(&work.area_vector(backwards[(k + 1) % n] as usize / 3)))
            .collect();
        let mut places: Vec<(u32, u32)> =
            vertices.iter().enumerate().map(|(k, v)| (*v, k as u32)).collect();
        places.sort_unstable();
        let mut forbidden = Chords::new();
        let around = (0..n)
            .map(|k| {
                let mut near = Vec::new();
                half_edges
                    .around(backwards[k], |h| near.extend([start(next(h)), start(previous(h))]));
                near.sort_unstable();
                near.dedup();
                near.retain(|v| *v != vertices[(k + 1) % n] && *v != vertices[(k + n - 1) % n]);
                for v in &near {
                    if let Ok(at) = places.binary_search_by_key(v, |p| p.0) {
                        let j = places[at].1;
                        forbidden.insert(((k as u32).min(j), (k as u32).max(j)));
                    }
                }
                near.iter().map(|v| work.points[*v as usize]).collect()
            })
            .collect();
        let mut lengths: Vec<Real> =
            backwards.iter().map(|&h| work.edge_length_at(half_edges, h)).collect();
        let mean = lengths.iter().sum::<Real>() / n.max(1) as Real;
        lengths.iter_mut().for_each(|l| *l = l.clamp(mean / SPREAD, mean * SPREAD));
        for _ in 0..AVERAGING {
            let old = lengths.clone();
            (0..n).for_each(|k| {
                lengths[k] = (old[(k + n - 1) % n] + old[k] + old[(k + 1) % n]) / 3.0
            });
        }
        let is_scrap = n == 3 && boundary.iter().all(|h| h / 3 == boundary[0] / 3);
        Self { vertices, points, outside, lengths, around, forbidden, is_scrap }
    }

    /// A patch of this shape, or of a simpler one if that is what it ends as, with its actual shape.
    /// `None` if the loop cannot be triangulated.
    pub(super) fn patch(
        &self,
        shape: PatchShape,
        field: Option<&dyn SignedDistance>,
        params: &FillParams,
    ) -> Option<(Patch, PatchShape)> {
        if self.is_scrap {
            return None;
        }
        let lid = LoopPolygon {
            points: &self.points,
            outside: &self.outside,
            forbidden: &self.forbidden,
        };
        let triangles = lid.triangulate(params.exact_up_to)?;
        let boundary = self.points.len();
        let mut patch = Patch { boundary, points: self.points.clone(), triangles };
        if shape == PatchShape::Plain || !params.refine {
            return Some((patch, PatchShape::Plain));
        }
        refine(&mut patch, &self.lengths, &self.forbidden, params.most_vertices);
        if patch.points.len() == boundary || shape == PatchShape::Refined {
            return Some((patch, PatchShape::Refined));
        }
        let is_fair = params.fair && fair(&mut patch, &self.around);
        match field.filter(|_| shape == PatchShape::Projected) {
            Some(field) => {
                project(&mut patch, field);
                Some((patch, PatchShape::Projected))
            }
            None => Some((patch, if is_fair { PatchShape::Fair } else { PatchShape::Refined })),
        }
    }

    /// Adds the patch to the mesh.
    pub(super) fn add_patch(&self, work: &mut EditMesh, patch: &Patch) {
        let base = work.points.len() as u32;
        let boundary = self.points.len() as u32;
        for p in &patch.points[boundary as usize..] {
            work.add_blend(*p, self.blend(work, p));
        }
        let name =
            |v: u32| if v < boundary { self.vertices[v as usize] } else { base + v - boundary };
        work.triangles.extend(patch.triangles.iter().map(|t| t.map(name)));
    }

    /// Weights of boundary vertices for a new vertex, by inverse squared distance: the nearest
    /// vertices, and others evenly spaced along the boundary.
    fn blend(&self, work: &EditMesh, p: &Point) -> Vec<(u32, Real)> {
        /// More sources than this change little, and cost memory.
        const SPACED: usize = 48;
        const NEAREST: usize = 4;
        let stride = self.points.len().div_ceil(SPACED);
        let distance = |k: usize| (p - self.points[k]).norm_squared();
        let mut near: Vec<(Real, usize)> =
            (0..self.points.len()).map(|k| (distance(k), k)).collect();
        let by_distance =
            |a: &(Real, usize), b: &(Real, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        // Boundary and patch may have thousands of vertices each: only what is used is sorted.
        if near.len() > NEAREST {
            near.select_nth_unstable_by(NEAREST, by_distance);
        }
        let mut spread = near.split_off(NEAREST.min(near.len()));
        spread.retain(|n| n.1.is_multiple_of(stride));
        near.sort_unstable_by(by_distance);
        spread.sort_unstable_by(by_distance);
        let near: Vec<(Real, u32)> =
            near.into_iter().chain(spread).map(|(d, k)| (d, self.vertices[k])).collect();
        let nearest = near.first().map_or(1.0, |n| n.0).max(Real::MIN_POSITIVE);
        let mut parts: Vec<(u32, Real)> = Vec::new();
        for (d, v) in near {
            let weight = nearest / d.max(nearest);
            let add = |parts: &mut Vec<(u32, Real)>, v: u32, w: Real| match parts
                .iter_mut()
                .find(|p| p.0 == v)
            {
                Some(p) => p.1 += w,
                None => parts.push((v, w)),
            };
            work.sources_of(v).for_each(|(v, w)| add(&mut parts, v, weight * w));
        }
        let total: Real = parts.iter().map(|p| p.1).sum();
        parts.iter_mut().for_each(|p| p.1 /= total);
        parts.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        parts
    }
}

impl Patch {
    pub(super) fn area(&self) -> Real {
        let twice = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| &self.points[v as usize]);
            area_vector(a, b, c).norm()
        };
        self.triangles.iter().map(|t| 0.5 * twice(t)).sum()
    }
}
