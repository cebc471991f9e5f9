//! Holes closed.

use super::fair::fair;
use super::guard::meeting;
use super::lid::{Chords, Lid};
use super::manifold::resolve;
use super::openings::{Openings, Verdict};
use super::patch::{Patch, refine};
use super::rim::LoopShape;
use super::twins::{Twins, ends, loops, next, previous};
use super::work::{Derived, Work};
use crate::attributes::Source;
use crate::validate::is_flat;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;
use rayon::prelude::*;
use serde::Serialize;

/// How holes are closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FillParams {
    /// Loops of up to this many edges get the best of all triangulations, in O(n³); longer ones are closed ear by ear.
    pub exact_up_to: usize,
    /// Whether the patch gets vertices until its edges are as long as those round it.
    pub refine: bool,
    /// Whether the patch is bent so that it goes on as the surface round it does (biharmonic). Needs `refine`.
    pub fair: bool,
    /// New vertices of one hole, at most.
    pub most_vertices: usize,
    /// Times that a hole, into which no patch fits, is widened by the triangles on its rim and tried again. What a scan has
    /// at the border of what nobody saw is often bent inwards or through itself.
    pub widenings: usize,
}

impl Default for FillParams {
    fn default() -> Self {
        Self { exact_up_to: 128, refine: true, fair: true, most_vertices: 20_000, widenings: 3 }
    }
}

/// What shape a patch has. The first that adds no intersection is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// On the zero of the field.
    Projected,
    /// Biharmonic.
    Fair,
    /// With new vertices on the triangles that close the loop.
    Refined,
    /// The triangles that close the loop.
    Plain,
}

/// A hole that was closed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FilledHole {
    /// The loop.
    pub rim: LoopShape,
    /// What shape its patch has.
    pub shape: Shape,
    /// Triangles added.
    pub triangles: usize,
    /// Vertices added.
    pub vertices: usize,
    /// Area added, in square metres.
    pub area: Real,
}

/// What was closed, and what stays open.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct FillReport {
    /// Holes that were closed.
    pub filled: Vec<FilledHole>,
    /// Holes that stay as they are, because every patch tried meets the mesh or repeats an edge of it.
    pub left: Vec<LoopShape>,
    /// Triangles cut away round holes so that a patch fits.
    pub cut_away: usize,
    /// Openings.
    pub openings: Vec<LoopShape>,
}

/// Closes the loops of `mesh` that `openings` takes for holes: triangulation by the smallest sharpest fold, refinement
/// to the edge length of the rim, and a biharmonic shape or, where there is a `field`, its zero. No triangle is
/// added that meets another one. A mesh that is not manifold is made so first ([`super::manifold::make_manifold`]).
///
/// New vertices are blends of the rim's, by inverse squared distance.
///
/// # Source
///
/// Supplement, Appendix B, Figure 2 (a); Liepa 2003.
pub fn fill_holes(
    mesh: &TriMesh,
    field: Option<&dyn SignedDistance>,
    openings: &Openings,
    params: &FillParams,
) -> (Derived, FillReport) {
    let mut work = Work::new(mesh);
    let (_, mut twins) = resolve(&mut work);
    let (report, _) = fill(&mut work, &mut twins, field, openings, params, false);
    (work.finish(), report)
}

/// The largest share of the area that is cut away to widen holes.
const MOST_CUT: Real = 0.01;

/// [`fill_holes`] in place, with the new twins and the rims of the openings.
pub(super) fn fill(
    work: &mut Work,
    twins: &mut Twins,
    field: Option<&dyn SignedDistance>,
    openings: &Openings,
    params: &FillParams,
    single_precision: bool,
) -> (FillReport, Vec<Vec<u32>>) {
    let once = |work: &mut Work, twins: &mut Twins| {
        let found = fill_once(work, twins, field, openings, params, single_precision);
        if !found.0.filled.is_empty() {
            *twins = Twins::new(work.points.len(), &work.triangles);
        }
        found
    };
    let (mut report, mut open, mut left) = once(work, twins);
    if left.is_empty() || params.widenings == 0 {
        return (report, open);
    }
    let area: Real = (0..work.triangles.len()).map(|t| work.area(t)).sum();
    let mut trial = work.clone();
    let mut tried = FillReport { cut_away: 0, ..report.clone() };
    for _ in 0..params.widenings {
        let mut rim: Vec<u32> = left.iter().flatten().map(|h| h / 3).collect();
        rim.sort_unstable();
        rim.dedup();
        if rim.iter().map(|t| trial.area(*t as usize)).sum::<Real>() > MOST_CUT * area {
            break;
        }
        tried.cut_away += rim.len();
        let mut k = 0..;
        trial.triangles.retain(|_| k.next().is_some_and(|k| rim.binary_search(&k).is_err()));
        let (_, mut trial_twins) = resolve(&mut trial);
        let (found, new_open, new_left) = once(&mut trial, &mut trial_twins);
        left = new_left;
        tried.filled.extend(found.filled);
        (tried.left, tried.openings) = (found.left, found.openings);
        if left.len() < report.left.len() && new_open.len() <= open.len() {
            report = tried.clone();
            (*work, *twins, open) = (trial.clone(), trial_twins, new_open);
        }
        if left.is_empty() {
            break;
        }
    }
    (report, open)
}

/// Judges the loops and fills holes once. The rims of openings, and of holes that are left; old half-edges keep their numbers.
fn fill_once(
    work: &mut Work,
    twins: &Twins,
    field: Option<&dyn SignedDistance>,
    openings: &Openings,
    params: &FillParams,
    single_precision: bool,
) -> (FillReport, Vec<Vec<u32>>, Vec<Vec<u32>>) {
    let rims = loops(&work.triangles, twins);
    let shapes: Vec<LoopShape> = rims.par_iter().map(|rim| LoopShape::new(work, twins, rim)).collect();
    let verdicts = openings.judge(work, &rims, &shapes);
    let mut report = FillReport::default();
    let mut jobs = Vec::new();
    for (k, verdict) in verdicts.iter().enumerate() {
        match verdict {
            Verdict::Opening => report.openings.push(shapes[k]),
            Verdict::Hole => jobs.push((k, Hole::new(work, twins, &rims[k]))),
        }
    }
    let first = if field.is_some() { Shape::Projected } else { Shape::Fair };
    let make = |hole: &Hole, shape: Shape| {
        let mut patch = hole.patch(shape, field, params)?;
        if single_precision {
            patch.0.points[hole.points.len()..].iter_mut().for_each(|p| *p = p.map(|x| Real::from(x as f32)));
        }
        Some(patch)
    };
    let mut patches: Vec<Option<(Patch, Shape)>> = jobs.par_iter().map(|(_, hole)| make(hole, first)).collect();
    let (points, base) = (work.points.len(), work.triangles.len());
    loop {
        let mut owner = Vec::new();
        for (job, patch) in patches.iter().enumerate() {
            if let Some((patch, _)) = patch {
                jobs[job].1.sew(work, patch);
                owner.resize(work.triangles.len() - base, job);
            }
        }
        let added: Vec<u32> = (base as u32..work.triangles.len() as u32).collect();
        let flat = added.iter().filter(|t| is_flat(work.triangles[**t as usize].map(|v| &work.points[v as usize])));
        let meets = meeting(&work.points, &work.triangles, &added);
        let mut bad: Vec<usize> =
            flat.chain(meets.iter().flatten()).filter(|t| **t as usize >= base).map(|t| owner[*t as usize - base]).collect();
        bad.sort_unstable();
        bad.dedup();
        if bad.is_empty() {
            break;
        }
        work.points.truncate(points);
        work.sources.truncate(points);
        work.triangles.truncate(base);
        let again: Vec<(usize, Option<(Patch, Shape)>)> = bad
            .par_iter()
            .map(|&job| {
                let shape = patches[job].as_ref().and_then(|p| worse(p.1));
                (job, shape.and_then(|shape| make(&jobs[job].1, shape)))
            })
            .collect();
        again.into_iter().for_each(|(job, patch)| patches[job] = patch);
    }
    for ((k, hole), patch) in jobs.iter().zip(&patches) {
        match patch {
            None => report.left.push(shapes[*k]),
            Some((patch, shape)) => report.filled.push(FilledHole {
                rim: shapes[*k],
                shape: *shape,
                triangles: patch.triangles.len(),
                vertices: patch.points.len() - hole.points.len(),
                area: patch.area(),
            }),
        }
    }
    let left = jobs.iter().zip(&patches).filter(|(_, p)| p.is_none()).map(|((k, _), _)| rims[*k].clone()).collect();
    let open = rims.into_iter().zip(&verdicts).filter(|(_, v)| **v == Verdict::Opening).map(|(rim, _)| rim).collect();
    (report, open, left)
}

fn worse(shape: Shape) -> Option<Shape> {
    match shape {
        Shape::Projected => Some(Shape::Fair),
        Shape::Fair => Some(Shape::Refined),
        Shape::Refined => Some(Shape::Plain),
        Shape::Plain => None,
    }
}

/// What a patch needs to know of the mesh.
struct Hole {
    /// The rim's vertices, against the direction of its triangles.
    vertices: Vec<u32>,
    points: Vec<Point>,
    /// Unit normals of the triangles beyond the edges.
    outside: Vec<Vector>,
    /// Wanted edge length at each vertex, in metres.
    lengths: Vec<Real>,
    /// Neighbours of each vertex that are not its neighbours on the rim.
    around: Vec<Vec<Point>>,
    taken: Chords,
    /// Whether the rim is that of one triangle.
    is_scrap: bool,
}

/// Rounds of averaging wanted lengths along the rim: single short edges, left by cutting, should not draw crowds of vertices.
const EVEN: usize = 8;
/// Wanted lengths are kept between the mean over the rim divided and multiplied by this.
const SPREAD: Real = 2.0;

impl Hole {
    fn new(work: &Work, twins: &Twins, rim: &[u32]) -> Self {
        let n = rim.len();
        let backwards: Vec<u32> = rim.iter().rev().copied().collect();
        let start = |h: u32| ends(&work.triangles, h)[0];
        let vertices: Vec<u32> = backwards.iter().map(|&h| start(h)).collect();
        let points: Vec<Point> = vertices.iter().map(|v| work.points[*v as usize]).collect();
        // From place k to k + 1 runs the half-edge that starts at place k + 1.
        let outside = (0..n).map(|k| unit_or_zero(&work.area_vector(backwards[(k + 1) % n] as usize / 3))).collect();
        let mut places: Vec<(u32, u32)> = vertices.iter().enumerate().map(|(k, v)| (*v, k as u32)).collect();
        places.sort_unstable();
        let mut taken = Chords::new();
        let around = (0..n)
            .map(|k| {
                let mut near = Vec::new();
                twins.around(backwards[k], |h| near.extend([start(next(h)), start(previous(h))]));
                near.sort_unstable();
                near.dedup();
                near.retain(|v| *v != vertices[(k + 1) % n] && *v != vertices[(k + n - 1) % n]);
                for v in &near {
                    if let Ok(at) = places.binary_search_by_key(v, |p| p.0) {
                        let j = places[at].1;
                        taken.insert(((k as u32).min(j), (k as u32).max(j)));
                    }
                }
                near.iter().map(|v| work.points[*v as usize]).collect()
            })
            .collect();
        let mut lengths: Vec<Real> = backwards.iter().map(|&h| work.edge_length_at(twins, h)).collect();
        let mean = lengths.iter().sum::<Real>() / n.max(1) as Real;
        lengths.iter_mut().for_each(|l| *l = l.clamp(mean / SPREAD, mean * SPREAD));
        for _ in 0..EVEN {
            let old = lengths.clone();
            (0..n).for_each(|k| lengths[k] = (old[(k + n - 1) % n] + old[k] + old[(k + 1) % n]) / 3.0);
        }
        let is_scrap = n == 3 && rim.iter().all(|h| h / 3 == rim[0] / 3);
        Self { vertices, points, outside, lengths, around, taken, is_scrap }
    }

    /// A patch of at most this quality, and the one it has.
    fn patch(&self, shape: Shape, field: Option<&dyn SignedDistance>, params: &FillParams) -> Option<(Patch, Shape)> {
        if self.is_scrap {
            return None;
        }
        let lid = Lid { points: &self.points, outside: &self.outside, taken: &self.taken };
        let triangles = lid.triangulate(params.exact_up_to)?;
        let rim = self.points.len();
        let mut patch = Patch { rim, points: self.points.clone(), triangles };
        if shape == Shape::Plain || !params.refine {
            return Some((patch, Shape::Plain));
        }
        refine(&mut patch, &self.lengths, &self.taken, params.most_vertices);
        if patch.points.len() == rim || shape == Shape::Refined {
            return Some((patch, Shape::Refined));
        }
        let is_fair = params.fair && fair(&mut patch, &self.around);
        match field.filter(|_| shape == Shape::Projected) {
            Some(field) => {
                project(&mut patch, field);
                Some((patch, Shape::Projected))
            }
            None => Some((patch, if is_fair { Shape::Fair } else { Shape::Refined })),
        }
    }

    /// Adds the patch to the mesh.
    fn sew(&self, work: &mut Work, patch: &Patch) {
        let base = work.points.len() as u32;
        let rim = self.points.len() as u32;
        for p in &patch.points[rim as usize..] {
            work.sources.push(self.blend(work, p));
            work.points.push(*p);
        }
        let name = |v: u32| if v < rim { self.vertices[v as usize] } else { base + v - rim };
        work.triangles.extend(patch.triangles.iter().map(|t| t.map(name)));
    }

    /// Vertices of the rim by inverse squared distance: the nearest, and others evenly spread along it.
    fn blend(&self, work: &Work, p: &Point) -> Source {
        /// More parts than this change little, and cost memory.
        const SPREAD: usize = 48;
        const NEAREST: usize = 4;
        let stride = self.points.len().div_ceil(SPREAD);
        let distance = |k: usize| (p - self.points[k]).norm_squared();
        let mut near: Vec<(Real, usize)> = (0..self.points.len()).map(|k| (distance(k), k)).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let chosen = near.into_iter().enumerate().filter(|(rank, (_, k))| *rank < NEAREST || k.is_multiple_of(stride));
        let near: Vec<(Real, u32)> = chosen.map(|(_, (d, k))| (d, self.vertices[k])).collect();
        let nearest = near.first().map_or(1.0, |n| n.0).max(Real::MIN_POSITIVE);
        let mut parts: Vec<(u32, Real)> = Vec::new();
        for (d, v) in near {
            let weight = nearest / d.max(nearest);
            let add = |parts: &mut Vec<(u32, Real)>, v: u32, w: Real| match parts.iter_mut().find(|p| p.0 == v) {
                Some(p) => p.1 += w,
                None => parts.push((v, w)),
            };
            match &work.sources[v as usize] {
                Source::Vertex(v) => add(&mut parts, *v, weight),
                Source::Blend(of) => of.iter().for_each(|(v, w)| add(&mut parts, *v, weight * w)),
            }
        }
        let total: Real = parts.iter().map(|p| p.1).sum();
        parts.iter_mut().for_each(|p| p.1 /= total);
        parts.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        Source::Blend(parts)
    }
}

impl Patch {
    fn area(&self) -> Real {
        let twice = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| &self.points[v as usize]);
            area_vector(a, b, c).norm()
        };
        self.triangles.iter().map(|t| 0.5 * twice(t)).sum()
    }
}

/// Rounds of evening out the vertices of a projected patch.
const RELAXATIONS: usize = 10;
/// Newton steps to the field's zero in each round. A distance needs one; a network's field, two or three.
const STEPS: usize = 3;

/// Brings the vertices inside the patch to the zero of the field, evenly spaced.
fn project(patch: &mut Patch, field: &dyn SignedDistance) {
    let rim = patch.rim;
    let size = if_core::aabb::Aabb::from_points(&patch.points).diagonal();
    let mut samples = vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; patch.points.len() - rim];
    let mut onto = |points: &mut [Point]| {
        for _ in 0..STEPS {
            field.samples(&points[rim..], &mut samples);
            for (p, s) in points[rim..].iter_mut().zip(&samples) {
                if let Some(step) = newton(s, 0.5 * size) {
                    *p += step;
                }
            }
        }
    };
    onto(&mut patch.points);
    for _ in 0..RELAXATIONS {
        let mut sums = vec![(Vector::zeros(), 0.0); patch.points.len()];
        for t in &patch.triangles {
            for k in 0..3 {
                for j in [1, 2] {
                    sums[t[k] as usize].0 += patch.points[t[(k + j) % 3] as usize].coords;
                    sums[t[k] as usize].1 += 1.0;
                }
            }
        }
        for v in rim..patch.points.len() {
            if sums[v].1 > 0.0 {
                let mean = Point::from(sums[v].0 / sums[v].1);
                patch.points[v] = nalgebra::center(&patch.points[v], &mean);
            }
        }
        onto(&mut patch.points);
    }
}

/// The step to φ = 0 along the gradient, at most `longest`; `None` where the field has no gradient or is not finite.
pub(super) fn newton(sample: &FieldSample, longest: Real) -> Option<Vector> {
    let squared = sample.gradient.norm_squared();
    if !(squared > 1e-12 && squared.is_finite() && sample.distance.is_finite()) {
        return None; // a signed distance has 1
    }
    let step = -sample.gradient * (sample.distance / squared);
    let length = step.norm();
    Some(if length > longest { step * (longest / length) } else { step })
}
