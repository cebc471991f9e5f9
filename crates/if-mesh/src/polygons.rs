//! The faces of a file, beside the triangles that the rest of the crate uses.

use if_core::math::{Point, Real, Vector};
use if_core::mesh::Triangles;

/// Faces of three corners or more, as consecutive vertex indices.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub struct Polygons {
    /// Corner k of face f is `corners[starts[f] + k]`. One entry more than there are faces.
    starts: Vec<u32>,
    corners: Vec<u32>,
}

impl Polygons {
    /// Number of faces.
    pub fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether there are no faces.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The vertices of face `f`, in the file's order.
    ///
    /// # Panics
    ///
    /// If `f` is out of range.
    pub fn face(&self, f: usize) -> &[u32] {
        &self.corners[self.starts[f] as usize..self.starts[f + 1] as usize]
    }

    /// All faces in the file's order.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        self.starts.windows(2).map(|w| &self.corners[w[0] as usize..w[1] as usize])
    }

    /// Faces given by their corners, for meshes that are not read from a file. They belong to the
    /// mesh of [`Polygons::triangles`].
    ///
    /// # Errors
    ///
    /// The index of the first face with fewer than three corners, or with which the corners exceed
    /// 32-bit offsets.
    pub fn new<F: AsRef<[u32]>>(faces: impl IntoIterator<Item = F>) -> Result<Self, usize> {
        let mut made = Self { starts: vec![0], corners: Vec::new() };
        for (index, face) in faces.into_iter().enumerate() {
            let face = face.as_ref();
            if face.len() < 3 || made.corners.len() + face.len() > MAX_CORNERS {
                return Err(index);
            }
            made.push(face);
        }
        Ok(made)
    }

    /// The triangles of the faces: fans around their first corners, without those that use a vertex
    /// twice.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        self.fans().collect()
    }

    /// Indices of the faces whose fans fold over themselves at these positions: concave faces with
    /// their hollow away from the first corner, and some that are far from flat. A triangle of
    /// their fan faces away from the face.
    ///
    /// # Panics
    ///
    /// If a corner is out of range of `positions`.
    pub fn folded(&self, positions: &[Point]) -> Vec<usize> {
        let of = |face: &[u32]| {
            let area = |t: [u32; 3]| {
                let [a, b, c] = t.map(|v| positions[v as usize]);
                (b - a).cross(&(c - a))
            };
            let whole: Vector = fan(face).map(area).sum();
            fan(face).any(|t| area(t).dot(&whole) < -FLAT * whole.norm_squared())
        };
        let is_folded = |(_, face): &(usize, &[u32])| face.len() > 3 && of(face);
        self.iter().enumerate().filter(is_folded).map(|(f, _)| f).collect()
    }

    pub(crate) fn fans(&self) -> impl Iterator<Item = [u32; 3]> {
        self.iter().flat_map(fan).filter(|[a, b, c]| a != b && b != c && c != a)
    }

    fn from_triangles(triangles: &[[u32; 3]]) -> Self {
        Self {
            starts: (0..=triangles.len() as u32).map(|t| 3 * t).collect(),
            corners: triangles.as_flattened().to_vec(),
        }
    }

    fn push(&mut self, face: &[u32]) {
        self.corners.extend_from_slice(face);
        self.starts.push(self.corners.len() as u32);
    }
}

/// A face of three corners or more as triangles around its first corner.
fn fan(face: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    face[1..].windows(2).map(|pair| [face[0], pair[0], pair[1]])
}

/// Faces as they are read: triangles, and the polygons too as soon as one face is not a triangle.
///
/// A face is split into a fan around its first corner. A triangle of the fan that uses a vertex
/// twice is missing in the triangles (it has no area, and [`if_core::mesh::TriMesh`] rejects it) but
/// not in the polygons; the face is then listed in `collapsed`.
#[derive(Clone, Debug, Default)]
pub(crate) struct FaceList {
    pub(crate) triangles: Triangles,
    /// `None` as long as the faces are the triangles.
    pub(crate) polygons: Option<Polygons>,
    /// Indices of faces that use a vertex twice.
    pub(crate) collapsed: Vec<u32>,
}

/// Area of a triangle, as a share of its face, up to which it faces nowhere: three corners on a line.
const FLAT: Real = 1e-6;

/// Maximum number of corners for 32-bit offsets.
const MAX_CORNERS: usize = u32::MAX as usize;

impl FaceList {
    /// Number of faces so far.
    pub(crate) fn len(&self) -> usize {
        self.polygons.as_ref().map_or(self.triangles.len(), Polygons::len)
    }

    /// Appends a face of three corners or more; returns `false` if the corners exceed 32-bit offsets.
    pub(crate) fn push(&mut self, face: &[u32]) -> bool {
        if let (None, &[a, b, c]) = (&self.polygons, face)
            && self.triangles.push([a, b, c]).is_ok()
        {
            return self.triangles.len() <= MAX_CORNERS / 3;
        }
        let index = self.len();
        let polygons =
            self.polygons.get_or_insert_with(|| Polygons::from_triangles(&self.triangles));
        if polygons.corners.len() + face.len() > MAX_CORNERS {
            return false;
        }
        polygons.push(face);
        let mut whole = true;
        for triangle in fan(face) {
            whole &= self.triangles.push(triangle).is_ok();
        }
        if !whole {
            self.collapsed.push(index as u32);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_alone_need_no_polygons() {
        let mut faces = FaceList::default();
        assert!(faces.push(&[0, 1, 2]) && faces.push(&[2, 1, 3]));
        assert_eq!(faces.triangles[..], [[0, 1, 2], [2, 1, 3]]);
        assert!(faces.polygons.is_none() && faces.collapsed.is_empty());
        assert_eq!(faces.len(), 2);
    }

    #[test]
    fn the_first_polygon_brings_the_earlier_triangles_along() {
        let mut faces = FaceList::default();
        for f in [&[0, 1, 2][..], &[3, 4, 5, 6, 7], &[1, 2, 3]] {
            assert!(faces.push(f));
        }
        assert_eq!(faces.triangles[..], [[0, 1, 2], [3, 4, 5], [3, 5, 6], [3, 6, 7], [1, 2, 3]]);
        let polygons = faces.polygons.unwrap();
        assert_eq!(
            polygons.iter().collect::<Vec<_>>(),
            [&[0, 1, 2][..], &[3, 4, 5, 6, 7], &[1, 2, 3]]
        );
        assert_eq!(polygons.face(1).len(), 5);
    }

    #[test]
    fn fans_fold_at_a_hollow_that_their_first_corner_does_not_see() {
        // An arrowhead with its notch at corner 3, and a square with a fifth corner on an edge.
        let at = [[0, 0], [2, 2], [0, 4], [1, 2], [4, 0], [4, 4], [0, 2]];
        let at = at.map(|[x, y]| Point::new(x.into(), y.into(), 0.0));
        let faces = [&[0, 1, 2, 3][..], &[3, 0, 1, 2], &[0, 4, 5, 2, 6], &[4, 5, 2, 0], &[0, 4, 1]];
        let faces = Polygons::new(faces).unwrap();
        assert_eq!(faces.folded(&at), [0]);
        let line = Polygons::new([[0, 4, 4, 0]]).unwrap();
        assert!(line.folded(&at).is_empty());
    }

    #[test]
    fn a_face_that_uses_a_vertex_twice_stays_a_face_but_gives_no_triangle() {
        let mut faces = FaceList::default();
        for f in [&[0, 1, 2][..], &[3, 3, 4], &[5, 6, 6, 7]] {
            assert!(faces.push(f));
        }
        assert_eq!(faces.triangles[..], [[0, 1, 2], [5, 6, 7]]);
        assert_eq!(faces.collapsed, [1, 2]);
        assert_eq!(faces.polygons.unwrap().len(), 3);
    }
}
