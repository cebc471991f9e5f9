//! Validation of meshes, for errors and warnings about inputs: [`is_valid`], [`first_defect`], and
//! [`faults`] for all defects and warnings.

mod fault;

use fault::LISTED;
pub use fault::{Fault, Unit};

use crate::inverted::{InvertedPart, NO_VOLUME, inverted_part};
use crate::seams::{coincident_vertices, weld_all};
use if_core::edges::{Edges, VertexTriangles};
use if_core::math::{Point, Real, area_vector};
use if_core::mesh::TriMesh;
use if_core::union_find::UnionFind;
use std::collections::{HashMap, HashSet};

/// Whether the mesh has no defect ([`Fault::is_defect`]).
pub fn is_valid(mesh: &TriMesh) -> bool {
    first_defect(mesh).is_ok()
}

/// The first defect as an error.
///
/// # Errors
///
/// The first of [`faults`] that is a defect.
pub fn first_defect(mesh: &TriMesh) -> Result<(), Fault> {
    faults(mesh).into_iter().find(Fault::is_defect).map_or(Ok(()), Err)
}

/// Height over longest edge up to which a triangle counts as having no area. Rounding makes it 1e-13
/// for edges of 1 mm at 1 m from the origin: with a value ten times smaller such triangles would be
/// missed; with one ten times larger no real triangle counts as flat yet (1e-10 mm on 10 mm).
const FLAT: Real = 1e-12;

/// All defects and warnings of a mesh, each kind once. Empty for a valid mesh.
pub fn faults(mesh: &TriMesh) -> Vec<Fault> {
    let vertices = mesh.vertices().len();
    let mut found = Vec::new();
    if mesh.triangles().is_empty() {
        found.push(Fault::NoTriangles { vertices });
        return found;
    }
    let edges = Edges::new(mesh);
    let mut flat = Collected::default();
    for t in 0..mesh.triangles().len() {
        flat.push_if(is_flat(mesh.corners(t)), t as u32);
    }
    found.extend(flat.some().map(|(count, triangles)| Fault::ZeroArea { count, triangles }));

    let is_against = |e: usize| {
        let [a, b] = edges.triangles[e];
        edges.valence[e] == 2 && same_direction(mesh, edges.vertices[e], a, b)
    };
    let is_faulty = |e: &usize| edges.valence[*e] > 2 || is_against(*e);
    let faulty: Vec<usize> = (0..edges.vertices.len()).filter(is_faulty).collect();
    // Two that wind against one another and share no edge with a third have no fault at an edge.
    let is_back_to_back = |e: usize| {
        let other =
            |t: u32| mesh.triangles()[t as usize].iter().find(|v| !edges.vertices[e].contains(v));
        edges.valence[e] == 2 && other(edges.triangles[e][0]) == other(edges.triangles[e][1])
    };
    let may_repeat = !faulty.is_empty() || (0..edges.vertices.len()).any(is_back_to_back);
    let repeated = if may_repeat { repeats(mesh.triangles()) } else { Vec::new() };
    // Of each edge the triangles that repeat others: without them it may have no fault.
    let mut again: HashMap<u32, u32> = HashMap::new();
    for e in repeated.iter().flat_map(|t| edges.of_triangle[*t as usize]) {
        *again.entry(e).or_default() += 1;
    }
    let mut listed = Collected::default();
    repeated.into_iter().for_each(|t| listed.push_if(true, t));
    found.extend(listed.some().map(|(count, triangles)| Fault::Repeated { count, triangles }));
    let (mut fins, mut against) = (Collected::default(), Collected::default());
    for e in faulty {
        let again = again.get(&(e as u32)).copied().unwrap_or(0);
        fins.push_if(edges.valence[e] - again > 2, edges.vertices[e]);
        against.push_if(again == 0 && is_against(e), edges.vertices[e]);
    }
    let closed = edges.valence.iter().all(|v| *v == 2) && against.count == 0;
    found.extend(fins.some().map(|(count, edges)| Fault::NonManifold { count, edges }));
    found.extend(against.some().map(|(count, edges)| Fault::Winding { count, edges }));
    let volume = mesh.signed_volume();
    if closed && volume < -NO_VOLUME * mesh.area().powf(1.5) {
        found.push(Fault::InsideOut { volume });
    } else if let Some(InvertedPart { triangle, triangles, volume }) =
        closed.then(|| inverted_part(mesh)).flatten()
    {
        found.push(Fault::PartInsideOut { triangle, triangles, volume });
    }

    let mut ties = Collected::default();
    not_of_seams(mesh, bow_ties(mesh, &edges)).into_iter().for_each(|v| ties.push_if(true, v));
    found.extend(ties.some().map(|(count, vertices)| Fault::BowTies { count, vertices }));
    let mut duplicates = Collected::default();
    duplicated(mesh.vertices()).for_each(|v| duplicates.push_if(true, v));
    found.extend(duplicates.some().map(|(count, vertices)| Fault::Duplicates { count, vertices }));
    let mut used = vec![false; vertices];
    mesh.triangles().as_flattened().iter().for_each(|&v| used[v as usize] = true);
    let mut unused = Collected::default();
    used.iter().enumerate().for_each(|(v, used)| unused.push_if(!used, v as u32));
    found.extend(unused.some().map(|(count, vertices)| Fault::Unused { count, vertices }));
    found.extend(suspicious_units(mesh));
    found
}

/// [`Fault::Units`] where the longest side of the box suggests that the mesh, a body or a whole garment,
/// is not in metres. Bodies in metres are 0.4 to 2.5 high; anything from a glove to a train passes.
pub fn suspicious_units(mesh: &TriMesh) -> Option<Fault> {
    let height = mesh.surface_aabb().size().amax();
    let unit = match height {
        h if (100.0..=250.0).contains(&h) => Unit::Centimetres,
        h if (800.0..=2500.0).contains(&h) => Unit::Millimetres,
        h if h > 10.0 || (h > 0.0 && h < 0.02) => Unit::Unknown,
        _ => return None,
    };
    Some(Fault::Units { height, unit })
}

pub(crate) fn is_flat([a, b, c]: [&Point; 3]) -> bool {
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    area_vector(a, b, c).norm() <= FLAT * longest
}

/// Triangles with the corners of an earlier one, in any order, ascending.
pub(crate) fn repeats(triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut seen = HashSet::new();
    let corners = triangles.iter().map(|t| {
        let mut corners = *t;
        corners.sort_unstable();
        corners
    });
    (0u32..).zip(corners).filter(|(_, corners)| !seen.insert(*corners)).map(|(t, _)| t).collect()
}

/// Whether both triangles traverse the edge in the same direction.
fn same_direction(mesh: &TriMesh, ends: [u32; 2], a: u32, b: u32) -> bool {
    let forward = |t: u32| {
        let tri = mesh.triangles()[t as usize];
        (0..3).any(|k| [tri[k], tri[(k + 1) % 3]] == ends)
    };
    forward(a) == forward(b)
}

/// Vertices in which several fans of triangles meet, ascending: the surface is not manifold there,
/// although its edges may be. Triangles at an edge of three or more count as one fan.
pub fn bow_ties(mesh: &TriMesh, edges: &Edges) -> Vec<u32> {
    let fans = VertexTriangles::new(mesh);
    let mut around_vertex = UnionFind::default();
    let mut found = Vec::new();
    for v in 0..mesh.vertices().len() {
        let around = fans.of(v);
        around_vertex.reset(around.len());
        let mut ends: Vec<(u32, u32)> = Vec::with_capacity(2 * around.len());
        for (k, t) in (0..).zip(around) {
            let at_vertex = edges.of_triangle[*t as usize]
                .into_iter()
                .filter(|e| edges.vertices[*e as usize].contains(&(v as u32)));
            ends.extend(at_vertex.map(|e| (e, k)));
        }
        ends.sort_unstable();
        for pair in ends.windows(2).filter(|p| p[0].0 == p[1].0) {
            around_vertex.join(pair[0].1, pair[1].1);
        }
        if around_vertex.count() > 1 {
            found.push(v as u32);
        }
    }
    found
}

/// Those [bow ties](bow_ties) in which fans meet also once seams are closed: where texture coordinates split
/// vertices, parts of one fan share a vertex, and others have twins of it.
fn not_of_seams(mesh: &TriMesh, ties: Vec<u32>) -> Vec<u32> {
    if ties.is_empty() {
        return ties;
    }
    let Some(welded) = weld_all(mesh) else { return ties };
    let left: HashSet<u32> =
        bow_ties(&welded.mesh, &Edges::new(&welded.mesh)).into_iter().collect();
    let is_left = |v: &u32| left.contains(&welded.vertex_map[*v as usize]);
    ties.into_iter().filter(is_left).collect()
}

/// Vertices at the position of one of smaller index, ascending.
fn duplicated(vertices: &[Point]) -> impl Iterator<Item = u32> {
    let first = coincident_vertices(vertices).unwrap_or_default();
    (0u32..).zip(first).filter(|(v, first)| v != first).map(|(v, _)| v)
}

/// A count and the first few.
struct Collected<T> {
    count: usize,
    first: Vec<T>,
}

impl<T> Default for Collected<T> {
    fn default() -> Self {
        Self { count: 0, first: Vec::new() }
    }
}

impl<T> Collected<T> {
    fn push_if(&mut self, condition: bool, item: T) {
        if condition {
            self.count += 1;
            if self.first.len() < LISTED {
                self.first.push(item);
            }
        }
    }

    fn some(self) -> Option<(usize, Vec<T>)> {
        (self.count > 0).then_some((self.count, self.first))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron(scale: Real) -> TriMesh {
        let v = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let v = v.map(|p| Point::from(p) * scale).to_vec();
        TriMesh::new(v, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap()
    }

    fn messages(mesh: &TriMesh) -> Vec<String> {
        faults(mesh).iter().map(Fault::to_string).collect()
    }

    #[test]
    fn a_valid_mesh_has_no_fault() {
        assert!(faults(&tetrahedron(1.7)).is_empty() && is_valid(&tetrahedron(1.7)));
    }

    #[test]
    fn an_inside_out_surface_is_distinguished_from_an_inconsistent_one() {
        let good = tetrahedron(1.0);
        let flipped = |which: &[usize]| {
            let mut t = good.triangles().to_vec();
            which.iter().for_each(|&k| t[k].swap(0, 1));
            TriMesh::new(good.vertices().to_vec(), t).unwrap()
        };
        assert!(matches!(faults(&flipped(&[0, 1, 2, 3]))[..], [Fault::InsideOut { .. }]));
        let fault = first_defect(&flipped(&[3])).unwrap_err();
        assert!(matches!(fault, Fault::Winding { count: 3, .. }), "{fault}");
        assert!(fault.to_string().contains("1–2"), "{fault}");
    }

    #[test]
    fn each_kind_of_fault_is_reported_once() {
        let mut v = tetrahedron(1.0).vertices().to_vec();
        let mut t = tetrahedron(1.0).triangles().to_vec();
        v.extend([
            Point::new(2.0, 2.0, 2.0),
            Point::new(-0.0, 0.0, 0.0),
            Point::new(0.5, 0.0, 0.0),
            Point::new(5.0, 5.0, 5.0),
        ]);
        t.extend([[0, 1, 4], [0, 1, 6]]);
        let mesh = TriMesh::new(v, t).unwrap();
        assert_eq!(
            faults(&mesh),
            [
                Fault::ZeroArea { count: 1, triangles: vec![5] },
                Fault::NonManifold { count: 1, edges: vec![[0, 1]] },
                Fault::Duplicates { count: 1, vertices: vec![5] },
                Fault::Unused { count: 2, vertices: vec![5, 7] },
            ]
        );
        assert!(!is_valid(&mesh));
    }

    #[test]
    fn triangles_that_repeat_others_are_named_instead_of_their_edges() {
        let one = tetrahedron(1.0);
        let with = |more: &[[u32; 3]]| {
            let all = [one.triangles(), more].concat();
            TriMesh::new(one.vertices().to_vec(), all).unwrap()
        };
        let found = faults(&with(&[[3, 1, 0], [1, 0, 2]]));
        assert_eq!(found, [Fault::Repeated { count: 2, triangles: vec![4, 5] }]);
        assert!(found[0].to_string().contains("(4, 5); drop them"), "{}", found[0]);
        // Alone its edges have two triangles, as they should.
        let v = one.vertices()[..3].to_vec();
        let twice = TriMesh::new(v, vec![[0, 1, 2], [1, 2, 0]]).unwrap();
        assert_eq!(
            first_defect(&twice).unwrap_err(),
            Fault::Repeated { count: 1, triangles: vec![1] }
        );
        // Nor has an edge a fault of two that wind against one another.
        let back = TriMesh::new(twice.vertices().to_vec(), vec![[0, 1, 2], [1, 0, 2]]).unwrap();
        assert_eq!(faults(&back)[0], Fault::Repeated { count: 1, triangles: vec![1] });
    }

    #[test]
    fn bow_ties_are_found() {
        // Two tetrahedra with a common tip, and two triangles that touch there too.
        let one = tetrahedron(1.0);
        let mut v = one.vertices().to_vec();
        v.extend(one.vertices()[1..].iter().map(|p| -p));
        v.extend([Point::new(5.0, 0.0, 0.1), Point::new(5.0, 1.0, 0.1)]);
        let other = |v: u32| if v == 0 { 0 } else { v + 3 };
        let mut t = one.triangles().to_vec();
        t.extend(one.triangles().iter().map(|t| [other(t[0]), other(t[2]), other(t[1])]));
        let tied = TriMesh::new(v.clone(), t.clone()).unwrap();
        assert_eq!(
            faults(&tied),
            [
                Fault::BowTies { count: 1, vertices: vec![0] },
                Fault::Unused { count: 2, vertices: vec![7, 8] }
            ]
        );
        assert!(is_valid(&tied), "a warning, no defect");
        t.push([0, 7, 8]);
        let three = TriMesh::new(v, t).unwrap();
        assert_eq!(bow_ties(&three, &Edges::new(&three)), [0]);
        assert!(bow_ties(&one, &Edges::new(&one)).is_empty());
    }

    #[test]
    fn parts_of_a_fan_that_seams_split_are_no_bow_tie() {
        // Four triangles round a vertex, of which two that lie across from one another have a twin of it.
        let ring = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)];
        let at = |k: usize| Point::new(ring[k % 4].0, ring[k % 4].1, 0.0);
        let mut v = vec![Point::origin(); 2];
        v.extend((0..4).flat_map(|k| [at(k), at(k + 1)]));
        let t = [0, 1, 2, 3].map(|k: u32| [k % 2, 2 + 2 * k, 3 + 2 * k]);
        let split = TriMesh::new(v.clone(), t.to_vec()).unwrap();
        assert_eq!(bow_ties(&split, &Edges::new(&split)), [0, 1]);
        let is_tied = |mesh: &TriMesh| {
            faults(mesh).iter().any(|fault| matches!(fault, Fault::BowTies { .. }))
        };
        assert!(!is_tied(&split));
        // Without the others no edge joins the two.
        let apart = TriMesh::new(v, vec![t[0], t[2]]).unwrap();
        assert!(is_tied(&apart));
    }

    #[test]
    fn other_units_are_detected() {
        assert_eq!(
            messages(&tetrahedron(1740.0)),
            ["1,740 units high: likely millimetres; scale by 0.001"]
        );
        assert_eq!(
            messages(&tetrahedron(173.2)),
            ["173 units high: likely centimetres; scale by 0.01"]
        );
        assert_eq!(
            messages(&tetrahedron(68.0)),
            ["68.000 units high: not metres; scale it to metres"]
        );
        for metres in [0.25, 0.4, 1.0, 1.9, 2.5] {
            assert!(is_valid(&tetrahedron(metres)) && messages(&tetrahedron(metres)).is_empty());
        }
        assert!(is_valid(&tetrahedron(1740.0)), "a warning, no defect");
    }

    #[test]
    fn degenerate_meshes_have_faults_and_never_panic() {
        assert_eq!(messages(&TriMesh::default()), ["there are no triangles (0 vertices)"]);
        let point = TriMesh::new(vec![Point::origin(); 3], vec![[0, 1, 2]]).unwrap();
        assert!(matches!(
            faults(&point)[..],
            [Fault::ZeroArea { .. }, Fault::Duplicates { count: 2, .. }]
        ));
        // A sheet folded onto itself is closed and encloses nothing, so it is not inside out.
        let v = tetrahedron(1.0).vertices()[..3].to_vec();
        let folded = TriMesh::new(v, vec![[0, 1, 2], [0, 2, 1]]).unwrap();
        assert_eq!(faults(&folded), [Fault::Repeated { count: 1, triangles: vec![1] }]);
        assert_eq!(fault::thousands(1_234_567.8), "1,234,568");
    }
}
