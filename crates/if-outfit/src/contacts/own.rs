//! Own samples of a garment: points that are fixed on it, against the layers below.

use super::{CHUNK, ContactParams, Exit, Found, Garment, Plane, Sample, Scene};
use if_core::edges::Edges;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::index::Nearby;
use if_mesh::outward::Outward;
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;

/// The triangles near a sample are kept if it moved by less than this since its last query, in
/// metres: then the next one is near, too. Twice as much made no clear difference on an outfit of
/// five layers; at ten times more most of those kept are not used again.
const STEADY: Real = 0.5e-3;
/// Layers that are skipped together leave a sample at least this much way, in metres: a step of a
/// contact. Ten times less is used up in each round, and at ten times more layers are too near.
const RESTING: Real = 2e-3;
/// Cosine between the nearest way out and the one on the scale of centimetres under which the
/// nearest one leads through a wall.
const SIDEWAYS: Real = 0.5;

/// Edges of so many times `long_edge` get their sample from the start. Others get it where something
/// is left to repair: from the start it takes a seventh of the time of garments with edges of 1 to 2 cm,
/// which end moved and strained alike. Those of 5 cm and more end strained half as much again without.
pub(crate) const COARSE: Real = 3.0;

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

/// The own samples of a garment, and what is remembered of them, to query them less often.
pub(super) struct OwnSamples {
    samples: Vec<Sample>,
    /// Samples of single vertices, which come first.
    single: usize,
    /// Middles that are no samples yet.
    middles: Vec<Sample>,
    /// Layers below.
    layers: usize,
    /// For each sample its last query of each layer, and the triangles near it from the second query
    /// on.
    last_queries: Vec<LastQuery>,
    nearby: Vec<Option<Box<Nearby>>>,
    /// For each sample the layers that it need not query.
    rests: Vec<Rest>,
}

impl OwnSamples {
    /// The samples of `mesh`. Middles of edges longer than `long_edge` metres are some, or will be.
    pub(super) fn new(mesh: &TriMesh, edges: &Edges, long_edge: Real, layers: usize) -> Self {
        let x = mesh.vertices();
        let mut samples = Vec::new();
        let used = mesh.used_vertices();
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
            if longest > COARSE * long_edge {
                samples.push(sample);
            } else if longest > long_edge {
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
        let mut own = Self {
            samples,
            single,
            middles,
            layers,
            last_queries: Vec::new(),
            nearby: Vec::new(),
            rests: Vec::new(),
        };
        own.remember();
        own
    }

    /// Makes room for what is remembered of all samples.
    fn remember(&mut self) {
        let queries = self.samples.len() * self.layers;
        self.last_queries.resize(queries, LastQuery::NONE);
        self.nearby.resize(queries, None);
        self.rests.resize(self.samples.len(), Rest::NONE);
    }

    /// Makes samples of the middles that are not held.
    pub(super) fn refine(&mut self, inverse_masses: &[Real]) {
        let is_free = |s: &mut Sample| !s.is_held(inverse_masses);
        self.samples.extend(self.middles.extract_if(.., is_free));
        self.remember();
    }

    /// Makes the samples at `vertices` query again wherever they are.
    pub(super) fn forget(&mut self, vertices: &[u32]) {
        let layers = self.layers;
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

    /// As [`super::Contacts::nearby_of_vertices`].
    pub(super) fn nearby_of_vertices(&mut self) -> &mut [Option<Box<Nearby>>] {
        &mut self.nearby[..self.single * self.layers]
    }

    /// The contacts of own samples, a chunk at a time.
    pub(super) fn contacts(&mut self, scene: Scene<'_>, garment: Garment<'_>) -> Vec<Found> {
        let Scene { below, outward, params } = scene;
        let Garment { x, gaps, inverse_masses, exits, .. } = garment;
        let layers = self.layers;
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
    use if_core::shapes::meshes::cloth;

    #[test]
    fn middles_of_long_edges_are_samples_at_once_only_if_they_are_very_long() {
        // Ten times ten squares of 4, 12 and 40 mm, each of two triangles.
        for (edge, at_once, later) in [(4e-3, 0, 0), (12e-3, 0, 520), (40e-3, 520, 520)] {
            let mesh = cloth(10.0 * edge, 10.0 * edge, 10, 10);
            let mut own = OwnSamples::new(&mesh, &Edges::new(&mesh), 8e-3, 2);
            assert_eq!(own.samples.len(), 121 + at_once, "{edge}");
            own.refine(&[0.0; 121]);
            assert_eq!(own.samples.len(), 121 + at_once, "{edge}");
            own.refine(&[1.0; 121]);
            assert_eq!(own.samples.len(), 121 + later, "{edge}");
            assert_eq!(own.last_queries.len(), 2 * own.samples.len());
            assert!(own.middles.is_empty() && own.single == 121);
        }
    }
}
