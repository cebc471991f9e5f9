//! Intersection contours of a mesh with itself, and which way each leads apart.
//!
//! Where two sheets pass through one another, edges of each pass through triangles of the other. A
//! contour is a chain of triangle pairs that such passages connect. It cuts both sheets: a part that
//! it cuts off lies on the wrong side of the other sheet, and goes back through it.
//!
//! # Source
//!
//! Global intersection analysis [Baraff et al. 2003]: the smaller one of the two parts is the one on
//! the wrong side. Deviation: a contour that cuts nothing off, as where it ends inside a sheet, has
//! no verdict, and all ways are tried, those that move least first.

use if_core::edges::{Edges, parts_by_edges};
use if_core::intersect::{Passage, segment_triangle};
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Which way two sheets are moved apart: the first relative to the second along ±1 or 0 times the
/// second's normal, and the second relative to the first along ±1 or 0 times the first's.
pub(super) type Way = [i8; 2];

/// Difference of two places along an edge, as a share of its length, below which they are one: the
/// edge passes through the common edge of two triangles. Rounding is 1e-15; two sheets of one
/// garment are not that close.
const SAME_PLACE: Real = 1e-9;

/// A chain of intersecting triangle pairs.
#[derive(Clone, Debug)]
pub(super) struct Contour {
    /// The triangle of the first sheet, and that of the second.
    pub(super) pairs: Vec<[u32; 2]>,
    /// Vertices of what the contour cuts off.
    pub(super) cut_off: Vec<u32>,
    /// The way back for what is cut off; `[0, 0]` if nothing is.
    verdict: Way,
    /// Mean depth of the first sheet's corners below the second sheet, and above it; the same for
    /// the second sheet.
    depths: [[Real; 2]; 2],
}

/// An edge that passes through a triangle.
struct Passing {
    edge: u32,
    triangle: u32,
    /// Place along the edge, from 0 to 1.
    place: Real,
    /// Pairs of the triangle with triangles at the edge, and whether the triangle is the second one
    /// there.
    pairs: Vec<(usize, bool)>,
}

impl Contour {
    /// All contours of the own `pairs` of `mesh`.
    pub(super) fn all(mesh: &TriMesh, edges: &Edges, pairs: &[[u32; 2]]) -> Vec<Self> {
        let passings = passings(mesh, edges, pairs);
        let mut of_pair = vec![Vec::new(); pairs.len()];
        for (k, passing) in passings.iter().enumerate() {
            passing.pairs.iter().for_each(|(pair, _)| of_pair[*pair].push(k));
        }
        // For each pair its contour, and whether its triangles change places there.
        let mut seen: Vec<Option<(usize, bool)>> = vec![None; pairs.len()];
        let mut chains: Vec<BTreeSet<usize>> = Vec::new();
        for first in 0..pairs.len() {
            if seen[first].is_some() {
                continue;
            }
            seen[first] = Some((chains.len(), false));
            let mut queue = VecDeque::from([first]);
            let mut chain = BTreeSet::new();
            while let Some(pair) = queue.pop_front() {
                let turned = seen[pair].is_some_and(|s| s.1);
                for &k in &of_pair[pair] {
                    chain.insert(k);
                    let here = passings[k].pairs.iter().find(|p| p.0 == pair).is_some_and(|p| p.1);
                    for &(other, second) in &passings[k].pairs {
                        if seen[other].is_none() {
                            seen[other] = Some((chains.len(), turned ^ (here != second)));
                            queue.push_back(other);
                        }
                    }
                }
            }
            chains.push(chain);
        }
        let mut of_chain = vec![Vec::new(); chains.len()];
        for (seen, pair) in seen.iter().zip(pairs) {
            if let Some((chain, turned)) = seen {
                of_chain[*chain].push(if *turned { [pair[1], pair[0]] } else { *pair });
            }
        }
        let mut pieces = Pieces::new(mesh, edges);
        let chain = |(chain, pairs): (&BTreeSet<usize>, Vec<[u32; 2]>)| {
            let passings: Vec<&Passing> = chain.iter().map(|k| &passings[*k]).collect();
            Self::new(mesh, edges, &mut pieces, pairs, &passings)
        };
        chains.iter().zip(of_chain).map(chain).collect()
    }

    fn new(
        mesh: &TriMesh,
        edges: &Edges,
        pieces: &mut Pieces,
        pairs: Vec<[u32; 2]>,
        passings: &[&Passing],
    ) -> Self {
        let x = mesh.vertices();
        let mut cuts: BTreeMap<u32, Vec<Real>> = BTreeMap::new();
        passings.iter().for_each(|p| cuts.entry(p.edge).or_default().push(p.place));
        for places in cuts.values_mut() {
            places.sort_by(Real::total_cmp);
            places.dedup_by(|a, b| (*a - *b).abs() < SAME_PLACE);
        }
        // An edge that passes twice ends where it began.
        let is_cut = |e: u32| cuts.get(&e).is_some_and(|places| places.len() % 2 == 1);
        let ends = passings.iter().map(|p| edges.vertices[p.edge as usize][0]);
        let parts = pieces.parts_without(edges, ends, is_cut);
        let firsts: BTreeSet<u32> = pairs.iter().map(|p| p[0]).collect();
        let (mut votes, mut counts) = ([0i64; 2], [0i64; 2]);
        let mut inside = BTreeSet::new();
        for passing in passings {
            let [p, q] = edges.vertices[passing.edge as usize];
            let [of_p, of_q] = [p, q].map(|v| parts.of(pieces, v));
            let on_first = !firsts.contains(&passing.triangle);
            counts[usize::from(!on_first)] += 1;
            if !is_cut(passing.edge) || of_p == of_q {
                continue;
            }
            let size = |part: u32| (parts.sizes[part as usize], part);
            let is_q_in = size(of_q) < size(of_p);
            let (outer, inner) = if is_q_in { (p, of_q) } else { (q, of_p) };
            inside.insert(inner);
            let height = height(mesh, passing.triangle, &x[outer as usize]);
            votes[usize::from(!on_first)] += if height > 0.0 { 1 } else { -1 };
        }
        let verdict = [0, 1].map(|k| match (votes[k], counts[k]) {
            (votes, count) if 2 * votes > count => 1,
            (votes, count) if -2 * votes > count => -1,
            _ => 0,
        });
        let cut_off = match verdict {
            [0, 0] => Vec::new(),
            _ => parts.vertices_in(&inside),
        };
        let depth = |moved: usize, sign: Real| {
            let below = pairs.iter().map(|pair| {
                let corners = mesh.corners(pair[moved] as usize);
                let heights = corners.map(|p| sign * height(mesh, pair[1 - moved], p));
                heights.into_iter().fold(0.0, Real::min).abs()
            });
            below.sum::<Real>() / pairs.len().max(1) as Real
        };
        let depths = [0, 1].map(|moved| [depth(moved, 1.0), depth(moved, -1.0)]);
        Self { pairs, cut_off, verdict, depths }
    }

    /// All ways apart, the verdict first, then those that move least.
    pub(super) fn ways(&self) -> Vec<Way> {
        let cost = |way: &Way| {
            let of = |k: usize| match way[k] {
                0 => None,
                sign => Some(self.depths[k][usize::from(sign < 0)]),
            };
            let costs: Vec<Real> = [of(0), of(1)].into_iter().flatten().collect();
            costs.iter().sum::<Real>() / costs.len().max(1) as Real
        };
        let mut ways: Vec<Way> = vec![[1, 0], [-1, 0], [0, 1], [0, -1]];
        ways.extend([[1, 1], [1, -1], [-1, 1], [-1, -1]]);
        ways.retain(|way| *way != self.verdict);
        ways.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        if self.verdict != [0, 0] {
            ways.insert(0, self.verdict);
        }
        ways
    }

    /// Vertices of the pairs, of the first sheet and of the second.
    pub(super) fn vertices(&self, triangles: &[[u32; 3]]) -> [BTreeSet<u32>; 2] {
        [0, 1].map(|k| self.pairs.iter().flat_map(|p| triangles[p[k] as usize]).collect())
    }
}

/// The connected pieces of a mesh: a contour cuts only those that it lies on.
struct Pieces {
    /// For each vertex its piece.
    of: Vec<u32>,
    /// Of each piece its vertices and edges, ascending.
    vertices: Vec<Vec<u32>>,
    edges: Vec<Vec<u32>>,
    /// For each vertex its place among those of the pieces that were cut last.
    places: Vec<u32>,
}

/// Some pieces in parts.
struct Parts {
    vertices: Vec<u32>,
    /// For each of these its part: the place of the first vertex in it.
    of: Vec<u32>,
    /// For each of these how many vertices are in the part that begins with it.
    sizes: Vec<usize>,
}

impl Pieces {
    fn new(mesh: &TriMesh, edges: &Edges) -> Self {
        let first = parts_by_edges(edges.vertices.iter().copied(), mesh.vertices().len());
        let (mut of, mut vertices) = (vec![0; first.len()], Vec::new());
        for (v, first) in first.iter().enumerate() {
            // The first vertex of a piece comes before the others.
            if v == *first as usize {
                of[v] = vertices.len() as u32;
                vertices.push(Vec::new());
            } else {
                of[v] = of[*first as usize];
            }
            vertices[of[v] as usize].push(v as u32);
        }
        let mut of_pieces = vec![Vec::new(); vertices.len()];
        for (e, [v, _]) in (0..).zip(&edges.vertices) {
            of_pieces[of[*v as usize] as usize].push(e);
        }
        Self { places: vec![0; of.len()], of, vertices, edges: of_pieces }
    }

    /// The pieces on which vertices of `on` lie, in parts that edges connect which are not cut.
    fn parts_without(
        &mut self,
        edges: &Edges,
        on: impl Iterator<Item = u32>,
        is_cut: impl Fn(u32) -> bool,
    ) -> Parts {
        let pieces: BTreeSet<u32> = on.map(|v| self.of[v as usize]).collect();
        let of =
            |list: &[Vec<u32>]| pieces.iter().flat_map(|k| &list[*k as usize]).copied().collect();
        let mut vertices: Vec<u32> = of(&self.vertices);
        vertices.sort_unstable();
        for (place, v) in (0..).zip(&vertices) {
            self.places[*v as usize] = place;
        }
        let all: Vec<u32> = of(&self.edges);
        let kept = all.into_iter().filter(|e| !is_cut(*e));
        let ends = kept.map(|e| edges.vertices[e as usize].map(|v| self.places[v as usize]));
        let of = parts_by_edges(ends, vertices.len());
        let mut sizes = vec![0; vertices.len()];
        of.iter().for_each(|part| sizes[*part as usize] += 1);
        Parts { vertices, of, sizes }
    }
}

impl Parts {
    /// The part of a vertex that is in one of `pieces`.
    fn of(&self, pieces: &Pieces, v: u32) -> u32 {
        self.of[pieces.places[v as usize] as usize]
    }

    fn vertices_in(&self, parts: &BTreeSet<u32>) -> Vec<u32> {
        let of = self.vertices.iter().zip(&self.of);
        of.filter(|(_, part)| parts.contains(part)).map(|(v, _)| *v).collect()
    }
}

/// Height of `p` over the plane of a triangle; 0 over one without area.
fn height(mesh: &TriMesh, triangle: u32, p: &Point) -> Real {
    let [a, b, c] = mesh.corners(triangle as usize);
    unit_or_zero(&area_vector(a, b, c)).dot(&(p - a))
}

/// The unit normal of a triangle; 0 for one without area.
pub(super) fn normal(mesh: &TriMesh, triangle: u32) -> Vector {
    let [a, b, c] = mesh.corners(triangle as usize);
    unit_or_zero(&area_vector(a, b, c))
}

/// The edges that pass through triangles of the `pairs`. Edges with an end at a common corner of the
/// two triangles only meet there.
fn passings(mesh: &TriMesh, edges: &Edges, pairs: &[[u32; 2]]) -> Vec<Passing> {
    let (x, triangles) = (mesh.vertices(), mesh.triangles());
    let mut found: BTreeMap<(u32, u32), Passing> = BTreeMap::new();
    for (k, pair) in pairs.iter().enumerate() {
        for second in [false, true] {
            let [through, of] = if second { [pair[1], pair[0]] } else { [pair[0], pair[1]] };
            let corners = mesh.corners(through as usize);
            for edge in edges.of_triangle[of as usize] {
                let ends = edges.vertices[edge as usize];
                let is_common = |v: &u32| {
                    triangles[through as usize].contains(v) || corners.contains(&&x[*v as usize])
                };
                let [p, q] = ends.map(|v| &x[v as usize]);
                if ends.iter().any(is_common) {
                    continue;
                }
                let Some(Passage { parameter: place, .. }) = segment_triangle(p, q, corners) else {
                    continue;
                };
                let new = || Passing { edge, triangle: through, place, pairs: Vec::new() };
                found.entry((edge, through)).or_insert_with(new).pairs.push((k, second));
            }
        }
    }
    found.into_values().collect()
}
