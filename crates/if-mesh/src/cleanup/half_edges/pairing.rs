//! Pairing of half-edges with their twins.

use super::{HalfEdges, NONE, ends};
use if_core::mesh::TriMesh;

/// Length of a bucket up to which insertion sort beats the library's sort.
const SHORT: usize = 20;

/// An edge while half-edges are paired.
#[derive(Clone, Copy)]
struct Edge {
    /// The larger end.
    far: u32,
    /// The next edge with the same smaller end.
    next: u32,
    first: u32,
    /// The second half-edge. While there is none, [`FROM_NEAR`] or [`FROM_FAR`]: where the first one
    /// starts.
    second: u32,
}

const FROM_NEAR: u32 = NONE;
const FROM_FAR: u32 = NONE - 1;
/// Maximum number of steps along chains of edges per triangle; beyond it all edges are sorted
/// instead. Meshes take about five.
const STEPS: usize = 30;

impl HalfEdges {
    /// Pairs the half-edges of `mesh`, in linear time unless a vertex has very many neighbours.
    pub(in crate::cleanup) fn of_mesh(mesh: &TriMesh) -> Self {
        Self::new(mesh.vertices().len(), mesh.triangles())
    }

    /// Pairs the half-edges of `triangles`.
    pub(in crate::cleanup) fn new(vertices: usize, triangles: &[[u32; 3]]) -> Self {
        Self::by_chains(vertices, triangles)
            .unwrap_or_else(|| Self::by_sorting(vertices, triangles))
    }

    fn unpaired(triangles: &[[u32; 3]]) -> Self {
        let mut twin = Vec::with_capacity(3 * triangles.len() + 3 * triangles.len() / 16); // patches are added soon
        twin.resize(3 * triangles.len(), NONE);
        Self { twin, ..Self::default() }
    }

    /// [`HalfEdges::new`] by chains of edges with the same smaller end; `None` if the chains are
    /// long.
    pub(super) fn by_chains(vertices: usize, triangles: &[[u32; 3]]) -> Option<Self> {
        let mut half_edges = Self::unpaired(triangles);
        let mut head = vec![NONE; vertices];
        let mut edges: Vec<Edge> =
            Vec::with_capacity(3 * triangles.len() / 2 + triangles.len() / 8);
        // By both ends: pairs of half-edges in the same direction, and all half-edges of edges with
        // three or more.
        let mut inconsistent: Vec<([u32; 2], [u32; 2])> = Vec::new();
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
                        inconsistent.push(([near, far], [edge.first, h]));
                    } else {
                        half_edges.twin[h as usize] = edge.first;
                        half_edges.twin[edge.first as usize] = h;
                    }
                    break;
                }
            }
        }
        crowd.sort_unstable();
        crowd.dedup();
        inconsistent.retain(|(ends, _)| crowd.binary_search_by(|c| c.0.cmp(ends)).is_err());
        inconsistent.sort_unstable();
        half_edges.inconsistent = inconsistent.into_iter().map(|a| a.1).collect();
        for run in crowd.chunk_by(|a, b| a.0 == b.0) {
            let run: Vec<u32> = run.iter().map(|c| c.1).collect();
            run.iter().for_each(|h| half_edges.twin[*h as usize] = NONE);
            half_edges.non_manifold.push(run);
        }
        Some(half_edges)
    }

    /// [`HalfEdges::new`] by sorting all half-edges.
    pub(super) fn by_sorting(vertices: usize, triangles: &[[u32; 3]]) -> Self {
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
        let mut half_edges = Self::unpaired(triangles);
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
                    half_edges.take(&same, triangles);
                }
                run = end;
            }
        }
        half_edges
    }

    /// The half-edges after the removal of triangles `gone`, ascending; the others are renumbered.
    pub(in crate::cleanup) fn without(&self, gone: &[u32]) -> Self {
        debug_assert!(
            self.inconsistent.is_empty() && self.non_manifold.is_empty(),
            "of a manifold mesh"
        );
        // By how much the half-edges of each triangle move up; NONE for removed triangles.
        let mut up = Vec::with_capacity(self.twin.len() / 3);
        for (k, &t) in gone.iter().enumerate() {
            up.resize(t as usize, 3 * k as u32);
            up.push(NONE);
        }
        up.resize(self.twin.len() / 3, 3 * gone.len() as u32);
        let name = |h: u32| match h {
            NONE => NONE,
            _ => match up[h as usize / 3] {
                NONE => NONE,
                up => h - up,
            },
        };
        let mut twin = Vec::with_capacity(self.twin.len()); // with room for what is added soon
        let mut first = 0;
        for (k, end) in (0..).zip(gone.iter().map(|t| 3 * t).chain([self.twin.len() as u32])) {
            // Most twins lie between the same two removed triangles.
            let here = first..end;
            twin.extend(
                self.twin[first as usize..end as usize]
                    .iter()
                    .map(|h| if here.contains(h) { h - 3 * k } else { name(*h) }),
            );
            first = end + 3;
        }
        Self { twin, ..Self::default() }
    }

    /// Pairs the half-edges of triangles that changed, or were added at the end. The new edges of
    /// `changed` must not be edges of unchanged triangles, except for boundary edges and edges to
    /// which they belonged before.
    pub(in crate::cleanup) fn update(&mut self, triangles: &[[u32; 3]], changed: &[u32]) {
        self.twin.resize(3 * triangles.len(), NONE);
        for &t in changed {
            for h in 3 * t..3 * t + 3 {
                let twin = std::mem::replace(&mut self.twin[h as usize], NONE);
                if twin != NONE {
                    self.twin[twin as usize] = NONE;
                }
            }
        }
        // Open now: boundaries, and the sides of what changed. Only edges of the latter can find a
        // twin.
        let key = |h: u32| {
            let [a, b] = ends(triangles, h);
            [a.min(b), a.max(b)]
        };
        let mut open: Vec<([u32; 2], u32)> = self.boundary().map(|h| (key(h), h)).collect();
        open.sort_unstable();
        for run in open.chunk_by(|a, b| a.0 == b.0) {
            let run: Vec<u32> = run.iter().map(|r| r.1).collect();
            self.take(&run, triangles);
        }
    }

    /// Pairs or records all half-edges between the same two vertices, ascending.
    fn take(&mut self, run: &[u32], triangles: &[[u32; 3]]) {
        match *run {
            [_] => {}
            [g, h] if ends(triangles, g)[0] == ends(triangles, h)[1] => {
                self.twin[g as usize] = h;
                self.twin[h as usize] = g;
            }
            [g, h] => self.inconsistent.push([g, h]),
            _ => self.non_manifold.push(run.to_vec()),
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
