//! Seams of exporters: closed for the clean-up, and open again in its result.

use super::edit_mesh::{Derived, EditMesh};
use super::half_edges::{HalfEdges, ends};
use crate::attributes::{Source, VertexAttributes};
use crate::seams::{Welded, coincident_vertices, weld};
use if_core::edges::NONE;
use if_core::mesh::TriMesh;
use std::collections::BTreeMap;

/// A mesh with seams, and the mesh in which they are closed.
pub(super) struct Seams {
    welded: Welded,
    /// For each vertex of the closed mesh its first one in the mesh before.
    first: Vec<u32>,
}

impl Seams {
    /// Those of `mesh`, whose manifold version is `work`; `None` if there are none.
    ///
    /// Sheets that are there twice stay as they are, seams included: closing them would make one
    /// sheet of both.
    pub(super) fn of(mesh: &TriMesh, work: &EditMesh, half_edges: &HalfEdges) -> Option<Self> {
        // Few vertices lie at a boundary: only if some of them coincide, all are compared.
        let starts = half_edges.boundary().map(|h| ends(&work.triangles, h)[0]);
        let mut border: Vec<u32> = starts.collect();
        border.sort_unstable();
        border.dedup();
        let border: Vec<_> = border.iter().map(|v| work.points[*v as usize]).collect();
        coincident_vertices(&border)?;
        let welded = weld(mesh).filter(|welded| welded.edges > 0 && welded.repeated == 0)?;
        let first = welded.first_of();
        Some(Self { welded, first })
    }

    /// The mesh with its seams closed.
    pub(super) fn closed(&self) -> &TriMesh {
        &self.welded.mesh
    }

    /// Number of edges that were closed.
    pub(super) fn edges(&self) -> usize {
        self.welded.edges
    }

    /// What was derived from the closed mesh, as derived from `mesh`: the corners of triangles that
    /// are still there have the vertices that they had, in the order of `mesh`. Others take the
    /// first of those at their places. Without properties, the seams stay closed. Also returns for each
    /// vertex that of the closed mesh, unless they stay.
    pub(super) fn reopened(
        &self,
        mesh: &TriMesh,
        derived: Derived,
        attributes: &VertexAttributes,
    ) -> (Derived, Option<Vec<u32>>) {
        let sources: Vec<Source> =
            derived.sources.iter().map(|s| self.in_terms_of_all(s)).collect();
        if attributes.properties().is_empty() {
            return (Derived { mesh: derived.mesh, sources }, None);
        }
        let before = self.corners_before(mesh);
        // Vertices with what they are copies of; new ones come last.
        let all = mesh.vertices().len() as u32;
        let corners = derived.mesh.triangles().iter().flat_map(|t| {
            let closed = t.map(|v| match &derived.sources[v as usize] {
                Source::Vertex(v) => *v,
                Source::Blend(_) => NONE,
            });
            let had = before.get(&sorted(closed));
            [0, 1, 2].map(|k| match (closed[k], had) {
                (NONE, _) => (all, t[k]),
                (v, Some(had)) => {
                    let same = had.iter().find(|o| self.welded.vertex_map[**o as usize] == v);
                    (*same.expect("the triangle has these vertices"), t[k])
                }
                (v, None) => (self.first[v as usize], t[k]),
            })
        });
        let corners: Vec<(u32, u32)> = corners.collect();
        let mut vertices = corners.clone();
        vertices.sort_unstable();
        vertices.dedup();
        let number = |corner: &(u32, u32)| {
            vertices.binary_search(corner).expect("each corner is among them") as u32
        };
        let numbers: Vec<u32> = corners.iter().map(number).collect();
        let triangles = numbers.as_chunks::<3>().0.to_vec();
        let points = vertices.iter().map(|(_, v)| derived.mesh.vertices()[*v as usize]).collect();
        let source = |&(o, v): &(u32, u32)| match o < all {
            true => Source::Vertex(o),
            false => sources[v as usize].clone(),
        };
        let mesh = TriMesh::new(points, triangles)
            .expect("positions are those of the derived mesh, and corners stay distinct");
        let sources = vertices.iter().map(source).collect();
        (Derived { mesh, sources }, Some(vertices.iter().map(|(_, v)| *v).collect()))
    }

    /// A source among vertices of the closed mesh, as one among all vertices.
    fn in_terms_of_all(&self, source: &Source) -> Source {
        let first = |v: u32| self.first[v as usize];
        match source {
            Source::Vertex(v) => Source::Vertex(first(*v)),
            Source::Blend(parts) => {
                Source::Blend(parts.iter().map(|(v, w)| (first(*v), *w)).collect())
            }
        }
    }

    /// The vertices of triangles at seams, by those in the closed mesh, sorted.
    fn corners_before(&self, mesh: &TriMesh) -> BTreeMap<[u32; 3], [u32; 3]> {
        let (closed, open) = (self.welded.mesh.triangles(), mesh.triangles());
        let mut before = BTreeMap::new();
        for (closed, open) in closed.iter().zip(open) {
            if (0..3).any(|k| self.first[closed[k] as usize] != open[k]) {
                before.entry(sorted(*closed)).or_insert(*open);
            }
        }
        before
    }
}

fn sorted(mut corners: [u32; 3]) -> [u32; 3] {
    corners.sort_unstable();
    corners
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attributes::{Column, Property};
    use crate::cleanup::{Cleaned, CleanupParams, SmoothParams, cleanup};
    use if_core::math::Point;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::tube;

    /// A tube of two halves that share no vertex, with a hole across one of the two seams, one end
    /// ragged, and a number of its half for each vertex.
    fn tube_in_halves() -> (TriMesh, VertexAttributes) {
        let whole = tube(0.1, 0.4, 40, 20, false);
        let is_gone = |t: &usize| (600..604).contains(t) || *t == 1;
        let triangles: Vec<[u32; 3]> = (0..whole.triangles().len())
            .filter(|t| !is_gone(t))
            .map(|t| whole.triangles()[t])
            .collect();
        let n = whole.vertices().len() as u32;
        let hole = whole.triangles()[600..604].as_flattened().iter();
        let middle =
            hole.map(|v| whole.vertices()[*v as usize].coords).sum::<if_core::math::Vector>();
        let turned = |p: &Point| p.x * middle.z - p.z * middle.x; // about the axis, y
        let is_right = |t: &[u32; 3]| {
            t.iter().map(|v| turned(&whole.vertices()[*v as usize])).sum::<f64>() > 0.0
        };
        let triangles = triangles.iter().map(|t| if is_right(t) { t.map(|v| v + n) } else { *t });
        let vertices = [whole.vertices(), whole.vertices()].concat();
        let loose = TriMesh::new(vertices, triangles.collect()).unwrap();
        let half = (0..2 * n).map(|v| f32::from(v >= n)).collect();
        let attributes = vec![Property::new("half", Column::F32(half))];
        let attributes = VertexAttributes::new(2 * n as usize, attributes).unwrap();
        let (used, _) = crate::cleanup::make_manifold(&loose); // without unused vertices
        (used.mesh, attributes.derive(&used.sources))
    }

    fn clean(mesh: &TriMesh, attributes: &VertexAttributes, params: &CleanupParams) -> Cleaned {
        cleanup(mesh, attributes, None, params, &mut Silent).unwrap()
    }

    #[test]
    fn seams_are_no_boundary_and_both_sides_keep_their_properties() {
        let (mesh, attributes) = tube_in_halves();
        let made = clean(&mesh, &attributes, &CleanupParams::default());
        let holes = &made.report.holes;
        assert_eq!((holes.filled.len(), holes.left.len(), holes.openings.len()), (1, 0, 2));
        assert!(made.report.seam_edges > 30 && made.report.components.kept.len() == 1);
        // As the whole tube, up to the vertices that are there twice.
        let closed = weld(&mesh).unwrap().mesh;
        let none = VertexAttributes::none(closed.vertices().len());
        let whole = clean(&closed, &none, &CleanupParams::default());
        let again = weld(&made.mesh).unwrap();
        let corners = |mesh: &TriMesh| -> Vec<_> {
            mesh.triangles().as_flattened().iter().map(|v| mesh.vertices()[*v as usize]).collect()
        };
        assert_eq!(corners(&again.mesh), corners(&whole.mesh));
        assert_eq!(whole.report.seam_edges, 0);
        // Corners of triangles that were there have the half that they had.
        let Column::F32(half) = &made.attributes.properties()[0].values else { panic!("as given") };
        let mut at_seam = 0;
        for t in made.mesh.triangles() {
            let [a, b, c] = t.map(|v| half[v as usize]);
            at_seam += usize::from(a != b || b != c);
        }
        assert!(at_seam <= 2 * holes.filled[0].triangles, "{at_seam} triangles of both halves");
    }

    #[test]
    fn what_needs_nothing_keeps_its_vertices_and_their_order() {
        let (mesh, attributes) = tube_in_halves();
        let first = clean(&mesh, &attributes, &CleanupParams::default());
        let second = clean(&first.mesh, &first.attributes, &CleanupParams::default());
        assert_eq!((&second.mesh, &second.attributes), (&first.mesh, &first.attributes));
    }

    #[test]
    fn without_properties_seams_stay_closed() {
        let (mesh, _) = tube_in_halves();
        let params =
            CleanupParams { fill: None, smooth: None::<SmoothParams>, ..CleanupParams::default() };
        let made = clean(&mesh, &VertexAttributes::none(mesh.vertices().len()), &params);
        assert_eq!(made.mesh, weld(&mesh).unwrap().mesh);
    }
}
