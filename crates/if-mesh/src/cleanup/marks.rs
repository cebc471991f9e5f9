//! Coarse cells of space, some of which are marked.

use if_core::aabb::Aabb;
use if_core::math::{Point, Real};

/// A box as the cells that it reaches, the first and the last along each axis.
pub(super) type CellBox = [[u8; 3]; 2];

/// Cells along each side of the region: a row of them is a word of bits. Of a garment of 1 m a cell
/// is 1.6 cm.
const CELLS: u8 = u64::BITS as u8;
/// Rows along each of the two other sides, with those of what lies outside.
const ROWS: usize = CELLS as usize + 2;

/// Coarse cells, and which of them are marked. The first and last along each axis are what lies
/// outside the region, and never are.
#[derive(Clone, Debug)]
pub(super) struct Marks {
    min: Point,
    scale: [Real; 3],
    /// A word for each row along z.
    marked: Vec<u64>,
}

impl Marks {
    /// Cells of the box round all `places`, marked where they reach into one of them.
    pub(super) fn new(places: &[Aabb]) -> Self {
        let region = places.iter().fold(Aabb::EMPTY, |b, p| b.merged(p));
        let scale =
            [0, 1, 2].map(|axis| Real::from(CELLS) / region.size()[axis].max(Real::MIN_POSITIVE));
        let mut marks = Self { min: region.min, scale, marked: Vec::new() };
        marks = marks.with(places.iter().map(|b| marks.range(b)));
        marks
    }

    /// The same cells, with others marked: those inside the region that `boxes` reach.
    pub(super) fn with(&self, boxes: impl Iterator<Item = CellBox>) -> Self {
        let mut marks = Self { marked: vec![0; ROWS * ROWS], ..*self };
        for [low, high] in boxes {
            let inside = |c: [u8; 3]| c.map(|c| c.clamp(1, CELLS));
            let (low, high) = (inside(low), inside(high));
            let bits = bits(low[2], high[2]);
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    marks.marked[row(x, y)] |= bits;
                }
            }
        }
        marks
    }

    /// The cell of a point. Each coordinate grows with the point's.
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
    pub(super) fn range(&self, b: &Aabb) -> CellBox {
        [self.cell(&b.min), self.cell(&b.max)]
    }

    /// Whether a box reaches a marked cell.
    #[inline]
    pub(super) fn touch(&self, [low, high]: CellBox) -> bool {
        let bits = bits(low[2], high[2]);
        let rows = usize::from(high[1] - low[1]) + 1;
        let mut first = row(low[0], low[1]);
        for _ in low[0]..=high[0] {
            if self.marked[first..first + rows].iter().any(|row| row & bits != 0) {
                return true;
            }
            first += ROWS;
        }
        false
    }

    /// Whether all cells that a box reaches are marked.
    pub(super) fn hold(&self, [low, high]: CellBox) -> bool {
        let bits = bits(low[2], high[2]);
        let inside = low[2] > 0 && high[2] <= CELLS;
        inside
            && (low[0]..=high[0])
                .all(|x| (low[1]..=high[1]).all(|y| self.marked[row(x, y)] & bits == bits))
    }
}

#[inline]
fn row(x: u8, y: u8) -> usize {
    usize::from(x) * ROWS + usize::from(y)
}

/// The cells inside the region from `low` to `high` along z.
#[inline]
fn bits(low: u8, high: u8) -> u64 {
    let (low, high) = (low.max(1), high.min(CELLS));
    if low > high { 0 } else { (u64::MAX << (low - 1)) & (u64::MAX >> (CELLS - high)) }
}

/// The smallest that holds both.
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
    fn words_of_cells_say_what_single_cells_say() {
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        let mut told = [0; 4];
        let region = Aabb { min: Point::origin(), max: Point::new(1.0, 1.0, 1.0) };
        for _ in 0..2000 {
            // Cells, those outside among them, and boxes of up to `size` more along each axis.
            let mut cells = |size: u8| -> CellBox {
                let low = [0; 3].map(|_: u8| rng.random_range(0..=CELLS + 1));
                [low, low.map(|c| (c + rng.random_range(0..=size)).min(CELLS + 1))]
            };
            let marks = Marks::new(&[region]).with([cells(40), cells(60), cells(60)].into_iter());
            let is_marked = |c: [u8; 3]| {
                c[2] > 0 && c[2] <= CELLS && marks.marked[row(c[0], c[1])] >> (c[2] - 1) & 1 == 1
            };
            let asked = cells(3);
            let reached = || {
                let along = |axis: usize| asked[0][axis]..=asked[1][axis];
                along(0)
                    .flat_map(move |x| along(1).flat_map(move |y| along(2).map(move |z| [x, y, z])))
            };
            assert_eq!(marks.touch(asked), reached().any(is_marked));
            assert_eq!(marks.hold(asked), reached().all(is_marked));
            told[usize::from(marks.touch(asked))] += 1;
            told[2 + usize::from(marks.hold(asked))] += 1;
        }
        assert!(told.iter().all(|n| *n > 50), "{told:?}");
    }
}
