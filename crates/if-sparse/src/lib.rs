//! Sparse symmetric positive definite systems A x = b, solved by Cholesky factorisation, A = L Lᵀ.
//!
//! [`Cholesky::new`] factors the matrix with given [`Entry`]s; [`Cholesky::solve_in_place`] solves for
//! the columns of a [`Mat`]. A [`Pattern`] analyses the places once, for matrices that differ in
//! their values only.
//!
//! The factorisation is faer's. Nothing here is generic, so that its kernels (for every instruction
//! set) are compiled once, in this crate, and not in each crate that solves a system.
//!
//! # Examples
//!
//! ```
//! use if_sparse::{Cholesky, Entry, Mat};
//!
//! // |  2 −1 | x = | 1 |
//! // | −1  2 |     | 0 |
//! let lower = [Entry::new(0, 0, 2.0), Entry::new(1, 0, -1.0), Entry::new(1, 1, 2.0)];
//! let mut x = Mat::zeros(2, 1);
//! x[(0, 0)] = 1.0;
//! Cholesky::new(2, &lower)?.solve_in_place(&mut x);
//! assert!((x[(0, 0)] - 2.0 / 3.0).abs() < 1e-15 && (x[(1, 0)] - 1.0 / 3.0).abs() < 1e-15);
//! # Ok::<(), if_sparse::CholeskyError>(())
//! ```

use faer::Side;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::LltError;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{Argsort, CreationError, Pair, SparseColMat, SymbolicSparseColMat, Triplet};
use std::fmt;
use std::ops::{Index, IndexMut};

/// A place in a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Row, counted from 0.
    pub row: usize,
    /// Column, counted from 0.
    pub column: usize,
}

impl Place {
    /// The place in this row and column.
    pub fn new(row: usize, column: usize) -> Self {
        Self { row, column }
    }
}

/// An entry of a matrix.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Row, counted from 0.
    pub row: usize,
    /// Column, counted from 0.
    pub column: usize,
    /// The value.
    pub value: f64,
}

impl Entry {
    /// The entry `value` in this row and column.
    pub fn new(row: usize, column: usize, value: f64) -> Self {
        Self { row, column, value }
    }
}

/// A dense matrix: the right-hand sides of a system, and then its solutions, one in each column.
#[derive(Clone, Debug, PartialEq)]
pub struct Mat(faer::Mat<f64>);

impl Mat {
    /// The zero matrix.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self(faer::Mat::zeros(rows, columns))
    }

    /// The matrix of the values `f(row, column)`.
    pub fn from_fn(rows: usize, columns: usize, f: impl FnMut(usize, usize) -> f64) -> Self {
        Self(faer::Mat::from_fn(rows, columns, f))
    }
}

/// The value in (row, column).
///
/// # Panics
///
/// If either is out of range.
impl Index<(usize, usize)> for Mat {
    type Output = f64;

    #[inline]
    fn index(&self, at: (usize, usize)) -> &f64 {
        &self.0[at]
    }
}

impl IndexMut<(usize, usize)> for Mat {
    #[inline]
    fn index_mut(&mut self, at: (usize, usize)) -> &mut f64 {
        &mut self.0[at]
    }
}

/// A matrix cannot be factored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CholeskyError {
    /// An entry is outside the matrix.
    #[error("an entry is in row {row}, column {column} of a matrix of {n} rows and columns")]
    Place {
        /// Row of the entry.
        row: usize,
        /// Column of the entry.
        column: usize,
        /// Rows and columns of the matrix.
        n: usize,
    },
    /// The number of values differs from that of places in the pattern.
    #[error("{values} values for a pattern of {places} places; give one for each")]
    Count {
        /// Values given.
        values: usize,
        /// Places of the pattern.
        places: usize,
    },
    /// The matrix is not positive definite, or a value is not finite.
    #[error("the matrix is not positive definite, or a value is not finite")]
    NotPositiveDefinite,
    /// The matrix or its factor has more entries than memory, or an index, can hold.
    #[error("the matrix of {n} rows and columns, or its factor, is too large for the memory")]
    TooLarge {
        /// Rows and columns of the matrix.
        n: usize,
    },
}

/// The places of a matrix's entries, analysed once for matrices that differ in their values.
#[derive(Clone)]
pub struct Pattern {
    n: usize,
    places: usize,
    symbolic: SymbolicSparseColMat<usize>,
    /// From the order of the places to that of the matrix.
    order: Argsort<usize>,
    llt: SymbolicLlt<usize>,
}

impl fmt::Debug for Pattern {
    /// Numbers only: a pattern is megabytes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Pattern")
            .field("n", &self.n)
            .field("places", &self.places)
            .finish_non_exhaustive()
    }
}

impl Pattern {
    /// The pattern of an n × n matrix with entries at `places` of its lower triangle; places above
    /// the diagonal are ignored. The values of repeated places add up.
    ///
    /// # Errors
    ///
    /// [`CholeskyError`]: a place is outside the matrix, or the matrix is too large.
    pub fn new(n: usize, places: &[Place]) -> Result<Self, CholeskyError> {
        let pairs: Vec<_> = places.iter().map(|p| Pair::new(p.row, p.column)).collect();
        let made = SymbolicSparseColMat::try_new_from_indices(n, n, &pairs);
        let (symbolic, order) = made.map_err(|e| creation(n, &e))?;
        let llt = SymbolicLlt::try_new(symbolic.as_ref(), Side::Lower)
            .map_err(|_| CholeskyError::TooLarge { n })?;
        Ok(Self { n, places: places.len(), symbolic, order, llt })
    }

    /// Factors the matrix with these values, one for each place in the order of [`Pattern::new`].
    ///
    /// # Errors
    ///
    /// [`CholeskyError`]: the number of values is wrong, or the matrix is not positive definite.
    pub fn factor(&self, values: &[f64]) -> Result<Cholesky, CholeskyError> {
        let (n, places) = (self.n, self.places);
        if values.len() != places {
            return Err(CholeskyError::Count { values: values.len(), places });
        }
        if !values.iter().all(|v| v.is_finite()) {
            return Err(CholeskyError::NotPositiveDefinite);
        }
        let matrix = SparseColMat::new_from_argsort(self.symbolic.clone(), &self.order, values);
        let matrix = matrix.map_err(|_| CholeskyError::TooLarge { n })?;
        let llt = Llt::try_new_with_symbolic(self.llt.clone(), matrix.as_ref(), Side::Lower);
        Ok(Cholesky { n, llt: llt.map_err(|e| numeric(n, e))? })
    }
}

/// A factored matrix.
#[derive(Clone)]
pub struct Cholesky {
    n: usize,
    llt: Llt<usize, f64>,
}

impl fmt::Debug for Cholesky {
    /// Numbers only: a factor is megabytes.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Cholesky").field("n", &self.n).finish_non_exhaustive()
    }
}

impl Cholesky {
    /// Factors the n × n matrix with these entries of its lower triangle; entries above the diagonal
    /// are ignored. Entries of the same place add up.
    ///
    /// # Errors
    ///
    /// [`CholeskyError`]: an entry is outside the matrix, or the matrix is too large or not positive
    /// definite.
    pub fn new(n: usize, entries: &[Entry]) -> Result<Self, CholeskyError> {
        let triplets: Vec<_> =
            entries.iter().map(|e| Triplet::new(e.row, e.column, e.value)).collect();
        let matrix =
            SparseColMat::try_new_from_triplets(n, n, &triplets).map_err(|e| creation(n, &e))?;
        // An infinite pivot would give zeros.
        if !triplets.iter().all(|t| t.val.is_finite()) {
            return Err(CholeskyError::NotPositiveDefinite);
        }
        drop(triplets);
        let symbolic = SymbolicLlt::try_new(matrix.symbolic(), Side::Lower)
            .map_err(|_| CholeskyError::TooLarge { n })?;
        let llt = Llt::try_new_with_symbolic(symbolic, matrix.as_ref(), Side::Lower);
        Ok(Self { n, llt: llt.map_err(|e| numeric(n, e))? })
    }

    /// Replaces each column b of `right` by the x of A x = b.
    ///
    /// # Panics
    ///
    /// If `right` has another number of rows than the matrix.
    pub fn solve_in_place(&self, right: &mut Mat) {
        assert_eq!(right.0.nrows(), self.n, "one row for each of the matrix");
        self.llt.solve_in_place(right.0.as_mut());
    }
}

fn creation(n: usize, error: &CreationError) -> CholeskyError {
    match *error {
        CreationError::OutOfBounds { row, col } => CholeskyError::Place { row, column: col, n },
        CreationError::Generic(_) => CholeskyError::TooLarge { n },
    }
}

fn numeric(n: usize, error: LltError) -> CholeskyError {
    match error {
        LltError::Numeric(_) => CholeskyError::NotPositiveDefinite,
        LltError::Generic(_) => CholeskyError::TooLarge { n },
    }
}

/// The example in the README is a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
