//! Intersecting triangle pairs of two meshes, and of one mesh with itself: exact.

mod fans;

use crate::index::Bvh;
pub use fans::Fans;
use if_core::aabb::Aabb;
use if_core::intersect::{Contact, is_degenerate, triangles, triangles_sharing};
use if_core::math::Point;
use if_core::mesh::TriMesh;
use rayon::prelude::*;

/// Two triangles that share a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TrianglePair {
    /// Triangle of the first mesh.
    pub a: u32,
    /// Triangle of the second mesh; of the same one, with `a < b`, for [`own_pairs`].
    pub b: u32,
    /// Their contact; never [`Contact::Disjoint`].
    pub contact: Contact,
}

/// All pairs of a triangle of `a` and one of `b` that share a point, in a deterministic order.
///
/// Both trees must hold the current positions. Cost is near-linear in the number of triangles plus
/// the number of pairs of overlapping boxes.
pub fn pairs(a: &Bvh, b: &Bvh) -> Vec<TrianglePair> {
    a.near_pairs(b, |i, ta, j, tb| match triangles(ta.each_ref(), tb.each_ref()) {
        Contact::Disjoint => None,
        contact => Some(TrianglePair { a: i, b: j, contact }),
    })
}

/// The [`pairs`] of every two of some meshes, as far as there are any: the indices of the two, the
/// smaller first, and their pairs.
pub fn pairs_between(meshes: &[Bvh]) -> Vec<([usize; 2], Vec<TrianglePair>)> {
    let both = (0..meshes.len()).flat_map(|b| (0..b).map(move |a| [a, b]));
    both.map(|[a, b]| ([a, b], pairs(&meshes[a], &meshes[b])))
        .filter(|(_, found)| !found.is_empty())
        .collect()
}

/// All pairs of triangles of one mesh that share a point beyond their common corners, sorted.
/// Corners are common if they are one vertex or have equal coordinates; triangles of zero area are
/// skipped.
///
/// `tree` must hold the current positions.
///
/// # Panics
///
/// If `tree` is of a mesh with another number of triangles.
pub fn own_pairs(mesh: &TriMesh, tree: &Bvh) -> Vec<TrianglePair> {
    own_pairs_with(mesh, tree, &Fans::new(mesh))
}

/// As [`own_pairs`], with the fans of the mesh, which serve all of its positions.
///
/// # Panics
///
/// If `fans` are of a mesh with fewer vertices, or `tree` is of one with another number of triangles.
pub fn own_pairs_with(mesh: &TriMesh, tree: &Bvh, fans: &Fans) -> Vec<TrianglePair> {
    own_pairs_searched(mesh, tree, fans, |_| true)
}

fn own_pairs_searched(
    mesh: &TriMesh,
    tree: &Bvh,
    fans: &Fans,
    is_searched: impl Fn(u32) -> bool,
) -> Vec<TrianglePair> {
    let (held, given) = (tree.len(), mesh.triangles().len());
    assert_eq!(held, given, "the tree must be of the mesh: it has another number of triangles");
    let (flat, triangles) = (fans.flat(mesh, &is_searched), mesh.triangles());
    let mut found = tree.own_near_pairs(is_searched, |i, ti, j, tj| {
        if flat.part(triangles[i as usize], triangles[j as usize]) {
            None
        } else if i < j {
            own_pair(mesh, i, ti, j, tj)
        } else {
            own_pair(mesh, j, tj, i, ti)
        }
    });
    found.sort_unstable();
    found
}

/// Updates the result of [`pairs`] after some triangles of `b` moved: `before` are the sorted pairs
/// before the motion, the result is sorted too. Only the triangles in `moved` are tested.
///
/// # Panics
///
/// If `moved` or `before` are of a mesh with other triangles than `b`.
pub fn pairs_after_motion(
    a: &Bvh,
    b: &TriMesh,
    moved: &MovedTriangles,
    before: &[TrianglePair],
) -> Vec<TrianglePair> {
    let again = moved.list.par_iter().flat_map_iter(|&t| {
        let corners = b.corners(t as usize);
        let mut found = Vec::new();
        a.overlapping_corners(&Aabb::from_points(corners), |other, other_corners| {
            let contact = triangles(other_corners.each_ref(), corners);
            if contact.is_some() {
                found.push(TrianglePair { a: other, b: t, contact });
            }
        });
        found
    });
    let mut all: Vec<TrianglePair> = again.collect();
    all.extend(before.iter().filter(|p| !moved.is_moved[p.b as usize]));
    all.sort_unstable();
    all
}

/// As [`pairs_after_motion`], for [`own_pairs`]; `tree` must hold the current positions. What has not
/// moved costs nothing.
///
/// # Panics
///
/// If `tree`, `fans`, `moved` or `before` are of a mesh with other triangles.
pub fn own_pairs_after_motion(
    mesh: &TriMesh,
    tree: &Bvh,
    fans: &Fans,
    moved: &MovedTriangles,
    before: &[TrianglePair],
) -> Vec<TrianglePair> {
    if moved.is_empty() {
        return before.to_vec();
    }
    let is_moved = |t: u32| moved.is_moved[t as usize];
    let mut all = own_pairs_searched(mesh, tree, fans, is_moved);
    all.extend(before.iter().filter(|p| !is_moved(p.a) && !is_moved(p.b)));
    all.sort_unstable();
    all
}

/// The triangles of a mesh that have moved.
#[derive(Clone, Debug)]
pub struct MovedTriangles {
    is_moved: Vec<bool>,
    list: Vec<u32>,
}

impl MovedTriangles {
    /// The triangles with a vertex for which `vertex_moved` is true.
    ///
    /// # Panics
    ///
    /// If `vertex_moved` has fewer values than the mesh has vertices.
    pub fn new(mesh: &TriMesh, vertex_moved: &[bool]) -> Self {
        let is_moved: Vec<bool> =
            mesh.triangles().iter().map(|t| t.iter().any(|v| vertex_moved[*v as usize])).collect();
        let list = (0..is_moved.len() as u32).filter(|t| is_moved[*t as usize]).collect();
        Self { is_moved, list }
    }

    /// Number of moved triangles.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether none has moved.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }
}

/// The contact of two triangles of one mesh, `i < j`, beyond their common corners.
fn own_pair(
    mesh: &TriMesh,
    i: u32,
    ti: &[Point; 3],
    j: u32,
    tj: &[Point; 3],
) -> Option<TrianglePair> {
    let (mut ni, mut nj) = (mesh.triangles()[i as usize], mesh.triangles()[j as usize]);
    // Corners at the same position get the same index.
    for k in 1..3 {
        if let Some(m) = (0..k).find(|&m| ti[m] == ti[k]) {
            ni[k] = ni[m];
        }
    }
    for k in 0..3 {
        if let Some(m) = (0..3).find(|&m| ti[m] == tj[k]) {
            nj[k] = ni[m];
        } else if let Some(m) = (0..k).find(|&m| tj[m] == tj[k]) {
            nj[k] = nj[m];
        }
    }
    if repeats(ni) || repeats(nj) {
        return None;
    }
    let contact = triangles_sharing(ti.each_ref(), ni, tj.each_ref(), nj);
    let counts =
        contact.is_some() && !is_degenerate(ti.each_ref()) && !is_degenerate(tj.each_ref());
    counts.then_some(TrianglePair { a: i, b: j, contact })
}

fn repeats(t: [u32; 3]) -> bool {
    t[0] == t[1] || t[1] == t[2] || t[0] == t[2]
}

#[cfg(test)]
mod tests {
    use super::*;

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
    #[should_panic(expected = "the tree must be of the mesh")]
    fn the_tree_of_a_mesh_with_more_triangles_is_refused() {
        let [small, large] = [1, 2].map(|n| grid(n, |x, y| Point::new(x, y, 0.0)));
        own_pairs(&small, &Bvh::new(&large));
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
    fn after_a_motion_the_pairs_are_those_of_a_new_search() {
        let below = grid(11, |x, y| Point::new(x, y, 0.04 * (8.0 * y).cos()));
        let mut sheet = grid(14, |x, y| Point::new(x, y, 0.05 * (9.0 * x).sin()));
        let floor = Bvh::new(&below);
        let mut tree = Bvh::new(&sheet);
        let sorted = |mut p: Vec<TrianglePair>| {
            p.sort_unstable();
            p
        };
        let fans = Fans::new(&sheet);
        let (mut with_floor, mut own) = (sorted(pairs(&floor, &tree)), own_pairs(&sheet, &tree));
        let (mut changed, mut most_own) = (0, 0);
        for round in 0..12u32 {
            let is_moved: Vec<bool> =
                (0..sheet.vertices().len() as u32).map(|v| (v * 7 + round * 31) % 97 < 9).collect();
            let shift = |k: usize| f64::from((k as u32 * 37 + round * 11) % 29) / 29.0 - 0.5;
            let x = sheet.vertices().iter().enumerate().map(|(k, p)| {
                let z = if is_moved[k] { 0.6 * shift(k) } else { 0.0 };
                Point::new(p.x + z, p.y - 0.8 * z, p.z + 0.1 * z)
            });
            sheet = sheet.with_vertices(x.collect()).unwrap();
            tree.refit(sheet.vertices());
            let moved = MovedTriangles::new(&sheet, &is_moved);
            assert!(!moved.is_empty() && moved.len() < sheet.triangles().len());
            let now = (
                pairs_after_motion(&floor, &sheet, &moved, &with_floor),
                own_pairs_after_motion(&sheet, &tree, &fans, &moved, &own),
            );
            assert_eq!(now.0, sorted(pairs(&floor, &tree)));
            assert_eq!(now.1, own_pairs(&sheet, &tree));
            changed += usize::from(now.0 != with_floor) + usize::from(now.1 != own);
            most_own = most_own.max(now.1.len());
            (with_floor, own) = now;
        }
        assert!(changed > 6 && most_own > 10, "{changed} {most_own}");
    }

    #[test]
    fn own_pairs_agree_with_all_triangles_however_rough_a_sheet_is() {
        let random =
            |k: u32| f64::from(k.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 24) - 0.5;
        for (level, rough) in [0.0, 0.05, 0.1, 0.6, 1.5].into_iter().enumerate() {
            let sheet = grid(9, |x, y| {
                let k = (4801.0 * x + 977.0 * y) as u32 + 7919 * level as u32;
                let [dx, dy, dz] = [k, k + 1, k + 2].map(|k| rough * random(k));
                // Rolled up, so that its fans face all ways.
                let (s, c) = (6.0 * x).sin_cos();
                Point::new(c + dx, s + dy, y + dz)
            });
            let mut all = Vec::new();
            let corners = |t: u32| sheet.corners(t as usize).map(|p| *p);
            for j in 0..sheet.triangles().len() as u32 {
                all.extend((0..j).filter_map(|i| own_pair(&sheet, i, &corners(i), j, &corners(j))));
            }
            all.sort_unstable();
            assert_eq!(own_pairs(&sheet, &Bvh::new(&sheet)), all, "{rough}");
            assert_eq!(level > 2, all.len() > 20, "{rough}: {}", all.len());
        }
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
