//! A spatial hash of boxes: which boxes overlap a given one.

use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};

/// Maximum number of entries per box; above it the cells are doubled, so that a few large triangles
/// do not fill the memory.
const ENTRIES: usize = 16;

/// A box in single precision, relative to an origin near it and rounded outwards: many are tested for each that overlaps, so they
/// should be compact. The fourth numbers are 0: four are compared at once.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SmallBox {
    min: [f32; 4],
    max: [f32; 4],
}

impl SmallBox {
    #[inline]
    pub(super) fn round(b: &Aabb, origin: &Point) -> Self {
        let down =
            |x: Real| if Real::from(x as f32) > x { (x as f32).next_down() } else { x as f32 };
        let up = |x: Real| if Real::from(x as f32) < x { (x as f32).next_up() } else { x as f32 };
        // Rounding is monotonic, so boxes that touch still overlap.
        let (min, max) = (b.min - origin, b.max - origin);
        Self {
            min: [down(min.x), down(min.y), down(min.z), 0.0],
            max: [up(max.x), up(max.y), up(max.z), 0.0],
        }
    }

    #[inline]
    fn overlaps(&self, other: &Self) -> bool {
        let along =
            |axis: usize| (self.min[axis] <= other.max[axis]) & (other.min[axis] <= self.max[axis]);
        along(0) & along(1) & along(2) & along(3)
    }
}

/// Coordinates of a cell.
type Cell = [i32; 3];

/// Boxes by the cells that they overlap, in buckets by a hash of the cell.
#[derive(Default)]
pub(super) struct SpatialHash {
    /// The last cell along each axis.
    last: Cell,
    scale: Real,
    /// First entry of each bucket.
    start: Vec<u32>,
    /// The boxes of each bucket, and their indices.
    entries: Vec<SmallBox>,
    indices: Vec<u32>,
    /// For each box the first cell that it overlaps.
    first: Vec<Cell>,
}

impl SpatialHash {
    /// Cells of about `side` over a region of this `size`, from the origin of `boxes` on, with `boxes`.
    pub(super) fn new(size: &Vector, side: Real, boxes: &[SmallBox]) -> Self {
        let mut side = side.max(size.max() / Real::from(1 << 20)).max(Real::MIN_POSITIVE);
        loop {
            let last = [0, 1, 2].map(|axis| (size[axis] / side) as i32);
            let mut hash = Self { last, scale: 1.0 / side, ..Self::default() };
            let ranges: Vec<[Cell; 2]> = boxes.iter().map(|b| hash.range(b)).collect();
            let count = |[low, high]: &[Cell; 2]| {
                let along = |axis: usize| (high[axis] - low[axis] + 1) as usize;
                along(0).saturating_mul(along(1)).saturating_mul(along(2))
            };
            let total = ranges.iter().map(count).fold(0, usize::saturating_add);
            if total <= ENTRIES * boxes.len() || last == [0; 3] {
                hash.fill(boxes, &ranges, total);
                return hash;
            }
            side *= 2.0;
        }
    }

    /// Counting sort of the boxes into their buckets.
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
        self.indices = vec![0; total];
        for (k, (b, range)) in boxes.iter().zip(ranges).enumerate() {
            for_each_cell(*range, |c| {
                let at = &mut self.start[bucket(c, buckets) + 1];
                self.entries[*at as usize] = *b;
                self.indices[*at as usize] = k as u32;
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
        // Conversion saturates outside the region.
        let along =
            |axis: usize| ((Real::from(p[axis]) * self.scale) as i32).clamp(0, self.last[axis]);
        [along(0), along(1), along(2)]
    }

    /// Appends the indices of the boxes that overlap `b`, some of them twice.
    #[inline]
    pub(super) fn query(&self, b: &SmallBox, found: &mut Vec<u32>) {
        let buckets = self.start.len().saturating_sub(2);
        if buckets == 0 {
            return;
        }
        let range = self.range(b);
        for_each_cell(range, |c| {
            let bucket = bucket(c, buckets);
            let here = self.start[bucket] as usize..self.start[bucket + 1] as usize;
            let from = found.len();
            found.extend_from_slice(&self.indices[here.clone()]);
            let mut boxes = self.entries[here].iter();
            retain_from(found, from, |_| boxes.next().is_some_and(|other| b.overlaps(other)));
            // Reported in one cell only: the first that both overlap.
            retain_from(found, from, |index| {
                let first = &self.first[index as usize];
                let along = |axis: usize| c[axis] == first[axis].max(range[0][axis]);
                along(0) & along(1) & along(2)
            });
        });
    }
}

/// Retains those entries from `from` on for which `stays` is true, without branches, as these would
/// be unpredictable.
#[inline]
pub(super) fn retain_from(found: &mut Vec<u32>, from: usize, mut stays: impl FnMut(u32) -> bool) {
    let mut to = from;
    for k in from..found.len() {
        let entry = found[k];
        found[to] = entry;
        to += usize::from(stays(entry));
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

/// Cells in a block of two along each axis, whose buckets are adjacent.
const BLOCK: usize = 8;

/// The bucket of a cell; `buckets` is a power of two, at least [`BLOCK`]. The factors are those of
/// Teschner et al. 2003.
#[inline]
fn bucket(cell: Cell, buckets: usize) -> usize {
    let [i, j, k] = cell.map(|c| u64::from(c as u32 >> 1));
    let mixed =
        i.wrapping_mul(73_856_093) ^ j.wrapping_mul(19_349_663) ^ k.wrapping_mul(83_492_791);
    let within = cell.iter().fold(0, |b, c| 2 * b + (*c as usize & 1));
    (BLOCK * (mixed ^ (mixed >> 15)) as usize + within) & (buckets - 1)
}
