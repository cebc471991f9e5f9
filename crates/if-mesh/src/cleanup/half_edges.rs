//! Half-edges of a triangle mesh: twins, walks around vertices, boundary loops.

mod pairing;

/// Marks a missing half-edge or vertex.
pub(super) const NONE: u32 = u32::MAX;

/// The half-edge after `h` in its triangle. Half-edge `3t + k` runs from corner k to corner k + 1
/// of triangle t.
#[inline]
pub(super) fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The half-edge before `h` in its triangle.
#[inline]
pub(super) fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

/// The two vertices of half-edge `h`, its origin first.
#[inline]
pub(super) fn ends(triangles: &[[u32; 3]], h: u32) -> [u32; 2] {
    let t = triangles[h as usize / 3];
    [t[h as usize % 3], t[next(h) as usize % 3]]
}

/// Clones get spare capacity of one in this many, so that additions need no reallocation.
const SPARE: usize = 16;

/// A clone with spare capacity.
pub(super) fn clone_with_spare<T: Copy>(of: &[T]) -> Vec<T> {
    let mut clone = Vec::with_capacity(of.len() + of.len() / SPARE);
    clone.extend_from_slice(of);
    clone
}

/// The half-edges of a mesh.
#[derive(Debug, Default)]
pub(super) struct HalfEdges {
    /// For each half-edge the opposite one: the only other one between its two vertices, in the
    /// opposite direction. [`NONE`] if there is none.
    pub(super) twin: Vec<u32>,
    /// Pairs of half-edges, alone between their vertices, that run in the same direction.
    pub(super) inconsistent: Vec<[u32; 2]>,
    /// Three or more half-edges between the same two vertices, ascending.
    pub(super) non_manifold: Vec<Vec<u32>>,
}

impl Clone for HalfEdges {
    fn clone(&self) -> Self {
        Self {
            twin: clone_with_spare(&self.twin),
            inconsistent: self.inconsistent.clone(),
            non_manifold: self.non_manifold.clone(),
        }
    }
}

impl HalfEdges {
    /// Half-edges without a twin, ascending.
    pub(super) fn boundary(&self) -> impl Iterator<Item = u32> {
        /// Half-edges tested together: those without a twin are rare.
        const MANY: usize = 32;
        let blocks = (0..).step_by(MANY).zip(self.twin.chunks(MANY));
        let open =
            blocks.filter(|(_, block)| block.iter().fold(false, |open, h| open | (*h == NONE)));
        open.flat_map(|(base, block)| {
            (base..).zip(block).filter(|(_, t)| **t == NONE).map(|(h, _)| h)
        })
    }

    /// Visits the half-edges that leave a vertex, around it from `h`, which is one of them: towards
    /// its twin first and, if that walk ends at a boundary, the other way.
    pub(super) fn around(&self, h: u32, mut visit: impl FnMut(u32)) {
        visit(h);
        let mut at = h;
        loop {
            let twin = self.twin[at as usize];
            if twin == NONE {
                break;
            }
            at = next(twin);
            if at == h {
                return;
            }
            visit(at);
        }
        at = h;
        loop {
            at = self.twin[previous(at) as usize];
            if at == NONE || at == h {
                return;
            }
            visit(at);
        }
    }
}

/// For each vertex an outgoing half-edge, [`NONE`] for unused vertices. On the boundary, the one
/// along it.
pub(super) fn outgoing(
    vertices: usize,
    triangles: &[[u32; 3]],
    half_edges: &HalfEdges,
) -> Vec<u32> {
    let mut first = vec![NONE; vertices];
    for (t, tri) in triangles.iter().enumerate() {
        for k in 0..3 {
            let h = (3 * t + k) as u32;
            if first[tri[k] as usize] == NONE || half_edges.twin[h as usize] == NONE {
                first[tri[k] as usize] = h;
            }
        }
    }
    first
}

/// The vertices that an edge joins to the one that half-edge `h` leaves, into a buffer. Empty for
/// [`NONE`].
pub(super) fn one_ring_into(
    triangles: &[[u32; 3]],
    half_edges: &HalfEdges,
    h: u32,
    ring: &mut Vec<u32>,
) {
    ring.clear();
    if h != NONE {
        half_edges.around(h, |g| {
            ring.push(ends(triangles, g)[1]);
            if half_edges.twin[previous(g) as usize] == NONE {
                ring.push(ends(triangles, previous(g))[0]);
            }
        });
    }
}

/// Boundary loops of half-edges, each in the direction of its triangles and from its smallest
/// half-edge on, the loop of the smallest half-edge first.
///
/// In a manifold mesh one boundary half-edge leaves each boundary vertex; elsewhere a loop ends
/// where it cannot continue.
pub(super) fn boundary_loops(triangles: &[[u32; 3]], half_edges: &HalfEdges) -> Vec<Vec<u32>> {
    let boundary: Vec<u32> = half_edges.boundary().collect();
    let mut seen = vec![false; boundary.len()];
    let mut found = Vec::new();
    for (k, &first) in boundary.iter().enumerate() {
        if seen[k] {
            continue;
        }
        let mut walk = Vec::new();
        let (mut h, mut at) = (first, k);
        while !std::mem::replace(&mut seen[at], true) {
            walk.push(h);
            // Turn around the end of `h` through the triangles there, up to the next boundary edge.
            h = next(h);
            while half_edges.twin[h as usize] != NONE {
                h = next(half_edges.twin[h as usize]);
            }
            at = boundary.partition_point(|r| *r < h);
        }
        found.push(walk);
    }
    debug_assert!(found.iter().flatten().all(|&h| ends(triangles, h)[0] != ends(triangles, h)[1]));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::edges::Edges;
    use if_core::shapes::meshes::{icosphere, tube};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn twins_and_loops_agree_with_the_edges_of_the_core() {
        for mesh in [tube(0.1, 0.3, 17, 5, false), icosphere(0.2, 2)] {
            let half_edges = HalfEdges::of_mesh(&mesh);
            let edges = Edges::new(&mesh);
            for h in 0..half_edges.twin.len() as u32 {
                let e = edges.of_triangle[h as usize / 3][h as usize % 3] as usize;
                assert_eq!(half_edges.twin[h as usize] == NONE, edges.valence[e] == 1);
            }
            let mine: Vec<Vec<u32>> = boundary_loops(mesh.triangles(), &half_edges)
                .iter()
                .map(|l| l.iter().map(|&h| ends(mesh.triangles(), h)[0]).collect())
                .collect();
            assert_eq!(mine, edges.boundary_loops(&mesh));
        }
    }

    #[test]
    fn chains_pair_like_sorting_on_soups_and_give_up_on_fans() {
        let mut rng = Pcg64Mcg::seed_from_u64(11);
        let mut seen = [0; 3];
        for round in 0..300 {
            let n = 4 + round % 20;
            let triangles: Vec<[u32; 3]> = (0..rng.random_range(1..60))
                .map(|_| {
                    let a = rng.random_range(0..n);
                    let b = (a + rng.random_range(1..n)) % n;
                    let c = (0..n).find(|c| *c != a && *c != b && rng.random_range(0..n) == 0);
                    [a, b, c.unwrap_or_else(|| (0..n).find(|c| *c != a && *c != b).unwrap())]
                })
                .collect();
            let sorted = HalfEdges::by_sorting(n as usize, &triangles);
            let chained = HalfEdges::new(n as usize, &triangles);
            assert_eq!(
                (&chained.twin, &chained.inconsistent, &chained.non_manifold),
                (&sorted.twin, &sorted.inconsistent, &sorted.non_manifold)
            );
            seen[0] += sorted.twin.iter().filter(|h| **h != NONE).count();
            seen[1] += sorted.inconsistent.len();
            seen[2] += sorted.non_manifold.len();
        }
        assert!(seen.iter().all(|n| *n > 300), "{seen:?}");
        // All edges at one vertex: a chain as long as the fan, searched for each triangle.
        let fan: Vec<[u32; 3]> = (1..2000).map(|k| [0, k, k + 1]).collect();
        assert!(
            HalfEdges::by_chains(2001, &fan.iter().rev().step_by(2).copied().collect::<Vec<_>>())
                .is_none()
        );
        assert_eq!(HalfEdges::new(2001, &fan).twin, HalfEdges::by_sorting(2001, &fan).twin);
    }

    #[test]
    fn updates_after_removals_flips_and_additions_equal_a_new_pairing() {
        let mesh = tube(0.1, 0.3, 9, 6, false);
        let n = mesh.vertices().len();
        let mut triangles = mesh.triangles().to_vec();
        let mut half_edges = HalfEdges::of_mesh(&mesh);
        let gone = [0, 7, 20, 21, 22, 107];
        let lost: Vec<[u32; 3]> = gone.iter().map(|t| triangles[*t as usize]).collect();
        let mut k = 0..;
        triangles.retain(|_| k.next().is_some_and(|k| gone.binary_search(&k).is_err()));
        half_edges = half_edges.without(&gone);
        assert_eq!(half_edges.twin, HalfEdges::new(n, &triangles).twin);
        // Appended again.
        let added: Vec<u32> = (triangles.len() as u32..).take(lost.len()).collect();
        triangles.extend(&lost);
        half_edges.update(&triangles, &added);
        assert_eq!(half_edges.twin, HalfEdges::new(n, &triangles).twin);
        // An edge flipped: (a, b, c) and (b, a, d) become (c, d, b) and (d, c, a).
        let h = (30..).find(|h| half_edges.twin[*h as usize] != NONE).unwrap();
        let twin = half_edges.twin[h as usize];
        let ([a, b], c, d) = (
            ends(&triangles, h),
            ends(&triangles, previous(h))[0],
            ends(&triangles, previous(twin))[0],
        );
        triangles[h as usize / 3] = [c, d, b];
        triangles[twin as usize / 3] = [d, c, a];
        half_edges.update(&triangles, &[h / 3, twin / 3]);
        assert_eq!(half_edges.twin, HalfEdges::new(n, &triangles).twin);
        assert!(half_edges.inconsistent.is_empty() && half_edges.non_manifold.is_empty());
    }

    #[test]
    fn a_walk_around_a_vertex_visits_each_triangle_once() {
        let mesh = tube(0.1, 0.3, 9, 3, false);
        let half_edges = HalfEdges::of_mesh(&mesh);
        for (v, &h) in
            outgoing(mesh.vertices().len(), mesh.triangles(), &half_edges).iter().enumerate()
        {
            let mut found = Vec::new();
            half_edges.around(h, |h| found.push(h / 3));
            found.sort_unstable();
            let all: Vec<u32> = (0..mesh.triangles().len() as u32)
                .filter(|t| mesh.triangles()[*t as usize].contains(&(v as u32)))
                .collect();
            assert_eq!(found, all);
        }
    }
}
