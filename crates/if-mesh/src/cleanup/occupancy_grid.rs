//! A coarse grid of occupied cells.

use if_core::aabb::Aabb;
use if_core::math::{Point, Real};

/// The cells that a box overlaps: the first and the last along each axis.
pub(super) type CellBox = [[u8; 3]; 2];

/// Cells along each side of the region: a row of them is one word. For a garment of 1 m a cell is
/// 1.6 cm.
const CELLS: u8 = u64::BITS as u8;
/// Rows along each of the two other sides, with a border for what lies outside.
const ROWS: usize = CELLS as usize + 2;

/// A coarse grid of 64³ cells, each occupied or free, as bits. The first and last cells along each
/// axis stand for what lies outside the region, and are always free.
#[derive(Clone, Debug)]
pub(super) struct OccupancyGrid {
    min: Point,
    scale: [Real; 3],
    /// One word for each row along z.
    occupied: Vec<u64>,
}

impl OccupancyGrid {
    /// A grid of the box around all `boxes`; cells that overlap one of them are occupied.
    pub(super) fn new(boxes: &[Aabb]) -> Self {
        let region = boxes.iter().fold(Aabb::EMPTY, |b, p| b.merged(p));
        let scale =
            [0, 1, 2].map(|axis| Real::from(CELLS) / region.size()[axis].max(Real::MIN_POSITIVE));
        let grid = Self { min: region.min, scale, occupied: Vec::new() };
        grid.with(boxes.iter().map(|b| grid.cells_of(b)))
    }

    /// The same grid with other occupied cells: those of `boxes` inside the region.
    pub(super) fn with(&self, boxes: impl Iterator<Item = CellBox>) -> Self {
        let mut grid = Self { occupied: vec![0; ROWS * ROWS], ..*self };
        for [low, high] in boxes {
            let inside = |c: [u8; 3]| c.map(|c| c.clamp(1, CELLS));
            let (low, high) = (inside(low), inside(high));
            let bits = bits(low[2], high[2]);
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    grid.occupied[row(x, y)] |= bits;
                }
            }
        }
        grid
    }

    /// The cell of a point: monotonic in each coordinate.
    #[inline]
    pub(super) fn cell(&self, p: &Point) -> [u8; 3] {
        let along = |axis: usize| {
            let x = (p[axis] - self.min[axis]) * self.scale[axis];
            // The far side of the box is still inside.
            if x < 0.0 {
                0
            } else if x > Real::from(CELLS) {
                CELLS + 1
            } else {
                1 + (x as u8).min(CELLS - 1)
            }
        };
        [along(0), along(1), along(2)]
    }

    /// The cells of a box.
    pub(super) fn cells_of(&self, b: &Aabb) -> CellBox {
        [self.cell(&b.min), self.cell(&b.max)]
    }

    /// Whether a box overlaps an occupied cell.
    #[inline]
    pub(super) fn overlaps(&self, [low, high]: CellBox) -> bool {
        let bits = bits(low[2], high[2]);
        let rows = usize::from(high[1] - low[1]) + 1;
        let mut first = row(low[0], low[1]);
        for _ in low[0]..=high[0] {
            if self.occupied[first..first + rows].iter().any(|row| row & bits != 0) {
                return true;
            }
            first += ROWS;
        }
        false
    }

    /// Whether all cells of a box are occupied.
    pub(super) fn contains(&self, [low, high]: CellBox) -> bool {
        let bits = bits(low[2], high[2]);
        let inside = low[2] > 0 && high[2] <= CELLS;
        inside
            && (low[0]..=high[0])
                .all(|x| (low[1]..=high[1]).all(|y| self.occupied[row(x, y)] & bits == bits))
    }
}

#[inline]
fn row(x: u8, y: u8) -> usize {
    usize::from(x) * ROWS + usize::from(y)
}

/// The bits of the cells inside the region from `low` to `high` along z.
#[inline]
fn bits(low: u8, high: u8) -> u64 {
    let (low, high) = (low.max(1), high.min(CELLS));
    if low > high { 0 } else { (u64::MAX << (low - 1)) & (u64::MAX >> (CELLS - high)) }
}

/// The smallest box of cells that contains both.
#[inline]
pub(super) fn merged(a: CellBox, b: CellBox) -> CellBox {
    let of = |end: usize, pick: fn(u8, u8) -> u8| {
        [pick(a[end][0], b[end][0]), pick(a[end][1], b[end][1]), pick(a[end][2], b[end][2])]
    };
    [of(0, u8::min), of(1, u8::max)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn words_of_cells_agree_with_single_cells() {
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        let mut answers = [0; 4];
        let region = Aabb { min: Point::origin(), max: Point::new(1.0, 1.0, 1.0) };
        for _ in 0..2000 {
            // A random cell, also outside the region, and a box of up to `size` more along each axis.
            let mut cells = |size: u8| -> CellBox {
                let low = [0; 3].map(|_: u8| rng.random_range(0..=CELLS + 1));
                [low, low.map(|c| (c + rng.random_range(0..=size)).min(CELLS + 1))]
            };
            let grid =
                OccupancyGrid::new(&[region]).with([cells(40), cells(60), cells(60)].into_iter());
            let is_occupied = |c: [u8; 3]| {
                c[2] > 0 && c[2] <= CELLS && grid.occupied[row(c[0], c[1])] >> (c[2] - 1) & 1 == 1
            };
            let queried = cells(3);
            let reached = || {
                let along = |axis: usize| queried[0][axis]..=queried[1][axis];
                along(0)
                    .flat_map(move |x| along(1).flat_map(move |y| along(2).map(move |z| [x, y, z])))
            };
            assert_eq!(grid.overlaps(queried), reached().any(is_occupied));
            assert_eq!(grid.contains(queried), reached().all(is_occupied));
            answers[usize::from(grid.overlaps(queried))] += 1;
            answers[2 + usize::from(grid.contains(queried))] += 1;
        }
        assert!(answers.iter().all(|n| *n > 50), "{answers:?}");
    }
}
