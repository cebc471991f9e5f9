//! Foreign samples of a garment: its nearest points to the vertices of the layers below.

use super::{CHUNK, Found, Garment, Plane, Sample, Scene};
use if_core::closest::{Closest, ClosestPoint};
use if_core::math::{Real, area_vector, unit_or_zero};
use if_mesh::index::distance_bound;
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;

/// Foreign samples this close to a corner of their triangle are left to the corner's own sample.
const CORNER: Real = 0.97;
/// Cosine between a triangle's normal and that of a vertex below it, under which the vertex belongs
/// to the wall of a fold, and does not poke at the triangle.
const POKES: Real = 0.3;
/// Height over length below which a triangle's normal turns with every small motion, and no foreign
/// sample is taken there. A long edge of 15 mm and a short one of 0.1 mm, in the coat of the test
/// data, drew the short one to 3 mm at a tenth of this value.
const SLIVER: Real = 0.05;

/// The last query of a vertex of a layer below.
#[derive(Clone, Copy, Debug, Default)]
struct LastForeign {
    /// The garment's path length before which it cannot touch the vertex, in metres.
    until: Real,
    /// The garment's nearest triangle, with which the next search begins.
    triangle: Option<u32>,
}

/// What is remembered of the foreign samples, to query them less often: for each layer and vertex of it
/// its last query.
pub(super) struct ForeignSamples(Vec<Vec<LastForeign>>);

impl ForeignSamples {
    /// Those of the layers `below`.
    pub(super) fn new(below: &[&ClosedLayer]) -> Self {
        Self(below.iter().map(|l| vec![LastForeign::default(); l.vertex_count()]).collect())
    }

    /// The contacts of foreign samples, a chunk of a layer at a time. The garment's `path` has this
    /// length so far, in metres.
    pub(super) fn contacts(
        &mut self,
        scene: Scene<'_>,
        garment: Garment<'_>,
        path: Real,
    ) -> Vec<Found> {
        let Scene { below, params, .. } = scene;
        let Garment { x, triangles, tree, gaps, .. } = garment;
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
                found.contacts.extend(contact(layer, number, &near, params.step, garment));
            }
            found
        };
        let in_layer = |(layer, last_queries): (&&ClosedLayer, &mut Vec<LastForeign>)| {
            let chunks = last_queries.par_chunks_mut(CHUNK).enumerate().with_max_len(1);
            let found = chunks.map(|(k, last_queries)| in_chunk(layer, k * CHUNK, last_queries));
            found.collect::<Vec<_>>()
        };
        below.par_iter().zip(&mut self.0).with_max_len(1).flat_map_iter(in_layer).collect()
    }
}

/// The contact of a vertex of a layer with the `garment`, whose nearest point is `near`, if the vertex
/// pokes at a triangle there. It is moved by `step` metres at most.
fn contact(
    layer: &ClosedLayer,
    vertex: usize,
    near: &Closest,
    step: Real,
    garment: Garment<'_>,
) -> Option<(Sample, Plane)> {
    let Garment { x, triangles, gaps, inverse_masses, exits, .. } = garment;
    let vertices = triangles[near.triangle as usize];
    let sample = Sample { vertices, weights: near.barycentric };
    if near.barycentric.iter().any(|b| *b > CORNER)
        || sample.is_held(inverse_masses)
        || sample.is_planned(exits)
    {
        return None;
    }
    let [a, b, c] = sample.vertices.map(|v| &x[v as usize]);
    let area = area_vector(a, b, c);
    let longest = (a - b).norm_squared().max((b - c).norm_squared()).max((c - a).norm_squared());
    if area.norm() < SLIVER * longest {
        return None;
    }
    let v = layer.vertex(vertex);
    let face = unit_or_zero(&area);
    let over = face.dot(&(near.point - v));
    if face.dot(&layer.vertex_normal(vertex)) < POKES || over < -4.0 * step {
        return None;
    }
    let gap = sample.gap(gaps).min(over + step);
    Some((sample, Plane { normal: face, point: v, gap }))
}
