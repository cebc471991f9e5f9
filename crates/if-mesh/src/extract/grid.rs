//! Surfaces of fields that are given as values on a grid.

use crate::extract::lattice::Lattice;
use crate::extract::polish::guess;
use crate::extract::rows::{NodeWord, Rows, WORD, below};
use crate::extract::surface::Crossings;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;
use rayon::prelude::*;

/// Why [`surface_of_grid`] fails.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GridError {
    /// The number of values is wrong.
    #[error("{got} values for a grid of {} × {} × {} nodes, which needs {needed}", nodes[0], nodes[1], nodes[2])]
    Count {
        /// Nodes along each axis.
        nodes: [u32; 3],
        /// Their product.
        needed: usize,
        /// Values given.
        got: usize,
    },
    /// More values than 32 bits can number.
    #[error("{nodes} nodes are more than 32 bits can number; extract parts of the grid")]
    TooMany {
        /// Number of nodes.
        nodes: usize,
    },
    /// The cell is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Nodes of the grid are not finite.
    #[error("a grid from {min} on with cells of {cell} m has nodes that are not finite")]
    Region {
        /// Position of node (0, 0, 0).
        min: Point,
        /// The cell, in metres.
        cell: Real,
    },
    /// A value is not a number.
    #[error("value {index} is not a number")]
    NotANumber {
        /// Index of a NaN.
        index: usize,
    },
}

/// Computes the surface of a field given at the nodes of a grid, linear on its edges.
///
/// `values` has x fastest and z slowest; node (0, 0, 0) is at `min`, and neighbours are `cell`
/// metres apart. The triangles are those of [`crate::extract::extract`].
///
/// # Errors
///
/// A wrong or too large number of values, a cell out of range, nodes that are not finite, a value
/// that is NaN.
pub fn surface_of_grid<T: Copy + Into<Real> + Sync>(
    values: &[T],
    nodes: [u32; 3],
    min: Point,
    cell: Real,
) -> Result<TriMesh, GridError> {
    // Checked at each step: the product of three 32-bit numbers may have 96 bits.
    let needed =
        nodes.iter().try_fold(1usize, |all, n| all.checked_mul(*n as usize)).unwrap_or(usize::MAX);
    if u32::try_from(needed).is_err() {
        return Err(GridError::TooMany { nodes: needed });
    }
    if values.len() != needed {
        return Err(GridError::Count { nodes, needed, got: values.len() });
    }
    let length = cell > 0.0 && cell.is_finite();
    ParameterError::check("cell", cell, length, "positive and finite (m)")?;
    let far = [0, 1, 2].map(|k| min[k] + cell * Real::from(nodes[k]));
    if !min.iter().chain(&far).all(|x| x.is_finite()) {
        return Err(GridError::Region { min, cell });
    }
    if needed == 0 {
        return Ok(TriMesh::default());
    }
    let rows = signs(values, nodes);
    if let Some(word) = rows.words().iter().find(|w| w.inside & !w.known != 0) {
        let at = word.base as usize;
        let index = (at..values.len()).find(|k| values[*k].into().is_nan()).unwrap_or(at);
        return Err(GridError::NotANumber { index });
    }
    let crossings = Crossings::of(&rows);
    let lattice = Lattice { min, cell, cells: nodes.map(|n| n - 1) };
    let (vertices, triangles) = rayon::join(
        || -> Vec<Point> {
            let edges = crossings.edges(|value| values[value].into());
            edges.par_iter().map(|e| guess(&lattice, e)).collect()
        },
        || crossings.triangles(),
    );
    Ok(TriMesh::new(vertices, triangles)
        .expect("vertices lie on edges of a finite grid, and cases name them"))
}

/// The signs of all nodes. A word with a NaN has bits in `inside` that are not in `known`.
fn signs<T: Copy + Into<Real> + Sync>(values: &[T], nodes: [u32; 3]) -> Rows<NodeWord> {
    let nx = nodes[0] as usize;
    Rows::build(nodes, |y, z, out| {
        let first = (y as usize + nodes[1] as usize * z as usize) * nx;
        for (x, part) in values[first..first + nx].chunks(WORD as usize).enumerate() {
            let mut bytes = [0u8; WORD as usize];
            let mut nan = false;
            for (byte, value) in bytes.iter_mut().zip(part) {
                let value: Real = (*value).into();
                *byte = u8::from(value < 0.0);
                nan |= value.is_nan();
            }
            let known =
                if part.len() < WORD as usize { below(part.len() as u32) } else { u64::MAX };
            let inside = pack(&bytes);
            let word =
                NodeWord { x: x as u32, base: (first + x * WORD as usize) as u32, known, inside };
            out.push(if nan { NodeWord { known: 0, inside: u64::MAX, ..word } } else { word });
        }
    })
}

/// Bit k from byte k, each of which is 0 or 1.
fn pack(bytes: &[u8; 64]) -> u64 {
    /// Moves byte k of eight to bit 56 + k: the products of two bytes never overlap.
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let mut out = 0;
    for (k, eight) in bytes.chunks_exact(8).enumerate() {
        let mut word = [0; 8];
        word.copy_from_slice(eight);
        out |= (u64::from_le_bytes(word).wrapping_mul(GATHER) >> 56) << (8 * k);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::extract::{ExtractParams, Resolution, extract};
    use if_core::aabb::Aabb;
    use if_core::field::SignedDistance;
    use if_core::shapes::Torus;

    #[test]
    fn bytes_become_bits() {
        let mut bytes = [0; 64];
        assert_eq!(pack(&bytes), 0);
        for k in [0, 1, 7, 8, 33, 63] {
            bytes[k] = 1;
        }
        assert_eq!(pack(&bytes), 1 | 2 | 1 << 7 | 1 << 8 | 1 << 33 | 1 << 63);
        assert_eq!(pack(&[1; 64]), u64::MAX);
    }

    #[test]
    fn a_grid_gives_the_triangles_of_its_field() {
        let ring = Torus { center: Point::new(0.5, 0.5, 0.5), major: 0.3, minor: 0.1 };
        // 71 nodes along x: rows are no whole words.
        let (nodes, cell) = ([71, 70, 65], 1.0 / 64.0);
        let size = nodes.map(|n| Real::from(n - 1) * cell);
        let region = Aabb { min: Point::origin(), max: Point::from(size) };
        let values: Vec<Real> = (0..71 * 70 * 65)
            .map(|k| {
                ring.distance(
                    &Point::new(f64::from(k % 71), f64::from(k / 71 % 70), f64::from(k / 71 / 70))
                        .coords
                        .scale(cell)
                        .into(),
                )
            })
            .collect();
        let params = ExtractParams {
            region: Some(region),
            resolution: Resolution::Cell(cell),
            phase: [0.0; 3],
            secant: false,
            newton: 0,
            ..ExtractParams::default()
        };
        let expected = extract(&ring, &params, &mut if_core::monitor::Silent).unwrap().mesh;
        assert_eq!(surface_of_grid(&values, nodes, Point::origin(), cell).unwrap(), expected);
        let single: Vec<f32> = values.iter().map(|v| *v as f32).collect();
        assert_eq!(
            surface_of_grid(&single, nodes, Point::origin(), cell).unwrap().triangles(),
            expected.triangles()
        );
    }

    #[test]
    fn invalid_grids_are_refused() {
        let grid =
            |values: &[Real], nodes, cell| surface_of_grid(values, nodes, Point::origin(), cell);
        assert!(matches!(
            grid(&[0.0; 7], [2; 3], 1.0),
            Err(GridError::Count { needed: 8, got: 7, .. })
        ));
        assert!(matches!(grid(&[0.0; 8], [2; 3], 0.0), Err(GridError::Parameter(_))));
        // A product of 2⁶⁴ is not 0.
        assert_eq!(
            grid(&[], [1 << 22, 1 << 22, 1 << 20], 1.0),
            Err(GridError::TooMany { nodes: usize::MAX })
        );
        assert!(matches!(grid(&[0.0; 8], [2; 3], 1e308), Err(GridError::Region { .. })));
        let nowhere =
            surface_of_grid(&[-1.0, 1.0], [2, 1, 1], Point::new(Real::NAN, 0.0, 0.0), 1.0);
        assert!(matches!(nowhere, Err(GridError::Region { .. })));
        let mut holed = vec![1.0; 300];
        holed[217] = Real::NAN;
        assert_eq!(grid(&holed, [100, 3, 1], 1.0), Err(GridError::NotANumber { index: 217 }));
        for (values, nodes) in [(&[][..], [0, 5, 5]), (&[-1.0], [1; 3]), (&[-1.0, 1.0], [2, 1, 1])]
        {
            assert_eq!(grid(values, nodes, 1.0).unwrap().triangles().len(), 0);
        }
    }
}
