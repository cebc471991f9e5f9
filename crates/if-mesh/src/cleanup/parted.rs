//! Boundary loops that run along others: the sides of a parted seam.

use super::edit_mesh::EditMesh;
use super::half_edges::{ends, previous};
use crate::index::Bvh;
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use rayon::prelude::*;

/// Distance up to which boundaries that run beside one another are the sides of a seam, in metres. Rounding
/// of files and merging leave less, and no two hems of a garment lie as near one another for long.
const DISTANCE: Real = 2e-4;
/// A loop is the side of a seam from this share of its length along others on.
const SHARE: Real = 0.5;

/// A boundary edge.
struct Border {
    /// Its loop.
    of: usize,
    ends: [Point; 2],
    /// From the edge to the opposite corner of its triangle, perpendicular to the edge.
    inward: Vector,
}

impl Border {
    fn new(work: &EditMesh, of: usize, h: u32) -> Self {
        let [a, b] = ends(&work.triangles, h).map(|v| work.points[v as usize]);
        let across = work.points[ends(&work.triangles, previous(h))[0] as usize] - a;
        let inward = across - (b - a) * along(&a, &b, &across);
        Self { of, ends: [a, b], inward }
    }

    /// Whether the surface goes on beyond `other` from the middle of this edge.
    fn continues_at(&self, other: &Self) -> bool {
        let middle = nalgebra::center(&self.ends[0], &self.ends[1]);
        let [a, b] = other.ends;
        let nearest = a + (b - a) * along(&a, &b, &(middle - a)).clamp(0.0, 1.0);
        (nearest - middle).norm() <= DISTANCE && self.inward.dot(&other.inward) < 0.0
    }
}

/// How far `offset` from `a` leads along the line from there to `b`, as a share of its length; 0 if `a` and
/// `b` coincide.
fn along(a: &Point, b: &Point, offset: &Vector) -> Real {
    let squared = (b - a).norm_squared();
    if squared > 0.0 { offset.dot(&(b - a)) / squared } else { 0.0 }
}

/// For each loop whether it is the side of a parted seam: most of it lies along other loops, beyond which
/// the surface goes on.
///
/// [`near_seams`](crate::seams::near_seams) pairs vertices. Here the sides may have vertices at different
/// places, and edges of two sheets that end together, as those of a lining, are no seam.
pub(super) fn parted(work: &EditMesh, loops: &[Vec<u32>]) -> Vec<bool> {
    if loops.len() < 2 {
        return vec![false; loops.len()];
    }
    let all = || loops.iter().enumerate().flat_map(|(of, l)| l.iter().map(move |h| (of, *h)));
    let borders: Vec<Border> = all().map(|(of, h)| Border::new(work, of, h)).collect();
    let corners = |h: u32| work.triangles[h as usize / 3].map(|v| work.points[v as usize]);
    let vertices: Vec<Point> = all().flat_map(|(_, h)| corners(h)).collect();
    let triangles = (0..borders.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let at_border = TriMesh::new(vertices, triangles).expect("triangles of the mesh");
    let tree = Bvh::new(&at_border);
    let is_along = |border: &Border| {
        let near = Aabb::from_points(border.ends.each_ref()).inflated(DISTANCE);
        let mut found = false;
        tree.overlapping(&near, |k| {
            let other = &borders[k as usize];
            found |= other.of != border.of && border.continues_at(other);
        });
        found
    };
    let is_along: Vec<bool> = borders.par_iter().map(is_along).collect();
    let mut lengths = vec![[0.0; 2]; loops.len()]; // in all, and along others
    for (border, is_along) in borders.iter().zip(is_along) {
        let length = (border.ends[1] - border.ends[0]).norm();
        lengths[border.of][0] += length;
        lengths[border.of][1] += if is_along { length } else { 0.0 };
    }
    lengths.iter().map(|[all, along]| *along > SHARE * all).collect()
}

#[cfg(test)]
mod tests {
    use crate::attributes::VertexAttributes;
    use crate::cleanup::{CleanupParams, FillReport, Openings, cleanup};
    use if_core::math::{Point, Real};
    use if_core::mesh::TriMesh;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::tube;

    /// Two tubes end to end, the upper one `gap` above, with so many edges around.
    fn halves(gap: Real, around: u32) -> TriMesh {
        let lower = tube(0.1, 0.2, 24, 8, false);
        let upper = tube(0.1, 0.2, around, 8, false);
        let moved = upper.vertices().iter().map(|p| Point::new(p.x, p.y + 0.2 + gap, p.z));
        // Those on the border lie on the edges of the lower one.
        let angle = std::f64::consts::PI / 24.0;
        let onto_edges = |p: Point| match (p.y - 0.2 - gap).abs() < 1e-9 && around > 24 {
            true => {
                let turn = p.z.atan2(p.x).rem_euclid(2.0 * angle);
                let r = angle.cos() / (turn - angle).cos();
                Point::new(r * p.x, p.y, r * p.z)
            }
            false => p,
        };
        let base = lower.vertices().len() as u32;
        let vertices = lower.vertices().iter().copied().chain(moved.map(onto_edges)).collect();
        let others = upper.triangles().iter().map(|t| t.map(|v| v + base));
        TriMesh::new(vertices, lower.triangles().iter().copied().chain(others).collect()).unwrap()
    }

    fn holes(mesh: &TriMesh, openings: Openings) -> FillReport {
        let params = CleanupParams { openings, ..CleanupParams::default() };
        let none = VertexAttributes::none(mesh.vertices().len());
        cleanup(mesh, &none, None, &params, &mut Silent).unwrap().report.holes
    }

    #[test]
    fn sides_of_a_parted_seam_are_neither_openings_nor_holes() {
        let as_they_are = |n: u32| halves(5e-5, n);
        for (mesh, what) in [
            (as_they_are(24), "a crack"),
            (halves(0.0, 48), "vertices on edges"),
            (as_they_are(72), "both"),
        ] {
            for openings in [Openings::Count(2), Openings::default(), Openings::Longer(0.2)] {
                let found = holes(&mesh, openings);
                assert_eq!((found.parted.len(), found.openings.len()), (2, 2), "{what}");
                assert!(found.filled.is_empty() && found.left.is_empty(), "{what}");
                let mut ends = [found.openings[0].center[1], found.openings[1].center[1]];
                ends.sort_by(Real::total_cmp);
                assert!(ends[0] < 0.01 && ends[1] > 0.39, "{what}: {ends:?}");
            }
        }
        assert!(holes(&halves(2e-3, 24), Openings::default()).parted.is_empty());
    }

    #[test]
    fn sheets_that_end_together_are_no_seam() {
        // A tube with a lining of its own vertices, 0.1 mm inside.
        let outside = tube(0.1, 0.2, 24, 8, false);
        let n = outside.vertices().len() as u32;
        let inside = outside.vertices().iter().map(|p| Point::new(0.999 * p.x, p.y, 0.999 * p.z));
        let vertices = outside.vertices().iter().copied().chain(inside).collect();
        let turned = outside.triangles().iter().map(|t| [t[0] + n, t[2] + n, t[1] + n]);
        let lined =
            TriMesh::new(vertices, outside.triangles().iter().copied().chain(turned).collect());
        let found = holes(&lined.unwrap(), Openings::default());
        assert_eq!((found.parted.len(), found.openings.len()), (0, 4));
    }
}
