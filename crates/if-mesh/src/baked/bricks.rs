//! A sparse grid of bricks of 4³ cells, whose cells may be halved where that is needed.

use super::index::{self, Index, power};
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};

/// Cells along the side of a brick.
pub(super) const SIDE: usize = 4;
/// Nodes along the side of a brick. Nodes on the border are stored in every brick that has them, so
/// that a query reads one brick.
pub(super) const NODES: usize = SIDE + 1;
/// Nodes of a brick.
pub(super) const BRICK: usize = NODES * NODES * NODES;
/// Entry of the directory: no brick, and the field is above the band there.
pub(super) const OUTSIDE: u32 = u32::MAX;
/// Entry of the directory: no brick, and the field is below the band there.
pub(super) const INSIDE: u32 = u32::MAX - 1;
/// Entries from here to [`INSIDE`] are split into eight; below are bricks.
pub(super) const SPLIT: u32 = 1 << 31;

/// Value at a node, and the bumps of the edges that lead from it along x, y and z; all in metres.
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
        Self {
            level: self.level + 1,
            at: [0, 1, 2].map(|a| 2 * self.at[a] + (half >> a & 1) as u32),
        }
    }
}

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
    /// Where the bricks stand, in the order in which `nodes` stores them.
    pub(super) places: Vec<Place>,
    /// [`BRICK`] nodes for each brick; x fastest.
    pub(super) nodes: Vec<Node>,
    /// Made by [`Bricks::indexed`]: points cannot be looked up before.
    index: Index,
}

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
            places.push(Place {
                level: 0,
                at: [r % size[0], r / size[0] % size[1], r / size[0] / size[1]].map(|b| b as u32),
            });
        }
        let nodes = vec![[0.0; 4]; places.len() * BRICK];
        Self::from_parts(origin, cell, size, roots, Vec::new(), places, nodes)
    }

    /// A grid of its parts.
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

    /// With the tables that find the brick of a point; `None` where they would have more than
    /// `most` entries ([`Index::new`]).
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
        (b[2] * self.size[1] + b[1]) * self.size[0] + b[0]
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

    /// The entry that covers the brick that would stand at `place`, and its level: at most that of
    /// `place`.
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

    /// The boxes of what is deeper than the band: no brick stands there.
    pub(super) fn inside(&self) -> Aabb {
        let mut found = Aabb::EMPTY;
        for (root, entry) in self.roots.iter().enumerate() {
            let at = [
                root % self.size[0],
                root / self.size[0] % self.size[1],
                root / self.size[0] / self.size[1],
            ];
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

    /// Where `p` lies.
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

    /// Value and gradient at a point that lies there.
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

    /// The same grid without what holds no node with a value in [−depth, band], in the order of
    /// [`Bricks::leaves`]; `None` where its bricks are more than an index can count.
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

    /// Bytes that the grid takes.
    pub(super) fn bytes(&self) -> usize {
        self.places.len() * (BRICK * size_of::<Node>() + size_of::<Place>())
            + self.splits.len() * 32
            + self.roots.len() * 4
            + self.index.bytes()
    }
}

/// The blend in the cell whose lowest corner is `slot`, at `u` in [0, 1]³; `inverse` is 1 / its
/// edge h:
///
/// ```text
/// φ = T(φₖ) + Σ_axes uₐ (1 − uₐ) B(bₐ),   bₐ = ½ h (∂ₐφ at the edge's start − ∂ₐφ at its end)
/// ```
///
/// with T the trilinear blend of the corners, and B the bilinear one of the four edges along the
/// axis. This is the half-Taylor blend `Σ wₖ (φₖ + ½ gₖ · (p − xₖ))`: the trilinear blend of the
/// values errs by +½ Σ u (1 − u) h² ∂²φ, that of whole Taylor expansions by the opposite, and half
/// of the slope is exact for quadratic fields. On a side of the cell it depends on that side alone;
/// and the blend in a part of a cell, with values and bumps that are the cell's own there, is the
/// cell's blend to the last term, so that small cells join large ones without a gap
/// ([`super::join`]). The gradient is the blend's own.
#[inline]
pub(super) fn blend(nodes: &[Node], slot: usize, u: [Real; 3], inverse: Real) -> (Real, Vector) {
    let n = &nodes[slot..slot + NODES * NODES + NODES + 2];
    let [ux, uy, uz] = u;
    let [cx, cy, cz] = [1.0 - ux, 1.0 - uy, 1.0 - uz];
    let get = |at: usize, k: usize| Real::from(n[at][k]);
    let mix = |a: Real, b: Real, t: Real| a + (b - a) * t;
    const Y: usize = NODES;
    const Z: usize = NODES * NODES;
    // Along x: the value, and its slope.
    let row = |at: usize| {
        let (a, rise, bump) = (get(at, 0), get(at + 1, 0) - get(at, 0), get(at, 1));
        (a + ux * (rise + cx * bump), rise + (cx - ux) * bump)
    };
    let [(a, da), (b, db), (c, dc), (d, dd)] = [row(0), row(Y), row(Z), row(Y + Z)];
    // Bumps along y at both ends along z, and along z at both ends along y: values and slopes along
    // x.
    let line = |at: usize, k: usize| {
        let rise = get(at + 1, k) - get(at, k);
        (get(at, k) + rise * ux, rise)
    };
    let [(y0, dy0), (y1, dy1)] = [line(0, 2), line(Z, 2)];
    let [(z0, dz0), (z1, dz1)] = [line(0, 3), line(Y, 3)];
    let (low, high) = (mix(a, b, uy), mix(c, d, uy));
    let (bump_y, bump_z) = (mix(y0, y1, uz), mix(z0, z1, uy));
    let (wy, wz) = (uy * cy, uz * cz);
    let value = mix(low, high, uz) + wy * bump_y + wz * bump_z;
    let gx =
        mix(mix(da, db, uy), mix(dc, dd, uy), uz) + wy * mix(dy0, dy1, uz) + wz * mix(dz0, dz1, uy);
    let gy = mix(b - a, d - c, uz) + (cy - uy) * bump_y + wz * (z1 - z0);
    let gz = high - low + wy * (y1 - y0) + (cz - uz) * bump_z;
    (value, Vector::new(gx, gy, gz) * inverse)
}

/// Indices in a brick of the lowest corners of its cells.
pub(super) fn cells() -> impl Iterator<Item = usize> {
    (0..SIDE * SIDE * SIDE)
        .map(|c| ((c / SIDE / SIDE) * NODES + c / SIDE % SIDE) * NODES + c % SIDE)
}

/// The eight corners of the cell whose lowest is `slot`: bit k of the index is the step along axis
/// k.
pub(super) fn corners(nodes: &[Node], slot: usize) -> [&Node; 8] {
    const Z: usize = NODES * NODES;
    [0, 1, NODES, NODES + 1, Z, Z + 1, Z + NODES, Z + NODES + 1].map(|d| &nodes[slot + d])
}

/// The twelve bumps of a cell, in threes for each axis of their edges.
pub(super) fn bumps(nodes: &[Node], slot: usize) -> [[f32; 4]; 3] {
    const Z: usize = NODES * NODES;
    let at = [[0, NODES, Z, Z + NODES], [0, 1, Z, Z + 1], [0, 1, NODES, NODES + 1]];
    [0, 1, 2].map(|axis| at[axis].map(|d| nodes[slot + d][axis + 1]))
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

#[cfg(test)]
mod tests {
    use super::*;

    fn quadratic(p: &Point) -> (Real, Vector) {
        let value = 0.3 + p.x - 2.0 * p.y + 0.5 * p.z + p.x * p.x - p.x * p.y + 2.0 * p.y * p.z
            - 0.7 * p.z * p.z;
        (
            value,
            Vector::new(1.0 + 2.0 * p.x - p.y, -2.0 - p.x + 2.0 * p.z, 0.5 + 2.0 * p.y - 1.4 * p.z),
        )
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
                    if l[k] < SIDE {
                        (0.5 * bricks.cell_of(level) * (g[k] - end)) as f32
                    } else {
                        0.0
                    }
                };
                bricks.nodes[brick * BRICK + i] = [v as f32, bump(0), bump(1), bump(2)];
            }
        }
    }

    /// Two bricks that share a side, the second split, and one half of that again.
    fn split() -> Bricks {
        let place = |level, x, y, z| Place { level, at: [x, y, z] };
        let halves = |level, at: [u32; 3]| {
            (0..8u32).map(move |k| {
                place(level, at[0] + (k & 1), at[1] + (k >> 1 & 1), at[2] + (k >> 2 & 1))
            })
        };
        let mut places = vec![place(0, 0, 0, 0)];
        places.extend(halves(1, [2, 0, 0]).skip(1));
        places.extend(halves(2, [4, 0, 0]));
        let roots = vec![0, SPLIT, INSIDE];
        let splits = vec![[SPLIT + 1, 1, 2, 3, 4, 5, 6, 7], [8, 9, 10, 11, 12, 13, 14, 15]];
        let nodes = vec![[0.0; 4]; places.len() * BRICK];
        Bricks::from_parts(
            Point::new(-0.5, 0.0, 0.25),
            0.25,
            [3, 1, 1],
            roots,
            splits,
            places,
            nodes,
        )
        .indexed(index::MOST)
        .unwrap()
    }

    #[test]
    fn quadratic_fields_are_exact_at_every_level() {
        let mut bricks = split();
        filled(&mut bricks, quadratic);
        for k in 0..500 {
            let s = |m: Real| (Real::from(k) * m).fract();
            let p = Point::new(-0.5 + 2.0 * s(0.618), s(0.414), 0.25 + s(0.732));
            let (value, gradient) = quadratic(&p);
            let Reading::Blend(v, g) = bricks.read(&p) else { panic!("{p} is in a brick") };
            // Single precision of values of about 5.
            approx::assert_relative_eq!(v, value, epsilon = 2e-6);
            approx::assert_relative_eq!(g, gradient, epsilon = 1e-4);
        }
        assert_eq!(bricks.read(&Point::new(1.6, 0.5, 0.5)), Reading::Inside);
        assert_eq!(bricks.read(&Point::new(-0.6, 0.5, 0.5)), Reading::Outside);
        assert_eq!(bricks.read(&Point::new(2.6, 0.5, 0.5)), Reading::Outside);
    }

    #[test]
    fn joined_cells_of_three_sizes_leave_no_gap() {
        let mut bricks = split();
        // Far from quadratic: each level has another field.
        filled(&mut bricks, |p| {
            let (a, b, c) = (9.0 * p.x, 7.0 * p.y, 8.0 * p.z);
            (
                a.sin() * b.cos() + c.sin(),
                Vector::new(9.0 * a.cos() * b.cos(), -7.0 * a.sin() * b.sin(), 8.0 * c.cos()),
            )
        });
        let gap = |bricks: &Bricks| {
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
                    let [Reading::Blend(a, _), Reading::Blend(b, _)] =
                        [bricks.read(&(on - off)), bricks.read(&(on + off))]
                    else {
                        panic!("{on} is in a brick")
                    };
                    gap = gap.max((a - b).abs());
                }
            }
            gap
        };
        let before = gap(&bricks);
        super::super::join::join(&mut bricks);
        // Values of 2 in single precision.
        assert!(before > 1e-2 && gap(&bricks) < 1e-6, "{before} {}", gap(&bricks));
    }

    #[test]
    fn five_halvings_are_found_through_two_tables() {
        // One corner of the root is halved five times.
        let (mut places, mut splits) = (Vec::new(), Vec::new());
        for level in 1..=5u32 {
            let first = places.len() as u32;
            let halves: [u32; 8] = std::array::from_fn(|k| {
                if k == 7 && level < 5 { SPLIT + level } else { first + k as u32 }
            });
            for k in (0..8u32).take(if level < 5 { 7 } else { 8 }) {
                let at = [0, 1, 2].map(|a| (1 << level) - 2 + (k >> a & 1));
                places.push(Place { level, at });
            }
            splits.push(halves);
        }
        let nodes = vec![[0.0; 4]; places.len() * BRICK];
        let bricks =
            Bricks::from_parts(Point::origin(), 0.5, [1, 1, 1], vec![SPLIT], splits, places, nodes);
        let bricks = bricks.indexed(index::MOST).unwrap();
        for (brick, place) in bricks.places.iter().enumerate() {
            assert_eq!(bricks.entry(place), (brick as u32, place.level));
            for i in 0..BRICK {
                if local(i).iter().all(|l| *l < SIDE) {
                    let p = bricks.at(place.level, bricks.node(brick, i)) + Vector::repeat(1e-9);
                    let Spot::Cell { slot, u, .. } = bricks.spot(&p) else {
                        panic!("{p} is in a brick")
                    };
                    assert!(
                        slot == brick * BRICK + i && u.iter().all(|u| *u < 1e-6),
                        "{place:?} {i}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_directory_finds_every_brick() {
        let bricks = split();
        let mut leaves = bricks.leaves();
        leaves.sort_unstable();
        assert_eq!(leaves, (0..16).collect::<Vec<u32>>());
        for (brick, place) in bricks.places.iter().enumerate() {
            assert_eq!(bricks.entry(place), (brick as u32, place.level));
            let middle =
                bricks.at(place.level, bricks.node(brick, BRICK / 2)) + Vector::repeat(1e-9);
            let Spot::Cell { slot, inverse, .. } = bricks.spot(&middle) else {
                panic!("{middle} is in a brick")
            };
            assert_eq!(
                (slot, inverse),
                (brick * BRICK + BRICK / 2, 1.0 / bricks.cell_of(place.level))
            );
        }
    }
}
