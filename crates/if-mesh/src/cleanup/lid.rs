//! A smooth lid over one loop of a surface that is not edited.

use super::fair::fair;
use super::loop_triangulation::{Chords, LoopPolygon};
use super::patch::{Patch, refine};
use if_core::math::{Point, Real, Vector};

/// Loops of more edges than this are closed by ear clipping.
const EXACT_UP_TO: usize = 48;
/// Maximum number of vertices inside a lid.
const MOST_VERTICES: usize = 400;

/// A loop of boundary edges and what lies around it; one entry of each list for each vertex.
pub(crate) struct Rim {
    /// Its vertices, in the direction of the lid's triangles.
    pub(crate) points: Vec<Point>,
    /// Unit normal of the triangle beyond the edge from each vertex to the next, or zero.
    pub(crate) outside: Vec<Vector>,
    /// Neighbours of each vertex that are not its neighbours on the loop.
    pub(crate) around: Vec<Vec<Point>>,
}

/// The vertices and triangles of a lid. Its first vertices are those of the loop.
pub(crate) type Lid = (Vec<Point>, Vec<[u32; 3]>);

impl Rim {
    /// A lid of the loop's own vertices. `None` if the loop has fewer than three.
    pub(crate) fn plain_lid(&self) -> Option<Lid> {
        let polygon =
            LoopPolygon { points: &self.points, outside: &self.outside, forbidden: &Chords::new() };
        Some((self.points.clone(), polygon.triangulate(EXACT_UP_TO)?))
    }

    /// A lid with edges as long as the loop's, that continues the slope around it.
    pub(crate) fn smooth_lid(&self) -> Option<Lid> {
        let (points, triangles) = self.plain_lid()?;
        let n = points.len();
        let edge = |k: usize| (points[(k + 1) % n] - points[k]).norm();
        let mean = (0..n).map(edge).sum::<Real>() / n as Real;
        let mut patch = Patch { boundary: n, points, triangles };
        refine(&mut patch, &vec![mean; n], &Chords::new(), MOST_VERTICES);
        fair(&mut patch, &self.around);
        Some((patch.points, patch.triangles))
    }
}
