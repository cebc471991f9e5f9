//! Parts of closed meshes that are inside out, or inside another part.

use crate::body_surface::with_triangles;
use crate::winding::Winding;
use if_core::edges::parts;
use if_core::math::{Point, Real, area_vector};
use if_core::mesh::TriMesh;
use std::collections::BTreeMap;

/// |volume| over the area to the power 3/2 up to which a closed surface encloses nothing, as a folded
/// sheet does. A ball has 0.094; a glove of 1 mm thickness and 20 cm length still has 1e-3.
pub(crate) const NO_VOLUME: Real = 1e-9;

/// A part of a closed mesh that faces inwards, and is not a cavity of another part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InvertedPart {
    /// Its first triangle.
    pub triangle: usize,
    /// Number of its triangles.
    pub triangles: usize,
    /// Its signed volume, in cubic metres: negative.
    pub volume: Real,
}

/// Sums over one part.
#[derive(Clone, Copy)]
struct Part {
    /// One of its vertices, the same number for all of them.
    root: u32,
    first: usize,
    triangles: usize,
    volume: Real,
    area: Real,
    /// The vertex that is farthest along x.
    tip: u32,
}

impl Part {
    /// Whether it encloses more than rounding does between the two copies of a sheet.
    fn has_volume(&self) -> bool {
        self.volume.abs() > NO_VOLUME * self.area.powf(1.5)
    }
}

/// The parts of `mesh` by their smallest vertices, and for each vertex the root of its part.
fn survey(mesh: &TriMesh) -> (Vec<Part>, Vec<u32>) {
    let part_of = parts(mesh);
    let mut found: Vec<Option<Part>> = vec![None; mesh.vertices().len()];
    for (t, corners) in mesh.triangles().iter().enumerate() {
        let root = part_of[corners[0] as usize];
        let part = found[root as usize].get_or_insert(Part {
            root,
            first: t,
            triangles: 0,
            volume: 0.0,
            area: 0.0,
            tip: corners[0],
        });
        // Volumes relative to a point of the part: far from the origin rounding would cancel them.
        let from = mesh.vertices()[root as usize];
        let [a, b, c] = mesh.corners(t);
        part.triangles += 1;
        part.volume += (a - from).dot(&(b - from).cross(&(c - from))) / 6.0;
        part.area += 0.5 * area_vector(a, b, c).norm();
        let x = |v: u32| mesh.vertices()[v as usize].x;
        part.tip = corners.iter().fold(part.tip, |tip, v| if x(*v) > x(tip) { *v } else { tip });
    }
    (found.into_iter().flatten().collect(), part_of)
}

/// The first part of `mesh`, by its smallest vertex, that faces inwards and is not enclosed by
/// another part; `None` if all parts are oriented correctly.
///
/// The mesh must be closed and consistently wound. A part that faces inwards inside of one that
/// faces outwards is a cavity, which is valid. Parts are connected by vertices
/// ([`if_core::edges::parts`]).
///
/// ```
/// use if_core::{mesh::TriMesh, shapes::meshes};
/// let ball = meshes::icosphere(1.0, 2);
/// let turned = ball.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
/// let turned = TriMesh::new(ball.vertices().to_vec(), turned)?;
/// assert!(if_mesh::inverted::inverted_part(&ball).is_none());
/// assert!(if_mesh::inverted::inverted_part(&turned).unwrap().volume < -4.0);
/// # Ok::<(), if_core::mesh::MeshError>(())
/// ```
pub fn inverted_part(mesh: &TriMesh) -> Option<InvertedPart> {
    let (parts, _) = survey(mesh);
    let mut suspects = parts.iter().filter(|p| p.volume < 0.0 && p.has_volume()).peekable();
    suspects.peek()?;
    let winding = Winding::new(mesh);
    // At its outermost vertex a part fills at most a half space: its winding number there is -1/2
    // to 0 if it faces inwards, and 1 more if another part encloses it.
    let enclosed = |p: &Part| winding.at(&mesh.vertices()[p.tip as usize]) > 0.25;
    let part = suspects.find(|p| !enclosed(p))?;
    Some(InvertedPart { triangle: part.first, triangles: part.triangles, volume: part.volume })
}

/// A closed, consistently wound mesh without the parts that face outwards and lie inside of others, as eyes
/// in a head, and how many these are; `None` if there are none. Vertices keep their numbers.
pub(crate) fn without_inner_parts(mesh: &TriMesh) -> Option<(TriMesh, usize)> {
    let (parts, part_of) = survey(mesh);
    if parts.len() < 2 {
        return None;
    }
    let winding = Winding::new(mesh);
    let outwards = parts.iter().filter(|p| p.volume > 0.0 && p.has_volume());
    // What encloses a part adds 1 all over it to the winding number of the part itself: to 0 to 1/2
    // at its outermost vertex, and to what is computed at the others.
    let suspects = outwards.filter(|p| winding.at(&mesh.vertices()[p.tip as usize]) > 0.75);
    let mut corners: BTreeMap<u32, Vec<Point>> = suspects.map(|p| (p.root, Vec::new())).collect();
    for (t, [first, ..]) in mesh.triangles().iter().enumerate() {
        if let Some(own) = corners.get_mut(&part_of[*first as usize]) {
            own.extend(mesh.corners(t));
        }
    }
    let mut is_gone = vec![false; mesh.vertices().len()];
    let mut count = 0;
    for (root, corners) in corners {
        let own = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let alone = TriMesh::new(corners, own).expect("corners of a mesh");
        let of_own = Winding::new(&alone);
        if alone.vertices().iter().all(|p| winding.at(p) - of_own.at(p) > 0.75) {
            is_gone[root as usize] = true;
            count += 1;
        }
    }
    let kept = mesh.triangles().iter().filter(|t| !is_gone[part_of[t[0] as usize] as usize]);
    (count > 0).then(|| (with_triangles(mesh, kept.copied().collect()), count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;
    use if_core::shapes::meshes::icosphere;

    /// Balls of one mesh: centre, radius, whether it faces inwards.
    fn balls(list: &[(Real, Real, bool)]) -> TriMesh {
        let (mut vertices, mut triangles): (Vec<Point>, Vec<[u32; 3]>) = (Vec::new(), Vec::new());
        for (x, radius, turned) in list {
            let ball = icosphere(*radius, 2);
            let first = vertices.len() as u32;
            vertices.extend(ball.vertices().iter().map(|p| p + Vector::x() * *x));
            triangles.extend(ball.triangles().iter().map(|[a, b, c]| {
                let t = if *turned { [*a, *c, *b] } else { [*a, *b, *c] };
                t.map(|v| v + first)
            }));
        }
        TriMesh::new(vertices, triangles).unwrap()
    }

    #[test]
    fn cavities_are_valid_and_free_inverted_parts_are_found() {
        let each = icosphere(1.0, 2).triangles().len();
        assert_eq!(inverted_part(&TriMesh::default()), None);
        assert_eq!(inverted_part(&balls(&[(0.0, 1.0, false), (3.0, 1.0, false)])), None);
        assert_eq!(inverted_part(&balls(&[(0.0, 1.0, false), (0.1, 0.5, true)])), None, "a cavity");
        assert_eq!(
            inverted_part(&balls(&[(0.0, 1.0, false), (0.1, 0.5, true), (0.1, 0.2, false)])),
            None,
            "a stone in it"
        );
        let found = inverted_part(&balls(&[(0.0, 1.0, false), (3.0, 0.5, true)])).unwrap();
        assert_eq!((found.triangle, found.triangles), (each, each));
        assert!(found.volume < -0.4 && found.volume > -0.53, "{found:?}");
        let found = inverted_part(&balls(&[(1e4, 0.5, true), (0.0, 1.0, false)])).unwrap();
        assert_eq!((found.triangle, found.triangles), (0, each));
        // Touching from outside, at the outermost vertex.
        assert!(inverted_part(&balls(&[(0.0, 1.0, false), (-1.5, 0.5, true)])).is_some());
    }

    #[test]
    fn a_folded_sheet_is_not_inside_out() {
        let v = [[0.0, 0.0, 0.0], [1.0, 0.1, 0.3], [0.2, 1.0, 0.7]].map(Point::from).to_vec();
        assert_eq!(inverted_part(&TriMesh::new(v, vec![[0, 1, 2], [0, 2, 1]]).unwrap()), None);
    }

    #[test]
    fn parts_inside_others_are_left_out_and_what_stands_in_a_cavity_is_not() {
        let each = icosphere(1.0, 2).triangles().len();
        let left = |list: &[(Real, Real, bool)]| {
            without_inner_parts(&balls(list)).map(|(mesh, n)| (mesh.triangles().len() / each, n))
        };
        let head = (0.0, 1.0, false);
        assert_eq!(left(&[head]), None);
        assert_eq!(left(&[head, (3.0, 1.0, false)]), None, "side by side");
        assert_eq!(left(&[head, (0.95, 0.2, false)]), None, "overlapping");
        assert_eq!(left(&[head, (0.1, 0.5, true), (0.1, 0.2, false)]), None, "a stone in a cavity");
        assert_eq!(left(&[head, head]), None, "twice the same");
        assert_eq!(left(&[head, (0.5, 0.2, false), (-0.5, 0.2, false)]), Some((1, 2)), "eyes");
        assert_eq!(left(&[(0.5, 0.2, false), (0.5, 0.1, false), head]), Some((1, 2)), "pupils");
    }
}
