//! Intersecting triangle pairs: of two meshes, and of one mesh with itself. Exact.

use crate::index::Bvh;
use if_core::intersect::{Contact, is_degenerate, triangles, triangles_sharing};
use if_core::mesh::TriMesh;

/// Two triangles that share a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TrianglePair {
    /// Triangle of the first mesh.
    pub a: u32,
    /// Triangle of the second mesh; of the same one, with `a < b`, for [`own_pairs`].
    pub b: u32,
    /// How they meet; never [`Contact::Disjoint`].
    pub contact: Contact,
}

/// All pairs of a triangle of `a` and one of `b` that share a point, in a fixed order.
///
/// Both trees must hold the current positions. Cost is near-linear in the number of triangles plus
/// the number of pairs of overlapping boxes.
pub fn pairs(a: &Bvh, b: &Bvh) -> Vec<TrianglePair> {
    a.overlapping_pairs(b, |i, ta, j, tb| match triangles(ta.each_ref(), tb.each_ref()) {
        Contact::Disjoint => None,
        contact => Some(TrianglePair { a: i, b: j, contact }),
    })
}

/// All pairs of triangles of one mesh that share a point beyond their common corners. Corners count
/// as common where they are one vertex or have equal coordinates; triangles of zero area are left out.
pub fn own_pairs(mesh: &TriMesh, tree: &Bvh) -> Vec<TrianglePair> {
    let names = names_of_equal_points(mesh);
    let tri = |t: u32| mesh.triangles()[t as usize].map(|v| names[v as usize]);
    let mut found = tree.overlapping_pairs(tree, |i, ta, j, tb| {
        let (na, nb) = (tri(i), tri(j));
        if i >= j || repeats(na) || repeats(nb) {
            return None;
        }
        let contact = triangles_sharing(ta.each_ref(), na, tb.each_ref(), nb);
        (contact.is_some() && !is_degenerate(ta.each_ref()) && !is_degenerate(tb.each_ref())).then_some(TrianglePair {
            a: i,
            b: j,
            contact,
        })
    });
    found.sort_unstable();
    found
}

fn repeats(t: [u32; 3]) -> bool {
    t[0] == t[1] || t[1] == t[2] || t[0] == t[2]
}

/// For each vertex the first vertex that lies at the same place.
fn names_of_equal_points(mesh: &TriMesh) -> Vec<u32> {
    let v = mesh.vertices();
    let key = |i: u32| v[i as usize].coords.map(|c| if c == 0.0 { 0.0f64 } else { c }.to_bits());
    let mut order: Vec<u32> = (0..v.len() as u32).collect();
    order.sort_unstable_by_key(|&i| (<[u64; 3]>::from(key(i)), i));
    let mut names: Vec<u32> = (0..v.len() as u32).collect();
    for w in order.windows(2) {
        if key(w[0]) == key(w[1]) {
            names[w[1] as usize] = names[w[0] as usize];
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Point;

    fn grid(n: u32, f: impl Fn(f64, f64) -> Point) -> TriMesh {
        let mut v = Vec::new();
        let mut t = Vec::new();
        for y in 0..=n {
            for x in 0..=n {
                v.push(f(f64::from(x) / f64::from(n), f64::from(y) / f64::from(n)));
            }
        }
        for y in 0..n {
            for x in 0..n {
                let a = y * (n + 1) + x;
                t.push([a, a + 1, a + n + 2]);
                t.push([a, a + n + 2, a + n + 1]);
            }
        }
        TriMesh::new(v, t).unwrap()
    }

    #[test]
    fn pairs_agree_with_all_triangles_and_with_any_number_of_threads() {
        let a = grid(14, |x, y| Point::new(x, y, 0.05 * (9.0 * x).sin()));
        let b = grid(11, |x, y| Point::new(x, y, 0.04 * (8.0 * y).cos()));
        let (ta, tb) = (Bvh::new(&a), Bvh::new(&b));
        let mut got = pairs(&ta, &tb);
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert_eq!(pool.install(|| pairs(&ta, &tb)), got);
        }
        got.sort_unstable();
        let mut all = Vec::new();
        for i in 0..a.triangles().len() {
            for j in 0..b.triangles().len() {
                let contact = triangles(a.corners(i), b.corners(j));
                if contact.is_some() {
                    all.push(TrianglePair { a: i as u32, b: j as u32, contact });
                }
            }
        }
        assert!(all.len() > 50);
        assert_eq!(got, all);
    }

    #[test]
    fn a_sheet_does_not_meet_itself_until_it_is_folded_through() {
        let flat = grid(8, |x, y| Point::new(x, y, 0.0));
        assert!(own_pairs(&flat, &Bvh::new(&flat)).is_empty());
        // A strip that comes back down through its own beginning.
        let curl = grid(24, |x, y| {
            let a = 7.0 * x;
            Point::new((1.0 - 0.05 * a) * a.cos() + 0.4 * x, (1.0 - 0.05 * a) * a.sin(), y)
        });
        assert!(!own_pairs(&curl, &Bvh::new(&curl)).is_empty());
    }

    #[test]
    fn triangles_with_corners_at_one_place_are_left_out() {
        let v = [[0, 0, 0], [1, 0, 0], [0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 0, 0]];
        let v = v.map(|p| Point::new(p[0].into(), p[1].into(), p[2].into())).to_vec();
        let mesh = TriMesh::new(v, vec![[0, 1, 2], [3, 4, 5], [0, 4, 5]]).unwrap();
        assert!(own_pairs(&mesh, &Bvh::new(&mesh)).is_empty());
    }

    #[test]
    fn a_seam_of_doubled_vertices_is_no_intersection() {
        let v = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]];
        let v = v.map(|p| Point::new(p[0].into(), p[1].into(), p[2].into())).to_vec();
        let mesh = TriMesh::new(v, vec![[0, 1, 2], [3, 5, 4]]).unwrap();
        assert!(own_pairs(&mesh, &Bvh::new(&mesh)).is_empty());
    }
}
