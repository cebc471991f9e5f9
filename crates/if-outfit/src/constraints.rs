//! What holds a garment together in the solver: its edges by length, its hinges, its doubled
//! points.

use if_core::edges::{Edges, NONE};
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::stretch::Stretch;

/// The edges in groups of similar length, the shorter the stiffer: β ~ ℓ², so that what is spread
/// evenly is strain, and not the change of length.
pub(crate) fn stretch_groups(edges: &Edges, x: &[Point], softness: Real) -> Vec<Stretch> {
    /// Bounds of the groups, relative to the mean length.
    const BOUNDS: [Real; 5] = [0.25, 0.5, 0.8, 1.2, 1.8];
    let length = |e: &[u32; 2]| (x[e[0] as usize] - x[e[1] as usize]).norm();
    let mean = edges.vertices.iter().map(length).sum::<Real>() / edges.len().max(1) as Real;
    let group_of = |l: Real| BOUNDS.iter().take_while(|b| l > **b * mean).count();
    (0..=BOUNDS.len())
        .filter_map(|g| {
            let ends: Vec<[u32; 2]> =
                edges.vertices.iter().filter(|e| group_of(length(e)) == g).copied().collect();
            let rests: Vec<Real> = ends.iter().map(length).collect();
            let typical = rests.iter().sum::<Real>() / (rests.len().max(1) as Real * mean);
            let set = EdgeSet::new(&ends, &rests, x.len())
                .expect("two different vertices of a mesh, and a finite length");
            (!ends.is_empty()).then(|| {
                Stretch::new(set, softness * typical * typical)
                    .expect("a checked softness and a finite length")
            })
        })
        .collect()
}

/// Share of the mean length below which an edge counts as a point that was doubled. Ten times less
/// leaves a 0.1 mm edge of the test data strained by 150 %; ten times more stiffens fine details.
const SHORT: Real = 0.03;

/// The edges that are doubled points.
pub(crate) fn short_edges(edges: &Edges, x: &[Point]) -> Vec<[u32; 2]> {
    let length = |e: &[u32; 2]| (x[e[0] as usize] - x[e[1] as usize]).norm();
    let mean = edges.vertices.iter().map(length).sum::<Real>() / edges.len().max(1) as Real;
    edges.vertices.iter().filter(|e| length(e) < SHORT * mean).copied().collect()
}

/// For each inner edge the two corners across it: kept at their distance, they keep the fold's
/// angle.
pub(crate) fn hinge_edges(mesh: &TriMesh, edges: &Edges) -> EdgeSet {
    let x = mesh.vertices();
    let mut across = Vec::new();
    let mut rest = Vec::new();
    for (e, &[a, b]) in edges.vertices.iter().enumerate() {
        let [t, u] = edges.triangles[e];
        if u == NONE {
            continue;
        }
        let opposite =
            |t: u32| mesh.triangles()[t as usize].into_iter().find(|v| *v != a && *v != b);
        if let (Some(c), Some(d)) = (opposite(t), opposite(u))
            && c != d
        {
            across.push([c, d]);
            rest.push((x[c as usize] - x[d as usize]).norm());
        }
    }
    EdgeSet::new(&across, &rest, x.len())
        .expect("two different vertices of a mesh, and a finite length")
}
