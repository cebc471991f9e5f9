//! What an extraction says of itself.

use if_core::aabb::Aabb;
use if_core::math::Real;
use serde::Serialize;
use std::fmt;

/// What an extraction cost, how exact it is, and what to be aware of.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExtractReport {
    /// The box that the lattice covers.
    pub region: Aabb,
    /// Side of the cells, in metres.
    pub cell: Real,
    /// Cells along each axis.
    pub cells: [u32; 3],
    /// The bound on |∇φ| that was used.
    pub slope: Real,
    /// Points at which the field was evaluated.
    pub evaluations: Evaluations,
    /// Share of the region's volume that was cleared without looking at its cells.
    pub skipped: Real,
    /// How far the mesh is from the surface.
    pub error: ErrorEstimate,
    /// With a requested accuracy: what was tried, the last of which this is.
    pub attempts: Vec<Attempt>,
    /// What to be aware of.
    pub warnings: Vec<Warning>,
    /// Where the time went.
    pub seconds: Seconds,
}

/// Points at which a field was evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
pub struct Evaluations {
    /// Nodes of the lattice.
    pub refine: usize,
    /// Vertices: secant and Newton steps. The latter with gradient.
    pub polish: usize,
    /// Vertices, with gradient.
    pub relax: usize,
    /// Places where the error was measured, with gradient.
    pub check: usize,
    /// All of them, of all attempts, and those that bounded the slope.
    pub total: usize,
}

/// Distances of the mesh from the surface, in metres: |φ| / |∇φ| at vertices and at centres of
/// triangles chosen by a seed. Zero for a mesh without triangles.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct ErrorEstimate {
    /// The largest of the chosen vertices.
    pub vertex_max: Real,
    /// Their root mean square.
    pub vertex_rms: Real,
    /// The largest of the chosen triangle centres.
    pub center_max: Real,
    /// Their root mean square.
    pub center_rms: Real,
    /// How many of each there were.
    pub checked: usize,
}

impl ErrorEstimate {
    /// The largest of all.
    pub fn worst(&self) -> Real {
        self.vertex_max.max(self.center_max)
    }
}

/// One cell size that was tried for a requested accuracy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Attempt {
    /// Side of the cells, in metres.
    pub cell: Real,
    /// [`ErrorEstimate::worst`], in metres.
    pub error: Real,
    /// Triangles.
    pub triangles: usize,
}

/// Seconds of each part, by the clock.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct Seconds {
    /// Finding and evaluating cells.
    pub refine: f64,
    /// Edges and triangles.
    pub triangles: f64,
    /// Vertices.
    pub polish: f64,
    /// Warnings and relaxation.
    pub relax: f64,
    /// Measuring.
    pub check: f64,
}

impl Seconds {
    /// The sum.
    pub fn total(&self) -> f64 {
        self.refine + self.triangles + self.polish + self.relax + self.check
    }
}

/// What to be aware of.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub enum Warning {
    /// The surface goes on beyond the region: the mesh has a border there.
    LeavesRegion {
        /// Lattice edges on the region's border that it crosses.
        edges: usize,
    },
    /// Two sheets that face one another are nearer than two cells: they are told apart, but their
    /// triangles may meet.
    NearSheets {
        /// Pairs of vertices on lattice lines.
        pairs: usize,
        /// The smallest distance of such a pair, in metres.
        gap: Real,
    },
    /// Something smaller than a cell may have been lost.
    Unresolved {
        /// Cells that neither show a surface nor can be cleared.
        cells: usize,
    },
    /// The bound on the field's slope is wrong.
    Slope {
        /// The bound given, or said by the field.
        given: Real,
        /// The bound that was used instead, as values of the field asked for it.
        used: Real,
        /// Cells that had been cleared all the same and hold a part of the surface. They were taken
        /// back; a part of the surface that is not connected to the rest may be missing.
        cells: usize,
    },
    /// The accuracy is not reached, with the smallest cell allowed or after the last attempt.
    Inaccurate {
        /// The error requested, in metres.
        requested: Real,
        /// The error reached, in metres.
        reached: Real,
        /// The cell, in metres.
        cell: Real,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::LeavesRegion { edges } => {
                write!(
                    f,
                    "the surface leaves the region through {edges} edges of the lattice; enlarge the region to close it"
                )
            }
            Self::NearSheets { pairs, gap } => write!(
                f,
                "sheets are nearer than two cells at {pairs} places, the nearest {:.3} mm apart; halve the cell to part them well",
                1e3 * gap
            ),
            Self::Unresolved { cells } => {
                write!(
                    f,
                    "something thinner than a cell may be lost in {cells} cells; take smaller cells"
                )
            }
            Self::Slope { given, used, cells } => write!(
                f,
                "the field is steeper than {given}, so {used:.3} was used and {cells} cells were taken back; give a larger slope"
            ),
            Self::Inaccurate { requested, reached, cell } => write!(
                f,
                "the error is {:.4} mm where {:.4} mm was asked for, with cells of {:.4} mm; allow smaller ones, or ask for less",
                1e3 * reached,
                1e3 * requested,
                1e3 * cell
            ),
        }
    }
}
