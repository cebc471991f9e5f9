//! The search for contacts: samples on a garment's triangles against the closed layers below.
//!
//! There are two kinds of samples. *Own samples* are fixed on the garment: its vertices, and the
//! middles of long edges and of the triangles at them; if they are not very long, only where
//! something is left to repair. *Foreign samples* follow the vertices of the
//! layers below: each has a nearest point on the garment, and where a fine mesh pokes through a
//! coarse triangle that point is the place to push.
//!
//! A sample that is further from a layer than the clearance and a reserve is skipped until it has
//! moved that far: a distance has Lipschitz bound 1. Samples whose vertices are all held are
//! skipped. A sample that is nearer is queried in each round: if it moves little, the nearest
//! triangle is found among those that were near before.

use if_core::closest::ClosestPoint;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, area_vector, barycentric_point, unit_or_zero};
use if_core::mesh::TriMesh;
use if_mesh::index::{Bvh, Nearby, distance_bound};
use if_mesh::outward::Outward;
use if_mesh::solid::ClosedLayer;
use if_xpbd::half_space::HalfSpaces;
use rayon::prelude::*;

/// A point of the garment by the vertices it depends on.
#[derive(Clone, Copy, Debug)]
struct Sample {
    vertices: [u32; 3],
    weights: [Real; 3],
}

impl Sample {
    fn at(&self, x: &[Point]) -> Point {
        barycentric_point(self.vertices.map(|v| &x[v as usize]), self.weights)
    }

    fn gap(&self, gaps: &[Real]) -> Real {
        (0..3).map(|k| self.weights[k] * gaps[self.vertices[k] as usize]).sum()
    }

    /// Whether one of its vertices takes a way of its own.
    fn is_planned(&self, exits: &[Exit]) -> bool {
        self.vertices.iter().any(|v| exits[*v as usize] == Exit::Planned)
    }

    fn is_held(&self, inverse_masses: &[Real]) -> bool {
        self.vertices.iter().all(|v| inverse_masses[*v as usize] == 0.0)
    }
}

/// How a vertex is led out of a layer that it is inside of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Exit {
    /// Step by step, the nearest way unless that leads through the wall of a fold.
    #[default]
    Steps,
    /// In leaps, the nearest way.
    Nearest,
    /// In leaps, the way out on the scale of centimetres.
    Outward,
    /// On a way of its own ([`crate::ways_out`]): no contact is looked for.
    Planned,
}

/// The last query of a sample against one layer below.
#[derive(Clone, Copy, Debug)]
struct LastQuery {
    /// Where the sample was.
    position: Point,
    /// Lower bound of its distance from the layer, in metres: 0 if it may have been in contact. How
    /// far it can move before the next query depends on its gap, which can widen.
    clear: Real,
    /// The nearest triangle, with which the next search begins.
    triangle: Option<u32>,
}

impl LastQuery {
    const NONE: Self = Self { position: Point::new(0.0, 0.0, 0.0), clear: 0.0, triangle: None };
}

/// The layers that a sample cannot touch while it stays near a position.
#[derive(Clone, Copy, Debug)]
struct Rest {
    position: Point,
    /// The least of the lower bounds of its distance from these layers, in metres.
    clear: Real,
    /// Up to this far from the position no side jumps, in metres.
    free: Real,
    /// The layers, a bit each: the first 64.
    layers: u64,
}

impl Rest {
    const NONE: Self =
        Self { position: Point::new(0.0, 0.0, 0.0), clear: 0.0, free: 0.0, layers: 0 };

    /// Of a sample at `p` with this gap.
    fn new(
        p: &Point,
        gap: Real,
        last_queries: &[LastQuery],
        below: &[&ClosedLayer],
        params: &ContactParams,
    ) -> Self {
        let mut rest = Self { position: *p, clear: Real::INFINITY, free: RESTING, layers: 0 };
        for (k, (m, layer)) in last_queries.iter().zip(below).enumerate().take(64) {
            // Less by more than rounding.
            let clear = (m.clear - (p - m.position).norm()) * (1.0 - 1e-9);
            if clear - gap - params.margin < RESTING {
                continue;
            }
            let free = layer.outside_radius(p);
            if free > 0.0 {
                rest.free = if rest.layers == 0 { free } else { rest.free.min(free) };
                rest.clear = rest.clear.min(clear);
                rest.layers |= 1 << k;
            }
        }
        rest
    }
}

/// The last query of a vertex of a layer below.
#[derive(Clone, Copy, Debug, Default)]
struct LastForeign {
    /// The garment's path length before which it cannot touch the vertex, in metres.
    until: Real,
    /// The garment's nearest triangle, with which the next search begins.
    triangle: Option<u32>,
}

/// The half-space that a contact keeps a sample in: at least `gap` beyond `point` along `normal`.
struct Plane {
    normal: Vector,
    point: Point,
    gap: Real,
}

/// Found in one chunk of samples: contacts, queries made, queries skipped.
#[derive(Default)]
struct Found {
    contacts: Vec<(Sample, Plane)>,
    queries: usize,
    skipped: usize,
}

/// Lengths that the search for contacts works with, in metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactParams {
    /// Maximum correction of a violated contact in one round.
    pub(crate) step: Real,
    /// Contacts are kept for samples up to this far beyond their clearance.
    pub(crate) margin: Real,
    /// How much further a query searches, to avoid later ones.
    pub(crate) reserve: Real,
    /// Edges longer than this get a sample in the middle, and their triangles too: at once if they are
    /// much longer, else where something is left to repair.
    pub(crate) long_edge: Real,
    /// Whether queries that cannot find a contact are skipped.
    pub(crate) skip: bool,
}

impl ContactParams {
    /// Maximum correction in one round of a vertex that is led out at once, in metres.
    pub(crate) fn leap(&self) -> Real {
        LEAP * self.step
    }
}

/// Samples per task: enough work to hide the fork, few enough to balance where most samples of a task
/// are queried and those of the next are held.
const CHUNK: usize = 64;
/// The triangles near a sample are kept if it moved by less than this since its last query, in
/// metres: then the next one is near, too. Twice as much made no clear difference on an outfit of
/// five layers; at ten times more most of those kept are not used again.
const STEADY: Real = 0.5e-3;
/// Layers that are skipped together leave a sample at least this much way, in metres: a step of a
/// contact. Ten times less is used up in each round, and at ten times more layers are too near.
const RESTING: Real = 2e-3;
/// Edges of so many times `long_edge` get their sample from the start. Others get it where something
/// is left to repair: from the start it takes a seventh of the time of garments with edges of 1 to 2 cm,
/// which end moved and strained alike. Those of 5 cm and more end strained half as much again without.
pub(crate) const COARSE: Real = 3.0;
/// Foreign samples this close to a corner of their triangle are left to the corner's own sample.
const CORNER: Real = 0.97;
/// Cosine between a triangle's normal and that of a vertex below it, under which the vertex belongs
/// to the wall of a fold, and does not poke at the triangle.
const POKES: Real = 0.3;
/// Steps that a vertex which is led out at once may take in one round.
const LEAP: Real = 4.0;
/// Height over length below which a triangle's normal turns with every small motion, and no foreign
/// sample is taken there. A long edge of 15 mm and a short one of 0.1 mm, in the coat of the test
/// data, drew the short one to 3 mm at a tenth of this value.
const SLIVER: Real = 0.05;
/// Cosine between the nearest way out and the one on the scale of centimetres under which the
/// nearest one leads through a wall.
const SIDEWAYS: Real = 0.5;

/// A garment as it is in one round.
#[derive(Clone, Copy)]
pub(crate) struct Garment<'a> {
    /// Its vertices, and their triangles.
    pub(crate) x: &'a [Point],
    pub(crate) triangles: &'a [[u32; 3]],
    /// Holds it at `x`.
    pub(crate) tree: &'a Bvh,
    /// The clearances of its vertices, in metres.
    pub(crate) gaps: &'a [Real],
    /// Vertices of inverse mass zero are held.
    pub(crate) inverse_masses: &'a [Real],
    /// How its vertices are led out.
    pub(crate) exits: &'a [Exit],
}

/// What a search works with.
#[derive(Clone, Copy)]
struct Scene<'a> {
    below: &'a [&'a ClosedLayer],
    outward: &'a Outward,
    params: ContactParams,
}

/// The search for contacts of one garment.
pub(crate) struct Contacts<'a> {
    below: &'a [&'a ClosedLayer],
    outward: &'a Outward,
    pub(crate) params: ContactParams,
    samples: Vec<Sample>,
    /// Samples of single vertices, which come first.
    single: usize,
    /// Middles that are no samples yet.
    middles: Vec<Sample>,
    /// For each sample its last query of each layer, and the triangles near it from the second query
    /// on.
    last_queries: Vec<LastQuery>,
    nearby: Vec<Option<Box<Nearby>>>,
    /// For each sample the layers that it need not query.
    rests: Vec<Rest>,
    /// For each layer and vertex of it its last query.
    foreign: Vec<Vec<LastForeign>>,
    /// Sum over the rounds of the largest motion of any vertex, in metres.
    path: Real,
    /// Nearest-point queries made.
    pub(crate) queries: usize,
    /// Queries skipped by the Lipschitz bound or because all vertices are held.
    pub(crate) skipped: usize,
}

impl<'a> Contacts<'a> {
    pub(crate) fn new(
        mesh: &TriMesh,
        edges: &Edges,
        below: &'a [&'a ClosedLayer],
        outward: &'a Outward,
        params: ContactParams,
    ) -> Self {
        let x = mesh.vertices();
        let mut samples = Vec::new();
        let mut used = vec![false; x.len()];
        mesh.triangles().iter().flatten().for_each(|v| used[*v as usize] = true);
        for v in (0..x.len() as u32).filter(|v| used[*v as usize]) {
            samples.push(Sample { vertices: [v; 3], weights: [1.0, 0.0, 0.0] });
        }
        let single = samples.len();
        let mut middles = Vec::new();
        let length = |e: usize| {
            let [a, b] = edges.vertices[e];
            (x[a as usize] - x[b as usize]).norm()
        };
        let mut add = |sample: Sample, longest: Real| {
            if longest > COARSE * params.long_edge {
                samples.push(sample);
            } else if longest > params.long_edge {
                middles.push(sample);
            }
        };
        for (e, &[a, b]) in edges.vertices.iter().enumerate() {
            add(Sample { vertices: [a, b, b], weights: [0.5, 0.5, 0.0] }, length(e));
        }
        for (t, tri) in mesh.triangles().iter().enumerate() {
            let longest = edges.of_triangle[t].iter().map(|e| length(*e as usize));
            let middle = Sample { vertices: *tri, weights: [1.0 / 3.0; 3] };
            add(middle, longest.fold(0.0, Real::max));
        }
        Self {
            last_queries: vec![LastQuery::NONE; samples.len() * below.len()],
            nearby: vec![None; samples.len() * below.len()],
            rests: vec![Rest::NONE; samples.len()],
            foreign: below.iter().map(|l| vec![LastForeign::default(); l.vertex_count()]).collect(),
            below,
            outward,
            params,
            samples,
            single,
            middles,
            path: 0.0,
            queries: 0,
            skipped: 0,
        }
    }

    /// Makes samples of the middles that are not held.
    pub(crate) fn refine(&mut self, inverse_masses: &[Real]) {
        let is_free = |s: &mut Sample| !s.is_held(inverse_masses);
        self.samples.extend(self.middles.extract_if(.., is_free));
        let queries = self.samples.len() * self.below.len();
        self.last_queries.resize(queries, LastQuery::NONE);
        self.nearby.resize(queries, None);
        self.rests.resize(self.samples.len(), Rest::NONE);
    }

    /// Makes the samples at `vertices` query again wherever they are: the side of a point can jump
    /// where a layer is closed by voxels, and no Lipschitz bound holds there.
    pub(crate) fn forget(&mut self, vertices: &[u32]) {
        let layers = self.below.len();
        for v in vertices {
            // The samples of single vertices come first, in ascending order.
            if let Ok(k) = self.samples[..self.single].binary_search_by_key(v, |s| s.vertices[0]) {
                self.last_queries[k * layers..(k + 1) * layers]
                    .iter_mut()
                    .for_each(|m| m.clear = 0.0);
                self.rests[k].free = 0.0;
            }
        }
    }

    /// Records that no vertex moved further than `most` metres since the last
    /// [`Contacts::detect`].
    pub(crate) fn moved(&mut self, most: Real) {
        self.path += most;
    }

    /// Fills `out` with the contacts of the `garment`.
    pub(crate) fn detect(&mut self, garment: Garment<'_>, out: &mut HalfSpaces) {
        out.clear();
        let scene = Scene { below: self.below, outward: self.outward, params: self.params };
        let (path, foreign) = (self.path, &mut self.foreign);
        let own = OwnSamples {
            samples: &self.samples,
            last_queries: &mut self.last_queries,
            nearby: &mut self.nearby,
            rests: &mut self.rests,
        };
        let foreign = || foreign_contacts(foreign, path, scene, garment);
        let (own, foreign) = rayon::join(|| own.contacts(scene, garment), foreign);
        for found in own.into_iter().chain(foreign) {
            self.queries += found.queries;
            self.skipped += found.skipped;
            for (s, plane) in found.contacts {
                out.push(s.vertices, s.weights, plane.normal, &plane.point, plane.gap);
            }
        }
    }

    /// For each vertex of a triangle, in ascending order, and for each layer the triangles near it,
    /// if it was queried more than once.
    pub(crate) fn nearby_of_vertices(&mut self) -> &mut [Option<Box<Nearby>>] {
        &mut self.nearby[..self.single * self.below.len()]
    }
}

/// What is remembered of the own samples, to query them less often.
struct OwnSamples<'a> {
    samples: &'a [Sample],
    last_queries: &'a mut [LastQuery],
    nearby: &'a mut [Option<Box<Nearby>>],
    rests: &'a mut [Rest],
}

impl OwnSamples<'_> {
    /// The contacts of own samples, a chunk at a time.
    fn contacts(self, scene: Scene<'_>, garment: Garment<'_>) -> Vec<Found> {
        let Scene { below, outward, params } = scene;
        let Garment { x, gaps, inverse_masses, exits, .. } = garment;
        let layers = below.len();
        self.samples
            .par_chunks(CHUNK)
            .zip(self.last_queries.par_chunks_mut(CHUNK * layers))
            .zip(self.nearby.par_chunks_mut(CHUNK * layers))
            .zip(self.rests.par_chunks_mut(CHUNK))
            .with_max_len(1)
            .map(|(((samples, last_queries), nearby), rests)| {
                let mut found = Found::default();
                for (k, (s, rest)) in samples.iter().zip(rests).enumerate() {
                    let held = s.is_held(inverse_masses) || s.is_planned(exits);
                    if params.skip && held {
                        found.skipped += layers;
                        continue;
                    }
                    let (p, gap, exit) = (s.at(x), s.gap(gaps), exits[s.vertices[0] as usize]);
                    let moved = (p - rest.position).norm();
                    let is_resting =
                        params.skip && moved < rest.free.min(rest.clear - gap - params.margin);
                    let resting = if is_resting { rest.layers } else { 0 };
                    let of_sample = k * layers..(k + 1) * layers;
                    let queries = last_queries[of_sample.clone()]
                        .iter_mut()
                        .zip(&mut nearby[of_sample.clone()]);
                    for (l, (layer, (m, nearby))) in below.iter().zip(queries).enumerate() {
                        if l < 64 && (resting >> l) & 1 == 1
                            || params.skip
                                && (p - m.position).norm() < m.clear - gap - params.margin
                                && layer.is_outside_by_voxels(&p)
                        {
                            found.skipped += 1;
                            continue;
                        }
                        found.queries += 1;
                        let plane = find_plane(&p, gap, exit, layer, outward, &params, (m, nearby));
                        found.contacts.extend(plane.filter(|_| !held).map(|plane| (*s, plane)));
                    }
                    if params.skip && !is_resting {
                        *rest = Rest::new(&p, gap, &last_queries[of_sample], below, &params);
                    }
                }
                found
            })
            .collect()
    }
}

/// The contacts of foreign samples, a chunk of a layer at a time. `foreign` are the last queries of
/// the layers below, and `path` is the length of the garment's path.
fn foreign_contacts(
    foreign: &mut [Vec<LastForeign>],
    path: Real,
    scene: Scene<'_>,
    garment: Garment<'_>,
) -> Vec<Found> {
    let Scene { below, params, .. } = scene;
    let Garment { x, triangles, tree, gaps, inverse_masses, exits } = garment;
    let range = gaps.iter().copied().fold(0.0, Real::max) + params.margin;
    let region = tree.aabb();
    let in_chunk = |layer: &ClosedLayer, first: usize, last_queries: &mut [LastForeign]| {
        let mut found = Found::default();
        for (number, last) in (first..).zip(last_queries) {
            if params.skip && path + range < last.until {
                found.skipped += 1;
                continue;
            }
            let v = layer.vertex(number);
            let away = region.distance_squared(&v).sqrt();
            if params.skip && away > range {
                last.until = path + away;
                found.skipped += 1;
                continue;
            }
            found.queries += 1;
            let hint = last
                .triangle
                .filter(|_| params.skip)
                .map(|t| distance_bound(&v, triangles[t as usize].map(|v| &x[v as usize])));
            let reach = range + params.reserve;
            let Some(near) = tree.closest(&v, hint.unwrap_or(reach).min(reach)) else {
                last.until = path + reach;
                continue;
            };
            last.triangle = Some(near.triangle);
            if near.distance > range {
                last.until = path + near.distance;
                continue;
            }
            let vertices = triangles[near.triangle as usize];
            let sample = Sample { vertices, weights: near.barycentric };
            if near.barycentric.iter().any(|b| *b > CORNER)
                || sample.is_held(inverse_masses)
                || sample.is_planned(exits)
            {
                continue;
            }
            let [a, b, c] = sample.vertices.map(|v| &x[v as usize]);
            let area = area_vector(a, b, c);
            let longest =
                (a - b).norm_squared().max((b - c).norm_squared()).max((c - a).norm_squared());
            if area.norm() < SLIVER * longest {
                continue;
            }
            let face = unit_or_zero(&area);
            let over = face.dot(&(near.point - v));
            if face.dot(&layer.vertex_normal(number)) < POKES || over < -4.0 * params.step {
                continue;
            }
            let gap = sample.gap(gaps).min(over + params.step);
            found.contacts.push((sample, Plane { normal: face, point: v, gap }));
        }
        found
    };
    let in_layer = |(layer, last_queries): (&&ClosedLayer, &mut Vec<LastForeign>)| {
        let chunks = last_queries.par_chunks_mut(CHUNK).enumerate().with_max_len(1);
        let found = chunks.map(|(k, last_queries)| in_chunk(layer, k * CHUNK, last_queries));
        found.collect::<Vec<_>>()
    };
    below.par_iter().zip(foreign).with_max_len(1).flat_map_iter(in_layer).collect()
}

/// The contact with one layer of a sample at `p` that is to be kept `gap` away.
fn find_plane(
    p: &Point,
    gap: Real,
    exit: Exit,
    layer: &ClosedLayer,
    outward: &Outward,
    params: &ContactParams,
    (m, nearby): (&mut LastQuery, &mut Option<Box<Nearby>>),
) -> Option<Plane> {
    let range = gap + params.margin;
    let reach = range + params.reserve;
    let is_steady = (p - m.position).norm() < STEADY;
    m.position = *p;
    m.clear = 0.0;
    let hint = m.triangle.filter(|_| params.skip);
    let sided = if hint.is_some() && (is_steady || nearby.is_some()) {
        layer.sided_nearby(p, reach, hint, (nearby.get_or_insert_default(), is_steady))
    } else {
        layer.sided_from(p, reach, hint)
    };
    let Some(s) = sided else {
        m.clear = reach;
        return None;
    };
    m.triangle = Some(s.triangle);
    if s.distance > range {
        m.clear = s.distance;
        return None;
    }
    let nearest = |gap| Some(Plane { normal: s.normal, point: s.point, gap });
    if s.distance >= gap || exit == Exit::Nearest {
        return nearest(gap.min(s.distance + params.leap()));
    }
    match outward.direction(p) {
        Some(out) if exit == Exit::Outward => {
            Some(Plane { normal: out, point: *p, gap: (gap - s.distance).min(params.leap()) })
        }
        // The nearest way out leads sideways, through the wall of a fold or of an armpit.
        Some(out) if s.normal.dot(&out) < SIDEWAYS => (s.distance < 0.0).then(|| Plane {
            normal: out,
            point: *p,
            gap: (gap - s.distance).min(params.step),
        }),
        _ => nearest(gap.min(s.distance + params.step)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::aabb::Aabb;
    use if_core::shapes::meshes::{cloth, icosphere};

    #[test]
    fn middles_of_long_edges_are_samples_at_once_only_if_they_are_very_long() {
        let ball = ClosedLayer::body(&icosphere(0.1, 2));
        let below = [&ball];
        let region = Aabb::from_points(&[Point::new(-0.2, -0.2, -0.2), Point::new(0.2, 0.2, 0.2)]);
        let outward = Outward::new(&below, &region, 0.01);
        let params =
            ContactParams { step: 2e-3, margin: 2e-3, reserve: 0.01, long_edge: 8e-3, skip: true };
        // Ten times ten squares of 4, 12 and 40 mm, each of two triangles.
        for (edge, at_once, later) in [(4e-3, 0, 0), (12e-3, 0, 520), (40e-3, 520, 520)] {
            let mesh = cloth(10.0 * edge, 10.0 * edge, 10, 10);
            let mut contacts = Contacts::new(&mesh, &Edges::new(&mesh), &below, &outward, params);
            assert_eq!(contacts.samples.len(), 121 + at_once, "{edge}");
            contacts.refine(&[0.0; 121]);
            assert_eq!(contacts.samples.len(), 121 + at_once, "{edge}");
            contacts.refine(&[1.0; 121]);
            assert_eq!(contacts.samples.len(), 121 + later, "{edge}");
            assert_eq!(contacts.last_queries.len(), contacts.samples.len());
            assert!(contacts.middles.is_empty() && contacts.single == 121);
        }
    }
}
