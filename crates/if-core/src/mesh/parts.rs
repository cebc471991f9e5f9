//! Vertices and triangles that are checked block by block while they are read, still in the cache.

use super::MeshError;
use crate::math::{Point, Real};
use std::ops::Deref;

/// Corners that are compared at once.
const LANES: usize = 12;

/// Points with finite coordinates.
///
/// # Examples
///
/// ```
/// use if_core::{math::Point, mesh::{FinitePoints, TriMesh, Triangles}};
/// let (mut points, mut triangles) = (FinitePoints::default(), Triangles::default());
/// for k in 0..3 {
///     points.extend((0..2).map(|j| Point::new(k as f64, j as f64, 0.0)))?;
/// }
/// triangles.extend_below(6, [[0, 2, 1], [1, 2, 3]])?;
/// triangles.push([2, 4, 3])?;
/// assert_eq!(TriMesh::from_parts(points, triangles)?.area(), 1.5);
/// # Ok::<(), if_core::mesh::MeshError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Default)]
pub struct FinitePoints(Vec<Point>);

impl FinitePoints {
    /// An empty list with this capacity.
    pub fn with_capacity(points: usize) -> Self {
        Self(Vec::with_capacity(points))
    }

    /// Checks `points`.
    ///
    /// # Errors
    ///
    /// The first coordinate that is not finite.
    pub fn new(points: Vec<Point>) -> Result<Self, MeshError> {
        check_finite(&points, 0)?;
        Ok(Self(points))
    }

    /// Appends a block of points.
    ///
    /// # Errors
    ///
    /// The first coordinate that is not finite; then the whole block is dropped. The error
    /// counts vertices from the first of all points.
    pub fn extend(&mut self, block: impl IntoIterator<Item = Point>) -> Result<(), MeshError> {
        let before = self.0.len();
        let mut good = true;
        #[allow(clippy::manual_inspect)]
        // `inspect` hides the size hint, and each push would check the capacity
        self.0.extend(block.into_iter().map(|p| {
            good &= is_finite(&p);
            p
        }));
        if good {
            return Ok(());
        }
        let fault = check_finite(&self.0[before..], before);
        self.0.truncate(before);
        fault
    }

    /// The points; finiteness is no longer guaranteed by the type.
    pub fn into_vec(self) -> Vec<Point> {
        self.0
    }
}

impl Deref for FinitePoints {
    type Target = [Point];

    fn deref(&self) -> &[Point] {
        &self.0
    }
}

/// Triangles, as indices of vertices, each of three different ones.
#[derive(Clone, Debug, Default)]
pub struct Triangles {
    list: Vec<[u32; 3]>,
    /// No corner is this or more.
    end: u64,
}

impl Triangles {
    /// An empty list with this capacity.
    pub fn with_capacity(triangles: usize) -> Self {
        Self { list: Vec::with_capacity(triangles), end: 0 }
    }

    /// Appends a triangle.
    ///
    /// # Errors
    ///
    /// One that names a vertex twice is not taken.
    #[inline]
    pub fn push(&mut self, triangle: [u32; 3]) -> Result<(), MeshError> {
        if let Some(vertex) = repeated(&triangle) {
            return Err(MeshError::RepeatedVertex { triangle: self.list.len(), vertex });
        }
        self.list.push(triangle);
        self.end = triangle.into_iter().fold(self.end, |end, v| end.max(u64::from(v) + 1));
        Ok(())
    }

    /// Appends a block of triangles that name the vertices before `limit`.
    ///
    /// # Errors
    ///
    /// The first that names another one, or one twice; then none of the block is taken. The
    /// triangle is counted from the first of all.
    #[inline]
    pub fn extend_below(
        &mut self,
        limit: u32,
        block: impl IntoIterator<Item = [u32; 3]>,
    ) -> Result<(), MeshError> {
        let before = self.list.len();
        self.list.extend(block);
        let checked = check_triangles(&self.list[before..], before, limit);
        match checked {
            Ok(()) => self.end = self.end.max(limit.into()),
            Err(_) => self.list.truncate(before),
        }
        checked
    }

    /// Keeps only the first `triangles` triangles.
    pub fn truncate(&mut self, triangles: usize) {
        self.list.truncate(triangles);
    }

    /// The triangles; validity is no longer guaranteed by the type.
    pub fn into_vec(self) -> Vec<[u32; 3]> {
        self.list
    }

    /// Rejects a corner that is not below `limit`.
    pub(super) fn check_below(&self, limit: u32) -> Result<(), MeshError> {
        if self.end <= limit.into() { Ok(()) } else { check_triangles(&self.list, 0, limit) }
    }
}

impl Deref for Triangles {
    type Target = [[u32; 3]];

    fn deref(&self) -> &[[u32; 3]] {
        &self.list
    }
}

/// The number of vertices, if 32-bit indices can name them all.
pub(super) fn limit(vertices: &[Point]) -> Result<u32, MeshError> {
    u32::try_from(vertices.len())
        .map_err(|_| MeshError::TooManyVertices { vertices: vertices.len() })
}

/// Rejects triangles that do not name three different vertices before `limit`. The first has the
/// index `first`.
pub(super) fn check_triangles(
    triangles: &[[u32; 3]],
    first: usize,
    limit: u32,
) -> Result<(), MeshError> {
    if are_good(triangles, limit) {
        return Ok(());
    }
    // Nearly all meshes are valid: search for the invalid triangle only if there is one.
    for (triangle, t) in (first..).zip(triangles) {
        for (corner, &index) in t.iter().enumerate() {
            if index >= limit {
                return Err(MeshError::IndexOutOfRange {
                    triangle,
                    corner,
                    index,
                    vertices: limit as usize,
                });
            }
        }
        if let Some(vertex) = repeated(t) {
            return Err(MeshError::RepeatedVertex { triangle, vertex });
        }
    }
    Ok(())
}

/// Whether all name three different vertices before `limit`.
fn are_good(triangles: &[[u32; 3]], limit: u32) -> bool {
    let all = triangles.as_flattened();
    // Four triangles at once: each corner against the next and the one after. `is_bad` then
    // reads only the comparisons within one triangle.
    let (mut is_next, mut is_second, mut is_beyond) = ([0; LANES], [0; LANES], [0; LANES]);
    let mut done = 0;
    while let Some(corners) = all[done..].first_chunk::<{ LANES + 2 }>() {
        for k in 0..LANES {
            is_next[k] |= u32::from(corners[k] == corners[k + 1]);
            is_second[k] |= u32::from(corners[k] == corners[k + 2]);
            is_beyond[k] |= u32::from(corners[k] >= limit);
        }
        done += LANES;
    }
    let is_bad = |k| {
        is_beyond[k] != 0 || (k % 3 < 2 && is_next[k] != 0) || (k % 3 == 0 && is_second[k] != 0)
    };
    !(0..LANES).any(is_bad)
        && triangles[done / 3..]
            .iter()
            .all(|t| t.iter().all(|v| *v < limit) && repeated(t).is_none())
}

/// The vertex that `triangle` names twice.
#[inline]
fn repeated(triangle: &[u32; 3]) -> Option<u32> {
    let [a, b, c] = *triangle;
    if a == b || a == c {
        Some(a)
    } else if b == c {
        Some(b)
    } else {
        None
    }
}

#[inline]
fn is_finite(p: &Point) -> bool {
    (p.x.abs() <= Real::MAX) & (p.y.abs() <= Real::MAX) & (p.z.abs() <= Real::MAX)
}

/// Refuses coordinates that are not finite. The first point has the index `first`.
pub(super) fn check_finite(points: &[Point], first: usize) -> Result<(), MeshError> {
    if points.iter().fold(true, |good, p| good & is_finite(p)) {
        return Ok(());
    }
    for (vertex, p) in (first..).zip(points) {
        for axis in 0..3 {
            if !p[axis].is_finite() {
                return Err(MeshError::NonFinite { vertex, axis, value: p[axis] });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::TriMesh;

    /// Eight corners of a cube, some of them not finite.
    fn points(faults: &[(usize, usize, Real)]) -> Vec<Point> {
        let mut points = (0..8)
            .map(|k| Point::new((k & 1) as Real, (k >> 1 & 1) as Real, (k >> 2) as Real))
            .collect::<Vec<_>>();
        faults.iter().for_each(|&(vertex, axis, value)| points[vertex][axis] = value);
        points
    }

    #[test]
    fn blocks_find_the_fault_that_the_whole_has() {
        let all = points(&[(5, 2, Real::INFINITY), (6, 0, Real::NAN)]);
        let fault = TriMesh::new(all.clone(), vec![]).unwrap_err();
        for block in 1..=8 {
            let mut taken = FinitePoints::default();
            let found = all.chunks(block).try_for_each(|b| taken.extend(b.iter().copied()));
            assert_eq!(found.unwrap_err(), fault);
            assert_eq!(taken.len(), 5 / block * block, "the invalid block is dropped as a whole");
        }
        let good: Vec<[u32; 3]> = (0..2000).map(|k| [k % 8, (k + 1) % 8, (k + 3) % 8]).collect();
        for (at, bad) in [
            (0, [0, 1, 8]),
            (511, [3, 3, 1]),
            (512, [3, 1, 3]),
            (513, [1, 3, 3]),
            (1999, [0, u32::MAX, 1]),
        ] {
            let mut triangles = good.clone();
            triangles[1999] = [9, 9, 9]; // a later fault
            triangles[at] = bad;
            let fault = TriMesh::new(points(&[]), triangles.clone()).unwrap_err();
            for block in [1, 7, 512, 600, 2000] {
                let mut taken = Triangles::with_capacity(10);
                let found = triangles
                    .chunks(block)
                    .try_for_each(|b| taken.extend_below(8, b.iter().copied()));
                assert_eq!(found.unwrap_err(), fault);
                assert_eq!(taken[..], triangles[..at / block * block]);
            }
        }
    }

    #[test]
    fn parts_make_a_mesh_when_the_vertices_are_there() {
        let of = |n: usize| FinitePoints::new(points(&[])[..n].to_vec()).unwrap();
        let mut triangles = Triangles::default();
        triangles.push([0, 1, 2]).unwrap();
        assert_eq!(
            triangles.push([4, 5, 4]),
            Err(MeshError::RepeatedVertex { triangle: 1, vertex: 4 })
        );
        triangles.push([0, 7, 3]).unwrap();
        let fault = MeshError::IndexOutOfRange { triangle: 1, corner: 1, index: 7, vertices: 7 };
        assert_eq!(TriMesh::from_parts(of(7), triangles.clone()), Err(fault));
        let mesh = TriMesh::from_parts(of(8), triangles.clone()).unwrap();
        assert_eq!(mesh, TriMesh::new(points(&[]), vec![[0, 1, 2], [0, 7, 3]]).unwrap());
        assert!(TriMesh::from_parts(of(0), Triangles::default()).unwrap().triangles().is_empty());
    }
}
