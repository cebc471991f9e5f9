//! Connected components, and the removal of isolated elements.

use super::edit_mesh::{Derived, EditMesh};
use super::half_edges::{HalfEdges, NONE};
use super::params::ComponentParams;
use super::report::{Component, ComponentReport};
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;
use if_core::union_find::UnionFind;

/// Removes components that are small compared to the largest one. Parts that touch only in a vertex
/// are separate components.
///
/// # Errors
///
/// Parameters out of range.
pub fn remove_isolated(
    mesh: &TriMesh,
    params: &ComponentParams,
) -> Result<(Derived, ComponentReport), ParameterError> {
    params.validate()?;
    let mut work = EditMesh::new(mesh);
    let (report, _) = drop_small(&mut work, &HalfEdges::of_mesh(mesh), params);
    Ok((work.finish(), report))
}

/// [`remove_isolated`] in place; also returns the removed triangles, ascending.
pub(super) fn drop_small(
    work: &mut EditMesh,
    half_edges: &HalfEdges,
    params: &ComponentParams,
) -> (ComponentReport, Vec<u32>) {
    let (part_of, parts) = components(work, half_edges);
    let mut order: Vec<u32> = (0..parts.len() as u32).collect();
    order.sort_by(|&a, &b| {
        parts[b as usize].area.total_cmp(&parts[a as usize].area).then(a.cmp(&b))
    });
    let largest = order.first().map_or(0.0, |&k| parts[k as usize].area);
    let mut keep = vec![false; parts.len()];
    let mut report = ComponentReport::default();
    for (rank, &k) in order.iter().enumerate() {
        let part = parts[k as usize];
        keep[k as usize] =
            params.most.is_none_or(|most| rank < most) && part.area >= params.least_share * largest;
        if keep[k as usize] { &mut report.kept } else { &mut report.dropped }.push(part);
    }
    let gone: Vec<u32> =
        (0..).zip(&part_of).filter(|(_, part)| !keep[**part as usize]).map(|(t, _)| t).collect();
    if !gone.is_empty() {
        work.remove(&gone);
        work.compact();
    }
    (report, gone)
}

/// The component of each triangle, and the components in the order of their first triangles.
pub(super) fn components(work: &EditMesh, half_edges: &HalfEdges) -> (Vec<u32>, Vec<Component>) {
    let ((part_of, names), areas) = rayon::join(
        || labels(work, half_edges),
        || (0..work.triangles.len()).map(|t| work.area(t)).collect::<Vec<Real>>(),
    );
    let none =
        Component { triangles: 0, area: 0.0, aabb: [[Real::INFINITY; 3], [Real::NEG_INFINITY; 3]] };
    let mut parts = vec![none; names as usize];
    // Most triangles belong to the component of the one before: it is kept in registers.
    let (mut part, mut at) = (none, 0);
    let mut aabb = part.aabb;
    for (t, name) in part_of.iter().enumerate() {
        if *name != at {
            parts[at as usize] = Component { aabb, ..part };
            part = parts[*name as usize];
            (aabb, at) = (part.aabb, *name);
        }
        part.triangles += 1;
        part.area += areas[t];
        for v in work.triangles[t] {
            let p = work.points[v as usize];
            for axis in 0..3 {
                // Comparisons suffice: positions are finite.
                aabb[0][axis] = if p[axis] < aabb[0][axis] { p[axis] } else { aabb[0][axis] };
                aabb[1][axis] = if p[axis] > aabb[1][axis] { p[axis] } else { aabb[1][axis] };
            }
        }
    }
    if let Some(last) = parts.get_mut(at as usize) {
        *last = Component { aabb, ..part };
    }
    (part_of, parts)
}

/// The component of each triangle, numbered in the order of their first triangles, and their number.
fn labels(work: &EditMesh, half_edges: &HalfEdges) -> (Vec<u32>, u32) {
    let mut sets = UnionFind::new(work.triangles.len());
    for (t, sides) in (0..).zip(half_edges.twin.as_chunks::<3>().0) {
        let earlier = sides.iter().filter(|twin| **twin != NONE && **twin / 3 < t);
        earlier.for_each(|twin| sets.join(t, twin / 3));
    }
    let first = sets.into_firsts();
    let mut names = 0;
    let mut part_of: Vec<u32> = Vec::with_capacity(first.len());
    for (t, of) in (0..).zip(&first) {
        part_of.push(if *of == t { names } else { part_of[*of as usize] });
        names += u32::from(*of == t);
    }
    (part_of, names)
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::{Point, Vector};
    use if_core::shapes::meshes::icosphere;

    fn three_balls() -> TriMesh {
        let (mut v, mut t): (Vec<Point>, Vec<[u32; 3]>) = (Vec::new(), Vec::new());
        for (radius, x) in [(0.01, 1.0), (0.3, 0.0), (0.05, -1.0)] {
            let ball = icosphere(radius, 2);
            let base = v.len() as u32;
            v.extend(ball.vertices().iter().map(|p| p + Vector::x() * x));
            t.extend(ball.triangles().iter().map(|t| t.map(|i| i + base)));
        }
        TriMesh::new(v, t).unwrap()
    }

    #[test]
    fn small_components_are_removed_and_reported_with_area_and_box() {
        let (left, report) = remove_isolated(&three_balls(), &ComponentParams::default()).unwrap();
        assert_eq!((report.kept.len(), report.dropped.len()), (2, 1));
        let gone = report.dropped[0];
        approx::assert_relative_eq!(gone.area, icosphere(0.01, 2).area(), max_relative = 1e-12);
        approx::assert_relative_eq!(gone.aabb[0][0], 0.99, epsilon = 1e-3);
        assert_eq!(left.mesh.triangles().len(), 2 * gone.triangles);
        let (one, _) =
            remove_isolated(&left.mesh, &ComponentParams { most: Some(1), ..Default::default() })
                .unwrap();
        assert_eq!(one.mesh.triangles(), icosphere(0.3, 2).triangles());
    }

    #[test]
    fn the_least_share_is_one_of_the_largest_component() {
        // Areas go with the squares of radii: 1/36 of the largest is the second of the balls.
        for (least_share, kept) in [(0.9 / 36.0, 2), (1.1 / 36.0, 1)] {
            let params = ComponentParams { least_share, ..Default::default() };
            let (_, report) = remove_isolated(&three_balls(), &params).unwrap();
            assert_eq!(report.kept.len(), kept, "{least_share}");
        }
        // The largest of many equal ones has a small share of the whole.
        let ball = icosphere(0.3, 1);
        let far = |p: &Point| p + Vector::x();
        let twice = [ball.vertices().to_vec(), ball.vertices().iter().map(far).collect()].concat();
        let n = ball.vertices().len() as u32;
        let others = ball.triangles().iter().map(|t| t.map(|v| v + n)).collect();
        let both = TriMesh::new(twice, [ball.triangles().to_vec(), others].concat()).unwrap();
        let params = ComponentParams { least_share: 0.9, ..Default::default() };
        assert_eq!(remove_isolated(&both, &params).unwrap().1.dropped, []);
    }

    #[test]
    fn an_empty_mesh_has_no_components() {
        let (left, report) =
            remove_isolated(&TriMesh::default(), &ComponentParams::default()).unwrap();
        assert!(left.mesh.triangles().is_empty());
        assert_eq!(report, ComponentReport::default());
    }
}
