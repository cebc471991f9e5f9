//! A sparse grid of bricks of 4³ cells, whose cells may be halved where that is needed.

use super::blend::{BRICK, NODES, Node, SIDE, blend, bumps, cells, corners, local};
use super::directory::{INSIDE, OUTSIDE, Place, SPLIT};
use super::index::{self, Index, power};
use crate::grid::GridSize;
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};

/// The grid.
#[derive(Clone)]
pub(super) struct Bricks {
    /// Node (0, 0, 0), in metres.
    pub(super) origin: Point,
    /// Edge of a cell of level 0, in metres.
    pub(super) cell: Real,
    inverse_cell: Real,
    inverse_side: Real,
    /// Bricks of level 0 along each axis.
    pub(super) size: [usize; 3],
    /// Entries of level 0, x fastest: a brick, a split, [`OUTSIDE`] or [`INSIDE`].
    pub(super) roots: Vec<u32>,
    /// Entries of the eight halves of what is split: bit k of the index is the half along axis k.
    pub(super) splits: Vec<[u32; 8]>,
    /// Positions of the bricks, in the order of `nodes`.
    pub(super) places: Vec<Place>,
    /// [`BRICK`] nodes for each brick; x fastest.
    pub(super) nodes: Vec<Node>,
    /// Built by [`Bricks::indexed`]; queries need it.
    index: Index,
}

/// The result of a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Reading {
    /// The blend in its cell.
    Blend(Real, Vector),
    /// Beyond the band or the grid.
    Outside,
    /// Deeper than the band.
    Inside,
}

/// The location of a point.
#[derive(Clone, Copy, Debug)]
pub(super) enum Spot {
    /// In the cell whose lowest corner is `slot`, at `u` in [0, 1)³; `inverse` is 1 / its edge.
    Cell { slot: usize, u: [Real; 3], inverse: Real },
    /// Beyond the band or the grid.
    Outside,
    /// Deeper than the band.
    Inside,
}

impl Bricks {
    /// A grid of level 0 with a brick at each of `kept`, ascending; elsewhere `roots` stay.
    pub(super) fn new(
        origin: Point,
        cell: Real,
        size: [usize; 3],
        mut roots: Vec<u32>,
        kept: &[u32],
    ) -> Self {
        let mut places = Vec::with_capacity(kept.len());
        for (brick, root) in kept.iter().enumerate() {
            let r = *root as usize;
            roots[r] = brick as u32;
            let at = GridSize(size).coordinates(r).map(|b| b as u32);
            places.push(Place { level: 0, at });
        }
        let nodes = vec![[0.0; 4]; places.len() * BRICK];
        Self::from_parts(origin, cell, size, roots, Vec::new(), places, nodes)
    }

    /// A grid from its parts.
    pub(super) fn from_parts(
        origin: Point,
        cell: Real,
        size: [usize; 3],
        roots: Vec<u32>,
        splits: Vec<[u32; 8]>,
        places: Vec<Place>,
        nodes: Vec<Node>,
    ) -> Self {
        let inverse_side = 1.0 / (cell * SIDE as Real);
        Self {
            origin,
            cell,
            inverse_cell: 1.0 / cell,
            inverse_side,
            size,
            roots,
            splits,
            places,
            nodes,
            index: Index::default(),
        }
    }

    /// Adds the tables that find the brick of a point; `None` if they would have more than `most`
    /// entries ([`Index::new`]).
    pub(super) fn indexed(mut self, most: usize) -> Option<Self> {
        self.index = Index::new(&self.roots, &self.splits, &self.places, most)?;
        Some(self)
    }

    /// Edge of a cell of a level, in metres.
    pub(super) fn cell_of(&self, level: u32) -> Real {
        self.cell / Real::from(1u32 << level)
    }

    /// Number of the root at such coordinates.
    pub(super) fn root_index(&self, b: [usize; 3]) -> usize {
        GridSize(self.size).index(b)
    }

    /// Position of a node given by its coordinates at a level: a node of several levels has the
    /// same bits.
    pub(super) fn at(&self, level: u32, node: [u32; 3]) -> Point {
        let cell = self.cell_of(level);
        Point::from([0, 1, 2].map(|k| self.origin[k] + Real::from(node[k]) * cell))
    }

    /// Coordinates of a node of a brick at the brick's level.
    pub(super) fn node(&self, brick: usize, index: usize) -> [u32; 3] {
        let (place, local) = (&self.places[brick], local(index));
        [0, 1, 2].map(|k| place.at[k] * SIDE as u32 + local[k] as u32)
    }

    /// The entry that covers a brick at `place`, and its level: at most that of `place`.
    pub(super) fn entry(&self, place: &Place) -> (u32, u32) {
        let mut entry = self.roots[self.root_index(place.at.map(|b| (b >> place.level) as usize))];
        let mut level = 0;
        while (SPLIT..INSIDE).contains(&entry) && level < place.level {
            level += 1;
            let half = (0..3)
                .fold(0, |h, k| h | ((place.at[k] >> (place.level - level) & 1) as usize) << k);
            entry = self.splits[(entry - SPLIT) as usize][half];
        }
        (entry, level)
    }

    /// The bricks in use, in the order of the directory: halves of a split follow one another.
    pub(super) fn leaves(&self) -> Vec<u32> {
        let mut out = Vec::with_capacity(self.places.len());
        let mut stack: Vec<u32> = self.roots.iter().rev().copied().collect();
        while let Some(entry) = stack.pop() {
            match entry {
                OUTSIDE | INSIDE => {}
                split if split >= SPLIT => {
                    stack.extend(self.splits[(split - SPLIT) as usize].iter().rev())
                }
                brick => out.push(brick),
            }
        }
        out
    }

    /// The box of all space deeper than the band, where there are no bricks.
    pub(super) fn inside(&self) -> Aabb {
        let mut found = Aabb::EMPTY;
        for (root, entry) in self.roots.iter().enumerate() {
            let at = GridSize(self.size).coordinates(root);
            self.inside_of(*entry, Place { level: 0, at: at.map(|b| b as u32) }, &mut found);
        }
        found
    }

    fn inside_of(&self, entry: u32, place: Place, found: &mut Aabb) {
        if entry == INSIDE {
            let corner = |add: u32| self.at(place.level, place.at.map(|b| (b + add) * SIDE as u32));
            *found = found.grown_to(&corner(0)).grown_to(&corner(1));
        } else if (SPLIT..INSIDE).contains(&entry) {
            for (k, half) in self.splits[(entry - SPLIT) as usize].iter().enumerate() {
                self.inside_of(*half, place.half(k), found);
            }
        }
    }

    /// Locates `p`.
    #[inline]
    pub(super) fn spot(&self, p: &Point) -> Spot {
        let (mut b, mut f) = ([0u32; 3], [0.0; 3]);
        for k in 0..3 {
            let q = (p[k] - self.origin[k]) * self.inverse_side;
            // Also where q is NaN.
            if !(q >= 0.0 && q < self.size[k] as Real) {
                return Spot::Outside;
            }
            b[k] = q as u32;
            f[k] = q - Real::from(b[k]);
        }
        let root = (b[2] as usize * self.size[1] + b[1] as usize) * self.size[0] + b[0] as usize;
        let (brick, level) = self.index.find(root, f);
        if brick >= INSIDE {
            return if brick == INSIDE { Spot::Inside } else { Spot::Outside };
        }
        let scale = power(level);
        let mut slot = brick as usize * BRICK;
        let mut u = [0.0; 3];
        for (k, stride) in [1, NODES, NODES * NODES].into_iter().enumerate() {
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

    /// Value and gradient at a located point.
    #[inline]
    pub(super) fn reading(&self, spot: &Spot) -> Reading {
        match spot {
            Spot::Cell { slot, u, inverse } => {
                let (value, gradient) = blend(&self.nodes, *slot, *u, *inverse);
                Reading::Blend(value, gradient)
            }
            Spot::Outside => Reading::Outside,
            Spot::Inside => Reading::Inside,
        }
    }

    /// The same grid without bricks of which no node has a value in [−depth, band], in the order of
    /// [`Bricks::leaves`]; `None` if there are more bricks than an index can count.
    pub(super) fn compacted(&self, band: Real, depth: Real) -> Option<Self> {
        let mut out = Self::from_parts(
            self.origin,
            self.cell,
            self.size,
            Vec::new(),
            Vec::new(),
            Vec::new(),
            Vec::new(),
        );
        out.roots =
            self.roots.iter().map(|entry| self.copy_kept(*entry, band, depth, &mut out)).collect();
        out.indexed(index::MOST)
    }

    fn copy_kept(&self, entry: u32, band: Real, depth: Real, out: &mut Self) -> u32 {
        if entry >= INSIDE {
            return entry;
        }
        if entry >= SPLIT {
            let number = out.splits.len();
            out.splits.push([OUTSIDE; 8]);
            let halves = self.splits[(entry - SPLIT) as usize]
                .map(|half| self.copy_kept(half, band, depth, out));
            if halves[0] >= INSIDE && halves.iter().all(|h| *h == halves[0]) {
                out.splits.pop();
                return halves[0];
            }
            out.splits[number] = halves;
            return SPLIT + number as u32;
        }
        let brick = entry as usize;
        let nodes = &self.nodes[brick * BRICK..(brick + 1) * BRICK];
        if nodes.iter().all(|n| Real::from(n[0]) > band) {
            OUTSIDE
        } else if nodes.iter().all(|n| Real::from(n[0]) < -depth) {
            INSIDE
        } else {
            out.places.push(self.places[brick]);
            out.nodes.extend_from_slice(nodes);
            (out.places.len() - 1) as u32
        }
    }

    /// The box of all cells that may hold a point of the zero set or the inside, and of what is
    /// deeper than the band: outside it the field is positive.
    pub(super) fn surface_box(&self) -> Aabb {
        let mut surface = self.inside();
        for (brick, place) in self.places.iter().enumerate() {
            let cell = self.cell_of(place.level);
            for c in cells() {
                let slot = brick * BRICK + c;
                let least = corners(&self.nodes, slot)
                    .into_iter()
                    .fold(Real::INFINITY, |m, n| m.min(n[0].into()));
                // Along each axis the blend is at most a quarter of the lowest bump below the
                // corners.
                let dip = |b: [f32; 4]| b.into_iter().fold(0.0f32, f32::min);
                let dips: Real = bumps(&self.nodes, slot).map(|b| Real::from(dip(b))).iter().sum();
                if least + 0.25 * dips <= 0.0 {
                    let low = self.at(place.level, self.node(brick, c));
                    surface = surface.grown_to(&low).grown_to(&(low + Vector::repeat(cell)));
                }
            }
        }
        surface
    }

    /// Bytes of the grid.
    pub(super) fn bytes(&self) -> usize {
        self.places.len() * (BRICK * size_of::<Node>() + size_of::<Place>())
            + self.splits.len() * 32
            + self.roots.len() * 4
            + self.index.bytes()
    }
}

impl std::fmt::Debug for Bricks {
    /// Sizes only: the nodes are megabytes.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (origin, cell, size, bricks) = (&self.origin, self.cell, &self.size, self.places.len());
        write!(f, "Bricks {{ origin: {origin}, cell: {cell}, size: {size:?}, bricks: {bricks} }}")
    }
}

#[cfg(test)]
mod tests;
