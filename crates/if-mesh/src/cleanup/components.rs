//! Isolated elements: parts that no edge joins to the rest.

use super::twins::{NONE, Twins};
use super::work::{Derived, Work};
use super::{CleanupError, range};
use if_core::math::Real;
use if_core::mesh::TriMesh;
use serde::Serialize;

/// What is an isolated element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComponentParams {
    /// A part is kept if it has at least this share of the area of the largest part, from 0 to 1.
    pub least_share: Real,
    /// At most this many parts are kept, the largest; `None` for no limit.
    pub most: Option<usize>,
}

impl Default for ComponentParams {
    /// 1 % of the largest: on the extractions of `data/clothed` the largest stray part has 0.07 %
    /// (clean votes).
    fn default() -> Self {
        Self { least_share: 0.01, most: None }
    }
}

/// A part of a mesh that edges hold together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Component {
    /// Number of triangles.
    pub triangles: usize,
    /// Area, in square metres.
    pub area: Real,
    /// Least and largest coordinates, in metres.
    pub aabb: [[Real; 3]; 2],
}

/// What was kept and dropped.
#[derive(Clone, Debug, PartialEq, Default, Serialize)]
pub struct ComponentReport {
    /// Parts that stay, the largest first.
    pub kept: Vec<Component>,
    /// Parts that were dropped, the largest first.
    pub dropped: Vec<Component>,
}

impl ComponentParams {
    /// Whether all numbers make sense.
    ///
    /// # Errors
    ///
    /// A share that is none.
    pub fn validate(&self) -> Result<(), CleanupError> {
        range("the least share of a part", self.least_share, 0.0, 1.0, "a share from 0 to 1")
    }
}

/// Drops parts that are small beside the largest one. What meets in a vertex only is not joined.
///
/// # Errors
///
/// Parameters out of range.
pub fn remove_isolated(
    mesh: &TriMesh,
    params: &ComponentParams,
) -> Result<(Derived, ComponentReport), CleanupError> {
    params.validate()?;
    let mut work = Work::new(mesh);
    let (report, _) = drop_small(&mut work, &Twins::of_mesh(mesh), params);
    Ok((work.finish(), report))
}

/// [`remove_isolated`] in place; the triangles that went, ascending.
pub(super) fn drop_small(
    work: &mut Work,
    twins: &Twins,
    params: &ComponentParams,
) -> (ComponentReport, Vec<u32>) {
    let (part_of, parts) = components(work, twins);
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

/// The part of each triangle, and the parts in the order of their first triangles.
pub(super) fn components(work: &Work, twins: &Twins) -> (Vec<u32>, Vec<Component>) {
    let ((part_of, names), areas) = rayon::join(
        || labels(work, twins),
        || (0..work.triangles.len()).map(|t| work.area(t)).collect::<Vec<Real>>(),
    );
    let none =
        Component { triangles: 0, area: 0.0, aabb: [[Real::INFINITY; 3], [Real::NEG_INFINITY; 3]] };
    let mut parts = vec![none; names as usize];
    // Most triangles are of the part that the one before them is of.
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
                // Positions are finite.
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

/// The part of each triangle, and how many there are, in the order of their first triangles.
fn labels(work: &Work, twins: &Twins) -> (Vec<u32>, u32) {
    // Each triangle points to an earlier one of its part, the first to itself.
    let mut first: Vec<u32> = Vec::with_capacity(work.triangles.len());
    for (t, sides) in (0..work.triangles.len() as u32).zip(twins.of.as_chunks::<3>().0) {
        first.push(t);
        let mut mine = t;
        for twin in sides.iter().filter(|twin| **twin != NONE && **twin / 3 < t) {
            let other = find(&mut first, twin / 3);
            if other != mine {
                first[mine.max(other) as usize] = mine.min(other);
                mine = mine.min(other);
            }
        }
    }
    let mut names = 0;
    let mut part_of: Vec<u32> = Vec::with_capacity(first.len());
    for (t, of) in (0..).zip(&first) {
        part_of.push(if *of == t { names } else { part_of[*of as usize] });
        names += u32::from(*of == t);
    }
    (part_of, names)
}

/// The first triangle that `t` leads to; the way there gets shorter.
fn find(first: &mut [u32], mut t: u32) -> u32 {
    while first[t as usize] != t {
        let next = first[t as usize];
        first[t as usize] = first[next as usize];
        t = next;
    }
    t
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
    fn small_parts_go_and_are_reported_with_area_and_box() {
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
    fn no_mesh_has_no_parts() {
        let (left, report) =
            remove_isolated(&TriMesh::default(), &ComponentParams::default()).unwrap();
        assert!(left.mesh.triangles().is_empty());
        assert_eq!(report, ComponentReport::default());
    }
}
