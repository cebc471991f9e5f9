//! A sparse grid of bricks of 4³ cells, whose cells may be halved where that is needed, while it is made.

use if_core::aabb::Aabb;
use if_core::math::{Point, Real};

/// Cells along the side of a brick.
pub(super) const SIDE: usize = 4;
/// Nodes along the side of a brick. Nodes on the border are stored in every brick that has them.
pub(super) const NODES: usize = SIDE + 1;
/// Nodes of a brick.
pub(super) const BRICK: usize = NODES * NODES * NODES;
/// Entry of the directory: no brick, and the field is above the band there.
pub(super) const OUTSIDE: u32 = u32::MAX;
/// Entry of the directory: no brick, and the field is below the band there.
pub(super) const INSIDE: u32 = u32::MAX - 1;
/// Entries from here to [`INSIDE`] are split into eight; below are bricks.
pub(super) const SPLIT: u32 = 1 << 31;

/// Value at a node, and the bumps of the edges that lead from it along x, y and z, [`rounded`](super::cell::rounded); all in metres.
pub(super) type Node = [f32; 4];

/// Where a brick stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// How often cells were halved.
    pub(super) level: u32,
    /// Counted in bricks of that level.
    pub(super) at: [u32; 3],
}

impl Place {
    /// One of the eight places that it is split into: bit k of `half` is the half along axis k.
    pub(super) fn half(&self, half: usize) -> Self {
        Self { level: self.level + 1, at: [0, 1, 2].map(|a| 2 * self.at[a] + (half >> a & 1) as u32) }
    }
}

/// The grid.
#[derive(Clone)]
pub(super) struct Bricks {
    /// Node (0, 0, 0), in metres.
    pub(super) origin: Point,
    /// Edge of a cell of level 0, in metres.
    pub(super) cell: Real,
    /// Bricks of level 0 along each axis.
    pub(super) size: [usize; 3],
    /// Entries of level 0, x fastest: a brick, a split, [`OUTSIDE`] or [`INSIDE`].
    pub(super) roots: Vec<u32>,
    /// Entries of the eight halves of what is split: bit k of the index is the half along axis k.
    pub(super) splits: Vec<[u32; 8]>,
    /// Where the bricks stand, in the order in which `nodes` stores them.
    pub(super) places: Vec<Place>,
    /// [`BRICK`] nodes for each brick; x fastest.
    pub(super) nodes: Vec<Node>,
}

impl Bricks {
    /// A grid of level 0 with a brick at each of `kept`, ascending; elsewhere `roots` stay.
    pub(super) fn new(origin: Point, cell: Real, size: [usize; 3], mut roots: Vec<u32>, kept: &[u32]) -> Self {
        let mut places = Vec::with_capacity(kept.len());
        for (brick, root) in kept.iter().enumerate() {
            let r = *root as usize;
            roots[r] = brick as u32;
            places.push(Place { level: 0, at: [r % size[0], r / size[0] % size[1], r / size[0] / size[1]].map(|b| b as u32) });
        }
        let nodes = vec![[0.0; 4]; places.len() * BRICK];
        Self { origin, cell, size, roots, splits: Vec::new(), places, nodes }
    }

    /// A grid of the same size without anything.
    pub(super) fn bare(&self) -> Self {
        let (origin, cell, size) = (self.origin, self.cell, self.size);
        Self { origin, cell, size, roots: Vec::new(), splits: Vec::new(), places: Vec::new(), nodes: Vec::new() }
    }

    /// The nodes of a brick.
    pub(super) fn nodes_of(&self, brick: usize) -> &[Node] {
        &self.nodes[brick * BRICK..(brick + 1) * BRICK]
    }

    /// Edge of a cell of a level, in metres.
    pub(super) fn cell_of(&self, level: u32) -> Real {
        self.cell / Real::from(1u32 << level)
    }

    /// Number of the root at such coordinates.
    pub(super) fn root_index(&self, b: [usize; 3]) -> usize {
        (b[2] * self.size[1] + b[1]) * self.size[0] + b[0]
    }

    /// Position of a node given by its coordinates at a level: a node of several levels has the same bits.
    pub(super) fn at(&self, level: u32, node: [u32; 3]) -> Point {
        let cell = self.cell_of(level);
        Point::from([0, 1, 2].map(|k| self.origin[k] + Real::from(node[k]) * cell))
    }

    /// Coordinates of a node of a brick at the brick's level.
    pub(super) fn node(&self, brick: usize, index: usize) -> [u32; 3] {
        let (place, local) = (&self.places[brick], local(index));
        [0, 1, 2].map(|k| place.at[k] * SIDE as u32 + local[k] as u32)
    }

    /// The entry that covers the brick that would stand at `place`, and its level: at most that of `place`.
    pub(super) fn entry(&self, place: &Place) -> (u32, u32) {
        let mut entry = self.roots[self.root_index(place.at.map(|b| (b >> place.level) as usize))];
        let mut level = 0;
        while (SPLIT..INSIDE).contains(&entry) && level < place.level {
            level += 1;
            let half = (0..3).fold(0, |h, k| h | ((place.at[k] >> (place.level - level) & 1) as usize) << k);
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
                split if split >= SPLIT => stack.extend(self.splits[(split - SPLIT) as usize].iter().rev()),
                brick => out.push(brick),
            }
        }
        out
    }

    /// The boxes of what is deeper than the band: no brick stands there.
    pub(super) fn inside(&self) -> Aabb {
        let mut found = Aabb::EMPTY;
        for (root, entry) in self.roots.iter().enumerate() {
            let at = [root % self.size[0], root / self.size[0] % self.size[1], root / self.size[0] / self.size[1]];
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

    /// Bytes that the grid takes.
    pub(super) fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>()
            + self.places.len() * size_of::<Place>()
            + self.splits.len() * 32
            + self.roots.len() * 4
    }
}

/// Indices in a brick of the lowest corners of its cells.
pub(super) fn cells() -> impl Iterator<Item = usize> {
    (0..SIDE * SIDE * SIDE).map(|c| ((c / SIDE / SIDE) * NODES + c / SIDE % SIDE) * NODES + c % SIDE)
}

/// Coordinates of a node in its brick.
pub(super) fn local(index: usize) -> [usize; 3] {
    [index % NODES, index / NODES % NODES, index / NODES / NODES]
}

impl std::fmt::Debug for Bricks {
    /// Sizes only: the nodes are megabytes.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (origin, cell, size, bricks) = (&self.origin, self.cell, &self.size, self.places.len());
        write!(f, "Bricks {{ origin: {origin}, cell: {cell}, size: {size:?}, bricks: {bricks} }}")
    }
}
