//! The moving garment against itself: contacts that keep sides, and a filter that never lets a new
//! intersection through.

use if_core::aabb::Aabb;
use if_core::closest::closest_on_triangle;
use if_core::edges::VertexTriangles;
use if_core::math::{Point, Real, area_vector, barycentric_point};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs;
use if_xpbd::pair_contact::PairContacts;
use rayon::prelude::*;

/// What is known of a garment's own contacts.
pub(crate) struct OwnContacts {
    around: VertexTriangles,
    /// Intersecting pairs of the input, sorted: they are its maker's, and allowed to stay.
    given: Vec<[u32; 2]>,
}

impl OwnContacts {
    pub(crate) fn new(mesh: &TriMesh, tree: &Bvh) -> Self {
        let given = own_pairs(mesh, tree).iter().map(|p| [p.a, p.b]).collect();
        Self { around: VertexTriangles::new(mesh), given }
    }

    pub(crate) fn given(&self) -> usize {
        self.given.len()
    }

    /// Intersecting pairs that the input did not have.
    pub(crate) fn fresh(&self, mesh: &TriMesh, tree: &Bvh) -> Vec<[u32; 2]> {
        own_pairs(mesh, tree).iter().map(|p| [p.a, p.b]).filter(|p| self.given.binary_search(p).is_err()).collect()
    }

    /// For each vertex the nearest triangle of another part of the garment, where one faces it within
    /// `reach`: the sheets of a fold, which move together.
    pub(crate) fn proximity(&self, x: &[Point], triangles: &[[u32; 3]], tree: &Bvh, reach: Real) -> Vec<(u32, u32, [Real; 3], Real)> {
        (0..x.len())
            .into_par_iter()
            .filter_map(|v| {
                let own = self.around.of(v);
                let p = &x[v];
                let mut best: Option<(Real, u32, [Real; 3])> = None;
                let near = Aabb { min: *p, max: *p }.inflated(reach);
                if own.is_empty() {
                    return None;
                }
                tree.overlapping(&near, |t| {
                    let tri = triangles[t as usize];
                    if own.iter().any(|o| triangles[*o as usize].iter().any(|u| tri.contains(u))) {
                        return;
                    }
                    let c = tri.map(|u| &x[u as usize]);
                    let (b, _) = closest_on_triangle(p, c[0], c[1], c[2]);
                    let to = p - barycentric_point(c, b);
                    let distance = to.norm();
                    let n = area_vector(c[0], c[1], c[2]);
                    let height = n.dot(&to) / n.norm();
                    if distance <= reach && height.abs() > 0.7 * distance && best.is_none_or(|(d, _, _)| distance < d) {
                        best = Some((distance, t, b));
                    }
                });
                best.map(|(d, t, b)| (v as u32, t, b, d))
            })
            .collect()
    }

    /// Vertices next to triangles of other parts of the garment within `reach`, each kept on its
    /// present side. `gap` is the distance to keep, or most of the present one where that is smaller.
    pub(crate) fn detect(&self, x: &[Point], triangles: &[[u32; 3]], tree: &Bvh, reach: Real, gap: Real, out: &mut PairContacts) {
        out.clear();
        let found: Vec<Vec<(u32, u32, Real, Real)>> = (0..x.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|v| {
                let own = self.around.of(v);
                let mut found = Vec::new();
                if own.is_empty() {
                    return found;
                }
                let p = &x[v];
                let near = Aabb { min: *p, max: *p }.inflated(reach);
                tree.overlapping(&near, |t| {
                    let tri = triangles[t as usize];
                    // Neighbours over an edge or a vertex are held by stretch and bending.
                    if own.iter().any(|o| triangles[*o as usize].iter().any(|u| tri.contains(u))) {
                        return;
                    }
                    let c = tri.map(|u| &x[u as usize]);
                    let (b, _) = closest_on_triangle(p, c[0], c[1], c[2]);
                    let to = p - barycentric_point(c, b);
                    let distance = to.norm();
                    let n = area_vector(c[0], c[1], c[2]);
                    let height = n.dot(&to) / n.norm();
                    // Beside the triangle rather than over it: the same sheet, further on.
                    if distance > reach || !(height.abs() > 0.5 * distance) {
                        return;
                    }
                    found.push((v as u32, t, height.signum(), gap.min(0.9 * distance)));
                });
                found
            })
            .collect();
        for (v, t, side, gap) in found.into_iter().flatten() {
            out.push_vertex_face(v, triangles[t as usize], side, gap);
        }
    }

    /// Moves from `from` to `to` as far as it can without an own intersection that the input did not
    /// have: vertices of offending triangles go half as far, then a quarter, then stay, and with them
    /// their neighbours. `from` must be free of new ones; so is then what is left in `to`.
    ///
    /// Returns the number of vertices held back.
    pub(crate) fn filter(&self, mesh: &TriMesh, from: &[Point], to: &mut [Point], tree: &mut Bvh) -> usize {
        let n = from.len();
        let mut share = vec![1.0; n];
        let target = to.to_vec();
        for attempt in 0..64 {
            tree.refit(to);
            let moved = mesh.with_vertices(to.to_vec());
            let Ok(moved) = moved else {
                to.copy_from_slice(from);
                return n;
            };
            let fresh: Vec<[u32; 2]> = own_pairs(&moved, tree)
                .iter()
                .map(|p| [p.a, p.b])
                .filter(|p| self.given.binary_search(p).is_err())
                .collect();
            if fresh.is_empty() {
                return share.iter().filter(|s| **s < 1.0).count();
            }
            let mut hit: Vec<u32> = fresh.iter().flatten().flat_map(|t| mesh.triangles()[*t as usize]).collect();
            // From the third attempt on the neighbourhood gives way too, one ring more each time.
            for _ in 0..(attempt / 3).min(8) {
                let ring: Vec<u32> = hit
                    .iter()
                    .flat_map(|v| self.around.of(*v as usize))
                    .flat_map(|t| mesh.triangles()[*t as usize])
                    .collect();
                hit.extend(ring);
                hit.sort_unstable();
                hit.dedup();
            }
            hit.sort_unstable();
            hit.dedup();
            for v in hit {
                let v = v as usize;
                share[v] = if attempt > 40 || share[v] < 0.2 { 0.0 } else { share[v] * 0.5 };
                to[v] = from[v] + (target[v] - from[v]) * share[v];
            }
        }
        to.copy_from_slice(from);
        tree.refit(to);
        n
    }
}
