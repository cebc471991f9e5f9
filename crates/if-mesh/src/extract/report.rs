//! The result of an extraction: mesh, cost, accuracy and warnings.

use if_core::aabb::Aabb;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use serde::Serialize;
use std::fmt;

/// A surface and its report.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Extraction {
    /// The surface, counter-clockwise seen from outside. Closed unless it leaves the region.
    pub mesh: TriMesh,
    /// Cost, accuracy and warnings.
    pub report: ExtractReport,
}

/// Cost, accuracy and warnings of an extraction.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
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
    /// Share of the region's volume that was dropped without evaluating its cells.
    pub skipped: Real,
    /// Distance of the mesh from the surface.
    pub error: ErrorEstimate,
    /// Vertices that went back to their edges of the lattice, or are not relaxed, as triangles of near sheets
    /// would meet otherwise: no two triangles of the mesh do.
    pub moved_back: usize,
    /// With a requested accuracy: all attempts; the last one is this mesh.
    pub attempts: Vec<Attempt>,
    /// Limits of the result.
    pub warnings: Vec<Warning>,
    /// Time of each part.
    pub seconds: Seconds,
}

/// Points at which a field was evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
#[non_exhaustive]
pub struct Evaluations {
    /// Nodes of the lattice.
    pub refine: usize,
    /// Vertices: secant steps, and Newton steps with gradient.
    pub polish: usize,
    /// Vertices, with gradient; those that go back to their edges, without.
    pub relax: usize,
    /// Points at which the error was measured, with gradient.
    pub check: usize,
    /// All of them, of all attempts, and those that bound the slope.
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
    /// Number of vertices checked.
    pub checked: usize,
}

impl ErrorEstimate {
    /// The largest of all.
    pub fn worst(&self) -> Real {
        self.vertex_max.max(self.center_max)
    }
}

/// One attempt at a requested accuracy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Attempt {
    /// Side of the cells, in metres.
    pub cell: Real,
    /// [`ErrorEstimate::worst`], in metres.
    pub error: Real,
    /// Number of triangles.
    pub triangles: usize,
}

/// Wall-clock seconds of each part.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct Seconds {
    /// Finding and evaluating cells.
    pub refine: f64,
    /// Edges and triangles.
    pub triangles: f64,
    /// Positions of vertices.
    pub polish: f64,
    /// Warnings and relaxation.
    pub relax: f64,
    /// Measuring the error.
    pub check: f64,
}

impl Seconds {
    /// The sum.
    pub fn total(&self) -> f64 {
        self.refine + self.triangles + self.polish + self.relax + self.check
    }
}

/// A limit of the result.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub enum Warning {
    /// The surface continues beyond the region: the mesh has a border there.
    LeavesRegion {
        /// Lattice edges on the region's border that it crosses.
        edges: usize,
    },
    /// The field has one sign in the whole region, as far as the cells show: there are no triangles.
    Empty {
        /// Whether the region is inside.
        inside: bool,
    },
    /// Two sheets that face one another are nearer than two cells: they are separate, and their triangles do
    /// not meet, but may lie farther from the surface.
    NearSheets {
        /// Pairs of vertices on lattice lines.
        pairs: usize,
        /// The smallest distance of such a pair, in metres.
        gap: Real,
    },
    /// Something smaller than a cell may have been lost.
    Unresolved {
        /// Cells without a surface that the bound on the slope cannot rule out.
        cells: usize,
    },
    /// The bound on the field's slope is too small.
    Slope {
        /// The bound given, or returned by the field.
        given: Real,
        /// The larger bound that was used instead, from values of the field.
        used: Real,
        /// Cells with a part of the surface that had been dropped, and were restored. A part of the
        /// surface that is not connected to the rest may be missing.
        cells: usize,
    },
    /// The accuracy is not reached with the smallest cell allowed, or after the last attempt.
    Inaccurate {
        /// The error requested, in metres.
        requested: Real,
        /// The error reached, in metres.
        reached: Real,
        /// Side of the cells, in metres.
        cell: Real,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::LeavesRegion { edges } => {
                write!(
                    f,
                    "the surface leaves the region of the lattice through {edges} of its edges, and is open there"
                )
            }
            Self::Empty { inside } => {
                let side = if inside { "inside" } else { "outside" };
                write!(
                    f,
                    "the surface does not pass through the region, which is all {side}: there are no triangles; give another region, or smaller cells"
                )
            }
            Self::NearSheets { pairs, gap } => write!(
                f,
                "sheets are nearer than two cells at {pairs} places, the nearest {:.3} mm apart; halve the cell to separate them well",
                1e3 * gap
            ),
            Self::Unresolved { cells } => {
                write!(
                    f,
                    "details thinner than a cell may be lost in {cells} cells; use smaller cells"
                )
            }
            Self::Slope { given, used, cells } => write!(
                f,
                "the field is steeper than {given:.3}: {used:.3} was taken instead, and {cells} cells were added again"
            ),
            Self::Inaccurate { requested, reached, cell } => write!(
                f,
                "the error is {:.4} mm, requested is {:.4} mm, with cells of {:.4} mm; allow smaller cells or a larger error",
                1e3 * reached,
                1e3 * requested,
                1e3 * cell
            ),
        }
    }
}
