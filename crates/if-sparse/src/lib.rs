//! Sparse symmetric positive definite systems: A x = b by A = L Lᵀ.
//!
//! The factorisation is faer's. Nothing here is generic, so that its kernels (for every instruction
//! set) are compiled in this crate, once, and not again in each crate that solves a system, in each
//! of its test programs, and after each of its changes.

use faer::Side;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::LltError;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{Argsort, CreationError, SparseColMat, SymbolicSparseColMat};
use std::fmt;

pub use faer::Mat;
/// A place in a matrix: row, column.
pub type Place = faer::sparse::Pair<usize, usize>;
/// An entry of a matrix: row, column, value.
pub type Entry = faer::sparse::Triplet<usize, usize, f64>;

/// Why a matrix cannot be factored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum CholeskyError {
    /// An entry beyond the matrix.
    #[error("an entry stands in row {row}, column {column} of a matrix of {n} rows and columns")]
    Place { row: usize, column: usize, n: usize },
    /// More or fewer values than the pattern has places.
    #[error("{values} values for a pattern of {places} places")]
    Count { values: usize, places: usize },
    /// Not positive definite, or with a number that is not finite.
    #[error("the matrix is not positive definite, or has a number that is not finite")]
    NotPositiveDefinite,
    /// The matrix or its factor has more entries than memory, or an index, can hold.
    #[error("the matrix of {n} rows and columns, or its factor, is too large for the memory")]
    TooLarge { n: usize },
}

/// Where the entries of a matrix are, analysed: for matrices of the same pattern and other values.
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
    /// The pattern of an n × n matrix with entries at `places` of its lower triangle (what stands
    /// above is not read). A place may stand there more than once: its values add up.
    ///
    /// # Errors
    ///
    /// [`CholeskyError`]: a place beyond the matrix, or a matrix too large.
    pub fn new(n: usize, places: &[Place]) -> Result<Self, CholeskyError> {
        let made = SymbolicSparseColMat::try_new_from_indices(n, n, places);
        let (symbolic, order) = made.map_err(|e| creation(n, &e))?;
        let llt = SymbolicLlt::try_new(symbolic.as_ref(), Side::Lower)
            .map_err(|_| CholeskyError::TooLarge { n })?;
        Ok(Self { n, places: places.len(), symbolic, order, llt })
    }

    /// Factors the matrix with these values, one for each place in the order of [`Pattern::new`].
    ///
    /// # Errors
    ///
    /// [`CholeskyError`]: another number of values, or a matrix that is not positive definite.
    pub fn factor(&self, values: &[f64]) -> Result<Cholesky, CholeskyError> {
        let (n, places) = (self.n, self.places);
        if values.len() != places {
            return Err(CholeskyError::Count { values: values.len(), places });
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
    /// Factors the n × n matrix with these entries of its lower triangle (what stands above is not
    /// read). Entries of the same place add up.
    ///
    /// # Errors
    ///
    /// [`CholeskyError`]: an entry beyond the matrix, a matrix too large, or one that is not positive definite.
    pub fn new(n: usize, entries: &[Entry]) -> Result<Self, CholeskyError> {
        let matrix =
            SparseColMat::try_new_from_triplets(n, n, entries).map_err(|e| creation(n, &e))?;
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
    pub fn solve_in_place(&self, right: &mut Mat<f64>) {
        assert_eq!(right.nrows(), self.n, "one row for each of the matrix");
        self.llt.solve_in_place(right.as_mut());
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
