//! A sparse grid of value and gradient: bricks of 8³ cells, found through a dense directory.

use if_core::math::{Point, Real, Vector};

/// Cells along the side of a brick.
pub(super) const SIDE: usize = 8;
/// Nodes along the side of a brick. Nodes on the border are stored in every brick that has them, so
/// that a query reads one brick.
pub(super) const NODES: usize = SIDE + 1;
/// Nodes of a brick.
pub(super) const BRICK: usize = NODES * NODES * NODES;
/// In the directory: no brick, and the field is above the band there.
pub(super) const OUTSIDE: u32 = u32::MAX;
/// In the directory: no brick, and the field is below the band there.
pub(super) const INSIDE: u32 = u32::MAX - 1;

/// Value in metres and gradient at a node.
pub(super) type Node = [f32; 4];

/// The grid.
#[derive(Clone)]
pub(super) struct Bricks {
    /// Node (0, 0, 0), in metres.
    pub(super) origin: Point,
    /// Edge of a cell, in metres.
    pub(super) cell: Real,
    inverse_cell: Real,
    /// Bricks along each axis.
    pub(super) size: [usize; 3],
    /// For each place its brick, [`OUTSIDE`] or [`INSIDE`]; x fastest.
    pub(super) directory: Vec<u32>,
    /// Places of the bricks, in the order in which `nodes` stores them.
    pub(super) places: Vec<u32>,
    /// [`BRICK`] nodes for each brick; x fastest.
    pub(super) nodes: Vec<Node>,
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

impl Bricks {
    /// A grid with a brick at each of `places`, in ascending order; elsewhere the directory is kept.
    pub(super) fn new(origin: Point, cell: Real, size: [usize; 3], mut directory: Vec<u32>, places: Vec<u32>) -> Self {
        for (brick, place) in places.iter().enumerate() {
            directory[*place as usize] = brick as u32;
        }
        let nodes = vec![[0.0; 4]; places.len() * BRICK];
        Self { origin, cell, inverse_cell: 1.0 / cell, size, directory, places, nodes }
    }

    /// Number of the brick at `b`, where there is one.
    pub(super) fn brick_at(&self, b: [usize; 3]) -> Option<u32> {
        if (0..3).any(|k| b[k] >= self.size[k]) {
            return None;
        }
        let entry = self.directory[self.place_index(b)];
        (entry < INSIDE).then_some(entry)
    }

    /// Where the brick stands, in bricks.
    pub(super) fn place(&self, brick: u32) -> [usize; 3] {
        self.place_at(self.places[brick as usize] as usize)
    }

    /// Coordinates of a place of the directory, in bricks.
    pub(super) fn place_at(&self, index: usize) -> [usize; 3] {
        [index % self.size[0], index / self.size[0] % self.size[1], index / self.size[0] / self.size[1]]
    }

    /// The place in the directory for such coordinates.
    pub(super) fn place_index(&self, b: [usize; 3]) -> usize {
        (b[2] * self.size[1] + b[1]) * self.size[0] + b[0]
    }

    /// Coordinates of a node, counted over the whole grid.
    pub(super) fn node(&self, slot: usize) -> [usize; 3] {
        let (b, l) = (self.place((slot / BRICK) as u32), local(slot % BRICK));
        [0, 1, 2].map(|k| b[k] * SIDE + l[k])
    }

    /// Position of a node: the same bits in each brick that has it.
    pub(super) fn position(&self, slot: usize) -> Point {
        self.at(self.node(slot))
    }

    /// Position of a node given by its coordinates.
    pub(super) fn at(&self, node: [usize; 3]) -> Point {
        Point::from([0, 1, 2].map(|k| self.origin[k] + node[k] as Real * self.cell))
    }

    /// The slot that speaks for a node: of the bricks that have it, the first in a fixed order.
    pub(super) fn owner(&self, node: [usize; 3]) -> Option<usize> {
        for back in 0..8usize {
            let step = [back & 1, back >> 1 & 1, back >> 2 & 1];
            if (0..3).any(|k| step[k] == 1 && (!node[k].is_multiple_of(SIDE) || node[k] == 0)) {
                continue;
            }
            let b = [0, 1, 2].map(|k| node[k] / SIDE - step[k]);
            if let Some(brick) = self.brick_at(b) {
                let l = [0, 1, 2].map(|k| node[k] - b[k] * SIDE);
                return Some(brick as usize * BRICK + (l[2] * NODES + l[1]) * NODES + l[0]);
            }
        }
        None
    }

    /// Whether `slot` speaks for its node.
    pub(super) fn owns(&self, slot: usize) -> bool {
        // Off the upper border the brick itself is the first in the order.
        local(slot % BRICK).iter().all(|l| *l < SIDE) || self.owner(self.node(slot)) == Some(slot)
    }

    /// Copies from the slots that speak for nodes to all others.
    pub(super) fn spread(&mut self) {
        for slot in 0..self.nodes.len() {
            if local(slot % BRICK).contains(&SIDE)
                && let Some(owner) = self.owner(self.node(slot))
            {
                self.nodes[slot] = self.nodes[owner];
            }
        }
    }

    /// Value and gradient at `p`.
    #[inline]
    pub(super) fn read(&self, p: &Point) -> Reading {
        let mut cell = [0usize; 3];
        let mut u = [0.0; 3];
        for k in 0..3 {
            let q = (p[k] - self.origin[k]) * self.inverse_cell;
            // Also where q is NaN.
            if !(q >= 0.0 && q < (self.size[k] * SIDE) as Real) {
                return Reading::Outside;
            }
            cell[k] = q as usize;
            u[k] = q - cell[k] as Real;
        }
        let place = ((cell[2] / SIDE) * self.size[1] + cell[1] / SIDE) * self.size[0] + cell[0] / SIDE;
        match self.directory[place] {
            OUTSIDE => Reading::Outside,
            INSIDE => Reading::Inside,
            brick => {
                let l = cell.map(|c| c % SIDE);
                let (value, gradient) = self.blend(brick as usize * BRICK + (l[2] * NODES + l[1]) * NODES + l[0], u);
                Reading::Blend(value, gradient)
            }
        }
    }

    /// The half-Taylor blend in the cell whose lowest corner is `slot`, at `u` in [0, 1]³:
    ///
    /// ```text
    /// φ(p) = Σ wₖ (φₖ + ½ gₖ · (p − xₖ)),   wₖ trilinear
    /// ```
    ///
    /// The trilinear blend of the values errs by +½ Σ u (1 − u) h² ∂²φ, that of the whole Taylor
    /// expansions by the opposite: half of the slope is exact for quadratic fields. The gradient is the
    /// blend's own.
    #[inline]
    pub(super) fn blend(&self, slot: usize, u: [Real; 3]) -> (Real, Vector) {
        let n = &self.nodes[slot..slot + NODES * NODES + NODES + 2];
        let half = 0.5 * self.cell;
        // Along x: value, gradient, and the value's difference.
        let line = |at: usize, dy: Real, dz: Real| {
            let [a, b] = [n[at].map(Real::from), n[at + 1].map(Real::from)];
            let ta = a[0] + half * (a[1] * u[0] + a[2] * dy + a[3] * dz);
            let tb = b[0] + half * (b[1] * (u[0] - 1.0) + b[2] * dy + b[3] * dz);
            let mix = |x: Real, y: Real| x + (y - x) * u[0];
            [mix(ta, tb), mix(a[1], b[1]), mix(a[2], b[2]), mix(a[3], b[3]), tb - ta]
        };
        let plane = |at: usize, dz: Real| {
            let (a, b) = (line(at, u[1], dz), line(at + NODES, u[1] - 1.0, dz));
            let mix = |k: usize| a[k] + (b[k] - a[k]) * u[1];
            [mix(0), mix(1), mix(2), mix(3), mix(4), b[0] - a[0]]
        };
        let (a, b) = (plane(0, u[2]), plane(NODES * NODES, u[2] - 1.0));
        let mix = |k: usize| a[k] + (b[k] - a[k]) * u[2];
        let difference = Vector::new(mix(4), mix(5), b[0] - a[0]);
        let slope = Vector::new(mix(1), mix(2), mix(3));
        (mix(0), difference * self.inverse_cell + slope * 0.5)
    }

    /// Slots of the lowest corners of all cells of a brick.
    pub(super) fn cells(brick: usize) -> impl Iterator<Item = usize> {
        (0..SIDE * SIDE * SIDE).map(move |c| brick * BRICK + ((c / SIDE / SIDE) * NODES + c / SIDE % SIDE) * NODES + c % SIDE)
    }

    /// The eight nodes of the cell whose lowest corner is `slot`: bit k of the index is the step along k.
    pub(super) fn corners(&self, slot: usize) -> [&Node; 8] {
        [0, 1, NODES, NODES + 1, NODES * NODES, NODES * NODES + 1, NODES * NODES + NODES, NODES * NODES + NODES + 1]
            .map(|d| &self.nodes[slot + d])
    }

    /// Drops the bricks that hold no node with a value in [−depth, band].
    pub(super) fn pruned(self, band: Real, depth: Real) -> Self {
        let mut directory = self.directory;
        let mut kept = Vec::new();
        let mut nodes = Vec::new();
        for (brick, place) in self.places.iter().enumerate() {
            let values = &self.nodes[brick * BRICK..(brick + 1) * BRICK];
            if values.iter().all(|n| Real::from(n[0]) > band) {
                directory[*place as usize] = OUTSIDE;
            } else if values.iter().all(|n| Real::from(n[0]) < -depth) {
                directory[*place as usize] = INSIDE;
            } else {
                directory[*place as usize] = kept.len() as u32;
                kept.push(*place);
                nodes.extend_from_slice(values);
            }
        }
        Self { directory, places: kept, nodes, ..self }
    }
}

impl std::fmt::Debug for Bricks {
    /// Sizes only: the nodes are megabytes.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (origin, cell, size, bricks) = (&self.origin, self.cell, &self.size, self.places.len());
        write!(f, "Bricks {{ origin: {origin}, cell: {cell}, size: {size:?}, bricks: {bricks} }}")
    }
}

/// Coordinates of a node in its brick.
pub(super) fn local(index: usize) -> [usize; 3] {
    [index % NODES, index / NODES % NODES, index / NODES / NODES]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two bricks that share a face, filled with a quadratic.
    fn quadratic() -> (Bricks, impl Fn(&Point) -> (Real, Vector)) {
        let f = |p: &Point| {
            let value = 0.3 + p.x - 2.0 * p.y + 0.5 * p.z + p.x * p.x - p.x * p.y + 2.0 * p.y * p.z - 0.7 * p.z * p.z;
            (value, Vector::new(1.0 + 2.0 * p.x - p.y, -2.0 - p.x + 2.0 * p.z, 0.5 + 2.0 * p.y - 1.4 * p.z))
        };
        let mut bricks = Bricks::new(Point::new(-0.5, 0.0, 0.25), 0.125, [3, 1, 1], vec![OUTSIDE, OUTSIDE, INSIDE], vec![0, 1]);
        for slot in 0..bricks.nodes.len() {
            if bricks.owns(slot) {
                let (v, g) = f(&bricks.position(slot));
                bricks.nodes[slot] = [v as f32, g.x as f32, g.y as f32, g.z as f32];
            }
        }
        bricks.spread();
        (bricks, f)
    }

    #[test]
    fn quadratic_fields_are_exact() {
        let (bricks, f) = quadratic();
        for k in 0..500 {
            let s = |m: Real| (Real::from(k) * m).fract();
            let p = Point::new(-0.5 + 2.0 * s(0.618), s(0.414), 0.25 + s(0.732));
            let (value, gradient) = f(&p);
            let Reading::Blend(v, g) = bricks.read(&p) else { panic!("{p} is in a brick") };
            // Single precision of values of about 5.
            approx::assert_relative_eq!(v, value, epsilon = 2e-6);
            approx::assert_relative_eq!(g, gradient, epsilon = 3e-5);
        }
        assert_eq!(bricks.read(&Point::new(1.6, 0.5, 0.5)), Reading::Inside);
        assert_eq!(bricks.read(&Point::new(-0.6, 0.5, 0.5)), Reading::Outside);
        assert_eq!(bricks.read(&Point::new(2.6, 0.5, 0.5)), Reading::Outside);
    }

    #[test]
    fn shared_nodes_have_one_owner_and_one_position() {
        let (bricks, _) = quadratic();
        let owned = (0..bricks.nodes.len()).filter(|s| bricks.owns(*s)).count();
        assert_eq!(owned, 17 * 9 * 9);
        for slot in 0..bricks.nodes.len() {
            let owner = bricks.owner(bricks.node(slot)).unwrap();
            assert_eq!(bricks.position(owner), bricks.position(slot));
            assert_eq!(bricks.nodes[owner], bricks.nodes[slot]);
        }
    }
}
