//! Local refinement: some triangles are split into four, their neighbours into two or three.

use crate::attributes::Source;
use crate::seams::Welded;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::{MeshError, TriMesh};
use std::collections::HashMap;

/// A mesh with some triangles split.
#[derive(Clone, Debug, PartialEq)]
pub struct SplitMesh {
    /// The old vertices first, in their order, then the new ones. The parts of a triangle replace it
    /// in place.
    pub mesh: TriMesh,
    /// The sources of each vertex, for [`crate::attributes::VertexAttributes::derive`].
    pub sources: Vec<Source>,
    /// For each triangle its place in a triangle of the mesh before.
    pub parts: Vec<Part>,
}

/// A part of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// The triangle of the mesh before.
    pub parent: u32,
    /// Barycentric coordinates of the three corners in it.
    pub corners: [[Real; 3]; 3],
}

impl Part {
    /// The whole of triangle `parent`.
    pub(crate) fn whole(parent: u32) -> Self {
        Self { parent, corners: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] }
    }

    /// Whether it is the whole of its parent.
    pub(crate) fn is_whole(&self) -> bool {
        *self == Self::whole(self.parent)
    }
}

/// Splits the `marked` triangles into four at the midpoints of their edges. Their neighbours are split
/// at the same midpoints, into two or three, so that the mesh stays conforming. The surface does not
/// change.
///
/// # Errors
///
/// More vertices than 32-bit indices allow.
///
/// # Panics
///
/// If `marked` does not have one entry per triangle.
///
/// # Source
///
/// Bank, Sherman and Weiser 1983, *Refinement algorithms and data structures for regular local mesh
/// refinement* (the regular, "red", split and its closure).
///
/// # Examples
///
/// ```
/// use if_core::shapes::meshes;
/// use if_mesh::split::split;
/// let ball = meshes::icosphere(1.0, 1);
/// let mut marked = vec![false; ball.triangles().len()];
/// marked[7] = true;
/// let fine = split(&ball, &marked)?;
/// assert_eq!(fine.mesh.triangles().len(), ball.triangles().len() + 3 + 3);
/// assert_eq!(fine.mesh.vertices()[..ball.vertices().len()], *ball.vertices());
/// # Ok::<(), if_core::mesh::MeshError>(())
/// ```
pub fn split(mesh: &TriMesh, marked: &[bool]) -> Result<SplitMesh, MeshError> {
    let x = mesh.vertices();
    assert_eq!(marked.len(), mesh.triangles().len(), "one mark for each triangle");
    let edges = Edges::new(mesh);
    let mut cut = vec![false; edges.len()];
    for (t, _) in marked.iter().enumerate().filter(|(_, m)| **m) {
        edges.of_triangle[t].iter().for_each(|e| cut[*e as usize] = true);
    }
    let mut vertices = x.to_vec();
    let mut sources: Vec<Source> = (0..x.len() as u32).map(Source::Vertex).collect();
    let mut middle = vec![u32::MAX; edges.len()];
    for (e, &[a, b]) in edges.vertices.iter().enumerate().filter(|(e, _)| cut[*e]) {
        middle[e] = vertices.len() as u32;
        vertices.push(Point::from((x[a as usize].coords + x[b as usize].coords) / 2.0));
        sources.push(Source::Blend(vec![(a, 0.5), (b, 0.5)]));
    }
    let (mut triangles, mut parts) = (Vec::new(), Vec::new());
    for (t, tri) in mesh.triangles().iter().enumerate() {
        let of = edges.of_triangle[t].map(|e| e as usize);
        // Places 0 to 2 are the corners, 3 to 5 the midpoints of the edges that begin there.
        let at = |place: usize| if place < 3 { tri[place] } else { middle[of[place - 3]] };
        // The length from a corner to a midpoint; of equal ones the lower corner's counts as shorter, so
        // that triangles with the same corners are split alike.
        let length = |corner: usize, middle: usize| {
            let [p, q] = [at(corner), at(middle)];
            ((vertices[p as usize] - vertices[q as usize]).norm_squared(), p)
        };
        for corners in places(of.map(|e| cut[e]), length) {
            triangles.push(corners.map(at));
            parts.push(Part { parent: t as u32, corners: corners.map(weights) });
        }
    }
    Ok(SplitMesh { mesh: TriMesh::new(vertices, triangles)?, sources, parts })
}

/// The parts of a triangle whose edges are `cut` at their midpoints, by places. A quadrilateral is
/// split at its shorter diagonal.
fn places(cut: [bool; 3], length: impl Fn(usize, usize) -> (Real, u32)) -> Vec<[usize; 3]> {
    let number = cut.iter().filter(|c| **c).count();
    // Rotate so that the edges that are cut, or the only one that is not, come first.
    let first = match number {
        1 => cut.iter().position(|c| *c),
        2 => cut.iter().position(|c| !*c),
        _ => Some(0),
    };
    let k = first.unwrap_or(0);
    let (a, b, c) = (k, (k + 1) % 3, (k + 2) % 3);
    let (ab, bc, ca) = (a + 3, b + 3, c + 3);
    match number {
        0 => vec![[0, 1, 2]],
        1 => vec![[a, ab, c], [ab, b, c]],
        2 if length(a, bc) <= length(b, ca) => vec![[a, b, bc], [a, bc, ca], [bc, c, ca]],
        2 => vec![[a, b, ca], [b, bc, ca], [bc, c, ca]],
        _ => vec![[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]],
    }
}

/// Barycentric coordinates of a place.
fn weights(place: usize) -> [Real; 3] {
    let mut w = [0.0; 3];
    if place < 3 {
        w[place] = 1.0;
    } else {
        w[place - 3] = 0.5;
        w[(place - 2) % 3] = 0.5;
    }
    w
}

impl SplitMesh {
    /// The split of `mesh` that splits nothing.
    pub fn none(mesh: &TriMesh) -> Self {
        Self {
            sources: (0..mesh.vertices().len() as u32).map(Source::Vertex).collect(),
            parts: (0..mesh.triangles().len() as u32).map(Part::whole).collect(),
            mesh: mesh.clone(),
        }
    }

    /// Both splits as one: `self` first, then `next`, a split of `self.mesh`.
    ///
    /// # Panics
    ///
    /// If `next` is of a mesh with other triangles.
    pub fn then(&self, next: SplitMesh) -> SplitMesh {
        let sources = next.sources.iter().map(|s| match s {
            Source::Vertex(v) => self.sources[*v as usize].clone(),
            Source::Blend(of) => blend(of.iter().flat_map(|(v, w)| {
                self.sources[*v as usize].parts().into_iter().map(move |p| (p.0, w * p.1))
            })),
        });
        let parts = next.parts.iter().map(|part| {
            let outer = &self.parts[part.parent as usize];
            let corners = part
                .corners
                .map(|w| [0, 1, 2].map(|k| (0..3).map(|j| w[j] * outer.corners[j][k]).sum()));
            Part { parent: outer.parent, corners }
        });
        SplitMesh { sources: sources.collect(), parts: parts.collect(), mesh: next.mesh }
    }

    /// This split, which is of the mesh of `welded`, for the mesh that was welded, which is `original`;
    /// and what it gives, welded to `self.mesh`. At a seam each side has new vertices of its own, at the
    /// same positions.
    ///
    /// # Errors
    ///
    /// More vertices than 32-bit indices allow.
    ///
    /// # Panics
    ///
    /// If `welded` is of a mesh with other triangles than `original`, or than what was split.
    pub fn unweld(
        &self,
        welded: &Welded,
        original: &TriMesh,
    ) -> Result<(SplitMesh, Welded), MeshError> {
        let mut vertices = original.vertices().to_vec();
        let mut sources: Vec<Source> = (0..vertices.len() as u32).map(Source::Vertex).collect();
        let mut vertex_map = welded.vertex_map.clone();
        // New vertices, by their welded ones and the corners that they lie between.
        let mut known: HashMap<(u32, Vec<u32>), u32> = HashMap::new();
        let mut triangles = Vec::with_capacity(self.parts.len());
        for (part, corners) in self.parts.iter().zip(self.mesh.triangles()) {
            let parent = original.triangles()[part.parent as usize];
            let at = |k: usize| {
                let source = blend(parent.into_iter().zip(part.corners[k]).filter(|p| p.1 > 0.0));
                let between = source.parts();
                if let [(v, _)] = between[..] {
                    return v;
                }
                let mut between: Vec<u32> = between.iter().map(|p| p.0).collect();
                between.sort_unstable();
                *known.entry((corners[k], between)).or_insert_with(|| {
                    vertices.push(self.mesh.vertices()[corners[k] as usize]);
                    sources.push(source);
                    vertex_map.push(corners[k]);
                    vertices.len() as u32 - 1
                })
            };
            triangles.push([0, 1, 2].map(at));
        }
        let mesh = TriMesh::new(vertices, triangles)?;
        let welded = Welded { mesh: self.mesh.clone(), vertex_map, ..*welded };
        Ok((SplitMesh { mesh, sources, parts: self.parts.clone() }, welded))
    }

    /// The split mesh for other positions of the vertices before.
    ///
    /// # Errors
    ///
    /// [`MeshError`] if a position is not finite.
    ///
    /// # Panics
    ///
    /// If there are fewer `positions` than vertices before.
    pub fn apply(&self, positions: &[Point]) -> Result<TriMesh, MeshError> {
        let at = |s: &Source| match s {
            Source::Vertex(v) => positions[*v as usize],
            Source::Blend(of) => Point::from(
                of.iter().map(|(v, w)| positions[*v as usize].coords * *w).sum::<Vector>(),
            ),
        };
        self.mesh.with_vertices(self.sources.iter().map(at).collect())
    }

    /// Number of triangles of the mesh before that were split.
    pub fn split_triangles(&self) -> usize {
        self.parts.chunk_by(|a, b| a.parent == b.parent).filter(|c| c.len() > 1).count()
    }
}

/// A blend with each vertex once, the largest weight first.
fn blend(parts: impl Iterator<Item = (u32, Real)>) -> Source {
    let mut sums: Vec<(u32, Real)> = Vec::new();
    for (v, w) in parts {
        match sums.iter_mut().find(|s| s.0 == v) {
            Some(s) => s.1 += w,
            None => sums.push((v, w)),
        }
    }
    sums.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    Source::Blend(sums)
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::barycentric_point;
    use if_core::shapes::meshes;

    /// Parts and vertices lie where their barycentric coordinates and sources place them.
    fn check(before: &TriMesh, split: &SplitMesh) {
        assert_eq!(split.mesh.triangles().len(), split.parts.len());
        for (tri, part) in split.mesh.triangles().iter().zip(&split.parts) {
            let parent =
                before.triangles()[part.parent as usize].map(|v| &before.vertices()[v as usize]);
            for (v, w) in tri.iter().zip(part.corners) {
                let expected = barycentric_point(parent, w);
                approx::assert_relative_eq!(
                    split.mesh.vertices()[*v as usize],
                    expected,
                    epsilon = 1e-14
                );
            }
        }
        approx::assert_relative_eq!(
            split.apply(before.vertices()).unwrap().area(),
            before.area(),
            max_relative = 1e-12
        );
        approx::assert_relative_eq!(split.mesh.area(), before.area(), max_relative = 1e-12);
    }

    #[test]
    fn any_choice_of_triangles_keeps_a_closed_surface_closed() {
        let ball = meshes::icosphere(1.0, 2);
        for step in [1, 2, 3, 5, 8, 13, 400] {
            let marked: Vec<bool> = (0..ball.triangles().len()).map(|t| t % step == 0).collect();
            let once = split(&ball, &marked).unwrap();
            check(&ball, &once);
            let edges = Edges::new(&once.mesh);
            assert!(edges.valence.iter().all(|v| *v == 2), "no gap, no third triangle at an edge");
            approx::assert_relative_eq!(
                once.mesh.signed_volume(),
                ball.signed_volume(),
                max_relative = 1e-12
            );
            let again = split(&once.mesh, &vec![true; once.parts.len()]).unwrap();
            let both = once.then(again);
            check(&ball, &both);
            assert_eq!(both.split_triangles(), ball.triangles().len());
        }
    }

    #[test]
    fn without_marked_triangles_the_mesh_is_unchanged() {
        let sheet = meshes::cloth(1.0, 1.0, 4, 3);
        let same = split(&sheet, &vec![false; sheet.triangles().len()]).unwrap();
        assert_eq!(same, SplitMesh::none(&sheet));
        assert!(same.parts.iter().all(Part::is_whole));
        assert_eq!(same.split_triangles(), 0);
    }

    #[test]
    fn boundary_and_non_manifold_edges_are_split_too() {
        let x =
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
                .map(Point::from);
        let fin = TriMesh::new(x.to_vec(), vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]]).unwrap();
        let fine = split(&fin, &[true, false, false]).unwrap();
        check(&fin, &fine);
        assert_eq!(
            fine.parts.iter().map(|p| p.parent).collect::<Vec<_>>(),
            [0, 0, 0, 0, 1, 1, 2, 2]
        );
        assert_eq!(fine.split_triangles(), 3);
    }
}
