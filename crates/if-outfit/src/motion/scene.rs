//! All layers of an outfit as one mesh: body and garments are solved in one problem.

use super::params::WalkParams;
use super::sides::Sides;
use crate::outfit::Outfit;
use if_core::edges::parts;
use if_core::math::{Point, Real, area_vector};
use if_core::mesh::TriMesh;
use if_mesh::body_surface::turned_outwards;
use if_mesh::intersections::Fans;
use if_mesh::seams::{Welded, weld, weld_all};
use std::collections::{HashMap, HashSet};

/// Area of a vertex whose mass is 1, in m²: a vertex of a mesh with edges of about 10 mm. Only the
/// ratios of masses and stiffness count; other values scale all multipliers.
const UNIT_AREA: Real = 1e-4;
/// Least area of a vertex, as a share of the mean of its layer. Ten times less makes slivers, such
/// as those of lips and fingers, move before anything around them.
const LEAST_AREA: Real = 0.1;

/// The layers of an outfit, joined: vertices and triangles of the body first, then of each garment.
#[derive(Clone, Debug)]
pub(super) struct Scene {
    /// The rest state, welded, and the body wound outwards.
    pub(super) mesh: TriMesh,
    /// First vertex of each layer, and the number of all.
    pub(super) starts: Vec<usize>,
    /// First triangle of each layer, and the number of all.
    pub(super) triangle_starts: Vec<usize>,
    /// Ends of the edges of all triangles, each once.
    pub(super) edges: Vec<[u32; 2]>,
    /// Of the mean lengths of the edges of layers, in metres, the shortest.
    pub(super) shortest_mean_edge: Real,
    /// Compliance of the difference of the displacements of an edge's ends.
    pub(super) compliance: Vec<Real>,
    /// 1 / mass of each vertex.
    pub(super) inverse_mass: Vec<Real>,
    /// Vertices that a seam doubles, each with the vertex that the triangles here have in its place.
    pub(super) doubled: Vec<[u32; 2]>,
    /// For each triangle which of its corners (bits 0 to 2) and edges (bits 3 to 5, from that
    /// corner to the next) no earlier triangle has: each is paired once.
    pub(super) owned: Vec<u8>,
    /// The triangles around each vertex. The body comes first, so they serve its mesh alone as well.
    pub(super) fans: Fans,
    /// Whether each vertex is one of a triangle.
    pub(super) used: Vec<bool>,
    /// For each vertex the first one of its connected part.
    pub(super) part_of: Vec<u32>,
    /// For each layer what tells its sides; `None` where it does so itself.
    pub(super) sides: Vec<Option<Sides>>,
}

impl Scene {
    /// Joins the layers of `outfit`.
    pub(super) fn new(outfit: &Outfit, params: &WalkParams) -> Self {
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        let (mut starts, mut triangle_starts) = (vec![0], vec![0]);
        let mut doubled = Vec::new();
        let turned = turned_outwards(&outfit.body.mesh);
        let body = turned.as_ref().unwrap_or(&outfit.body.mesh);
        let garments = outfit.garments.iter().map(|g| (&g.mesh, weld_all(&g.mesh)));
        for (mesh, welded) in [(body, weld(body))].into_iter().chain(garments) {
            let first = vertices.len() as u32;
            let kept = welded.as_ref().map(kept_vertices);
            vertices.extend_from_slice(mesh.vertices());
            let moved = |v: u32| first + kept.as_ref().map_or(v, |kept| kept[v as usize]);
            triangles.extend(mesh.triangles().iter().map(|t| t.map(moved)));
            let all = 0..mesh.vertices().len() as u32;
            doubled.extend(all.map(|v| [first + v, moved(v)]).filter(|[v, kept]| v != kept));
            starts.push(vertices.len());
            triangle_starts.push(triangles.len());
        }
        let mesh = TriMesh::new(vertices, triangles).expect("layers are valid meshes");
        let (owned, edges) = ownership(&mesh);
        let mut scene = Self {
            fans: Fans::new(&mesh),
            used: mesh.used_vertices(),
            part_of: parts(&mesh),
            mesh,
            starts,
            triangle_starts,
            edges,
            shortest_mean_edge: Real::INFINITY,
            compliance: Vec::new(),
            inverse_mass: Vec::new(),
            doubled,
            owned,
            sides: Vec::new(),
        };
        let layers = 0..scene.layers();
        let layers: Vec<TriMesh> =
            layers.map(|layer| scene.layer_mesh(scene.mesh.vertices(), layer)).collect();
        scene.sides = Sides::new(&layers);
        scene.weigh(params);
        scene.measure_edges();
        scene
    }

    /// Masses by area, and stiffness so that displacements fade over the stated lengths:
    ///
    /// ```text
    /// E(u) = ½ Σ mᵥ |uᵥ|² + ½ Σ k |uᵢ − uⱼ|²,    mᵥ = ρ A_v,   k = ρ ℓ² 2 Aₑ / L²
    /// ```
    ///
    /// For equilateral triangles k / (ρ ℓ²) is the cotangent weight; it is never negative.
    fn weigh(&mut self, params: &WalkParams) {
        let n = self.mesh.vertices().len();
        let mut area = vec![0.0; n];
        let mut shares: HashMap<[u32; 2], Real> = HashMap::new();
        for (t, corners) in self.mesh.triangles().iter().enumerate() {
            let [a, b, c] = self.mesh.corners(t);
            let third = area_vector(a, b, c).norm() / 3.0;
            for k in 0..3 {
                area[corners[k] as usize] += third;
                *shares.entry(sorted(corners[k], corners[(k + 1) % 3])).or_default() += third;
            }
        }
        self.inverse_mass = vec![0.0; n];
        let mut stiffness = vec![0.0; n];
        for layer in 0..self.layers() {
            let range = self.starts[layer]..self.starts[layer + 1];
            let mean = area[range.clone()].iter().sum::<Real>() / range.len().max(1) as Real;
            let (density, length) = if layer == 0 {
                (params.body_weight, params.body_length)
            } else {
                (1.0, params.garment_length)
            };
            for v in range {
                let mass = density * area[v].max(LEAST_AREA * mean) / UNIT_AREA;
                self.inverse_mass[v] = if mass > 0.0 { 1.0 / mass } else { 0.0 };
                stiffness[v] = density * length * length / UNIT_AREA;
            }
        }
        let x = self.mesh.vertices();
        self.compliance = self
            .edges
            .iter()
            .map(|e| {
                let squared = (x[e[0] as usize] - x[e[1] as usize]).norm_squared();
                squared / (2.0 * shares[e] * stiffness[e[0] as usize]).max(Real::MIN_POSITIVE)
            })
            .collect();
    }

    fn measure_edges(&mut self) {
        let mut sums = vec![(0.0, 0.0); self.layers()];
        let x = self.mesh.vertices();
        for [a, b] in &self.edges {
            let sum = &mut sums[self.layer_of(*a)];
            *sum = (sum.0 + (x[*a as usize] - x[*b as usize]).norm(), sum.1 + 1.0);
        }
        let means = sums.iter().map(|(length, count)| length / count).filter(|mean| *mean > 0.0);
        self.shortest_mean_edge = means.fold(Real::INFINITY, Real::min);
    }

    /// Number of layers, the body included.
    pub(super) fn layers(&self) -> usize {
        self.starts.len() - 1
    }

    /// The layer of a vertex.
    pub(super) fn layer_of(&self, vertex: u32) -> usize {
        self.starts.partition_point(|s| *s <= vertex as usize) - 1
    }

    /// The layer of a triangle, and its index there.
    pub(super) fn local_triangle(&self, triangle: u32) -> (usize, u32) {
        let layer = self.triangle_starts.partition_point(|s| *s <= triangle as usize) - 1;
        (layer, triangle - self.triangle_starts[layer] as u32)
    }

    /// The corners, among the vertices of all layers, of a triangle of one.
    pub(super) fn corners_of(&self, layer: usize, triangle: u32) -> [usize; 3] {
        let corners = self.mesh.triangles()[self.triangle_starts[layer] + triangle as usize];
        corners.map(|v| v as usize)
    }

    /// Gives doubled vertices the positions of those that stand for them.
    pub(super) fn copy_doubled(&self, x: &mut [Point]) {
        for [v, kept] in &self.doubled {
            x[*v as usize] = x[*kept as usize];
        }
    }

    /// One layer with its positions of `positions`, welded.
    pub(super) fn layer_mesh(&self, positions: &[Point], layer: usize) -> TriMesh {
        let first = self.starts[layer] as u32;
        let triangles =
            &self.mesh.triangles()[self.triangle_starts[layer]..self.triangle_starts[layer + 1]];
        let triangles = triangles.iter().map(|t| t.map(|v| v - first)).collect();
        TriMesh::new(self.of_layer(positions, layer).to_vec(), triangles)
            .expect("positions that were checked, and triangles of a mesh")
    }

    /// The positions of one layer.
    pub(super) fn of_layer<'a>(&self, positions: &'a [Point], layer: usize) -> &'a [Point] {
        &positions[self.starts[layer]..self.starts[layer + 1]]
    }
}

/// For each vertex the one that stands for it once seams are welded.
fn kept_vertices(welded: &Welded) -> Vec<u32> {
    let first = welded.first_of();
    let kept = |(v, to): (usize, &u32)| match first.get(*to as usize) {
        Some(first) => *first,
        // Of no triangle.
        None => v as u32,
    };
    welded.vertex_map.iter().enumerate().map(kept).collect()
}

fn sorted(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Which corners and edges each triangle owns, and all edges in that order.
fn ownership(mesh: &TriMesh) -> (Vec<u8>, Vec<[u32; 2]>) {
    let mut seen = vec![false; mesh.vertices().len()];
    let (mut seen_edges, mut edges) = (HashSet::new(), Vec::new());
    let own = |t: &[u32; 3]| {
        let mut bits = 0;
        for k in 0..3 {
            if !std::mem::replace(&mut seen[t[k] as usize], true) {
                bits |= 1 << k;
            }
            let edge = sorted(t[k], t[(k + 1) % 3]);
            if seen_edges.insert(edge) {
                bits |= 8 << k;
                edges.push(edge);
            }
        }
        bits
    };
    (mesh.triangles().iter().map(own).collect(), edges)
}
