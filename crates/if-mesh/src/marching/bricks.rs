//! The part of a lattice where a field can vanish: bricks of 4 × 4 × 4 cells, and the values at their nodes.

use crate::marching::MarchError;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};
use rayon::prelude::*;

/// Cells along a brick. With 4 the values at nodes that are not needed weigh about as much as the values
/// at centres that finer bricks would need.
pub(super) const BRICK: u32 = 4;
/// Nodes along a brick, both ends included.
pub(super) const NODES: usize = BRICK as usize + 1;
/// Bits of a coordinate within a key.
const BITS: u32 = 21;
/// Bricks along an axis, at most: their nodes still fit into keys.
pub(super) const MAX_BRICKS: Real = ((1u32 << (BITS - 2)) - 2) as Real;

/// Coordinates as one number, x fastest. Steps along the axes are sums with [`STEP`].
pub(super) fn key(c: [u32; 3]) -> u64 {
    u64::from(c[0]) | u64::from(c[1]) << BITS | u64::from(c[2]) << (2 * BITS)
}

/// What a step along each axis adds to a key.
pub(super) const STEP: [u64; 3] = [1, 1 << BITS, 1 << (2 * BITS)];

/// The coordinates of a key.
pub(super) fn unkey(key: u64) -> [u32; 3] {
    [0, BITS, 2 * BITS].map(|shift| (key >> shift) as u32 & ((1 << BITS) - 1))
}

/// Where nodes are.
pub(super) struct Lattice {
    /// Node (0, 0, 0).
    pub(super) min: Point,
    /// Distance of neighbouring nodes, in metres.
    pub(super) cell: Real,
    /// Bricks along each axis.
    pub(super) bricks: [u32; 3],
}

impl Lattice {
    /// Position of a node.
    pub(super) fn node(&self, node: u64) -> Point {
        self.min + Vector::from(unkey(node).map(Real::from)) * self.cell
    }
}

/// The bricks that may hold a piece of the surface, and the field at all their nodes.
pub(super) struct Bricks {
    /// Keys of the bricks, ascending.
    pub(super) bricks: Vec<u64>,
    /// Keys of the nodes, ascending.
    pub(super) nodes: Vec<u64>,
    /// The field there.
    pub(super) values: Vec<Real>,
    /// Calls of the field so far.
    pub(super) evaluations: usize,
    /// Whether the surface crosses the border of the lattice.
    pub(super) leaves: bool,
}

impl Bricks {
    /// Finds the bricks and evaluates their nodes.
    ///
    /// A box of half diagonal r about m is dropped where |φ(m)| > L r. Where L is wrong this can drop a
    /// brick through which the surface passes; a brick is therefore added again where the common nodes
    /// with a neighbour have both signs, so that the surface has no holes.
    pub(super) fn new<F: SignedDistance + ?Sized>(field: &F, lattice: &Lattice) -> Result<Self, MarchError> {
        let mut found = candidates(field, lattice);
        let mut fresh = found.bricks.clone();
        while !fresh.is_empty() {
            found.evaluate(field, lattice, &fresh)?;
            fresh = found.missing_neighbours(lattice, &fresh);
            found.bricks.extend(&fresh);
            found.bricks.sort_unstable();
        }
        Ok(found)
    }

    /// Positions in `nodes` of a brick's nodes, x fastest.
    pub(super) fn nodes_of(&self, brick: u64) -> [u32; NODES * NODES * NODES] {
        let mut out = [0; NODES * NODES * NODES];
        let first = key(unkey(brick).map(|c| c * BRICK));
        for (row, out) in out.chunks_exact_mut(NODES).enumerate() {
            let start = first + (row % NODES) as u64 * STEP[1] + (row / NODES) as u64 * STEP[2];
            let at = self.nodes.partition_point(|n| *n < start);
            // The nodes of a row have consecutive keys, so they stand side by side.
            out.iter_mut().enumerate().for_each(|(k, o)| *o = (at + k) as u32);
        }
        out
    }

    /// Adds the nodes of `fresh` bricks.
    fn evaluate<F: SignedDistance + ?Sized>(&mut self, field: &F, lattice: &Lattice, fresh: &[u64]) -> Result<(), MarchError> {
        let mut keys: Vec<u64> = fresh
            .par_iter()
            .flat_map_iter(|brick| {
                let first = key(unkey(*brick).map(|c| c * BRICK));
                let steps = 0..NODES as u64;
                steps.clone().flat_map(move |z| {
                    let steps = steps.clone();
                    steps.clone().flat_map(move |y| steps.clone().map(move |x| first + x + y * STEP[1] + z * STEP[2]))
                })
            })
            .collect();
        keys.par_sort_unstable();
        keys.dedup();
        keys.retain(|k| self.nodes.binary_search(k).is_err());
        let points: Vec<Point> = keys.par_iter().map(|k| lattice.node(*k)).collect();
        let mut values = vec![0.0; points.len()];
        field.distances(&points, &mut values);
        self.evaluations += points.len();
        if let Some(k) = values.iter().position(|v| v.is_nan()) {
            return Err(MarchError::NotANumber { point: points[k] });
        }
        let mut all: Vec<(u64, Real)> =
            std::mem::take(&mut self.nodes).into_iter().zip(std::mem::take(&mut self.values)).collect();
        all.extend(keys.into_iter().zip(values));
        all.par_sort_unstable_by_key(|n| n.0);
        (self.nodes, self.values) = all.into_iter().unzip();
        Ok(())
    }

    /// Bricks not in the list that share a side of both signs with one of `fresh`.
    fn missing_neighbours(&mut self, lattice: &Lattice, fresh: &[u64]) -> Vec<u64> {
        let this = &*self;
        let mut out: Vec<Option<u64>> = fresh
            .par_iter()
            .flat_map_iter(|&brick| {
                let nodes = this.nodes_of(brick);
                let at = unkey(brick);
                (0..6).filter_map(move |side| {
                    let (axis, up) = (side / 2, side % 2 == 1);
                    let beyond = if up { at[axis] + 1 < lattice.bricks[axis] } else { at[axis] > 0 };
                    let neighbour = if up { brick.wrapping_add(STEP[axis]) } else { brick.wrapping_sub(STEP[axis]) };
                    if beyond && this.bricks.binary_search(&neighbour).is_ok() {
                        return None;
                    }
                    let stride = NODES.pow(axis as u32);
                    let layer = if up { NODES - 1 } else { 0 };
                    let mut inside = (0..nodes.len()).filter(|n| n / stride % NODES == layer);
                    let first = this.values[nodes[inside.next()?] as usize] < 0.0;
                    inside.any(|n| (this.values[nodes[n] as usize] < 0.0) != first).then_some(beyond.then_some(neighbour))
                })
            })
            .collect();
        out.sort_unstable();
        out.dedup();
        self.leaves |= out.first() == Some(&None);
        out.into_iter().flatten().collect()
    }
}

/// Halves a cube round the lattice down to bricks, a level a batch, and drops what the bound clears.
fn candidates<F: SignedDistance + ?Sized>(field: &F, lattice: &Lattice) -> Bricks {
    let lipschitz = field.lipschitz();
    let mut side = lattice.bricks.iter().copied().max().unwrap_or(1).max(1).next_power_of_two();
    let mut boxes = vec![[0u32; 3]];
    let mut evaluations = 0;
    loop {
        let half = 0.5 * Real::from(side * BRICK) * lattice.cell;
        let centre = |b: &[u32; 3]| lattice.min + Vector::from(b.map(|c| Real::from(c * BRICK) * lattice.cell)).add_scalar(half);
        let points: Vec<Point> = boxes.iter().map(centre).collect();
        let mut values = vec![0.0; points.len()];
        field.distances(&points, &mut values);
        evaluations += points.len();
        let reach = lipschitz * half * 3f64.sqrt();
        let mut value = values.iter();
        // NaN is kept: it is reported where nodes have it.
        boxes.retain(|_| value.next().is_none_or(|v| v.is_nan() || v.abs() <= reach || reach.is_nan()));
        if side == 1 {
            break;
        }
        side /= 2;
        boxes = boxes
            .iter()
            .flat_map(|b| (0..8u32).map(move |c| [0, 1, 2].map(|k| b[k] + side * (c >> k & 1))))
            .filter(|b| (0..3).all(|k| b[k] < lattice.bricks[k]))
            .collect();
    }
    let mut bricks: Vec<u64> = boxes.into_iter().map(key).collect();
    bricks.sort_unstable();
    Bricks { bricks, nodes: Vec::new(), values: Vec::new(), evaluations, leaves: false }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::{ScaledGradient, Sphere};

    #[test]
    fn keys_keep_coordinates_and_steps() {
        let c = [5, 1_000_000, 77];
        assert_eq!(unkey(key(c)), c);
        assert_eq!(unkey(key(c) + STEP[0] + STEP[1] + STEP[2]), [6, 1_000_001, 78]);
    }

    #[test]
    fn bricks_follow_the_surface_also_where_the_lipschitz_bound_lies() {
        struct Lying(ScaledGradient<Sphere>);
        impl SignedDistance for Lying {
            fn distance(&self, p: &Point) -> Real {
                self.0.distance(p)
            }
            fn sample(&self, p: &Point) -> if_core::field::FieldSample {
                self.0.sample(p)
            }
            fn bounds(&self) -> Option<if_core::aabb::Aabb> {
                None
            }
            fn lipschitz(&self) -> Real {
                1.0
            }
        }
        let ball = Sphere { center: Point::new(1.01, 1.02, 0.99), radius: 0.7 };
        let lattice = Lattice { min: Point::origin(), cell: 0.03, bricks: [17; 3] };
        let honest = Bricks::new(&ball, &lattice).unwrap();
        let dense = (17 * BRICK as usize + 1).pow(3);
        assert!(honest.evaluations < dense / 4, "{} of {dense}", honest.evaluations);
        assert_eq!(honest.nodes.len(), honest.values.len());
        assert!(honest.nodes.is_sorted() && !honest.leaves);
        // Too steep by far: centres seem to be clear of the surface. What is found is completed.
        let lying = Bricks::new(&Lying(ScaledGradient { field: ball, factor: 1.5 }), &lattice).unwrap();
        let crossed = |b: &Bricks| {
            b.bricks
                .iter()
                .filter(|k| {
                    let inside = b.nodes_of(**k).map(|n| b.values[n as usize] < 0.0);
                    inside.iter().any(|i| *i != inside[0])
                })
                .count()
        };
        assert_eq!(crossed(&honest), crossed(&lying));
        assert!(lying.bricks.len() <= honest.bricks.len());
    }
}
