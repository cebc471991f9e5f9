//! Coarse cells of space, some of which are marked.

use if_core::aabb::Aabb;
use if_core::math::{Point, Real};

/// A box as the cells that it reaches, the first and the last along each axis.
pub(super) type CellBox = [[u8; 3]; 2];

/// Coarse cells, and which of them are marked. The first and last along each axis are what lies outside the region.
#[derive(Clone, Debug)]
pub(super) struct Marks {
    min: Point,
    /// Cells along each side of the region.
    cells: u8,
    scale: [Real; 3],
    marked: Vec<bool>,
}

impl Marks {
    /// `cells` along each side of the box round all `places`, at most 253, marked where they reach into one of them.
    pub(super) fn new(cells: u8, places: &[Aabb]) -> Self {
        let region = places.iter().fold(Aabb::EMPTY, |b, p| b.merged(p));
        let scale = [0, 1, 2].map(|axis| Real::from(cells) / region.size()[axis].max(Real::MIN_POSITIVE));
        let mut marks = Self { min: region.min, cells, scale, marked: Vec::new() };
        marks = marks.with(places.iter().map(|b| marks.range(b)));
        marks
    }

    /// The same cells, with others marked: those inside the region that `boxes` reach.
    pub(super) fn with(&self, boxes: impl Iterator<Item = CellBox>) -> Self {
        let marked = vec![false; (usize::from(self.cells) + 2).pow(3)];
        let mut marks = Self { marked, ..*self };
        for [low, high] in boxes {
            let inside = |c: [u8; 3]| c.map(|c| c.clamp(1, self.cells));
            let (low, high) = (inside(low), inside(high));
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    let row = self.row(x, y);
                    marks.marked[row + usize::from(low[2])..=row + usize::from(high[2])].fill(true);
                }
            }
        }
        marks
    }

    #[inline]
    fn row(&self, x: u8, y: u8) -> usize {
        let side = usize::from(self.cells) + 2;
        (usize::from(x) * side + usize::from(y)) * side
    }

    /// The cell of a point. Each coordinate grows with the point's.
    #[inline]
    pub(super) fn cell(&self, p: &Point) -> [u8; 3] {
        let along = |axis: usize| {
            let x = (p[axis] - self.min[axis]) * self.scale[axis];
            // The far side of the box is still inside.
            if x < 0.0 {
                0
            } else if x > Real::from(self.cells) {
                self.cells + 1
            } else {
                1 + (x as u8).min(self.cells - 1)
            }
        };
        [along(0), along(1), along(2)]
    }

    /// The cells of a box.
    pub(super) fn range(&self, b: &Aabb) -> CellBox {
        [self.cell(&b.min), self.cell(&b.max)]
    }

    /// Whether a box reaches a marked cell.
    #[inline(always)]
    pub(super) fn touch(&self, [low, high]: CellBox) -> bool {
        if low == high {
            return self.marked[self.row(low[0], low[1]) + usize::from(low[2])];
        }
        self.touch_any(low, high)
    }

    #[inline(never)] // most boxes reach one cell
    fn touch_any(&self, low: [u8; 3], high: [u8; 3]) -> bool {
        self.rows(low, high).any(|row| row.contains(&true))
    }

    /// Whether all cells that a box reaches are marked.
    pub(super) fn hold(&self, [low, high]: CellBox) -> bool {
        self.rows(low, high).all(|row| !row.contains(&false))
    }

    fn rows(&self, low: [u8; 3], high: [u8; 3]) -> impl Iterator<Item = &[bool]> {
        (low[0]..=high[0]).flat_map(move |x| {
            (low[1]..=high[1]).map(move |y| {
                let row = self.row(x, y);
                &self.marked[row + usize::from(low[2])..=row + usize::from(high[2])]
            })
        })
    }
}

/// The smallest that holds both.
pub(super) fn merged(a: CellBox, b: CellBox) -> CellBox {
    let of =
        |end: usize, pick: fn(u8, u8) -> u8| [pick(a[end][0], b[end][0]), pick(a[end][1], b[end][1]), pick(a[end][2], b[end][2])];
    [of(0, u8::min), of(1, u8::max)]
}
