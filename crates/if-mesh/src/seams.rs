//! Welding of seams: boundary edges at the same positions, as exporters leave them where texture
//! coordinates or normals are discontinuous; of the sides of sheets that are there twice; and of parts that
//! are sewn on.

mod near;

pub use near::{NearSeams, near_seams};

use if_core::edges::{Edges, NONE};
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::union_find::UnionFind;

/// A mesh with its seams welded ([`weld`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Welded {
    /// The same triangles in the same order. Of the vertices of a seam at one position only the first
    /// is kept, and unused vertices are dropped.
    pub mesh: TriMesh,
    /// For each original vertex its vertex in `mesh`; [`NONE`] for unused vertices.
    pub vertex_map: Vec<u32>,
    /// Number of welded edges.
    pub edges: usize,
    /// Number of triangles at the positions of earlier ones, whose vertices became theirs.
    pub repeated: usize,
}

impl Welded {
    /// For each vertex of `mesh` the first original one.
    pub fn first_of(&self) -> Vec<u32> {
        let mut first = vec![NONE; self.mesh.vertices().len()];
        for (v, at) in self.vertex_map.iter().enumerate().rev().filter(|(_, at)| **at != NONE) {
            first[*at as usize] = v as u32;
        }
        first
    }

    /// Positions of the original vertices, from those of `mesh`; unused vertices keep their `original`
    /// ones.
    ///
    /// # Panics
    ///
    /// If the numbers of positions are not those of the vertices of `mesh` and of the original mesh.
    pub fn unweld(&self, welded: &[Point], original: &[Point]) -> Vec<Point> {
        assert_eq!(
            (welded.len(), original.len()),
            (self.mesh.vertices().len(), self.vertex_map.len()),
            "one position for each vertex"
        );
        // Without a move the original is kept, with the sign of its zeros.
        let at = |(v, original): (&u32, &Point)| match welded.get(*v as usize) {
            Some(p) if p != original => *p,
            _ => *original,
        };
        self.vertex_map.iter().zip(original).map(at).collect()
    }
}

/// Welds seams: two boundary edges whose ends have exactly the same positions, of consistently
/// oriented triangles, become one. So do the vertices of triangles at the same three positions, as of
/// cloth that is exported with a front and a back. Unused vertices are dropped. `None` if there is
/// nothing to do, which takes one pass over sorted positions.
///
/// Positions are compared exactly, so that hems that only come close are not welded. Edges where
/// more than two triangles would meet stay open, as do triangles with two corners at one position.
///
/// ```
/// use if_core::{math::Point, mesh::TriMesh};
/// // Two triangles of a square that share no vertex, and an unused vertex.
/// let v = [[0., 0.], [1., 0.], [0., 1.], [1., 0.], [1., 1.], [0., 1.], [5., 5.]].map(|[x, y]| Point::new(x, y, 0.));
/// let square = TriMesh::new(v.to_vec(), vec![[0, 1, 2], [3, 4, 5]])?;
/// let welded = if_mesh::seams::weld(&square).unwrap();
/// assert_eq!(welded.mesh.triangles(), [[0, 1, 2], [1, 3, 2]]);
/// assert!(if_mesh::seams::weld(&welded.mesh).is_none());
/// # Ok::<(), if_core::mesh::MeshError>(())
/// ```
pub fn weld(mesh: &TriMesh) -> Option<Welded> {
    welded(mesh, join)
}

/// Welds all vertices at one position, unless a triangle has two corners there: [`weld`], and also what is
/// sewn on with vertices of its own, as pockets, flaps and linings are, and seams whose sides are oriented
/// against each other. Edges of the welded mesh may have any number of triangles: it says what moves
/// together, and bounds no solid.
///
/// ```
/// use if_core::{math::Point, mesh::TriMesh};
/// // Three triangles at an edge, each with vertices of its own.
/// let v = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 0.], [1., 0., 0.], [0., -1., 0.],
///     [0., 0., 0.], [1., 0., 0.], [0., 0., 1.]].map(|p| Point::from(p));
/// let fin = TriMesh::new(v.to_vec(), vec![[0, 1, 2], [4, 3, 5], [6, 7, 8]])?;
/// assert!(if_mesh::seams::weld(&fin).is_none());
/// let welded = if_mesh::seams::weld_all(&fin).unwrap();
/// assert_eq!(welded.mesh.triangles(), [[0, 1, 2], [1, 0, 3], [0, 1, 4]]);
/// # Ok::<(), if_core::mesh::MeshError>(())
/// ```
pub fn weld_all(mesh: &TriMesh) -> Option<Welded> {
    welded(mesh, join_all)
}

/// Welds a mesh as a function of it and the first vertices at all positions joins its vertices.
fn welded(
    mesh: &TriMesh,
    join: impl Fn(&TriMesh, &[u32]) -> (Vec<u32>, usize, usize),
) -> Option<Welded> {
    let n = mesh.vertices().len();
    let used = mesh.used_vertices();
    let first_at = coincident_vertices(mesh.vertices());
    let all_used = used.iter().all(|u| *u);
    if first_at.is_none() && all_used {
        return None;
    }
    let (joined, edges, repeated) = match &first_at {
        Some(first_at) => join(mesh, first_at),
        None => ((0..n as u32).collect(), 0, 0),
    };
    if all_used && (0u32..).zip(&joined).all(|(v, first)| v == *first) {
        return None;
    }
    let (mut vertex_map, mut vertices) = (vec![NONE; n], Vec::with_capacity(n));
    for v in (0..n).filter(|v| used[*v]) {
        let first = joined[v] as usize; // itself, or an earlier vertex
        if first == v {
            vertex_map[v] = vertices.len() as u32;
            vertices.push(mesh.vertices()[v]);
        } else {
            vertex_map[v] = vertex_map[first];
        }
    }
    let triangles = mesh.triangles().iter().map(|t| t.map(|v| vertex_map[v as usize])).collect();
    let mesh = TriMesh::new(vertices, triangles)
        .expect("corners stay distinct, and positions are those of the input");
    Some(Welded { mesh, vertex_map, edges, repeated })
}

/// For each vertex the first vertex at the same position; `None` if all positions are distinct.
pub(crate) fn coincident_vertices(vertices: &[Point]) -> Option<Vec<u32>> {
    // The bits of a coordinate; both zeros are equal.
    let key = |v: &u32| [0, 1, 2].map(|k| (vertices[*v as usize][k] + 0.0).to_bits());
    let mut order: Vec<u32> = (0..vertices.len() as u32).collect();
    order.sort_unstable_by_key(|v| (key(v), *v));
    let mut first_at: Vec<u32> = (0..vertices.len() as u32).collect();
    let mut any = false;
    for run in order.chunk_by(|a, b| key(a) == key(b)).filter(|run| run.len() > 1) {
        any = true;
        run.iter().for_each(|v| first_at[*v as usize] = run[0]);
    }
    any.then_some(first_at)
}

/// A boundary edge with its triangle on the left: by the positions of its ends, then its direction.
/// Positions are numbered by their first vertices.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Border {
    /// Smaller number first.
    positions: [u32; 2],
    /// Whether it runs from the smaller number to the larger one.
    forward: bool,
    /// The vertices at the smaller and at the larger number.
    ends: [u32; 2],
    /// The position of the opposite corner.
    across: u32,
}

/// Joins the ends of coincident boundary edges, and the corners of coincident triangles: returns for each
/// vertex the first of its group, and the numbers of welded edges and of repeated triangles.
fn join(mesh: &TriMesh, first_at: &[u32]) -> (Vec<u32>, usize, usize) {
    let edges = Edges::new(mesh);
    let repeats = coincident_triangles(mesh, first_at);
    let mut is_repeated = vec![false; mesh.triangles().len()];
    repeats.iter().for_each(|(t, _)| is_repeated[*t as usize] = true);
    let mut borders = Vec::new();
    for (t, corners) in mesh.triangles().iter().enumerate().filter(|(t, _)| !is_repeated[*t]) {
        for k in 0..3 {
            let [a, b, c] = [0, 1, 2].map(|i| corners[(k + i) % 3]);
            let [from, to, across] = [a, b, c].map(|v| first_at[v as usize]);
            if edges.valence[edges.of_triangle[t][k] as usize] == 1
                && from != to
                && across != from
                && across != to
            {
                let forward = from < to;
                let (positions, ends) =
                    if forward { ([from, to], [a, b]) } else { ([to, from], [b, a]) };
                borders.push(Border { positions, forward, ends, across });
            }
        }
    }
    borders.sort_unstable();
    let mut joined = UnionFind::new(mesh.vertices().len());
    let mut welded = 0;
    for run in borders.chunk_by(|a, b| a.positions == b.positions) {
        if let [back, forth] = run
            && !back.forward
            && forth.forward
            && back.across != forth.across
        {
            welded += 1;
            (0..2).for_each(|k| joined.join(back.ends[k], forth.ends[k]));
        }
    }
    let mut repeated = 0;
    for (t, earlier) in repeats {
        let [corners, others] = [t, earlier].map(|t| mesh.triangles()[t as usize]);
        let mut is_new = false;
        for v in corners {
            let at_same = |u: &&u32| first_at[**u as usize] == first_at[v as usize];
            let other = *others.iter().find(at_same).expect("the positions are the same");
            is_new |= other != v;
            joined.join(v, other);
        }
        repeated += usize::from(is_new);
    }
    let joined = joined.into_firsts();
    // A needle at the seam may now have two corners in one vertex: such vertices stay separate.
    let separate: Vec<u32> = (0..joined.len() as u32).collect();
    (without_needles(mesh, joined, &separate), welded, repeated)
}

/// [`join`], and then all used vertices at one position.
fn join_all(mesh: &TriMesh, first_at: &[u32]) -> (Vec<u32>, usize, usize) {
    let used = mesh.used_vertices();
    let (sewn, edges, repeated) = join(mesh, first_at);
    let mut joined: Vec<u32> = (0..sewn.len() as u32).collect();
    let mut first_used = vec![NONE; sewn.len()];
    for v in (0..sewn.len()).filter(|v| used[*v]) {
        let first = &mut first_used[first_at[v] as usize];
        *first = (*first).min(v as u32);
        joined[v] = *first;
    }
    (without_needles(mesh, joined, &sewn), edges, repeated)
}

/// `joined`, but as they were `before` where a triangle would have two corners in one vertex.
fn without_needles(mesh: &TriMesh, mut joined: Vec<u32>, before: &[u32]) -> Vec<u32> {
    let mut separate = vec![false; joined.len()];
    for t in mesh.triangles() {
        let [a, b, c] = t.map(|v| joined[v as usize]);
        for (same, v) in [(a == b || a == c, a), (b == c, b)] {
            separate[v as usize] |= same;
        }
    }
    if separate.contains(&true) {
        let parted: Vec<usize> =
            (0..joined.len()).filter(|v| separate[joined[*v] as usize]).collect();
        parted.into_iter().for_each(|v| joined[v] = before[v]);
    }
    joined
}

/// The triangles whose three positions, all distinct, are those of an earlier one, and the first of these.
fn coincident_triangles(mesh: &TriMesh, first_at: &[u32]) -> Vec<(u32, u32)> {
    let places = |t: &u32| {
        let mut places = mesh.triangles()[*t as usize].map(|v| first_at[v as usize]);
        places.sort_unstable();
        places
    };
    // Only those with a corner at the position of another vertex can repeat one with other vertices.
    let mut is_shared = vec![false; first_at.len()];
    for (v, first) in first_at.iter().enumerate().filter(|(v, first)| *v != **first as usize) {
        (is_shared[v], is_shared[*first as usize]) = (true, true);
    }
    let mut list: Vec<u32> = (0..mesh.triangles().len() as u32).collect();
    list.retain(|t| mesh.triangles()[*t as usize].iter().all(|v| is_shared[*v as usize]));
    list.sort_unstable_by_key(|t| (places(t), *t));
    let runs = list.chunk_by(|a, b| places(a) == places(b));
    let distinct = runs.filter(|run| {
        let [a, b, c] = places(&run[0]);
        a != b && b != c
    });
    distinct.flat_map(|run| run[1..].iter().map(|t| (*t, run[0]))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::edges::part_count;
    use if_core::shapes::meshes::{icosphere, tube};

    /// Each triangle with vertices of its own.
    fn separated(mesh: &TriMesh) -> TriMesh {
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
    fn meshes_without_seams_are_not_changed() {
        for mesh in [icosphere(1.0, 2), tube(0.5, 1.0, 12, 4, false), TriMesh::default()] {
            assert_eq!(weld(&mesh), None);
        }
    }

    #[test]
    fn separated_triangles_are_welded_to_their_surface() {
        for mesh in [icosphere(1.0, 2), tube(0.5, 1.0, 12, 4, false)] {
            let loose = separated(&mesh);
            let welded = weld(&loose).unwrap();
            assert_eq!((part_count(&welded.mesh), borders(&welded.mesh)), (1, borders(&mesh)));
            assert_eq!(welded.mesh.vertices().len(), mesh.vertices().len());
            assert_eq!(welded.mesh.triangles().len(), mesh.triangles().len());
            // Moved vertices carry all original vertices at their position.
            let moved: Vec<Point> = welded.mesh.vertices().iter().map(|p| p * 2.0).collect();
            let unwelded = welded.unweld(&moved, loose.vertices());
            assert!(unwelded.iter().zip(loose.vertices()).all(|(q, p)| *q == p * 2.0));
        }
    }

    #[test]
    fn sheets_that_are_there_twice_get_the_same_vertices() {
        let sheet = tube(0.5, 1.0, 12, 4, false);
        let n = sheet.vertices().len() as u32;
        let twice = |turn: bool| {
            let second = sheet.triangles().iter().map(|t| {
                let [a, b, c] = t.map(|v| v + n);
                if turn { [a, c, b] } else { [b, c, a] }
            });
            let triangles = sheet.triangles().iter().copied().chain(second).collect();
            TriMesh::new([sheet.vertices(), sheet.vertices()].concat(), triangles).unwrap()
        };
        for turn in [true, false] {
            let both = twice(turn);
            let welded = weld(&both).unwrap();
            assert_eq!(welded.mesh.vertices(), sheet.vertices());
            assert_eq!((welded.edges, welded.repeated), (0, sheet.triangles().len()));
            assert_eq!(welded.mesh.triangles()[..sheet.triangles().len()], *sheet.triangles());
            let moved: Vec<Point> = sheet.vertices().iter().map(|p| p * 2.0).collect();
            let unwelded = welded.unweld(&moved, both.vertices());
            assert!(unwelded.iter().zip(both.vertices()).all(|(q, p)| *q == p * 2.0));
            assert_eq!(weld(&welded.mesh), None);
        }
    }

    #[test]
    fn what_is_sewn_on_is_welded_with_all_the_rest() {
        // A tube with a strip of its triangles lifted off, which shares the positions of one row of vertices.
        let sheet = tube(0.5, 1.0, 12, 4, false);
        let n = sheet.vertices().len() as u32;
        let strip: Vec<[u32; 3]> =
            sheet.triangles()[24..48].iter().map(|t| t.map(|v| v + n)).collect();
        let lifted = |p: &Point| if p.y < 0.3 { *p } else { Point::new(1.1 * p.x, p.y, 1.1 * p.z) };
        let vertices = sheet.vertices().iter().copied();
        let vertices = vertices.clone().chain(vertices.map(|p| lifted(&p))).collect();
        let mesh = TriMesh::new(vertices, [sheet.triangles(), &strip].concat()).unwrap();
        let apart = weld(&mesh).unwrap();
        let sewn = weld_all(&mesh).unwrap();
        assert_eq!(part_count(&apart.mesh), 2);
        assert_eq!(part_count(&sewn.mesh), 1);
        assert_eq!(sewn.mesh.vertices().len() + 12, apart.mesh.vertices().len());
        // Nothing but what lies at the same position moves together, and a second time there is nothing to do.
        let moved: Vec<Point> = sewn.mesh.vertices().iter().map(|p| p * 2.0).collect();
        let unwelded = sewn.unweld(&moved, mesh.vertices());
        let used = mesh.used_vertices();
        assert_eq!(apart.mesh.vertices().len(), used.iter().filter(|used| **used).count());
        assert!((0..used.len()).all(|v| !used[v] || unwelded[v] == mesh.vertices()[v] * 2.0));
        assert_eq!(weld_all(&sewn.mesh), None);
    }

    #[test]
    fn where_all_of_a_position_would_crush_a_needle_its_seam_stays_closed() {
        // Two triangles of a square with a seam, and one with two corners at one end of it.
        let v = [
            [0.0, 0.0],
            [1.0, 0.0],
            [0.0, 1.0],
            [1.0, 0.0],
            [1.0, 1.0],
            [0.0, 1.0],
            [1.0, 0.0],
            [2.0, 0.0],
        ];
        let v: Vec<Point> = v.map(|[x, y]| Point::new(x, y, 0.0)).to_vec();
        let mesh = TriMesh::new(v, vec![[0, 1, 2], [3, 4, 5], [6, 7, 1]]).unwrap();
        let sewn = weld_all(&mesh).unwrap();
        assert_eq!(sewn.vertex_map[1], sewn.vertex_map[3], "the seam");
        assert_ne!(sewn.vertex_map[6], sewn.vertex_map[1], "the needle");
    }

    #[test]
    fn inconsistently_oriented_sheets_are_not_welded() {
        let v: Vec<Point> = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 2.0]]
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
        assert_eq!(weld(&with(&[0, 1, 2, 1, 2, 3])), None, "against each other");
        assert_eq!(weld_all(&with(&[0, 1, 2, 1, 2, 3])).unwrap().mesh.vertices().len(), 4);
        assert_eq!(weld(&with(&[0, 1, 2, 1, 3, 2])).unwrap().edges, 1);
        assert_eq!(weld(&with(&[0, 1, 2, 1, 3, 2, 1, 4, 2])), None, "three triangles at an edge");
        // A seam of two sheets that are both there twice is one.
        let twice = weld(&with(&[0, 1, 2, 1, 3, 2, 0, 2, 1, 1, 2, 3])).unwrap();
        assert_eq!((twice.edges, twice.repeated, twice.mesh.vertices().len()), (1, 2, 4));
    }

    #[test]
    fn needles_keep_their_corners_and_unused_vertices_their_positions() {
        // Two triangles of a square, and a needle with two corners in one end of the seam.
        let v =
            [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [3.0, -0.0]];
        let v: Vec<Point> = v.map(|[x, y]| Point::new(x, y, 0.0)).to_vec();
        let mesh = TriMesh::new(v, vec![[0, 1, 2], [3, 4, 5], [1, 3, 0]]).unwrap();
        let welded = weld(&mesh).unwrap();
        assert_eq!(welded.vertex_map, [0, 1, 2, 3, 4, 2, NONE]);
        let unwelded = welded.unweld(welded.mesh.vertices(), mesh.vertices());
        assert!(
            unwelded
                .iter()
                .zip(mesh.vertices())
                .all(|(a, b)| a.coords.map(f64::to_bits) == b.coords.map(f64::to_bits))
        );
    }
}
