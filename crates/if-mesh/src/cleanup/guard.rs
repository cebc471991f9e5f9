//! Intersections that a change adds, found without looking at the whole mesh.

use super::apart::{clearly_apart, surely_go_on};
use super::vicinity::Vicinity;
use if_core::aabb::Aabb;
use if_core::intersect::{is_degenerate, triangles_sharing};
use if_core::math::{Point, Real};
use rayon::prelude::*;

/// Side of a fine cell over the mean side of the suspects' boxes: a triangle lies in two to four
/// cells, and a cell holds few.
const CELL: Real = 1.5;
/// Entries in fine cells for each triangle, at most; else cells are doubled. Few triangles that are
/// large beside the others do not fill the memory.
const ENTRIES: usize = 16;
/// Suspects for a task: each takes a microsecond.
const TASK: usize = 512;

/// Pairs of triangles that meet beyond their common corners and of which one at least is in
/// `suspects`, ascending.
pub(super) fn meeting(
    points: &[Point],
    triangles: &[[u32; 3]],
    suspects: &[u32],
    vicinity: &mut Vicinity,
) -> Vec<[u32; 2]> {
    Guard::new(points, triangles, suspects, points, vicinity).meeting(points, triangles, suspects)
}

/// What suspects can meet while their corners go anywhere between two places: looked for once,
/// asked often.
pub(super) struct Guard {
    /// The triangles that a suspect can meet, suspects included, ascending.
    near: Vec<u32>,
    /// Boxes round all their places.
    cells: Cells,
}

impl Guard {
    /// Of `suspects`, ascending, whose corners stay between `points` and `target`, give or take a
    /// rounding to single precision. All other triangles stay where they are in `points`.
    pub(super) fn new(
        points: &[Point],
        triangles: &[[u32; 3]],
        suspects: &[u32],
        target: &[Point],
        vicinity: &mut Vicinity,
    ) -> Self {
        let place = |t: &u32| {
            let corners = triangles[*t as usize];
            let b = bounds(corners.map(|v| &points[v as usize]))
                .merged(&bounds(corners.map(|v| &target[v as usize])));
            (
                *t,
                b.inflated(b.min.coords.amax().max(b.max.coords.amax()) * Real::from(f32::EPSILON)),
            )
        };
        Self::of_places(
            points,
            triangles,
            &suspects.iter().map(place).collect::<Vec<_>>(),
            vicinity,
        )
    }

    /// Of suspects, ascending, with a box each that holds all their places. All other triangles
    /// stay where they are in `points`.
    pub(super) fn of_places(
        points: &[Point],
        triangles: &[[u32; 3]],
        suspects: &[(u32, Aabb)],
        vicinity: &mut Vicinity,
    ) -> Self {
        if suspects.is_empty() {
            return Self { near: Vec::new(), cells: Cells::default() };
        }
        let near = vicinity.of(points, triangles, suspects);
        let mut next = suspects.iter().peekable();
        let boxes: Vec<SmallBox> = near
            .iter()
            .map(|t| match next.next_if(|s| s.0 == *t) {
                Some((_, b)) => SmallBox::round(b),
                None => {
                    SmallBox::round(&bounds(triangles[*t as usize].map(|v| &points[v as usize])))
                }
            })
            .collect();
        let region = suspects.iter().fold(Aabb::EMPTY, |b, s| b.merged(&s.1));
        let side = suspects.iter().map(|s| s.1.size().max()).sum::<Real>() / suspects.len() as Real;
        let cells = Cells::new(&region, CELL * side, &boxes);
        Self { near, cells }
    }

    /// Pairs of triangles that meet at `points` beyond their common corners and of which one at
    /// least is in `suspects`, ascending. `suspects`, ascending, are some of those that this was
    /// made for.
    pub(super) fn meeting(
        &self,
        points: &[Point],
        triangles: &[[u32; 3]],
        suspects: &[u32],
    ) -> Vec<[u32; 2]> {
        let mut is_suspect = vec![false; self.near.len()];
        let places: Vec<u32> = suspects
            .iter()
            .filter_map(|t| self.near.binary_search(t).ok())
            .map(|k| k as u32)
            .collect();
        places.iter().for_each(|k| is_suspect[*k as usize] = true);
        let of = |places: &[u32]| {
            let mut found = Vec::new();
            let mut others = Vec::new();
            for &k in places {
                let t = self.near[k as usize];
                let a = triangles[t as usize];
                let corners =
                    [&points[a[0] as usize], &points[a[1] as usize], &points[a[2] as usize]];
                others.clear();
                self.cells.reached(&SmallBox::round(&bounds(corners)), &mut others);
                // A pair of two suspects is the smaller one's.
                keep(&mut others, 0, |other| {
                    (other > k) | ((other < k) & !is_suspect[other as usize])
                });
                for &other in &others {
                    let u = self.near[other as usize];
                    if meet(points, a, triangles[u as usize]) {
                        found.push([t.min(u), t.max(u)]);
                    }
                }
            }
            found
        };
        let mut pairs: Vec<[u32; 2]> = if places.len() <= TASK {
            of(&places)
        } else {
            places.par_chunks(TASK).map(of).collect::<Vec<_>>().concat()
        };
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }

    /// Whether two triangles meet at `points` beyond their common corners.
    pub(super) fn met(points: &[Point], triangles: &[[u32; 3]], pair: [u32; 2]) -> bool {
        meet(points, triangles[pair[0] as usize], triangles[pair[1] as usize])
    }
}

pub(super) fn bounds(t: [&Point; 3]) -> Aabb {
    Aabb { min: t[0].inf(t[1]).inf(t[2]), max: t[0].sup(t[1]).sup(t[2]) }
}

/// Whether triangles meet beyond their common corners, as
/// [`own_pairs`](crate::intersections::own_pairs) has it: corners at one place are common, and
/// triangles without area meet nothing.
fn meet(points: &[Point], ia: [u32; 3], ib: [u32; 3]) -> bool {
    let a = [&points[ia[0] as usize], &points[ia[1] as usize], &points[ia[2] as usize]];
    let b = [&points[ib[0] as usize], &points[ib[1] as usize], &points[ib[2] as usize]];
    // Most are neighbours, and go on from one another as a surface does.
    if surely_go_on(a, ia, b, ib) {
        return false;
    }
    if !bounds(a).overlaps(&bounds(b)) {
        return false;
    }
    let mut common = [None; 3];
    for (p, c) in a.iter().zip(&mut common) {
        for (j, q) in b.iter().enumerate() {
            if p.x == q.x && p.y == q.y && p.z == q.z {
                *c = Some(j);
                break;
            }
        }
    }
    if clearly_apart(a, b, common) {
        return false;
    }
    let mut names = [3, 4, 5];
    common.iter().zip(0..).for_each(|(j, i)| j.iter().for_each(|j| names[*j] = i));
    triangles_sharing(a, [0, 1, 2], b, names).is_some() && !is_degenerate(a) && !is_degenerate(b)
}

/// A box in single precision, rounded outwards: many are looked at for each that is of use, and
/// they should lie close together. The fourth numbers are 0: four are compared at once.
#[derive(Clone, Copy, Debug, Default)]
struct SmallBox {
    min: [f32; 4],
    max: [f32; 4],
}

impl SmallBox {
    #[inline]
    fn round(b: &Aabb) -> Self {
        let down =
            |x: Real| if Real::from(x as f32) > x { (x as f32).next_down() } else { x as f32 };
        let up = |x: Real| if Real::from(x as f32) < x { (x as f32).next_up() } else { x as f32 };
        Self {
            min: [down(b.min.x), down(b.min.y), down(b.min.z), 0.0],
            max: [up(b.max.x), up(b.max.y), up(b.max.z), 0.0],
        }
    }

    #[inline]
    fn overlaps(&self, other: &Self) -> bool {
        let along =
            |axis: usize| (self.min[axis] <= other.max[axis]) & (other.min[axis] <= self.max[axis]);
        along(0) & along(1) & along(2) & along(3)
    }
}

/// A fine cell.
type Cell = [i32; 3];

/// Boxes by the fine cells that they reach into, in buckets by a hash of the cell.
#[derive(Default)]
struct Cells {
    /// Where the first cell begins.
    min: Point,
    /// The last cell along each axis.
    last: Cell,
    scale: Real,
    /// First entry of each bucket.
    start: Vec<u32>,
    /// The boxes of each bucket, and whose they are.
    entries: Vec<SmallBox>,
    names: Vec<u32>,
    /// For each box the first cell that it reaches.
    first: Vec<Cell>,
}

impl Cells {
    fn new(region: &Aabb, side: Real, boxes: &[SmallBox]) -> Self {
        let size = region.size();
        let mut side = side.max(size.max() / Real::from(1 << 20)).max(Real::MIN_POSITIVE);
        loop {
            let last = [0, 1, 2].map(|axis| (size[axis] / side) as i32);
            let mut cells = Self { min: region.min, last, scale: 1.0 / side, ..Self::default() };
            let ranges: Vec<[Cell; 2]> = boxes.iter().map(|b| cells.range(b)).collect();
            let count = |[low, high]: &[Cell; 2]| {
                let along = |axis: usize| (high[axis] - low[axis] + 1) as usize;
                along(0).saturating_mul(along(1)).saturating_mul(along(2))
            };
            let total = ranges.iter().map(count).fold(0, usize::saturating_add);
            if total <= ENTRIES * boxes.len() || last == [0; 3] {
                cells.fill(boxes, &ranges, total);
                return cells;
            }
            side *= 2.0;
        }
    }

    fn fill(&mut self, boxes: &[SmallBox], ranges: &[[Cell; 2]], total: usize) {
        let buckets = total.next_power_of_two().max(BLOCK);
        self.start = vec![0; buckets + 2];
        for range in ranges {
            for_each_cell(*range, |c| self.start[bucket(c, buckets) + 2] += 1);
        }
        for k in 2..self.start.len() {
            self.start[k] += self.start[k - 1];
        }
        self.entries = vec![SmallBox::default(); total];
        self.names = vec![0; total];
        for (k, (b, range)) in boxes.iter().zip(ranges).enumerate() {
            for_each_cell(*range, |c| {
                let at = &mut self.start[bucket(c, buckets) + 1];
                self.entries[*at as usize] = *b;
                self.names[*at as usize] = k as u32;
                *at += 1;
            });
        }
        self.first = ranges.iter().map(|r| r[0]).collect();
    }

    #[inline]
    fn range(&self, b: &SmallBox) -> [Cell; 2] {
        [self.cell(b.min), self.cell(b.max)]
    }

    #[inline]
    fn cell(&self, p: [f32; 4]) -> Cell {
        // Out of range it saturates.
        let along = |axis: usize| {
            (((Real::from(p[axis]) - self.min[axis]) * self.scale) as i32).clamp(0, self.last[axis])
        };
        [along(0), along(1), along(2)]
    }

    /// Appends the boxes that overlap `b`, some of them twice.
    #[inline]
    fn reached(&self, b: &SmallBox, found: &mut Vec<u32>) {
        let buckets = self.start.len().saturating_sub(2);
        if buckets == 0 {
            return;
        }
        let range = self.range(b);
        for_each_cell(range, |c| {
            let bucket = bucket(c, buckets);
            let here = self.start[bucket] as usize..self.start[bucket + 1] as usize;
            let from = found.len();
            found.extend_from_slice(&self.names[here.clone()]);
            let mut boxes = self.entries[here].iter();
            keep(found, from, |_| boxes.next().is_some_and(|other| b.overlaps(other)));
            // Told in one cell: the first that both reach.
            keep(found, from, |name| {
                let first = &self.first[name as usize];
                let along = |axis: usize| c[axis] == first[axis].max(range[0][axis]);
                along(0) & along(1) & along(2)
            });
        });
    }
}

/// Drops the numbers from place `from` on that `stays` does not hold for: without a branch for
/// each, as nobody can foretell it.
#[inline]
fn keep(found: &mut Vec<u32>, from: usize, mut stays: impl FnMut(u32) -> bool) {
    let mut to = from;
    for k in from..found.len() {
        let name = found[k];
        found[to] = name;
        to += usize::from(stays(name));
    }
    found.truncate(to);
}

#[inline]
fn for_each_cell([low, high]: [Cell; 2], mut visit: impl FnMut(Cell)) {
    for i in low[0]..=high[0] {
        for j in low[1]..=high[1] {
            for k in low[2]..=high[2] {
                visit([i, j, k]);
            }
        }
    }
}

/// Cells in a block of two along each axis, whose buckets lie side by side.
const BLOCK: usize = 8;

/// A bucket for a cell; `buckets` is a power of two, at least [`BLOCK`]. The factors are those of
/// Teschner et al. 2003.
#[inline]
fn bucket(cell: Cell, buckets: usize) -> usize {
    let [i, j, k] = cell.map(|c| u64::from(c as u32 >> 1));
    let mixed =
        i.wrapping_mul(73_856_093) ^ j.wrapping_mul(19_349_663) ^ k.wrapping_mul(83_492_791);
    let within = cell.iter().fold(0, |b, c| 2 * b + (*c as usize & 1));
    (BLOCK * (mixed ^ (mixed >> 15)) as usize + within) & (buckets - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Bvh;
    use crate::intersections::own_pairs;
    use if_core::math::Vector;
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::icosphere;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn the_cells_leave_no_pair_out() {
        let (a, b) = (icosphere(0.3, 2), icosphere(0.2, 2));
        let mut points = a.vertices().to_vec();
        let base = points.len() as u32;
        points.extend(b.vertices().iter().map(|p| p + Vector::new(0.21, 0.05, 0.02)));
        let mut triangles = a.triangles().to_vec();
        triangles.extend(b.triangles().iter().map(|t| t.map(|v| v + base)));
        let mesh = TriMesh::new(points.clone(), triangles.clone()).unwrap();
        let all: Vec<[u32; 2]> =
            own_pairs(&mesh, &Bvh::new(&mesh)).iter().map(|p| [p.a, p.b]).collect();
        assert!(all.len() > 20);
        let everyone: Vec<u32> = (0..triangles.len() as u32).collect();
        assert_eq!(meeting(&points, &triangles, &everyone, &mut Vicinity::default()), all);
        let some: Vec<u32> = (0..triangles.len() as u32).filter(|t| t % 7 == 0).collect();
        let of_some: Vec<[u32; 2]> =
            all.iter().filter(|p| p[0] % 7 == 0 || p[1] % 7 == 0).copied().collect();
        assert_eq!(meeting(&points, &triangles, &some, &mut Vicinity::default()), of_some);
        assert!(meeting(&points, &triangles, &[], &mut Vicinity::default()).is_empty());
    }

    #[test]
    fn on_soups_of_any_size_the_pairs_are_those_of_the_tree_also_while_corners_move() {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        for round in 0..60 {
            let n = 30 + 10 * (round % 5);
            // Few large triangles among small ones, corners on a lattice, in one plane, all at one
            // place.
            let mut points: Vec<Point> = (0..n)
                .map(|k| {
                    let size = if k % 7 == 0 { 1.0 } else { 0.1 };
                    let mut p = [0.0; 3].map(|_: Real| 0.5 + size * (rng.random::<Real>() - 0.5));
                    if round % 4 == 1 {
                        p = p.map(|x| (x * 16.0).round() / 16.0);
                    }
                    if round % 4 == 2 {
                        p[2] = 0.25;
                    }
                    Point::from(if round == 7 { [0.3; 3] } else { p })
                })
                .collect();
            let triangles: Vec<[u32; 3]> = (0..2 * n)
                .map(|_| {
                    let a = rng.random_range(0..n as u32);
                    let step = rng.random_range(1..4);
                    [a, (a + step) % n as u32, (a + step + 1) % n as u32]
                })
                .collect();
            let suspects: Vec<u32> = (0..triangles.len() as u32).filter(|t| t % 3 == 0).collect();
            let mut target = points.clone();
            for v in suspects.iter().flat_map(|t| triangles[*t as usize]).filter(|v| v % 2 == 0) {
                target[v as usize] += Vector::new(0.03, -0.02, 0.01);
            }
            // All that have a corner that moves are suspects.
            let moves = |v: &u32| points[*v as usize] != target[*v as usize];
            let suspects: Vec<u32> = (0..triangles.len() as u32)
                .filter(|t| t % 3 == 0 || triangles[*t as usize].iter().any(moves))
                .collect();
            let guard =
                Guard::new(&points, &triangles, &suspects, &target, &mut Vicinity::default());
            let start = points.clone();
            for share in [0.0, 0.37, 1.0] {
                points = start.iter().zip(&target).map(|(p, q)| p + (q - p) * share).collect();
                let mesh = TriMesh::new(points.clone(), triangles.clone()).unwrap();
                let mut all: Vec<[u32; 2]> =
                    own_pairs(&mesh, &Bvh::new(&mesh)).iter().map(|p| [p.a, p.b]).collect();
                all.retain(|p| p.iter().any(|t| suspects.binary_search(t).is_ok()));
                assert_eq!(
                    guard.meeting(&points, &triangles, &suspects),
                    all,
                    "round {round}, share {share}"
                );
                let some: Vec<u32> = suspects.iter().copied().filter(|t| t % 2 == 0).collect();
                all.retain(|p| p.iter().any(|t| some.binary_search(t).is_ok()));
                assert_eq!(
                    guard.meeting(&points, &triangles, &some),
                    all,
                    "round {round}, share {share}"
                );
            }
        }
    }
}
