//! Closed loops of boundary edges, of any soup of triangles.

use if_core::edges::Edges;
use if_core::mesh::TriMesh;

/// Loops that close the surface: triangles over them, wound like the loops, make every edge run as
/// often in one direction as in the other.
///
/// The boundary of oriented triangles is a cycle, so that the loops always close, also where more
/// than two triangles meet or neighbours wind against each other. No loop passes a vertex twice.
pub(super) fn closing_loops(mesh: &TriMesh, edges: &Edges) -> Vec<Vec<u32>> {
    let balance = edges.balance(mesh);
    // For each vertex the ends of the edges that leave it, the first edge last.
    let mut leaving: Vec<Vec<u32>> = vec![Vec::new(); mesh.vertices().len()];
    let mut starts = Vec::new();
    for (e, [a, b]) in edges.vertices.iter().enumerate().rev() {
        let (from, to) = if balance[e] > 0 { (*b, *a) } else { (*a, *b) };
        for _ in 0..balance[e].unsigned_abs() {
            leaving[from as usize].push(to);
            starts.push(from);
        }
    }
    let mut loops = Vec::new();
    let mut place = vec![usize::MAX; mesh.vertices().len()];
    for start in starts.into_iter().rev() {
        let (mut path, mut v) = (Vec::new(), start);
        loop {
            if place[v as usize] != usize::MAX {
                // Back on the path: what lies between is a loop.
                let found = path.split_off(place[v as usize]);
                found.iter().for_each(|u: &u32| place[*u as usize] = usize::MAX);
                loops.push(found);
            }
            let Some(next) = leaving[v as usize].pop() else { break };
            place[v as usize] = path.len();
            path.push(v);
            v = next;
        }
        path.iter().for_each(|u| place[*u as usize] = usize::MAX);
    }
    loops.retain(|found| found.len() > 2);
    loops
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Point;
    use if_core::shapes::meshes::{icosphere, tube};

    fn loops_of(mesh: &TriMesh) -> Vec<Vec<u32>> {
        closing_loops(mesh, &Edges::new(mesh))
    }

    /// The sum of the directed edges of triangles and loops is zero.
    fn is_closed_by(mesh: &TriMesh, loops: &[Vec<u32>]) -> bool {
        let mut sum = std::collections::BTreeMap::new();
        let mut add = |a: u32, b: u32| {
            *sum.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
        };
        for [a, b, c] in mesh.triangles() {
            [(a, b), (b, c), (c, a)].into_iter().for_each(|(a, b)| add(*a, *b));
        }
        for found in loops {
            // A cap over the loop has it as its boundary, in the same direction.
            (0..found.len()).for_each(|k| add(found[k], found[(k + 1) % found.len()]));
        }
        sum.values().all(|n| *n == 0)
    }

    #[test]
    fn loops_close_tubes_bow_ties_fins_and_turned_triangles() {
        assert!(loops_of(&icosphere(1.0, 1)).is_empty());
        let open = tube(0.5, 1.0, 12, 3, false);
        assert_eq!(loops_of(&open).iter().map(Vec::len).collect::<Vec<_>>(), [12, 12]);
        let v = |n: u32| (0..n).map(|k| Point::new(f64::from(k), 0.0, f64::from(k * k))).collect();
        let soups: [Vec<[u32; 3]>; 4] = [
            vec![[0, 1, 2], [0, 3, 4]],
            vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]],
            vec![[0, 1, 2], [0, 1, 3]],
            vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 2, 4], [4, 2, 1]],
        ];
        for soup in soups {
            let mesh = TriMesh::new(v(5), soup.clone()).unwrap();
            let loops = loops_of(&mesh);
            assert!(is_closed_by(&mesh, &loops), "{soup:?}: {loops:?}");
        }
        assert!(is_closed_by(&open, &loops_of(&open)));
    }
}
