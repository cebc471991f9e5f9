//! Dense grids: indices of their nodes or cells.

use if_core::math::Real;

/// Size of a dense grid along x, y and z. Values are stored with x fastest and z slowest.
///
/// # Examples
///
/// ```
/// use if_mesh::grid::GridSize;
/// let size = GridSize([4, 3, 2]);
/// assert_eq!((size.len(), size.index([1, 2, 1])), (24, 21));
/// assert_eq!(size.coordinates(21), [1, 2, 1]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GridSize(pub [usize; 3]);

impl GridSize {
    /// Number of values.
    #[inline]
    pub fn len(self) -> usize {
        let [nx, ny, nz] = self.0;
        nx * ny * nz
    }

    /// Whether there are no values.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Index of the value at `coordinates`, which must be in range.
    #[inline]
    pub fn index(self, [x, y, z]: [usize; 3]) -> usize {
        let [nx, ny, _] = self.0;
        (z * ny + y) * nx + x
    }

    /// Coordinates of the value at `index`.
    #[inline]
    pub fn coordinates(self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.0;
        [index % nx, index / nx % ny, index / nx / ny]
    }

    /// Distances between the indices of neighbours along each axis.
    #[inline]
    pub fn strides(self) -> [usize; 3] {
        let [nx, ny, _] = self.0;
        [1, nx, nx * ny]
    }

    /// Indices of the up to six face neighbours: the lower, then the upper one along each axis.
    pub fn neighbours(self, index: usize) -> impl Iterator<Item = usize> {
        let (at, strides) = (self.coordinates(index), self.strides());
        (0..3).flat_map(move |k| {
            let low = (at[k] > 0).then(|| index - strides[k]);
            let high = (at[k] + 1 < self.0[k]).then(|| index + strides[k]);
            low.into_iter().chain(high)
        })
    }

    /// The lowest node of the grid cell at `place`, in cells and clamped to the grid, and the
    /// position in that cell from 0 to 1.
    #[inline]
    pub fn cell_at(self, place: [Real; 3]) -> ([usize; 3], [Real; 3]) {
        let (mut low, mut part) = ([0; 3], [0.0; 3]);
        for k in 0..3 {
            let last = self.0[k] - 1;
            let place = place[k].clamp(0.0, last as Real);
            low[k] = (place as usize).min(last.saturating_sub(1));
            part[k] = place - low[k] as Real;
        }
        (low, part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_and_coordinates_are_inverse_and_neighbours_one_step_away() {
        let size = GridSize([5, 3, 4]);
        for index in 0..size.len() {
            let at = size.coordinates(index);
            assert_eq!(size.index(at), index);
            let expected: Vec<usize> = (0..size.len())
                .filter(|other| {
                    let b = size.coordinates(*other);
                    (0..3).map(|k| at[k].abs_diff(b[k])).sum::<usize>() == 1
                })
                .collect();
            let mut found: Vec<usize> = size.neighbours(index).collect();
            found.sort_unstable();
            assert_eq!(found, expected, "{at:?}");
        }
    }

    #[test]
    fn positions_outside_are_clamped_to_the_border() {
        let size = GridSize([5, 3, 1]);
        assert_eq!(size.cell_at([1.25, 9.0, -2.0]), ([1, 1, 0], [0.25, 1.0, 0.0]));
        assert_eq!(size.cell_at([4.0, 0.5, 0.0]), ([3, 0, 0], [1.0, 0.5, 0.0]));
    }
}
