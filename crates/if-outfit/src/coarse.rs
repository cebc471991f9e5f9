//! A garment of small triangles, in large ones: it settles there first.
//!
//! Sweeps carry a push from edge to edge. Where edges are millimetres long, most pushes end before a
//! fold is smooth, and rounds grow with the number of vertices. So cells of the surface settle first,
//! each as one vertex, and the garment begins where they lead it; what then is left is small.
//!
//! ```text
//! visit the vertices, those of borders first:
//!     farther along edges than RADIUS from all seeds: a seed      each vertex belongs to its nearest
//! a triangle whose corners belong to three seeds: a triangle of those
//! settle the seeds                                                                     settle.rs
//! move each vertex as the nearest place in the triangles round its seed and round the neighbours of that
//! ```

use crate::outfit::Layer;
use if_core::closest::closest_on_triangle;
use if_core::edges::{Edges, NONE};
use if_core::geodesic::Neighbours;
use if_core::math::{Point, Real, Vector, barycentric_point};
use if_core::mesh::TriMesh;
use if_core::rows::Rows;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Radius of cells along the surface, in metres: their triangles have edges of about a centimetre, as
/// garments have for which the solver's parameters were chosen.
const RADIUS: Real = 7e-3;
/// Garments whose edges are longer than this on average settle at once, in metres.
const LONGEST: Real = 6e-3;

/// A place on three vertices of the coarse garment, with weights of sum 1.
type Place = ([u32; 3], [Real; 3]);

/// A garment in large triangles.
pub(crate) struct Coarse {
    pub(crate) garment: Layer,
    /// Of each vertex of the fine garment.
    places: Vec<Place>,
}

impl Coarse {
    /// `garment` in large triangles; `None` if its own are not small.
    pub(crate) fn new(garment: &Layer, edges: &Edges, neighbours: &Neighbours) -> Option<Self> {
        let x = garment.mesh.vertices();
        if garment.mesh.mean_edge() > LONGEST {
            return None;
        }
        let is_border = |e: &usize| edges.triangles[*e][1] == NONE;
        let border = (0..edges.len()).filter(is_border).flat_map(|e| edges.vertices[e]);
        let cells = neighbours.cells(border.chain(0..x.len() as u32), RADIUS);
        // Small parts, of which each becomes a vertex.
        if 2 * cells.seeds.len() > x.len() {
            return None;
        }
        let mut known = BTreeSet::new();
        let mut triangles = Vec::new();
        for corners in garment.mesh.triangles() {
            let seeds = corners.map(|v| cells.of[v as usize]);
            let mut sorted = seeds;
            sorted.sort_unstable();
            if sorted[0] != sorted[1] && sorted[1] != sorted[2] && known.insert(sorted) {
                triangles.push(seeds);
            }
        }
        let seeds = cells.seeds.iter().map(|v| x[*v as usize]).collect();
        let mesh = TriMesh::new(seeds, triangles).ok()?;
        let places = places(&mesh, x, &cells.of);
        Some(Self { garment: Layer { mesh, ..garment.clone() }, places })
    }

    /// Displacements of the fine garment's vertices where the coarse one has moved to `positions`.
    pub(crate) fn displacements<'a>(
        &'a self,
        positions: &'a [Point],
    ) -> impl Iterator<Item = Vector> + 'a {
        let given = self.garment.mesh.vertices();
        let moved = move |v: u32| positions[v as usize] - given[v as usize];
        self.places
            .iter()
            .map(move |(v, w)| moved(v[0]) * w[0] + moved(v[1]) * w[1] + moved(v[2]) * w[2])
    }
}

/// For each point of `x`, which belongs to the vertex `cell` of `mesh`, the nearest place on the
/// triangles round that and round its neighbours: a cell may reach beyond the triangles of its seed.
fn places(mesh: &TriMesh, x: &[Point], cells: &[u32]) -> Vec<Place> {
    let corners = mesh.triangles().iter().enumerate();
    let corners = corners.flat_map(|(t, corners)| corners.map(|v| (v, t as u32)));
    let round = Rows::new(mesh.vertices().len(), corners);
    let around = |v: usize| {
        let corners = round.of(v).iter().flat_map(|t| mesh.triangles()[*t as usize]);
        let all: BTreeSet<u32> = corners.flat_map(|v| round.of(v as usize)).copied().collect();
        all.into_iter().collect::<Vec<_>>()
    };
    let around: Vec<Vec<u32>> = (0..mesh.vertices().len()).into_par_iter().map(around).collect();
    let place = |(p, cell): (&Point, &u32)| {
        let near = around[*cell as usize].iter().map(|t| {
            let corners = mesh.corners(*t as usize);
            let (weights, _) = closest_on_triangle(p, corners[0], corners[1], corners[2]);
            let distance = (p - barycentric_point(corners, weights)).norm_squared();
            (distance, (mesh.triangles()[*t as usize], weights))
        });
        // The vertex itself, if it has no triangle.
        let nearest = near.min_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map_or(([*cell; 3], [1.0, 0.0, 0.0]), |(_, place)| place)
    };
    x.par_iter().zip(cells).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outfit::Outfit;
    use crate::params::ResolveParams;
    use crate::resolve::resolve;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::{icosphere, tube};

    fn coarse(mesh: &TriMesh) -> Option<Coarse> {
        let edges = Edges::new(mesh);
        let neighbours = Neighbours::new(&edges, mesh.vertices());
        Coarse::new(&Layer::new("band", mesh.clone()), &edges, &neighbours)
    }

    #[test]
    fn a_fine_band_becomes_a_coarse_one_with_the_same_borders_and_moves_as_it() {
        let fine = tube(0.1, 0.2, 256, 80, false);
        let coarse = coarse(&fine).unwrap();
        let mesh = &coarse.garment.mesh;
        let (few, many) = (mesh.triangles().len(), fine.triangles().len());
        assert!(few * 5 < many && few > 500, "{few} of {many}");
        let edges = Edges::new(mesh);
        assert_eq!(edges.boundary_loops(mesh).len(), 2);
        assert!(mesh.used_vertices().iter().all(|used| *used));
        let mean = mesh.mean_edge();
        assert!((5e-3..12e-3).contains(&mean), "{mean}");
        // A motion that is linear in space is kept, up to the bend of the surface.
        let motion = |p: &Point| Vector::new(0.1 * p.y, 0.2 * p.x + 0.01, -0.1 * p.z);
        let moved: Vec<Point> = mesh.vertices().iter().map(|p| p + motion(p)).collect();
        for (p, d) in fine.vertices().iter().zip(coarse.displacements(&moved)) {
            assert!((d - motion(p)).norm() < 1e-3, "{p}: {d}");
        }
    }

    #[test]
    fn a_fine_band_settles_in_coarse_triangles_and_ends_clean() {
        let band = |round, along| {
            let tube = tube(0.146, 0.1, round, along, false);
            let low = tube.vertices().iter().map(|p| Point::new(p.x, p.y - 0.05, p.z)).collect();
            Layer::new("band", tube.with_vertices(low).unwrap())
        };
        let body = Layer::new("body", icosphere(0.15, 5));
        let resolved = |garment| {
            let outfit = Outfit::new(body.clone(), vec![garment]).unwrap();
            let params = ResolveParams::default();
            resolve(&outfit, &params, &mut Silent).unwrap().report.layers.remove(0)
        };
        let (fine, usual) = (resolved(band(384, 40)), resolved(band(96, 10)));
        assert!(fine.strategies.coarse_rounds > 0 && usual.strategies.coarse_rounds == 0);
        assert!(fine.moved.max > 3e-3 && fine.moved.max < 7e-3, "{:?}", fine.moved);
        // It gives way as the coarse one does, and its own rounds are few.
        assert!(fine.strain.rms < 1.3 * usual.strain.rms, "{:?} {:?}", fine.strain, usual.strain);
        assert!(fine.rounds <= 4, "{}", fine.rounds);
    }

    #[test]
    fn a_garment_of_usual_triangles_settles_at_once() {
        assert!(coarse(&tube(0.1, 0.2, 64, 20, false)).is_none());
    }
}
