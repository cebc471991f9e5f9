//! Clean-up of a garment that was cut out of a scan: Appendix B of the supplement.
//!
//! | step | paper | alone |
//! |---|---|---|
//! | make manifold: degenerate triangles removed, non-manifold edges cut, bow-ties split | | [`make_manifold`] |
//! | isolated elements removal | Figure 1 | [`remove_isolated`] |
//! | hole filling; neck, cuffs, hem and front stay open | Figure 2 (a) | [`fill_holes`] |
//! | Laplacian smoothing of the boundary | Figure 2 (b) | [`smooth_boundary`] |
//!
//! [`cleanup`](cleanup()) takes them in this order. Each step records which vertices the new ones
//! are blends of, so that [`crate::attributes`] carries labels, skinning weights, colours and any
//! other property along. [`cleanup`](cleanup()) also turns normals with the surface.
//!
//! ```text
//! close seams                            # until the end
//! make manifold                          # degenerate triangles, non-manifold edges, bow-ties
//! repeat
//!     drop components below a share of the largest
//!     loops → openings or holes          # Openings; sides of parted seams are neither
//!     for each hole: triangulate → refine → fair or project; the first shape without intersections
//! until nothing is dropped or filled
//! smooth the openings' loops             # ears, Taubin, falloff, back to φ, no triangle turned over
//! ```

mod boundary_loop;
mod broad_phase;
mod classify;
mod complement;
mod components;
mod curve;
mod degenerate;
mod disjoint;
mod ears;
mod edit_mesh;
mod error;
mod fair;
mod falloff;
mod fill;
mod half_edges;
mod hole;
mod intersection_query;
mod lid;
mod loop_triangulation;
mod manifold;
mod normals_before;
mod occupancy_grid;
mod openings;
mod params;
mod parted;
mod patch;
mod project;
mod report;
mod safe_move;
mod seams;
mod smooth;
mod spatial_hash;

pub use boundary_loop::LoopShape;
pub use components::remove_isolated;
pub use edit_mesh::Derived;
pub use error::CleanupError;
pub use fill::fill_holes;
pub(crate) use lid::{Lid, Rim};
pub use manifold::make_manifold;
pub use openings::{Around, Complement, Openings};
pub use params::{CleanupParams, ComponentParams, FillParams, MAX_PASSES, SmoothParams};
pub use report::{
    CleanupReport, Component, ComponentReport, DegenerateReport, FillReport, FilledHole,
    ManifoldReport, MeshSize, PatchShape, SmoothReport, SmoothedLoop,
};
pub use smooth::smooth_boundary;

use crate::attributes::VertexAttributes;
use edit_mesh::EditMesh;
use if_core::field::SignedDistance;
use if_core::mesh::TriMesh;
use if_core::monitor::{Monitor, Progress};
use normals_before::NormalsBefore;
use seams::Seams;

/// A clean mesh.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Cleaned {
    /// Manifold, consistently oriented, and without isolated elements and holes, as far as the
    /// report says.
    pub mesh: TriMesh,
    /// The properties of its vertices.
    pub attributes: VertexAttributes,
    /// What was done.
    pub report: CleanupReport,
}

/// Makes a garment manifold, removes isolated elements, fills holes and smooths the boundary.
///
/// Seams (boundary edges at the same positions, which [`weld`](crate::seams::weld) would close) are not
/// boundaries: they are closed meanwhile, and open again in the result where vertices have properties.
/// Without any, they stay closed.
///
/// No step adds a self-intersection. `field` is the clothed body's φ, negative inside, if there is
/// one: patches and smoothed boundaries lie on its zero set.
///
/// A second call changes nothing, with four exceptions: holes that were left may be filled; a loop
/// that counted as an opening by shape beside a large hole may count as a hole once that is filled;
/// of three sheets with vertices of their own that met in an edge, two may be left, whose seam is closed
/// then; and loops where vertices were held back ([`SmoothReport`]) may be smoothed further.
///
/// The monitor receives the stages `manifold`, `components`, `holes` and `boundary`, and further
/// reports within a stage: before each attempt at patches, each round of moves and each pass over
/// the surface.
///
/// # Source
///
/// Supplement, Appendix B.
///
/// # Errors
///
/// [`CleanupError`]: parameters out of range, attributes of another number of vertices, a mesh so large
/// or small that squared areas are no numbers, or cancelled.
///
/// # Examples
///
/// A tube with a hole in its side; the ends stay open:
///
/// ```
/// use if_core::{mesh::TriMesh, monitor::Silent, shapes::meshes::tube};
/// use if_mesh::{attributes::VertexAttributes, cleanup::{CleanupParams, cleanup}};
/// let tube = tube(0.1, 0.4, 40, 20, false);
/// let holed = TriMesh::new(tube.vertices().to_vec(), [&tube.triangles()[..600], &tube.triangles()[604..]].concat())?;
/// let attributes = VertexAttributes::none(holed.vertices().len());
/// let clean = cleanup(&holed, &attributes, None, &CleanupParams::default(), &mut Silent)?;
/// assert_eq!(clean.report.holes.filled.len(), 1);
/// assert_eq!(clean.report.holes.openings.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn cleanup(
    mesh: &TriMesh,
    attributes: &VertexAttributes,
    field: Option<&dyn SignedDistance>,
    params: &CleanupParams,
    monitor: &mut dyn Monitor,
) -> Result<Cleaned, CleanupError> {
    params.validate()?;
    if attributes.vertices() != mesh.vertices().len() {
        return Err(CleanupError::Attributes {
            attributes: attributes.vertices(),
            vertices: mesh.vertices().len(),
        });
    }
    let metres = mesh.surface_aabb().size().max();
    if metres > 0.0 && !(1e-70..=1e70).contains(&metres) {
        return Err(CleanupError::Size { metres });
    }
    let mut work = EditMesh::new(mesh);
    monitor.report(&Progress::stage("manifold"))?;
    let (before, (mut manifold, mut half_edges)) =
        rayon::join(|| MeshSize::of(mesh), || manifold::make_manifold_in_place(&mut work));
    let seams = Seams::of(mesh, &work, &half_edges);
    if let Some(seams) = &seams {
        work = EditMesh::new(seams.closed());
        (manifold, half_edges) = manifold::make_manifold_in_place(&mut work);
    }
    let given = seams.as_ref().map_or(mesh, Seams::closed);
    let normals = attributes.has_normals().then(|| NormalsBefore::of(given, &work));
    let seam_edges = seams.as_ref().map_or(0, Seams::edges);
    let mut report = CleanupReport { before, manifold, seam_edges, ..CleanupReport::default() };
    let mut loops;
    loop {
        monitor.report(&Progress::stage("components"))?;
        if let Some(params) = &params.components {
            let (found, gone) = components::drop_small(&mut work, &half_edges, params);
            if !gone.is_empty() {
                half_edges = half_edges.without(&gone);
            }
            report.components.dropped.extend(&found.dropped);
            report.components.kept = found.kept;
        }
        monitor.report(&Progress::stage("holes"))?;
        let (found, open) = match &params.fill {
            Some(fill) => fill::fill(
                &mut work,
                &mut half_edges,
                field,
                &params.openings,
                fill,
                params.single_precision,
                monitor,
            )?,
            None => fill::unfilled(&work, &half_edges),
        };
        loops = open;
        report.holes.left = found.left;
        report.holes.openings = found.openings;
        report.holes.parted = found.parted;
        if found.filled.is_empty() {
            break;
        }
        // A patch makes its component larger, and others small in comparison.
        report.holes.filled.extend(&found.filled);
        report.holes.cut_away += found.cut_away;
        if report.components.kept.len() < 2 && found.cut_away == 0 {
            break;
        }
    }
    monitor.report(&Progress::stage("boundary"))?;
    if let Some(smooth) = &params.smooth {
        report.smoothing = smooth::smooth(
            &mut work,
            &half_edges,
            &loops,
            field,
            smooth,
            params.single_precision,
            monitor,
        )?;
        work.compact(); // tips of ears that were removed
    }
    let closed = work.finish();
    let turns = normals.map(|normals| normals.turns_to(&closed));
    let (derived, in_closed) = match &seams {
        Some(seams) => seams.reopened(mesh, closed, attributes),
        None => (closed, None),
    };
    let (after, mut attributes) =
        rayon::join(|| MeshSize::of(&derived.mesh), || attributes.derive(&derived.sources));
    if let Some(turns) = turns {
        attributes.turn_normals(&match in_closed {
            Some(in_closed) => turns.picked(&in_closed),
            None => turns,
        });
    }
    report.after = after;
    Ok(Cleaned { mesh: derived.mesh, attributes, report })
}
