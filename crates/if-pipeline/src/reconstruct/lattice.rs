//! A dense lattice of voxels.

use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};
use if_mesh::grid::GridSize;

/// Largest number of voxels: 64 MB. Beyond, voxels are made larger.
const MOST_VOXELS: Real = 8e6;

/// Cubic voxels over a box.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    pub(super) min: Point,
    pub(super) cell: Real,
    pub(super) size: GridSize,
}

impl Lattice {
    /// A lattice with at least two voxels along each axis.
    pub(super) fn new(region: &Aabb, cell: Real) -> Self {
        let size = region.size();
        let counts = |cell: Real| [0, 1, 2].map(|k| (size[k] / cell).ceil().max(2.0));
        let mut cell = cell;
        while counts(cell).iter().product::<Real>() > MOST_VOXELS {
            cell *= 1.25;
        }
        Self { min: region.min, cell, size: GridSize(counts(cell).map(|n| n as usize)) }
    }

    pub(super) fn len(&self) -> usize {
        self.size.len()
    }

    /// The centre of voxel `i`; x is the fastest index.
    pub(super) fn center(&self, i: usize) -> Point {
        let at = self.size.coordinates(i).map(|c| c as Real);
        self.min + Vector::from(at).add_scalar(0.5) * self.cell
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice(counts: [usize; 3]) -> Lattice {
        Lattice { min: Point::origin(), cell: 0.5, size: GridSize(counts) }
    }

    #[test]
    fn centres_and_neighbours_of_voxels_agree() {
        let l = lattice([3, 4, 2]);
        for i in 0..l.len() {
            let p = l.center(i);
            for k in l.size.neighbours(i) {
                assert!(((l.center(k) - p).norm() - 0.5).abs() < 1e-12);
            }
            let border = (0..3).map(|k| {
                usize::from(p[k] < 0.5) + usize::from(p[k] > 0.5 * (l.size.0[k] - 1) as Real)
            });
            assert_eq!(l.size.neighbours(i).count() + border.sum::<usize>(), 6, "{i}");
        }
        let fine =
            Lattice::new(&Aabb::from_points(&[Point::origin(), Point::new(1.0, 2.0, 1.0)]), 1e-4);
        assert!(
            fine.len() as Real <= MOST_VOXELS && fine.len() as Real > 0.3 * MOST_VOXELS,
            "{}",
            fine.len()
        );
        assert_eq!(Lattice::new(&Aabb::from_points(&[Point::origin()]), 0.1).size.0, [2; 3]);
    }
}
