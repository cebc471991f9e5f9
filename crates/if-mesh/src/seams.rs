//! Seams: borders that lie in one place, as exporters leave them where texture coordinates or
//! normals jump.

use if_core::edges::{Edges, NONE};
use if_core::math::Point;
use if_core::mesh::TriMesh;

/// A mesh with its seams closed ([`sew`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Sewn {
    /// The same triangles in the same order. Of the vertices of a seam that stand in one place the
    /// first is left, and only vertices that triangles use.
    pub mesh: TriMesh,
    /// For each vertex that came the one of `mesh` in its place; [`NONE`] for one of no triangle.
    pub place: Vec<u32>,
    /// Edges that were closed.
    pub edges: usize,
}

impl Sewn {
    /// Positions for the mesh that came: those of its vertices in `mesh`, and `came` for those of
    /// no triangle.
    ///
    /// # Panics
    ///
    /// If `sewn` or `came` are not as many as the vertices of `mesh` or of the mesh that came.
    pub fn spread(&self, sewn: &[Point], came: &[Point]) -> Vec<Point> {
        assert_eq!(
            (sewn.len(), came.len()),
            (self.mesh.vertices().len(), self.place.len()),
            "one position for each vertex"
        );
        // Where nothing moved the sign of a zero stays, too.
        let at = |(place, came): (&u32, &Point)| match sewn.get(*place as usize) {
            Some(p) if p != came => *p,
            _ => *came,
        };
        self.place.iter().zip(came).map(at).collect()
    }
}

/// Closes seams: two boundary edges whose ends stand in exactly the same places, of triangles that
/// wind alike, become one. Vertices that no triangle uses are left out. `None` where there is
/// nothing to do, which is found out in one pass over sorted positions.
///
/// Positions are compared exactly, so that no hem is sewn to another that only comes near. Edges
/// where more than two triangles would meet stay open, as do both sides of a sheet that lies on
/// itself and triangles that have two corners in one place.
///
/// ```
/// use if_core::{math::Point, mesh::TriMesh};
/// // Two triangles of a square that share no vertex, and a vertex of no triangle.
/// let v = [[0., 0.], [1., 0.], [0., 1.], [1., 0.], [1., 1.], [0., 1.], [5., 5.]].map(|[x, y]| Point::new(x, y, 0.));
/// let square = TriMesh::new(v.to_vec(), vec![[0, 1, 2], [3, 4, 5]])?;
/// let sewn = if_mesh::seams::sew(&square).unwrap();
/// assert_eq!(sewn.mesh.triangles(), [[0, 1, 2], [1, 3, 2]]);
/// assert!(if_mesh::seams::sew(&sewn.mesh).is_none());
/// # Ok::<(), if_core::mesh::MeshError>(())
/// ```
pub fn sew(mesh: &TriMesh) -> Option<Sewn> {
    let n = mesh.vertices().len();
    let used = mesh.used_vertices();
    let spots = spots(mesh.vertices());
    let mut joined: Vec<u32> = (0..n as u32).collect();
    let edges = spots.as_ref().map_or(0, |spots| join(mesh, spots, &mut joined));
    if edges == 0 && used.iter().all(|u| *u) {
        return None;
    }
    let (mut place, mut vertices) = (vec![NONE; n], Vec::with_capacity(n));
    for v in (0..n).filter(|v| used[*v]) {
        let first = joined[v] as usize; // itself, or one that came before
        if first == v {
            place[v] = vertices.len() as u32;
            vertices.push(mesh.vertices()[v]);
        } else {
            place[v] = place[first];
        }
    }
    let triangles = mesh.triangles().iter().map(|t| t.map(|v| place[v as usize])).collect();
    let mesh = TriMesh::new(vertices, triangles)
        .expect("corners stay apart, and positions are those that came");
    Some(Sewn { mesh, place, edges })
}

/// For each vertex the first that stands in its place; `None` where none stands in that of another.
pub(crate) fn spots(vertices: &[Point]) -> Option<Vec<u32>> {
    // The bits of a coordinate; both zeros are one place.
    let key = |v: &u32| [0, 1, 2].map(|k| (vertices[*v as usize][k] + 0.0).to_bits());
    let mut order: Vec<u32> = (0..vertices.len() as u32).collect();
    order.sort_unstable_by_key(|v| (key(v), *v));
    let mut spots: Vec<u32> = (0..vertices.len() as u32).collect();
    let mut any = false;
    for run in order.chunk_by(|a, b| key(a) == key(b)).filter(|run| run.len() > 1) {
        any = true;
        run.iter().for_each(|v| spots[*v as usize] = run[0]);
    }
    any.then_some(spots)
}

/// A boundary edge with its triangle on the left: by the places of its ends, then its direction.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Border {
    /// Smaller place first.
    places: [u32; 2],
    /// Whether it runs from the smaller place to the larger one.
    forward: bool,
    /// At the smaller and at the larger place.
    ends: [u32; 2],
    /// The place of the corner across.
    across: u32,
}

/// Unites in `joined` the ends of boundary edges that lie in one place: each vertex names the first
/// of its group. Returns how many edges are closed.
fn join(mesh: &TriMesh, spots: &[u32], joined: &mut [u32]) -> usize {
    let edges = Edges::new(mesh);
    let mut borders = Vec::new();
    for (t, corners) in mesh.triangles().iter().enumerate() {
        for k in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|i| corners[(k + i) % 3]);
            let [from, to, across] = [a, b, c].map(|v| spots[v as usize]);
            if edges.valence[edges.of_triangle[t][k] as usize] == 1
                && from != to
                && across != from
                && across != to
            {
                let forward = from < to;
                let (places, ends) =
                    if forward { ([from, to], [a, b]) } else { ([to, from], [b, a]) };
                borders.push(Border { places, forward, ends, across });
            }
        }
    }
    borders.sort_unstable();
    fn first(joined: &mut [u32], mut v: u32) -> u32 {
        while joined[v as usize] != v {
            joined[v as usize] = joined[joined[v as usize] as usize];
            v = joined[v as usize];
        }
        v
    }
    let mut closed = 0;
    for run in borders.chunk_by(|a, b| a.places == b.places) {
        if let [back, forth] = run
            && !back.forward
            && forth.forward
            && back.across != forth.across
        {
            closed += 1;
            for k in 0..2 {
                let (a, b) = (first(joined, back.ends[k]), first(joined, forth.ends[k]));
                joined[a.max(b) as usize] = a.min(b);
            }
        }
    }
    (0..joined.len() as u32).for_each(|v| joined[v as usize] = first(joined, v));
    // A needle somewhere at the seam may have got two corners in one vertex: what meets there stays
    // apart.
    let mut apart = vec![false; joined.len()];
    for t in mesh.triangles() {
        let [a, b, c] = t.map(|v| joined[v as usize]);
        for (same, v) in [(a == b || a == c, a), (b == c, b)] {
            apart[v as usize] |= same;
        }
    }
    if apart.contains(&true) {
        (0..joined.len())
            .filter(|v| apart[joined[*v] as usize])
            .collect::<Vec<_>>()
            .into_iter()
            .for_each(|v| joined[v] = v as u32);
    }
    closed
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::edges::part_count;
    use if_core::shapes::meshes::{icosphere, tube};

    /// Each triangle with corners of its own.
    fn unsewn(mesh: &TriMesh) -> TriMesh {
        let vertices =
            mesh.triangles().as_flattened().iter().map(|v| mesh.vertices()[*v as usize]).collect();
        let triangles =
            (0..mesh.triangles().len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        TriMesh::new(vertices, triangles).unwrap()
    }

    fn borders(mesh: &TriMesh) -> usize {
        Edges::new(mesh).valence.iter().filter(|v| **v == 1).count()
    }

    #[test]
    fn what_has_no_seam_stays_as_it_is() {
        for mesh in [icosphere(1.0, 2), tube(0.5, 1.0, 12, 4, false), TriMesh::default()] {
            assert_eq!(sew(&mesh), None);
        }
    }

    #[test]
    fn loose_triangles_become_the_surface_they_came_from() {
        for mesh in [icosphere(1.0, 2), tube(0.5, 1.0, 12, 4, false)] {
            let loose = unsewn(&mesh);
            let sewn = sew(&loose).unwrap();
            assert_eq!((part_count(&sewn.mesh), borders(&sewn.mesh)), (1, borders(&mesh)));
            assert_eq!(sewn.mesh.vertices().len(), mesh.vertices().len());
            assert_eq!(sewn.mesh.triangles().len(), mesh.triangles().len());
            // Moved vertices go to all that stood in their place.
            let moved: Vec<Point> = sewn.mesh.vertices().iter().map(|p| p * 2.0).collect();
            let spread = sewn.spread(&moved, loose.vertices());
            assert!(spread.iter().zip(loose.vertices()).all(|(q, p)| *q == p * 2.0));
        }
    }

    #[test]
    fn sheets_that_lie_on_one_another_or_wind_against_each_other_are_not_sewn() {
        let v: Vec<Point> = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
            .map(|[x, y]| Point::new(x, y, 0.0))
            .to_vec();
        let with = |places: &[usize]| {
            let vertices = places.iter().map(|k| v[*k]).collect();
            TriMesh::new(
                vertices,
                (0..places.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
            )
            .unwrap()
        };
        assert_eq!(sew(&with(&[0, 1, 2, 0, 2, 1])), None, "front and back of one sheet");
        assert_eq!(sew(&with(&[0, 1, 2, 0, 1, 2])), None, "twice the same");
        assert_eq!(sew(&with(&[0, 1, 2, 1, 2, 3])), None, "against each other");
        assert_eq!(sew(&with(&[0, 1, 2, 1, 3, 2])).unwrap().edges, 1);
        assert_eq!(sew(&with(&[0, 1, 2, 1, 3, 2, 1, 3, 2])), None, "three triangles at an edge");
    }

    #[test]
    fn needles_keep_their_corners_and_strays_stay_where_they_are() {
        // Two triangles of a square, and a needle with two corners in one end of the seam.
        let v =
            [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [3.0, -0.0]];
        let v: Vec<Point> = v.map(|[x, y]| Point::new(x, y, 0.0)).to_vec();
        let mesh = TriMesh::new(v, vec![[0, 1, 2], [3, 4, 5], [1, 3, 0]]).unwrap();
        let sewn = sew(&mesh).unwrap();
        assert_eq!(sewn.place, [0, 1, 2, 3, 4, 2, NONE]);
        let spread = sewn.spread(sewn.mesh.vertices(), mesh.vertices());
        assert!(
            spread
                .iter()
                .zip(mesh.vertices())
                .all(|(a, b)| a.coords.map(f64::to_bits) == b.coords.map(f64::to_bits))
        );
    }
}
