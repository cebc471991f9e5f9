//! The distance to the zero set of any field.

use super::error::BakeError;
use super::params::BakeParams;
use crate::extract::{ExtractError, ExtractParams, Resolution, Slope, extract};
use crate::index::Bvh;
use if_core::aabb::Aabb;
use if_core::closest::{Closest, ClosestPoint};
use if_core::edges::Edges;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::monitor::Monitor;
use rayon::prelude::*;

/// Edges of triangles as a share of a cell of level 0: 3 mm for cells of 12 mm. The search for
/// nearest points starts on them; details that are thinner may be lost.
const EDGE: Real = 0.25;
/// Minimum and maximum number of edges along the region.
const EDGES: [Real; 2] = [48.0, 1024.0];
/// A point is on the zero set when a Newton step moves it by less than this share of an edge: it is
/// then off by the square of that times the curvature, 1e-9 m.
const SETTLED: Real = 1e-3;
/// It is the nearest when it would slide by less than this share of an edge.
const NEAREST: Real = 1e-3;
/// Nearer than so many edges the gradient is the normal at the nearest point, farther the direction
/// from there.
const NORMAL: Real = 4.0;
/// Maximum number of steps: nearly all settle in four. Creases, where two points are nearest, do not.
const STEPS: usize = 12;
/// Points of one call of the source.
const BATCH: usize = 1 << 14;
/// Consecutive points, which are likely near: each starts from the nearest point of the one before.
const NEIGHBOURS: usize = 64;
/// Networks have values in single precision.
const NOISE: Real = 1e-6;

/// Nearer than so many edges, the search includes thin details that the mesh does not have.
const FAR: Real = 8.0;
/// Where the source is below this share of the distance to the mesh, something is nearer than the
/// mesh. Below what scaled fields are, as a rule.
const THIN: Real = 0.3;
/// Triangles that meet under a larger angle than that of this cosine, 35°, show a crease: a finger
/// bends by 25° from one to the next.
const CREASE: Real = 0.82;
/// Slopes are assumed to be at most this times the steepest sample.
const STEEPER: Real = 1.5;

/// A field that is the distance to the zero set of `source`, with the source's sign.
///
/// ```text
/// mesh of the zero set, once           extract
/// q ← nearest point of the mesh
/// q ← q − n φ(q) / |∇φ(q)| until φ(q) = 0
/// a few times: q ← q − n φ(q) / |∇φ(q)| + α t,   t = (p − q) − n n·(p − q),   n = ∇φ / |∇φ| at q
/// φ' = ±|p − q|,   ∇φ' = ±(p − q) / |p − q|
/// ```
///
/// α is the step of Barzilai and Borwein 1988: where the surface bends at distance d with the
/// curvature κ, it comes to 1 / (1 + d κ) by itself. Of all q that were on the zero set the nearest
/// counts, so that the distance is never too small.
pub(super) struct ZeroSet<'a> {
    source: &'a dyn SignedDistance,
    surface: Bvh,
    edge: Real,
    /// Maximum distance of the zero set from the mesh where no step finds it, in metres: at corners.
    unseen: Real,
    /// Maximum distances of the search, outside and inside.
    limits: [Real; 2],
}

impl<'a> ZeroSet<'a> {
    /// Extracts the surface. `samples` are some of the source's; `far` is how far beyond the band a
    /// distance is wanted, in metres.
    pub(super) fn new(
        source: &'a dyn SignedDistance,
        region: &Aabb,
        params: &BakeParams,
        samples: &[FieldSample],
        far: Real,
        monitor: &mut dyn Monitor,
    ) -> Result<Self, BakeError> {
        let longest = region.size().max();
        let edge = (EDGE * params.cell).clamp(longest / EDGES[1], longest / EDGES[0]);
        // A bound that holds everywhere may be far above the actual slopes; extraction detects and
        // corrects one that is too small.
        let steepest = samples.iter().map(|s| s.gradient.norm()).fold(0.0, Real::max);
        let slope = (STEEPER * steepest).max(1e-3).min(source.lipschitz());
        let size = region.size().max().max(region.max.coords.amax()).max(region.min.coords.amax());
        let extraction = ExtractParams {
            region: Some(*region),
            resolution: Resolution::Cell(edge),
            noise: NOISE * size,
            slope: Slope::Given(slope),
            check: 0,
            memory: params.memory,
            ..ExtractParams::default()
        };
        let mesh = extract(source, &extraction, monitor).map_err(|error| match error {
            ExtractError::Cancelled(cancelled) => BakeError::Cancelled(cancelled),
            ExtractError::NotANumber { point } => {
                BakeError::NotFinite { point, sample: source.sample(&point) }
            }
            error => BakeError::Surface(error),
        })?;
        let limits = [params.band + far, params.depth + far];
        let unseen = if has_creases(&mesh.mesh) { edge / Real::sqrt(3.0) } else { 0.0 };
        Ok(Self { source, surface: Bvh::new(&mesh.mesh), edge, unseen, limits })
    }

    /// Amount by which distances may be too large, in metres: a corner is cut by the lattice of the
    /// extraction, and no slide along a side ends in it. 0 if the mesh has no creases.
    pub(super) fn unseen(&self) -> Real {
        self.unseen
    }

    /// The state before the first step.
    fn start(&self, p: &Point, value: Real, before: Option<&Foot>) -> Foot {
        let most = self.limits[usize::from(value < 0.0)];
        // The nearest point of the mesh for the neighbour bounds the search.
        let known = before
            .and_then(|b| b.closest)
            .map_or(Real::INFINITY, |c| (p - c.point).norm() + 1e-6 * self.edge);
        let closest = self.surface.closest(p, most.min(known));
        let at = match &closest {
            // A thin detail that the mesh does not have is nearer.
            Some(c) if c.distance < FAR * self.edge && value.abs() < THIN * c.distance => *p,
            Some(c) => c.point,
            None => *p,
        };
        Foot { side: if value < 0.0 { -1.0 } else { 1.0 }, closest, at, step: None, best: None }
    }

    /// One step of a foot, from the source's sample there; `false` if no step is left.
    fn step(&self, p: &Point, foot: &mut Foot, here: &FieldSample) -> bool {
        let slope = here.gradient.norm();
        if !(slope > 0.0 && slope.is_finite() && here.distance.is_finite()) {
            return false;
        }
        let normal = here.gradient / slope;
        let mut down = normal * (here.distance / slope);
        let fall = down.norm();
        if fall > self.edge {
            down *= self.edge / fall;
        }
        let on = foot.at - down;
        let arm = p - on;
        let along = arm - normal * normal.dot(&arm);
        if fall < SETTLED * self.edge {
            let settled = along.norm() < NEAREST * self.edge;
            if foot.best.is_none_or(|b| arm.norm() < b.distance) {
                foot.best = Some(Best { distance: arm.norm(), at: on, normal, settled });
            }
            if settled {
                return false;
            }
        } else if foot.best.is_none() {
            foot.at = on;
            return true;
        }
        let share = match foot.step {
            None => 0.7,
            Some((before, step)) => {
                let bend = step.dot(&(before - along));
                if bend > 0.0 { (step.norm_squared() / bend).clamp(0.05, 1.5) } else { 1.0 }
            }
        };
        let mut step = along * share;
        if step.norm() > self.edge {
            step *= self.edge / step.norm();
        }
        foot.step = Some((along, step));
        foot.at = on + step;
        true
    }

    fn sample_of(&self, p: &Point, foot: &Foot, value: Real) -> FieldSample {
        let Some(mesh) = &foot.closest else {
            let limit = self.limits[usize::from(value < 0.0)];
            let far = if limit.is_finite() { limit } else { self.limits[0] };
            return FieldSample { distance: foot.side * far, gradient: Vector::zeros() };
        };
        // A foot that moved away has reached another part of the surface.
        match foot.best.filter(|b| b.distance <= mesh.distance + self.edge) {
            Some(b) => {
                // A foot that is off by t turns the arm by t / d, the normal by t κ.
                let near = if b.settled { NORMAL } else { NEAREST } * self.edge;
                let arm = p - b.at;
                // A detail too small for the mesh has no inside: away from the surface the side is
                // that of the surface.
                let side = if b.settled && b.distance > near {
                    Real::signum(arm.dot(&b.normal))
                } else {
                    foot.side
                };
                let gradient = if b.distance > near { arm * (side / b.distance) } else { b.normal };
                FieldSample { distance: side * b.distance, gradient }
            }
            None => FieldSample {
                distance: foot.side * mesh.distance,
                gradient: unit_or_zero(&(p - mesh.point)) * foot.side,
            },
        }
    }
}

/// State of the search for a nearest point.
struct Foot {
    side: Real,
    closest: Option<Closest>,
    at: Point,
    /// The full slide of the last step, and the part of it that was taken.
    step: Option<(Vector, Vector)>,
    best: Option<Best>,
}

/// The nearest point of the zero set so far.
#[derive(Clone, Copy)]
struct Best {
    distance: Real,
    at: Point,
    normal: Vector,
    /// Whether it is the nearest of its neighbourhood.
    settled: bool,
}

impl SignedDistance for ZeroSet<'_> {
    fn distance(&self, p: &Point) -> Real {
        self.sample(p).distance
    }

    fn sample(&self, p: &Point) -> FieldSample {
        let mut out = [FieldSample { distance: 0.0, gradient: Vector::zeros() }];
        self.samples(&[*p], &mut out);
        out[0]
    }

    fn samples(&self, points: &[Point], out: &mut [FieldSample]) {
        let nothing = FieldSample { distance: 0.0, gradient: Vector::zeros() };
        for (points, out) in points.chunks(BATCH).zip(out.chunks_mut(BATCH)) {
            let mut values = vec![0.0; points.len()];
            self.source.distances(points, &mut values);
            let mut feet: Vec<Foot> = points
                .par_chunks(NEIGHBOURS)
                .zip(values.par_chunks(NEIGHBOURS))
                .flat_map_iter(|(points, values)| {
                    let mut feet: Vec<Foot> = Vec::with_capacity(points.len());
                    for (p, value) in points.iter().zip(values) {
                        let foot = self.start(p, *value, feet.last());
                        feet.push(foot);
                    }
                    feet
                })
                .collect();
            let mut active: Vec<usize> =
                (0..points.len()).filter(|k| feet[*k].closest.is_some()).collect();
            let mut here = vec![nothing; points.len()];
            for _ in 0..STEPS {
                let at: Vec<Point> = active.iter().map(|k| feet[*k].at).collect();
                self.source.samples(&at, &mut here[..at.len()]);
                let mut next = 0;
                for i in 0..active.len() {
                    let k = active[i];
                    if self.step(&points[k], &mut feet[k], &here[i]) {
                        active[next] = k;
                        next += 1;
                    }
                }
                active.truncate(next);
                if next == 0 {
                    break;
                }
            }
            for (k, o) in out.iter_mut().enumerate() {
                *o = self.sample_of(&points[k], &feet[k], values[k]);
                if !values[k].is_finite() {
                    o.distance = values[k];
                }
            }
        }
    }

    fn bounds(&self) -> Option<Aabb> {
        self.source.bounds()
    }

    fn lipschitz(&self) -> Real {
        1.0
    }
}

/// Whether two triangles with a common edge meet under a large angle.
fn has_creases(mesh: &TriMesh) -> bool {
    let normal = |t: u32| {
        let [a, b, c] = mesh.corners(t as usize);
        unit_or_zero(&(b - a).cross(&(c - a)))
    };
    let edges = Edges::new(mesh);
    // Triangles without area have no normal, and are skipped.
    edges.triangles.par_iter().any(|[s, t]| {
        let inner =
            (*s as usize) < mesh.triangles().len() && (*t as usize) < mesh.triangles().len();
        inner && {
            let (a, b) = (normal(*s), normal(*t));
            a != Vector::zeros() && b != Vector::zeros() && a.dot(&b) < CREASE
        }
    })
}
