//! The proof of one state: exact intersections of all layers with one another and with themselves,
//! and sides by the nearest surface and by closed layers, but of what lies in the open.
//!
//! ```text
//! side of a vertex of a part that comes near the layer      by the nearest point, where that is near
//! of a part that lies within the layer's box, far from it   by the nearest point
//! of any other part: it reaches beyond the box              outside
//! ```
//!
//! Parts are connected: what does not intersect a closed layer lies on one side of it as a whole.
//!
//! What lies behind the nearest surface has a second opinion, as [`verify`](crate::verify()) has it at rest: the
//! closed layer says so as well, and, where a garment does not meet the layer, of a neighbour too. States without
//! such vertices close no layer.

use super::scene::Scene;
use super::tolerated::Tolerated;
use crate::findings::alone;
use if_core::closest::ClosestPoint;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::{own_pairs, pairs};
use if_mesh::sdf::MeshSdf;
use if_mesh::solid::{ClosedLayer, Exposure};
use rayon::prelude::*;

/// Distance up to which a vertex has a side of a layer below, in metres: as the project's referee.
/// Farther away the nearest surface may be that of another limb.
const REACH: Real = 0.06;
/// Pairs and vertices that a proof names.
const NAMED: usize = 8;

/// What exact verification finds in one state.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Proof {
    /// Intersecting triangle pairs between layers.
    pub pairs: usize,
    /// Vertices on the wrong side of a layer below, once for each layer, by the nearest point of its
    /// surface. A vertex whose nearest point lies on a boundary has no side; nor has one that is 6 cm
    /// from the surface where its part of the garment comes nearer. Vertices of no triangle do not count,
    /// nor do those that lie outside of the closed layer as in [`verify`](crate::verify()), those over a garment
    /// that lie in the open, or those that are the only ones of their triangles inside while nothing intersects:
    /// under a folded collar, beside a waist that is folded over, or at an ear or a toe the nearest surface faces
    /// the wrong way.
    pub inside: usize,
    /// For each layer, the body first, its intersecting triangle pairs with itself.
    pub own_pairs: Vec<usize>,
    /// Own pairs of garments that the rest state does not have.
    pub new_own_pairs: usize,
    /// What lies in the pinches of a body that is kept ([`Walker::keep`](super::Walker::keep)), in
    /// no other field; `None` if the body yields.
    pub pinched: Option<Pinched>,
    /// Up to eight of the [pairs](Self::pairs), and then of the [new own pairs](Self::new_own_pairs): layers
    /// and their triangles.
    pub first_pairs: Vec<[(usize, u32); 2]>,
    /// Up to eight of the vertices on a [wrong side](Self::inside).
    pub first_inside: Vec<VertexInside>,
}

/// A vertex on the wrong side of a layer below.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct VertexInside {
    /// The layer below.
    pub below: usize,
    /// The layer of the vertex.
    pub layer: usize,
    /// The vertex there.
    pub vertex: u32,
}

impl Proof {
    /// Counts the vertex `v` of all layers as one on the wrong side of a layer below.
    fn add_inside(&mut self, scene: &Scene, below: usize, v: usize) {
        self.inside += 1;
        if self.first_inside.len() < NAMED {
            let layer = scene.layer_of(v as u32);
            let vertex = (v - scene.starts[layer]) as u32;
            self.first_inside.push(VertexInside { below, layer, vertex });
        }
    }
}

/// What meets a body in its pinches.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Pinched {
    /// Triangles of the body that lie in pinches.
    pub body: Vec<u32>,
    /// For each garment its intersecting triangle pairs with the body: triangle of the body, of the
    /// garment.
    pub pairs: Vec<Vec<[u32; 2]>>,
    /// For each garment its vertices on the wrong side of the body.
    pub inside: Vec<usize>,
}

/// Verifies `positions` with trees of its own.
pub(super) fn prove(scene: &Scene, positions: &[Point], tolerated: &Tolerated) -> Proof {
    let layers: Vec<(TriMesh, Bvh)> = (0..scene.layers())
        .into_par_iter()
        .map(|layer| {
            let mesh = scene.layer_mesh(positions, layer);
            let tree = Bvh::new(&mesh);
            (mesh, tree)
        })
        .collect();
    let mut proof = Proof::default();
    let garments = scene.layers() - 1;
    proof.pinched = tolerated.pinched.as_ref().map(|pinched| Pinched {
        body: (0u32..).zip(pinched).filter(|(_, is)| **is).map(|(t, _)| t).collect(),
        pairs: vec![Vec::new(); garments],
        inside: vec![0; garments],
    });
    // Whether a layer meets one above it.
    let mut meet = vec![vec![false; layers.len()]; layers.len()];
    let mut new_own: Vec<[(usize, u32); 2]> = Vec::new();
    for (k, (mesh, tree)) in layers.iter().enumerate() {
        let first = scene.triangle_starts[k] as u32;
        let own: Vec<[u32; 2]> =
            own_pairs(mesh, tree).iter().map(|p| [p.a + first, p.b + first]).collect();
        proof.own_pairs.push(own.len());
        if k > 0 {
            let new = tolerated.left(&own);
            proof.new_own_pairs += new.len();
            new_own.extend(new.iter().take(NAMED).map(|pair| pair.map(|t| (k, t - first))));
        }
        for (j, (_, below)) in layers[..k].iter().enumerate() {
            let found = pairs(below, tree);
            meet[j][k] = !found.is_empty();
            proof.pairs += found.len();
            let counted = found.iter().filter(|p| j > 0 || !tolerated.is_pinched(p.a));
            let more = NAMED - proof.first_pairs.len();
            proof.first_pairs.extend(counted.take(more).map(|p| [(j, p.a), (k, p.b)]));
            if let (0, Some(pinched)) = (j, &mut proof.pinched) {
                let there = found.iter().filter(|p| tolerated.is_pinched(p.a));
                pinched.pairs[k - 1].extend(there.map(|p| [p.a, p.b]));
                proof.pairs -= pinched.pairs[k - 1].len();
            }
        }
    }
    proof.first_pairs.extend(new_own);
    proof.first_pairs.truncate(NAMED);
    let mut body = None;
    for (below, (mesh, tree)) in layers.iter().enumerate().take(scene.layers() - 1) {
        let sides = scene.sides[below].as_ref();
        let told = sides.map(|sides| sides.mesh(mesh.vertices()));
        // An empty mesh is the only other error, and layers have triangles.
        let Ok(field) = MeshSdf::open(told.as_ref().unwrap_or(mesh), Real::INFINITY) else {
            continue;
        };
        let mut found = behind(scene, positions, below, &field);
        if found.is_empty() {
            continue;
        }
        let skin = &layers[0].0;
        let body = body.get_or_insert_with(|| ClosedLayer::body(skin));
        if below == 0 {
            found = within(body, found, positions);
        } else {
            let exposure = Exposure::in_pose(mesh, tree, body);
            found =
                found.into_par_iter().filter(|v| !exposure.is_exposed(&positions[*v])).collect();
            if !found.is_empty() {
                found = within(&ClosedLayer::garment(mesh, body, skin), found, positions);
            }
        }
        for above in (below + 1..scene.layers()).filter(|above| !meet[below][*above]) {
            let triangles = scene.triangle_starts[above]..scene.triangle_starts[above + 1];
            let alone = alone(&scene.mesh.triangles()[triangles], &found);
            found.retain(|v| !alone.contains(v));
        }
        if let (0, Some(pinched)) = (below, &mut proof.pinched) {
            // Where the body passes itself, the nearest skin is that of a pinch.
            let mut inside = Vec::new();
            for v in found {
                let nearest = field.surface().closest(&positions[v], REACH);
                let triangle = nearest.map(|c| sides.map_or(c.triangle, |s| s.given(c.triangle)));
                if triangle.is_some_and(|t| tolerated.is_pinched(t)) {
                    pinched.inside[scene.layer_of(v as u32) - 1] += 1;
                } else {
                    inside.push(v);
                }
            }
            found = inside;
        }
        found.into_iter().for_each(|v| proof.add_inside(scene, below, v));
    }
    proof
}

/// Those of some vertices that a closed layer has inside.
fn within(layer: &ClosedLayer, vertices: Vec<usize>, positions: &[Point]) -> Vec<usize> {
    let is_inside = |v: &usize| layer.sided(&positions[*v], 0.0).is_some_and(|s| s.distance < 0.0);
    vertices.into_par_iter().filter(is_inside).collect()
}

/// The vertices above layer `below` that lie behind its surface, which `field` holds; ascending.
fn behind(scene: &Scene, positions: &[Point], below: usize, field: &MeshSdf) -> Vec<usize> {
    let vertices = || (scene.starts[below + 1]..positions.len()).filter(|v| scene.used[*v]);
    let side = |v: usize, limit: Real| Some(field.signed_within(&positions[v], limit)?.distance);
    let near: Vec<(usize, Real)> = vertices()
        .collect::<Vec<_>>()
        .into_par_iter()
        .with_min_len(256)
        .filter_map(|v| Some((v, side(v, REACH)?)))
        .collect();
    // Of each part, by its first vertex: whether it has a side so, or lies outside.
    let mut is_decided = vec![false; positions.len()];
    near.iter().for_each(|(v, _)| is_decided[scene.part_of[*v] as usize] = true);
    let region = field.surface().aabb();
    let beyond = vertices().filter(|v| region.distance_squared(&positions[*v]) > 0.0);
    beyond.for_each(|v| is_decided[scene.part_of[v] as usize] = true);
    let far = vertices()
        .filter(|v| !is_decided[scene.part_of[*v] as usize])
        .filter_map(|v| Some((v, side(v, Real::INFINITY)?)));
    let mut found: Vec<usize> =
        near.iter().copied().chain(far).filter(|(_, d)| *d < 0.0).map(|(v, _)| v).collect();
    found.sort_unstable();
    found
}
