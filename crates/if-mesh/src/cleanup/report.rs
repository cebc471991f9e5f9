//! Reports of the clean-up's steps.

use super::boundary_loop::LoopShape;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use serde::Serialize;

/// Report of [`cleanup`](super::cleanup()), step by step.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
#[non_exhaustive]
pub struct CleanupReport {
    /// Size before.
    pub before: MeshSize,
    /// Edges of seams that were closed meanwhile.
    pub seam_edges: usize,
    /// What made the mesh manifold.
    pub manifold: ManifoldReport,
    /// Parts kept and dropped.
    pub components: ComponentReport,
    /// Holes filled, openings kept.
    pub holes: FillReport,
    /// Loops smoothed.
    pub smoothing: SmoothReport,
    /// Size after.
    pub after: MeshSize,
}

/// Size of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
#[non_exhaustive]
pub struct MeshSize {
    /// Number of vertices.
    pub vertices: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// Area, in square metres.
    pub area: Real,
}

impl MeshSize {
    pub(super) fn of(mesh: &TriMesh) -> Self {
        Self {
            vertices: mesh.vertices().len(),
            triangles: mesh.triangles().len(),
            area: mesh.area(),
        }
    }
}

/// What was done about degenerate triangles.
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize)]
#[non_exhaustive]
pub struct DegenerateReport {
    /// Triangles dropped because an earlier one has the same three vertices.
    pub duplicates: usize,
    /// Edges of zero length that were collapsed.
    pub collapsed: usize,
    /// Triangles of zero area whose longest edge was flipped, so that they take part of their
    /// neighbour.
    pub flipped: usize,
    /// Triangles of zero area that could only be dropped.
    pub dropped: usize,
}

/// What was done to make a surface manifold.
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize)]
#[non_exhaustive]
pub struct ManifoldReport {
    /// Triangles of zero area and duplicates.
    pub degenerate: DegenerateReport,
    /// Triangles whose orientation was reversed so that neighbours wind the same way.
    pub reoriented: usize,
    /// Edges that were cut because no orientation makes their neighbours agree (a Möbius strip).
    pub non_orientable_edges: usize,
    /// Edges of more than two triangles: the two that continue flattest stay together, others in
    /// further pairs.
    pub non_manifold_edges: usize,
    /// Triangles dropped because cutting at their edges does not make them manifold.
    pub dropped: usize,
    /// Vertices added where several fans of triangles met in one (bow-ties).
    pub split_vertices: usize,
    /// Vertices of no triangle, dropped.
    pub unused_vertices: usize,
}

impl ManifoldReport {
    /// Whether nothing was changed.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// A connected component of a mesh: triangles that are joined by edges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Component {
    /// Number of triangles.
    pub triangles: usize,
    /// Area, in square metres.
    pub area: Real,
    /// Least and largest coordinates, in metres.
    pub aabb: [[Real; 3]; 2],
}

/// Components kept and dropped.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
#[non_exhaustive]
pub struct ComponentReport {
    /// Components that were kept, the largest first.
    pub kept: Vec<Component>,
    /// Components that were dropped, the largest first.
    pub dropped: Vec<Component>,
}

/// Shape of a patch. The first of these that adds no intersection is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PatchShape {
    /// On the zero set of the field.
    Projected,
    /// Biharmonic.
    Fair,
    /// With new vertices on the triangles that close the loop.
    Refined,
    /// The triangles that close the loop.
    Plain,
}

/// A hole that was filled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct FilledHole {
    /// The boundary loop.
    pub boundary: LoopShape,
    /// Shape of the patch.
    pub shape: PatchShape,
    /// Triangles added.
    pub triangles: usize,
    /// Vertices added.
    pub vertices: usize,
    /// Area added, in square metres.
    pub area: Real,
}

/// Holes filled, and loops that stay open.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
#[non_exhaustive]
pub struct FillReport {
    /// Holes that were filled.
    pub filled: Vec<FilledHole>,
    /// Holes that stay open because every patch tried intersects the mesh or repeats one of its
    /// edges.
    pub left: Vec<LoopShape>,
    /// Triangles removed around holes so that a patch fits.
    pub cut_away: usize,
    /// Openings.
    pub openings: Vec<LoopShape>,
    /// Sides of parted seams: loops that lie along others, less than 0.2 mm away, beyond which the surface
    /// goes on. They are left as they are; [`weld`](crate::seams::weld) closes those at the same positions.
    pub parted: Vec<LoopShape>,
}

/// A boundary loop that smoothing has visited.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SmoothedLoop {
    /// The loop afterwards.
    pub boundary: LoopShape,
    /// Length before, in metres.
    pub length_before: Real,
    /// Roughness before and after, in radians ([`SmoothParams::roughness`](super::SmoothParams)).
    pub roughness: [Real; 2],
    /// Passes made, in all rounds.
    pub passes: usize,
}

/// What was smoothed.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
#[non_exhaustive]
pub struct SmoothReport {
    /// All loops, also those that were smooth already.
    pub loops: Vec<SmoothedLoop>,
    /// Ears (triangles with two edges on a rough loop) whose inner edge was flipped.
    pub ears_flipped: usize,
    /// Ears that were removed because their inner edge could not be flipped.
    pub ears_removed: usize,
    /// Triangles that fill notches of rough loops.
    pub notches_filled: usize,
    /// Vertices that moved.
    pub moved: usize,
    /// The largest move, in metres.
    pub farthest: Real,
    /// Vertices that moved only part of their way, or not at all, in the last round, because a
    /// triangle would have turned over or intersected another one.
    pub held_back: usize,
}
