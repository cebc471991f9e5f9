//! Clean-up of a garment that was cut out of a scan: Appendix B of the supplement.
//!
//! | step | paper | alone |
//! |---|---|---|
//! | make manifold: no triangle without area, non-manifold edges cut, bow-ties split | | [`manifold::make_manifold`] |
//! | isolated elements removal | Figure 1 | [`components::remove_isolated`] |
//! | hole filling; neck, cuffs, hem and front stay open | Figure 2 (a) | [`holes::fill_holes`] |
//! | Laplacian smoothing of the boundary | Figure 2 (b) | [`boundary::smooth_boundary`] |
//!
//! [`cleanup`] takes them in this order. Each step says which vertices the new ones are made of, and
//! [`crate::attributes`] carries labels, skinning weights, colours and any other property along.
//!
//! ```text
//! resolve(mesh)                          # degenerate triangles, crowded edges, bow-ties
//! repeat
//!     drop parts below a share of the largest
//!     loops → openings or holes          # Openings
//!     for each hole: Liepa → refine → fair or project, the best shape that meets nothing
//! until nothing is dropped or filled
//! smooth the openings' loops             # trim teeth, Taubin, spread, back to φ, nothing turned over
//! ```

mod apart;
pub mod boundary;
pub mod complement;
pub mod components;
mod curve;
pub mod degenerate;
mod fair;
mod guard;
mod hole;
pub mod holes;
mod lid;
pub mod manifold;
mod marks;
pub mod openings;
mod patch;
mod project;
pub mod rim;
mod safe_move;
mod spread;
mod trim;
mod twins;
mod vicinity;
mod watch;
pub mod work;

use crate::attributes::VertexAttributes;
use crate::cleanup::boundary::{SmoothParams, SmoothReport};
use crate::cleanup::components::{ComponentParams, ComponentReport};
use crate::cleanup::holes::{FillParams, FillReport};
use crate::cleanup::manifold::ManifoldReport;
use crate::cleanup::openings::{Openings, OpeningsError};
use crate::cleanup::watch::{Cancelled, Watch};
use crate::cleanup::work::Work;
use if_core::field::SignedDistance;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use serde::Serialize;
use std::ops::ControlFlow;

/// What [`cleanup`] does.
#[derive(Clone, Debug)]
pub struct CleanupParams {
    /// Which parts are isolated elements; `None` keeps all.
    pub components: Option<ComponentParams>,
    /// How openings are told from holes.
    pub openings: Openings,
    /// How holes are closed; `None` leaves them.
    pub fill: Option<FillParams>,
    /// How the loops of openings are smoothed; `None` leaves them.
    pub smooth: Option<SmoothParams>,
    /// Whether all positions are rounded to `f32`, because a file will hold them so: what is
    /// promised then holds for the file. Positions of the input are not rounded.
    pub single_precision: bool,
}

impl Default for CleanupParams {
    /// All three steps, openings by shape, double precision.
    fn default() -> Self {
        Self {
            components: Some(ComponentParams::default()),
            openings: Openings::default(),
            fill: Some(FillParams::default()),
            smooth: Some(SmoothParams::default()),
            single_precision: false,
        }
    }
}

/// Why nothing was cleaned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum CleanupError {
    /// A number that makes no sense.
    #[error("{name} is {value}; give {wanted}")]
    Range { name: &'static str, value: Real, wanted: &'static str },
    /// Openings cannot be told.
    #[error(transparent)]
    Openings(#[from] OpeningsError),
    /// Attributes of another mesh.
    #[error(
        "attributes of {attributes} vertices for a mesh of {vertices}; give those of this mesh, or `VertexAttributes::none`"
    )]
    Attributes { attributes: usize, vertices: usize },
    /// The caller broke.
    #[error("the clean-up was cancelled")]
    Cancelled,
}

impl From<Cancelled> for CleanupError {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

impl CleanupParams {
    /// Whether all numbers make sense.
    ///
    /// # Errors
    ///
    /// The first that does not.
    pub fn validate(&self) -> Result<(), CleanupError> {
        self.components.as_ref().map_or(Ok(()), ComponentParams::validate)?;
        self.fill.as_ref().map_or(Ok(()), FillParams::validate)?;
        self.smooth.as_ref().map_or(Ok(()), SmoothParams::validate)?;
        Ok(self.openings.validate()?)
    }
}

/// Refuses a number that is not from `low` to `high`.
fn range(
    name: &'static str,
    value: Real,
    low: Real,
    high: Real,
    wanted: &'static str,
) -> Result<(), CleanupError> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(CleanupError::Range { name, value, wanted })
    }
}

/// What was done, step by step.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct CleanupReport {
    /// Vertices and triangles before.
    pub before: Counts,
    /// What made the mesh manifold.
    pub manifold: ManifoldReport,
    /// Parts kept and dropped.
    pub components: ComponentReport,
    /// Holes filled, openings kept.
    pub holes: FillReport,
    /// Loops smoothed.
    pub smoothing: SmoothReport,
    /// Vertices and triangles after.
    pub after: Counts,
}

/// Size of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct Counts {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Area, in square metres.
    pub area: Real,
}

impl Counts {
    fn of(mesh: &TriMesh) -> Self {
        Self {
            vertices: mesh.vertices().len(),
            triangles: mesh.triangles().len(),
            area: mesh.area(),
        }
    }
}

/// A clean mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Cleaned {
    /// Manifold, consistently wound, and without isolated elements and holes, as far as the report
    /// says.
    pub mesh: TriMesh,
    /// The properties of its vertices.
    pub attributes: VertexAttributes,
    /// What was done.
    pub report: CleanupReport,
}

/// A step of [`cleanup`], for progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Making the mesh manifold.
    Manifold,
    /// Removing isolated elements.
    Components,
    /// Filling holes.
    Holes,
    /// Smoothing the boundary.
    Boundary,
}

/// Removes isolated elements, fills holes and smooths the boundary of a garment, and makes it
/// manifold first.
///
/// No step adds an intersection of the mesh with itself. A second call without smoothing changes
/// nothing, but where openings are told by shape (a loop that was an opening beside a large hole
/// may be a hole once that is filled) or holes were left; with it, loops that are smooth stay as
/// they are, and those where vertices were held back ([`SmoothReport`]) may go on. `field` is the
/// clothed body's φ, negative inside, where there is one: patches and smoothed boundaries lie on
/// its zero.
///
/// # Source
///
/// Supplement, Appendix B.
///
/// # Errors
///
/// Parameters out of range, or attributes of another number of vertices.
///
/// # Examples
///
/// A tube with a hole in its side; the ends stay open:
///
/// ```
/// use if_core::{mesh::TriMesh, shapes::meshes::tube};
/// use if_mesh::{attributes::VertexAttributes, cleanup::{CleanupParams, cleanup}};
/// let tube = tube(0.1, 0.4, 40, 20, false);
/// let holed = TriMesh::new(tube.vertices().to_vec(), [&tube.triangles()[..600], &tube.triangles()[604..]].concat())?;
/// let clean = cleanup(&holed, &VertexAttributes::none(holed.vertices().len()), None, &CleanupParams::default())?;
/// assert_eq!(clean.report.holes.filled.len(), 1);
/// assert_eq!(clean.report.holes.openings.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn cleanup(
    mesh: &TriMesh,
    attributes: &VertexAttributes,
    field: Option<&dyn SignedDistance>,
    params: &CleanupParams,
) -> Result<Cleaned, CleanupError> {
    cleanup_with(mesh, attributes, field, params, &mut |_| ControlFlow::Continue(()))
}

/// [`cleanup`], telling `progress` before each step which it is, and again within it: before each try at patches, each round of moves and each pass
/// over the surface. `Break` ends it.
///
/// # Errors
///
/// As [`cleanup`], and [`CleanupError::Cancelled`].
pub fn cleanup_with(
    mesh: &TriMesh,
    attributes: &VertexAttributes,
    field: Option<&dyn SignedDistance>,
    params: &CleanupParams,
    progress: &mut dyn FnMut(Step) -> ControlFlow<()>,
) -> Result<Cleaned, CleanupError> {
    params.validate()?;
    if attributes.vertices() != mesh.vertices().len() {
        return Err(CleanupError::Attributes {
            attributes: attributes.vertices(),
            vertices: mesh.vertices().len(),
        });
    }
    let mut watch = Watch(progress);
    let mut work = Work::new(mesh);
    watch.at(Step::Manifold)?;
    let (before, (manifold, mut twins)) =
        rayon::join(|| Counts::of(mesh), || manifold::resolve(&mut work));
    let mut report = CleanupReport { before, manifold, ..CleanupReport::default() };
    let mut rims;
    loop {
        watch.at(Step::Components)?;
        if let Some(params) = &params.components {
            let (found, gone) = components::drop_small(&mut work, &twins, params);
            if !gone.is_empty() {
                twins = twins.without(&gone);
            }
            report.components.dropped.extend(&found.dropped);
            report.components.kept = found.kept;
        }
        watch.at(Step::Holes)?;
        let (found, open) = match &params.fill {
            Some(fill) => holes::fill(
                &mut work,
                &mut twins,
                field,
                &params.openings,
                fill,
                params.single_precision,
                &mut watch,
            )?,
            None => (FillReport::default(), twins::loops(&work.triangles, &twins)),
        };
        rims = open;
        report.holes.left = found.left;
        report.holes.openings = found.openings;
        if found.filled.is_empty() {
            break;
        }
        // A patch makes its part larger, and others small beside it.
        report.holes.filled.extend(&found.filled);
        report.holes.cut_away += found.cut_away;
        if report.components.kept.len() < 2 && found.cut_away == 0 {
            break;
        }
    }
    watch.at(Step::Boundary)?;
    if let Some(smooth) = &params.smooth {
        report.smoothing = boundary::smooth(
            &mut work,
            &twins,
            &rims,
            field,
            smooth,
            params.single_precision,
            &mut watch,
        )?;
        work.compact(); // tips of teeth that were cut off
    }
    let derived = work.finish();
    let (after, attributes) =
        rayon::join(|| Counts::of(&derived.mesh), || attributes.derive(&derived.sources));
    report.after = after;
    Ok(Cleaned { mesh: derived.mesh, attributes, report })
}
