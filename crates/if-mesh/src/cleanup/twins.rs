//! Which half-edges face each other.

use super::work::roomy;
use if_core::mesh::TriMesh;

/// No half-edge.
pub(crate) const NONE: u32 = u32::MAX;

/// The half-edge after `h` in its triangle. Half-edge `3t + k` runs from corner k to corner k + 1
/// of triangle t.
#[inline]
pub(crate) fn next(h: u32) -> u32 {
    if h % 3 == 2 { h - 2 } else { h + 1 }
}

/// The half-edge before `h` in its triangle.
#[inline]
pub(crate) fn previous(h: u32) -> u32 {
    if h.is_multiple_of(3) { h + 2 } else { h - 1 }
}

/// Both ends of half-edge `h`, where it starts first.
#[inline]
pub(crate) fn ends(triangles: &[[u32; 3]], h: u32) -> [u32; 2] {
    let t = triangles[h as usize / 3];
    [t[h as usize % 3], t[next(h) as usize % 3]]
}

/// The half-edges of a mesh.
#[derive(Debug, Default)]
pub(crate) struct Twins {
    /// For each half-edge the one that faces it: the only other one between its two vertices, in
    /// the opposite direction. [`NONE`] else.
    pub(crate) of: Vec<u32>,
    /// Pairs of half-edges alone between their vertices that run in the same direction.
    pub(crate) against: Vec<[u32; 2]>,
    /// Three or more half-edges between the same two vertices, ascending.
    pub(crate) crowded: Vec<Vec<u32>>,
}

impl Clone for Twins {
    fn clone(&self) -> Self {
        Self { of: roomy(&self.of), against: self.against.clone(), crowded: self.crowded.clone() }
    }
}

/// Lengths of buckets up to which insertion beats a library sort.
const SHORT: usize = 20;

/// An edge while half-edges are paired.
#[derive(Clone, Copy)]
struct Edge {
    /// The larger end.
    far: u32,
    /// The next edge with the same smaller end.
    next: u32,
    first: u32,
    /// The second half-edge, or [`FROM_NEAR`] or [`FROM_FAR`]: there is none yet, and where the
    /// first one starts.
    second: u32,
}

const FROM_NEAR: u32 = NONE;
const FROM_FAR: u32 = NONE - 1;
/// Steps along chains of edges for each triangle, at most, before all are sorted instead: meshes
/// take about five.
const STEPS: usize = 30;

impl Twins {
    /// Pairs the half-edges of `mesh`, in linear time where no vertex has very many neighbours.
    pub(crate) fn of_mesh(mesh: &TriMesh) -> Self {
        Self::new(mesh.vertices().len(), mesh.triangles())
    }

    /// Pairs the half-edges of `triangles`.
    pub(crate) fn new(vertices: usize, triangles: &[[u32; 3]]) -> Self {
        Self::by_chains(vertices, triangles)
            .unwrap_or_else(|| Self::by_sorting(vertices, triangles))
    }

    fn unpaired(triangles: &[[u32; 3]]) -> Self {
        let mut of = Vec::with_capacity(3 * triangles.len() + 3 * triangles.len() / 16); // patches are added soon
        of.resize(3 * triangles.len(), NONE);
        Self { of, ..Self::default() }
    }

    /// [`Twins::new`] where edges hang in chains by their smaller ends; none if the chains are long.
    fn by_chains(vertices: usize, triangles: &[[u32; 3]]) -> Option<Self> {
        let mut twins = Self::unpaired(triangles);
        let mut head = vec![NONE; vertices];
        let mut edges: Vec<Edge> =
            Vec::with_capacity(3 * triangles.len() / 2 + triangles.len() / 8);
        // Edges of two half-edges that start at the same end, and further half-edges of an edge, by
        // both ends.
        let mut against: Vec<([u32; 2], [u32; 2])> = Vec::new();
        let mut crowd: Vec<([u32; 2], u32)> = Vec::new();
        let mut steps = STEPS * triangles.len();
        for (t, corners) in (0..).zip(triangles) {
            let [a, b, c] = *corners;
            for (k, [a, b]) in (0..).zip([[a, b], [b, c], [c, a]]) {
                let h = 3 * t + k;
                let (near, far, from) = if a < b { (a, b, FROM_NEAR) } else { (b, a, FROM_FAR) };
                let first = head[near as usize];
                let mut at = first;
                loop {
                    let Some(edge) = edges.get_mut(at as usize) else {
                        head[near as usize] = edges.len() as u32;
                        edges.push(Edge { far, next: first, first: h, second: from });
                        break;
                    };
                    if edge.far != far {
                        at = edge.next;
                        steps = steps.checked_sub(1)?;
                        continue;
                    }
                    let before = std::mem::replace(&mut edge.second, h);
                    if before < FROM_FAR {
                        edge.second = before;
                        crowd.extend([edge.first, before, h].map(|h| ([near, far], h)));
                    } else if before == from {
                        against.push(([near, far], [edge.first, h]));
                    } else {
                        twins.of[h as usize] = edge.first;
                        twins.of[edge.first as usize] = h;
                    }
                    break;
                }
            }
        }
        crowd.sort_unstable();
        crowd.dedup();
        against.retain(|(ends, _)| crowd.binary_search_by(|c| c.0.cmp(ends)).is_err());
        against.sort_unstable();
        twins.against = against.into_iter().map(|a| a.1).collect();
        for run in crowd.chunk_by(|a, b| a.0 == b.0) {
            let run: Vec<u32> = run.iter().map(|c| c.1).collect();
            run.iter().for_each(|h| twins.of[*h as usize] = NONE);
            twins.crowded.push(run);
        }
        Some(twins)
    }

    /// [`Twins::new`] where all half-edges are sorted.
    fn by_sorting(vertices: usize, triangles: &[[u32; 3]]) -> Self {
        // Buckets by the smaller end; each holds (larger end, half-edge), the latter ascending.
        let mut start = vec![0u32; vertices + 2];
        for t in triangles {
            for k in 0..3 {
                start[t[k].min(t[(k + 1) % 3]) as usize + 2] += 1;
            }
        }
        for v in 2..start.len() {
            start[v] += start[v - 1];
        }
        let mut list = vec![(0u32, 0u32); 3 * triangles.len()];
        for (i, t) in triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                let at = &mut start[a.min(b) as usize + 1];
                list[*at as usize] = (a.max(b), (3 * i + k) as u32);
                *at += 1;
            }
        }
        let mut twins = Self::unpaired(triangles);
        let mut same = Vec::new();
        for v in 0..vertices {
            let bucket = &mut list[start[v] as usize..start[v + 1] as usize];
            sort(bucket);
            let mut run = 0;
            while run < bucket.len() {
                let mut end = run + 1;
                while end < bucket.len() && bucket[end].0 == bucket[run].0 {
                    end += 1;
                }
                if end > run + 1 {
                    same.clear();
                    same.extend(bucket[run..end].iter().map(|r| r.1));
                    twins.take(&same, triangles);
                }
                run = end;
            }
        }
        twins
    }

    /// Those of the same triangles without `gone`, ascending, the others renumbered.
    pub(crate) fn without(&self, gone: &[u32]) -> Self {
        debug_assert!(self.against.is_empty() && self.crowded.is_empty(), "of a manifold mesh");
        // How far the half-edges of each triangle move up; NONE for those that go.
        let mut up = Vec::with_capacity(self.of.len() / 3);
        for (k, &t) in gone.iter().enumerate() {
            up.resize(t as usize, 3 * k as u32);
            up.push(NONE);
        }
        up.resize(self.of.len() / 3, 3 * gone.len() as u32);
        let name = |h: u32| match h {
            NONE => NONE,
            _ => match up[h as usize / 3] {
                NONE => NONE,
                up => h - up,
            },
        };
        let mut of = Vec::with_capacity(self.of.len()); // with room for what is added soon
        let mut first = 0;
        for (k, end) in (0..).zip(gone.iter().map(|t| 3 * t).chain([self.of.len() as u32])) {
            // Most twins lie between the same two that go.
            let here = first..end;
            of.extend(
                self.of[first as usize..end as usize]
                    .iter()
                    .map(|h| if here.contains(h) { h - 3 * k } else { name(*h) }),
            );
            first = end + 3;
        }
        Self { of, ..Self::default() }
    }

    /// Pairs the half-edges of triangles that changed, or were added at the end. The edges of
    /// `changed` now must be no edges of triangles that are not among them, but for rims and what
    /// they were joined to before.
    pub(crate) fn update(&mut self, triangles: &[[u32; 3]], changed: &[u32]) {
        self.of.resize(3 * triangles.len(), NONE);
        for &t in changed {
            for h in 3 * t..3 * t + 3 {
                let twin = std::mem::replace(&mut self.of[h as usize], NONE);
                if twin != NONE {
                    self.of[twin as usize] = NONE;
                }
            }
        }
        // What is open now: rims, and the sides of what changed. Only edges of the latter can find
        // a twin.
        let key = |h: u32| {
            let [a, b] = ends(triangles, h);
            [a.min(b), a.max(b)]
        };
        let mut open: Vec<([u32; 2], u32)> = self.rim().map(|h| (key(h), h)).collect();
        open.sort_unstable();
        for run in open.chunk_by(|a, b| a.0 == b.0) {
            let run: Vec<u32> = run.iter().map(|r| r.1).collect();
            self.take(&run, triangles);
        }
    }

    /// Half-edges between the same two vertices, ascending.
    fn take(&mut self, run: &[u32], triangles: &[[u32; 3]]) {
        match *run {
            [_] => {}
            [g, h] if ends(triangles, g)[0] == ends(triangles, h)[1] => {
                self.of[g as usize] = h;
                self.of[h as usize] = g;
            }
            [g, h] => self.against.push([g, h]),
            _ => self.crowded.push(run.to_vec()),
        }
    }

    /// Half-edges without a twin, ascending.
    pub(crate) fn rim(&self) -> impl Iterator<Item = u32> {
        /// Half-edges looked at together: rims are rare.
        const MANY: usize = 32;
        let blocks = (0..).step_by(MANY).zip(self.of.chunks(MANY));
        let open =
            blocks.filter(|(_, block)| block.iter().fold(false, |open, h| open | (*h == NONE)));
        open.flat_map(|(base, block)| {
            (base..).zip(block).filter(|(_, t)| **t == NONE).map(|(h, _)| h)
        })
    }

    /// The half-edges that leave a vertex, round it from `h`, which is one of them: towards its
    /// twin first, and where a rim ends that walk, the other way.
    pub(crate) fn around(&self, h: u32, mut visit: impl FnMut(u32)) {
        visit(h);
        let mut at = h;
        loop {
            let twin = self.of[at as usize];
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
            at = self.of[previous(at) as usize];
            if at == NONE || at == h {
                return;
            }
            visit(at);
        }
    }
}

fn sort(bucket: &mut [(u32, u32)]) {
    if bucket.len() > SHORT {
        bucket.sort_unstable();
        return;
    }
    for k in 1..bucket.len() {
        let mut at = k;
        while at > 0 && bucket[at] < bucket[at - 1] {
            bucket.swap(at, at - 1);
            at -= 1;
        }
    }
}

/// For each vertex a half-edge that leaves it, [`NONE`] for one of no triangle. On the rim, the one
/// along it.
pub(crate) fn leaving(vertices: usize, triangles: &[[u32; 3]], twins: &Twins) -> Vec<u32> {
    let mut first = vec![NONE; vertices];
    for (t, tri) in triangles.iter().enumerate() {
        for k in 0..3 {
            let h = (3 * t + k) as u32;
            if first[tri[k] as usize] == NONE || twins.of[h as usize] == NONE {
                first[tri[k] as usize] = h;
            }
        }
    }
    first
}

/// Rims as loops of half-edges, each in the direction of its triangles, that of the smallest
/// half-edge first.
///
/// In a manifold mesh one rim half-edge leaves each rim vertex; elsewhere a loop ends where it
/// cannot go on.
pub(crate) fn loops(triangles: &[[u32; 3]], twins: &Twins) -> Vec<Vec<u32>> {
    let rim: Vec<u32> = twins.rim().collect();
    let mut seen = vec![false; rim.len()];
    let mut found = Vec::new();
    for (k, &first) in rim.iter().enumerate() {
        if seen[k] {
            continue;
        }
        let mut walk = Vec::new();
        let (mut h, mut at) = (first, k);
        while !std::mem::replace(&mut seen[at], true) {
            walk.push(h);
            // Turn round the end of `h` through the triangles there, until the rim comes again.
            h = next(h);
            while twins.of[h as usize] != NONE {
                h = next(twins.of[h as usize]);
            }
            at = rim.partition_point(|r| *r < h);
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
            let twins = Twins::of_mesh(&mesh);
            let edges = Edges::new(&mesh);
            for h in 0..twins.of.len() as u32 {
                let e = edges.of_triangle[h as usize / 3][h as usize % 3] as usize;
                assert_eq!(twins.of[h as usize] == NONE, edges.valence[e] == 1);
            }
            let mine: Vec<Vec<u32>> = loops(mesh.triangles(), &twins)
                .iter()
                .map(|l| l.iter().map(|&h| ends(mesh.triangles(), h)[0]).collect())
                .collect();
            assert_eq!(mine, edges.boundary_loops(&mesh));
        }
    }

    #[test]
    fn chains_pair_as_sorting_does_on_soups_and_give_up_on_fans() {
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
            let sorted = Twins::by_sorting(n as usize, &triangles);
            let chained = Twins::new(n as usize, &triangles);
            assert_eq!(
                (&chained.of, &chained.against, &chained.crowded),
                (&sorted.of, &sorted.against, &sorted.crowded)
            );
            seen[0] += sorted.of.iter().filter(|h| **h != NONE).count();
            seen[1] += sorted.against.len();
            seen[2] += sorted.crowded.len();
        }
        assert!(seen.iter().all(|n| *n > 300), "{seen:?}");
        // All edges of one vertex: a chain as long as the fan, looked through for each triangle.
        let fan: Vec<[u32; 3]> = (1..2000).map(|k| [0, k, k + 1]).collect();
        assert!(
            Twins::by_chains(2001, &fan.iter().rev().step_by(2).copied().collect::<Vec<_>>())
                .is_none()
        );
        assert_eq!(Twins::new(2001, &fan).of, Twins::by_sorting(2001, &fan).of);
    }

    #[test]
    fn what_is_left_out_turned_or_added_is_paired_as_if_all_were_paired_anew() {
        let mesh = tube(0.1, 0.3, 9, 6, false);
        let n = mesh.vertices().len();
        let mut triangles = mesh.triangles().to_vec();
        let mut twins = Twins::of_mesh(&mesh);
        let gone = [0, 7, 20, 21, 22, 107];
        let lost: Vec<[u32; 3]> = gone.iter().map(|t| triangles[*t as usize]).collect();
        let mut k = 0..;
        triangles.retain(|_| k.next().is_some_and(|k| gone.binary_search(&k).is_err()));
        twins = twins.without(&gone);
        assert_eq!(twins.of, Twins::new(n, &triangles).of);
        // Back, at the end.
        let added: Vec<u32> = (triangles.len() as u32..).take(lost.len()).collect();
        triangles.extend(&lost);
        twins.update(&triangles, &added);
        assert_eq!(twins.of, Twins::new(n, &triangles).of);
        // An edge turned: (a, b, c) and (b, a, d) become (c, d, b) and (d, c, a).
        let h = (30..).find(|h| twins.of[*h as usize] != NONE).unwrap();
        let twin = twins.of[h as usize];
        let ([a, b], c, d) = (
            ends(&triangles, h),
            ends(&triangles, previous(h))[0],
            ends(&triangles, previous(twin))[0],
        );
        triangles[h as usize / 3] = [c, d, b];
        triangles[twin as usize / 3] = [d, c, a];
        twins.update(&triangles, &[h / 3, twin / 3]);
        assert_eq!(twins.of, Twins::new(n, &triangles).of);
        assert!(twins.against.is_empty() && twins.crowded.is_empty());
    }

    #[test]
    fn a_walk_round_a_vertex_meets_each_triangle_once() {
        let mesh = tube(0.1, 0.3, 9, 3, false);
        let twins = Twins::of_mesh(&mesh);
        for (v, &h) in leaving(mesh.vertices().len(), mesh.triangles(), &twins).iter().enumerate() {
            let mut found = Vec::new();
            twins.around(h, |h| found.push(h / 3));
            found.sort_unstable();
            let all: Vec<u32> = (0..mesh.triangles().len() as u32)
                .filter(|t| mesh.triangles()[*t as usize].contains(&(v as u32)))
                .collect();
            assert_eq!(found, all);
        }
    }
}
