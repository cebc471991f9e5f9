//! A finished grid: made once from [`Bricks`], then asked.

use super::bricks::{BRICK, Bricks, INSIDE, Node, OUTSIDE, SIDE, SPLIT, cells, local};
use super::cell::{Cell, PackedCell};
use super::index::{self, Index, power};
use if_core::math::{Point, Real, Vector};

/// Cells of a brick.
pub(super) const CELLS: usize = SIDE * SIDE * SIDE;

/// What a point reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Reading {
    /// The blend in its cell.
    Blend(Real, Vector),
    /// Beyond the band or the grid.
    Outside,
    /// Deeper than the band.
    Inside,
}

/// Where a point lies.
#[derive(Clone, Copy, Debug)]
pub(super) enum Spot {
    /// In the cell `slot`, at `u` in [0, 1)³; `inverse` is 1 / its edge.
    Cell { slot: usize, u: [Real; 3], inverse: Real },
    /// Beyond the band or the grid.
    Outside,
    /// Deeper than the band.
    Inside,
}

impl Spot {
    /// Value and gradient, of the cell that [`Grid::cell`] gave.
    #[inline]
    pub(super) fn reading(&self, cell: &PackedCell) -> Reading {
        match self {
            Self::Cell { u, inverse, .. } => {
                let (value, gradient) = cell.cell().blend(*u, *inverse);
                Reading::Blend(value, gradient)
            }
            Self::Outside => Reading::Outside,
            Self::Inside => Reading::Inside,
        }
    }
}

/// The grid.
#[derive(Clone)]
pub(super) struct Grid {
    /// Where bricks stand. Their nodes are in `cells`.
    pub(super) bricks: Bricks,
    /// [`CELLS`] for each brick; x fastest.
    cells: Vec<PackedCell>,
    index: Index,
    inverse_cell: Real,
    inverse_side: Real,
}

impl Grid {
    /// The grid without what holds no node with a value in [−depth, band], in the order of [`Bricks::leaves`]; `None` where its
    /// bricks are more than an index can count.
    pub(super) fn new(bricks: &Bricks, band: Real, depth: Real) -> Option<Self> {
        let mut kept = bricks.bare();
        let mut cells = Vec::with_capacity(bricks.leaves().len() * CELLS);
        kept.roots = bricks.roots.iter().map(|entry| copy(bricks, *entry, (band, depth), &mut kept, &mut cells)).collect();
        Self::from_parts(kept, cells, index::MOST)
    }

    /// A grid of bricks without nodes, and their cells; `None` where its tables would have more than `most` entries ([`Index::new`]).
    pub(super) fn from_parts(bricks: Bricks, cells: Vec<PackedCell>, most: usize) -> Option<Self> {
        let index = Index::new(&bricks.roots, &bricks.splits, &bricks.places, most)?;
        let (inverse_cell, inverse_side) = (1.0 / bricks.cell, 1.0 / (bricks.cell * SIDE as Real));
        Some(Self { bricks, cells, index, inverse_cell, inverse_side })
    }

    /// Where `p` lies.
    #[inline]
    pub(super) fn spot(&self, p: &Point) -> Spot {
        let (origin, size) = (&self.bricks.origin, &self.bricks.size);
        let (mut b, mut f) = ([0u32; 3], [0.0; 3]);
        for k in 0..3 {
            let q = (p[k] - origin[k]) * self.inverse_side;
            // Also where q is NaN.
            if !(q >= 0.0 && q < size[k] as Real) {
                return Spot::Outside;
            }
            b[k] = q as u32;
            f[k] = q - Real::from(b[k]);
        }
        let root = (b[2] as usize * size[1] + b[1] as usize) * size[0] + b[0] as usize;
        let (brick, level) = self.index.find(root, f);
        if brick >= INSIDE {
            return if brick == INSIDE { Spot::Inside } else { Spot::Outside };
        }
        let scale = power(level);
        let mut slot = brick as usize * CELLS;
        let mut u = [0.0; 3];
        for (k, stride) in [1, SIDE, SIDE * SIDE].into_iter().enumerate() {
            let x = f[k] * (scale * SIDE as Real);
            let c = x as u32;
            u[k] = x - Real::from(c);
            slot += (c as usize % SIDE) * stride;
        }
        let inverse = self.inverse_cell * scale;
        Spot::Cell { slot, u, inverse }
    }

    /// Value and gradient at `p`.
    #[inline]
    pub(super) fn read(&self, p: &Point) -> Reading {
        self.reading(&self.spot(p))
    }

    /// Value and gradient at a point that lies there.
    #[inline]
    pub(super) fn reading(&self, spot: &Spot) -> Reading {
        spot.reading(&self.cell(spot))
    }

    /// The cell of a point that lies there; some cell where it lies in none.
    #[inline]
    pub(super) fn cell(&self, spot: &Spot) -> PackedCell {
        match spot {
            Spot::Cell { slot, .. } => self.cells[*slot],
            Spot::Outside | Spot::Inside => PackedCell::default(),
        }
    }

    /// The cells of a brick, x fastest.
    pub(super) fn cells_of(&self, brick: usize) -> impl Iterator<Item = Cell> {
        self.cells[brick * CELLS..(brick + 1) * CELLS].iter().map(PackedCell::cell)
    }

    /// The nodes of a brick. Bumps of edges that leave it are zero: nobody reads them.
    pub(super) fn nodes_of(&self, brick: usize) -> [Node; BRICK] {
        std::array::from_fn(|i| {
            let l = local(i);
            let [x, y, z] = l.map(|l| l.min(SIDE - 1));
            let cell = self.cells[brick * CELLS + (z * SIDE + y) * SIDE + x].cell();
            // 1 on the far side of the brick, which is that of its last cell.
            let [x, y, z] = l.map(|l| l / SIDE);
            let bump = |axis: usize, edge: usize| if l[axis] == SIDE { 0.0 } else { cell.bumps[axis][edge] };
            [cell.values[x + 2 * y + 4 * z], bump(0, y + 2 * z), bump(1, x + 2 * z), bump(2, x + 2 * y)]
        })
    }

    /// Bytes that the grid takes.
    pub(super) fn bytes(&self) -> usize {
        self.cells.len() * size_of::<PackedCell>() + self.bricks.bytes() + self.index.bytes()
    }
}

/// Packs the cells of a brick.
pub(super) fn pack(nodes: &[Node], cells_of_all: &mut Vec<PackedCell>) {
    cells_of_all.extend(cells().map(|slot| PackedCell::new(&Cell::of(nodes, slot))));
}

/// Copies what an entry of `from` leads to, where it has a node with a value in [−depth, band].
fn copy(from: &Bricks, entry: u32, (band, depth): (Real, Real), kept: &mut Bricks, cells: &mut Vec<PackedCell>) -> u32 {
    if entry >= INSIDE {
        return entry;
    }
    if entry >= SPLIT {
        let number = kept.splits.len();
        kept.splits.push([OUTSIDE; 8]);
        let halves = from.splits[(entry - SPLIT) as usize].map(|half| copy(from, half, (band, depth), kept, cells));
        if halves[0] >= INSIDE && halves.iter().all(|h| *h == halves[0]) {
            kept.splits.pop();
            return halves[0];
        }
        kept.splits[number] = halves;
        return SPLIT + number as u32;
    }
    let nodes = from.nodes_of(entry as usize);
    if nodes.iter().all(|n| Real::from(n[0]) > band) {
        OUTSIDE
    } else if nodes.iter().all(|n| Real::from(n[0]) < -depth) {
        INSIDE
    } else {
        kept.places.push(from.places[entry as usize]);
        pack(nodes, cells);
        (kept.places.len() - 1) as u32
    }
}

impl std::fmt::Debug for Grid {
    /// Sizes only: the cells are megabytes.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Bricks { origin, cell, size, places, .. } = &self.bricks;
        write!(f, "Grid {{ origin: {origin}, cell: {cell}, size: {size:?}, bricks: {} }}", places.len())
    }
}

#[cfg(test)]
mod tests {
    use super::super::bricks::Place;
    use super::super::cell::rounded;
    use super::*;

    fn quadratic(p: &Point) -> (Real, Vector) {
        let value = 0.3 + p.x - 2.0 * p.y + 0.5 * p.z + p.x * p.x - p.x * p.y + 2.0 * p.y * p.z - 0.7 * p.z * p.z;
        (value, Vector::new(1.0 + 2.0 * p.x - p.y, -2.0 - p.x + 2.0 * p.z, 0.5 + 2.0 * p.y - 1.4 * p.z))
    }

    fn filled(bricks: &mut Bricks, f: impl Fn(&Point) -> (Real, Vector)) {
        for brick in 0..bricks.places.len() {
            let level = bricks.places[brick].level;
            for i in 0..BRICK {
                let (l, at) = (local(i), bricks.node(brick, i));
                let (v, g) = f(&bricks.at(level, at));
                let bump = |k: usize| {
                    let mut next = at;
                    next[k] += 1;
                    let end = f(&bricks.at(level, next)).1[k];
                    if l[k] < SIDE { rounded(0.5 * bricks.cell_of(level) * (g[k] - end)) } else { 0.0 }
                };
                bricks.nodes[brick * BRICK + i] = [v as f32, bump(0), bump(1), bump(2)];
            }
        }
    }

    /// Two bricks that share a side, the second split, and one half of that again.
    fn split() -> Bricks {
        let place = |level, x, y, z| Place { level, at: [x, y, z] };
        let halves = |level, at: [u32; 3]| {
            (0..8u32).map(move |k| place(level, at[0] + (k & 1), at[1] + (k >> 1 & 1), at[2] + (k >> 2 & 1)))
        };
        let mut places = vec![place(0, 0, 0, 0)];
        places.extend(halves(1, [2, 0, 0]).skip(1));
        places.extend(halves(2, [4, 0, 0]));
        let roots = vec![0, SPLIT, INSIDE];
        let splits = vec![[SPLIT + 1, 1, 2, 3, 4, 5, 6, 7], [8, 9, 10, 11, 12, 13, 14, 15]];
        let nodes = vec![[0.0; 4]; places.len() * BRICK];
        Bricks { origin: Point::new(-0.5, 0.0, 0.25), cell: 0.25, size: [3, 1, 1], roots, splits, places, nodes }
    }

    /// With all bricks.
    fn whole(bricks: &Bricks) -> Grid {
        Grid::new(bricks, Real::INFINITY, Real::INFINITY).unwrap()
    }

    #[test]
    fn quadratic_fields_are_exact_at_every_level() {
        let mut bricks = split();
        filled(&mut bricks, quadratic);
        let grid = whole(&bricks);
        for k in 0..500 {
            let s = |m: Real| (Real::from(k) * m).fract();
            let p = Point::new(-0.5 + 2.0 * s(0.618), s(0.414), 0.25 + s(0.732));
            let (value, gradient) = quadratic(&p);
            let Reading::Blend(v, g) = grid.read(&p) else { panic!("{p} is in a brick") };
            // Single precision of values of about 5, and bumps of 0.1 with 12 bits.
            approx::assert_relative_eq!(v, value, epsilon = 2e-6);
            approx::assert_relative_eq!(g, gradient, epsilon = 1e-4);
        }
        assert_eq!(grid.read(&Point::new(1.6, 0.5, 0.5)), Reading::Inside);
        assert_eq!(grid.read(&Point::new(-0.6, 0.5, 0.5)), Reading::Outside);
        assert_eq!(grid.read(&Point::new(2.6, 0.5, 0.5)), Reading::Outside);
    }

    #[test]
    fn joined_cells_of_three_sizes_leave_no_gap() {
        let mut bricks = split();
        // Far from quadratic: each level has another field.
        filled(&mut bricks, |p| {
            let (a, b, c) = (9.0 * p.x, 7.0 * p.y, 8.0 * p.z);
            (a.sin() * b.cos() + c.sin(), Vector::new(9.0 * a.cos() * b.cos(), -7.0 * a.sin() * b.sin(), 8.0 * c.cos()))
        });
        let gap = |bricks: &Bricks| {
            let grid = whole(bricks);
            let mut gap: Real = 0.0;
            for k in 0..4000 {
                let s = |m: Real| (Real::from(k) * m).fract();
                // On the border of levels 0 and 1 and 2, on those of 1 and 2, and on edges of them.
                for (on, axis) in [
                    (Point::new(0.5, s(0.618), 0.25 + s(0.414)), 0),
                    (Point::new(1.0, 0.5 * s(0.618), 0.25 + 0.5 * s(0.414)), 0),
                    (Point::new(0.5 + 0.5 * s(0.618), 0.5, 0.25 + 0.5 * s(0.414)), 1),
                    (Point::new(0.5 + 0.5 * s(0.618), 0.5 * s(0.414), 0.75), 2),
                    (Point::new(1.0, 0.5, 0.25 + 0.5 * s(0.414)), 0),
                ] {
                    let off = Vector::ith(axis, 1e-12);
                    let [Reading::Blend(a, _), Reading::Blend(b, _)] = [grid.read(&(on - off)), grid.read(&(on + off))] else {
                        panic!("{on} is in a brick")
                    };
                    gap = gap.max((a - b).abs());
                }
            }
            gap
        };
        let before = gap(&bricks);
        super::super::join::join(&mut bricks);
        // A quarter of bumps of 1.5 with 12 bits.
        assert!(before > 1e-2 && gap(&bricks) < 5e-5, "{before} {}", gap(&bricks));
    }

    #[test]
    fn five_halvings_are_found_through_two_tables() {
        // One corner of the root is halved five times.
        let (mut places, mut splits) = (Vec::new(), Vec::new());
        for level in 1..=5u32 {
            let first = places.len() as u32;
            let halves: [u32; 8] = std::array::from_fn(|k| if k == 7 && level < 5 { SPLIT + level } else { first + k as u32 });
            for k in (0..8u32).take(if level < 5 { 7 } else { 8 }) {
                let at = [0, 1, 2].map(|a| (1 << level) - 2 + (k >> a & 1));
                places.push(Place { level, at });
            }
            splits.push(halves);
        }
        let nodes = vec![[0.0; 4]; places.len() * BRICK];
        let bricks = Bricks { origin: Point::origin(), cell: 0.5, size: [1, 1, 1], roots: vec![SPLIT], splits, places, nodes };
        let grid = whole(&bricks);
        let bricks = &grid.bricks;
        for (brick, place) in bricks.places.iter().enumerate() {
            assert_eq!(bricks.entry(place), (brick as u32, place.level));
            for (c, i) in cells().enumerate() {
                let p = bricks.at(place.level, bricks.node(brick, i)) + Vector::repeat(1e-9);
                let Spot::Cell { slot, u, .. } = grid.spot(&p) else { panic!("{p} is in a brick") };
                assert!(slot == brick * CELLS + c && u.iter().all(|u| *u < 1e-6), "{place:?} {i}");
            }
        }
    }

    #[test]
    fn the_directory_finds_every_brick() {
        let bricks = split();
        let mut leaves = bricks.leaves();
        leaves.sort_unstable();
        assert_eq!(leaves, (0..16).collect::<Vec<u32>>());
        let grid = whole(&bricks);
        let bricks = &grid.bricks;
        assert_eq!(bricks.leaves(), (0..16).collect::<Vec<u32>>(), "halves of a split follow one another");
        for (brick, place) in bricks.places.iter().enumerate() {
            assert_eq!(bricks.entry(place), (brick as u32, place.level));
            let middle = bricks.at(place.level, bricks.node(brick, BRICK / 2)) + Vector::repeat(1e-9);
            let Spot::Cell { slot, inverse, .. } = grid.spot(&middle) else { panic!("{middle} is in a brick") };
            assert_eq!((slot, inverse), (brick * CELLS + (2 * SIDE + 2) * SIDE + 2, 1.0 / bricks.cell_of(place.level)));
        }
    }

    #[test]
    fn the_nodes_of_cells_are_those_they_were_packed_of() {
        let mut bricks = split();
        filled(&mut bricks, quadratic);
        let grid = whole(&bricks);
        for (brick, from) in bricks.leaves().into_iter().enumerate() {
            assert_eq!(&grid.nodes_of(brick), bricks.nodes_of(from as usize));
        }
    }
}
