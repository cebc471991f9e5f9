//! Struts: where no frame sees it, as behind what an open coat leaves free, the surface tangles, and comes out
//! as a lattice that hangs at the cloth.

use if_core::edges::{Edges, part_count, parts_by_edges};
use if_core::geodesic::Neighbours;
use if_core::math::{Point, Real, Vector, area_vector};
use if_core::mesh::TriMesh;
use if_mesh::cleanup::Around;
use std::collections::BTreeMap;

/// Area of an unseen patch for each tunnel through it up to which it is a lattice, in square metres: 7 cm
/// squared. Cloth that was not seen has a tunnel now and then.
const LATTICE: Real = 0.005;
/// Patches that are looked at, the largest ones.
const PATCHES: usize = 32;

/// The genus of a mesh, the sum of its parts: its Euler characteristic is 2 · parts − 2 · genus − boundary
/// loops.
pub(super) fn tunnels(mesh: &TriMesh) -> usize {
    let unused = mesh.used_vertices().iter().filter(|used| !**used).count();
    let (parts, vertices) = (part_count(mesh) - unused, mesh.vertices().len() - unused);
    let edges = Edges::new(mesh);
    let loops = edges.boundary_loops(mesh).len();
    let twice = (2 * parts + edges.vertices.len())
        .saturating_sub(vertices + mesh.triangles().len() + loops);
    twice / 2
}

/// The piece of a garment without the patches between unseen vertices that are lattices; `None` if none is. What one
/// of the `lines` leads through, as an arm through a cuff, remains: where the lattice reaches that far, all but its
/// end there goes.
pub(super) fn removed(piece: &TriMesh, seen: &[bool], lines: &[Vec<Point>]) -> Option<TriMesh> {
    let mut left = tunnels(piece);
    if left == 0 {
        return None;
    }
    let triangles = piece.triangles();
    let is_unseen = |t: &[u32; 3]| t.iter().all(|v| !seen[*v as usize]);
    let edges =
        triangles.iter().filter(|t| is_unseen(t)).flat_map(|[a, b, c]| [[*a, *b], [*a, *c]]);
    let part = parts_by_edges(edges, piece.vertices().len());
    let mut patches: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (k, t) in triangles.iter().enumerate().filter(|(_, t)| is_unseen(t)) {
        patches.entry(part[t[0] as usize]).or_default().push(k);
    }
    let mut patches: Vec<Vec<usize>> = patches.into_values().collect();
    patches.sort_by_key(|patch| std::cmp::Reverse(patch.len()));
    let mut kept = vec![true; triangles.len()];
    let of = |kept: &[bool]| {
        let rest = triangles.iter().zip(kept).filter(|(_, kept)| **kept).map(|(t, _)| *t);
        TriMesh::new(piece.vertices().to_vec(), rest.collect()).expect("a part of a mesh")
    };
    let ends = Ends::new(piece, lines);
    for patch in patches.iter().take(PATCHES) {
        if left == 0 {
            break;
        }
        let away: Vec<usize> = patch.iter().copied().filter(|k| !ends.is_near(*k)).collect();
        for part in [patch, &away] {
            let area: Real = part.iter().map(|k| area(piece, *k)).sum();
            if area > LATTICE * left as Real {
                continue; // however many tunnels lead through it
            }
            part.iter().for_each(|k| kept[*k] = false);
            let rest = of(&kept);
            let fewer = left.saturating_sub(tunnels(&rest));
            if fewer > 0 && area <= LATTICE * fewer as Real && ends.remain(&rest) {
                left -= fewer;
                break;
            }
            part.iter().for_each(|k| kept[*k] = true);
        }
    }
    kept.contains(&false).then(|| of(&kept))
}

/// How far along the cloth from the ends of a garment a triangle counts as near them, in metres.
const NEAR: Real = 0.025;
/// How much longer what a limb leads through may become.
const LONGER: Real = 1.15;

/// The ends of a garment: loops that a limb, the head or the trunk leads through.
struct Ends<'a> {
    lines: &'a [Vec<Point>],
    /// The lengths of the loops that each line leads through, in metres and ascending.
    lengths: Vec<Vec<Real>>,
    /// Whether each triangle is near one of them.
    near: Vec<bool>,
}

impl<'a> Ends<'a> {
    fn new(piece: &TriMesh, lines: &'a [Vec<Point>]) -> Self {
        let ends = loops_about(piece, lines).flat_map(|(_, walk)| walk);
        let neighbours = Neighbours::new(&Edges::new(piece), piece.vertices());
        let far = neighbours.distances(ends, NEAR);
        let is_near = |t: &[u32; 3]| t.iter().any(|v| far[*v as usize] <= NEAR);
        let near = piece.triangles().iter().map(is_near).collect();
        Self { lines, lengths: lengths(piece, lines), near }
    }

    fn is_near(&self, triangle: usize) -> bool {
        self.near[triangle]
    }

    /// Whether the lines lead through the same loops in `rest`, which is a part of the piece, as in all of it.
    fn remain(&self, rest: &TriMesh) -> bool {
        let are_same = |(now, then): (&Vec<Real>, &Vec<Real>)| {
            now.len() == then.len() && now.iter().zip(then).all(|(now, then)| *now <= LONGER * then)
        };
        lengths(rest, self.lines).iter().zip(&self.lengths).all(are_same)
    }
}

/// The lengths of the boundary loops that each line leads through, in metres and ascending.
fn lengths(mesh: &TriMesh, lines: &[Vec<Point>]) -> Vec<Vec<Real>> {
    let mut lengths = vec![Vec::new(); lines.len()];
    loops_about(mesh, lines).for_each(|(k, walk)| lengths[k].push(length(mesh, &walk)));
    lengths.iter_mut().for_each(|of_line| of_line.sort_by(Real::total_cmp));
    lengths
}

/// The boundary loops that lines lead through, each with the index of the line.
fn loops_about<'a>(
    mesh: &'a TriMesh,
    lines: &'a [Vec<Point>],
) -> impl Iterator<Item = (usize, Vec<u32>)> + 'a {
    let loops = Edges::new(mesh).boundary_loops(mesh);
    let about = |line: &Vec<Point>| Around { lines: vec![line.clone()], count: 0 };
    let lines: Vec<Around> = lines.iter().map(about).collect();
    loops.into_iter().flat_map(move |walk| {
        let corners: Vec<Point> = walk.iter().map(|v| mesh.vertices()[*v as usize]).collect();
        let sum = corners.iter().fold(Vector::zeros(), |sum, p| sum + p.coords);
        let middle = Point::from(sum / corners.len() as Real);
        let through = |k: &usize| lines[*k].leads_through(&corners, &middle);
        let led: Vec<usize> = (0..lines.len()).filter(through).collect();
        led.into_iter().map(move |k| (k, walk.clone()))
    })
}

fn length(mesh: &TriMesh, walk: &[u32]) -> Real {
    let x = |k: usize| mesh.vertices()[walk[k % walk.len()] as usize];
    (0..walk.len()).map(|k| (x(k + 1) - x(k)).norm()).sum()
}

fn area(mesh: &TriMesh, triangle: usize) -> Real {
    let [a, b, c] = mesh.corners(triangle);
    0.5 * area_vector(a, b, c).norm()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes::{icosphere, tube};

    #[test]
    fn tunnels_are_counted_beside_openings() {
        assert_eq!(tunnels(&icosphere(1.0, 2)), 0);
        let sleeve = tube(0.1, 0.4, 12, 5, false);
        assert_eq!((tunnels(&sleeve), part_count(&sleeve)), (0, 1));
        // Its ends meet: a ring, and beside it the sleeve.
        let last = sleeve.vertices().len() as u32 - 12;
        let joined = |v: u32| if v < last { v } else { v - last };
        let ring = sleeve.triangles().iter().map(|t| t.map(joined));
        let beside = sleeve.triangles().iter().map(|t| t.map(|v| v + last));
        let vertices = [&sleeve.vertices()[..last as usize], sleeve.vertices()].concat();
        let both = TriMesh::new(vertices, ring.chain(beside).collect()).unwrap();
        assert_eq!((tunnels(&both), part_count(&both)), (1, 2));
    }

    /// A square sheet of cells of 1 cm with two of a row missing, and a tube from one hole to the other below it.
    fn handle(n: u32, row: u32) -> (TriMesh, u32) {
        let at = |i: u32, j: u32| j * (n + 1) + i;
        let grid = (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j)));
        let place =
            |(i, j): (u32, u32)| Point::new(0.01 * Real::from(i), 0.0, 0.01 * Real::from(j));
        let mut vertices: Vec<Point> = grid.map(place).collect();
        let holes = [(1, row), (n - 2, row)];
        let cells = (0..n).flat_map(|j| (0..n).map(move |i| (i, j)));
        let quad = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
        let corners = |(i, j): (u32, u32)| [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
        let cells = cells.filter(|cell| !holes.contains(cell));
        let mut triangles: Vec<[u32; 3]> = cells.flat_map(|cell| quad(corners(cell))).collect();
        let seen = vertices.len() as u32;
        // Below each hole a ring, and between the rings a tube.
        let rings = holes.map(|hole| {
            let first = vertices.len() as u32;
            let below = corners(hole).map(|v| vertices[v as usize] - Vector::y() * 0.01);
            vertices.extend(below);
            (corners(hole), [0, 1, 2, 3].map(|k| first + k))
        });
        let mut join = |a: [u32; 4], b: [u32; 4]| {
            (0..4)
                .for_each(|k| triangles.extend(quad([a[(k + 1) % 4], a[k], b[k], b[(k + 1) % 4]])));
        };
        join(rings[0].0, rings[0].1);
        join(rings[1].1, rings[1].0);
        // Mirrored, as the one looks down and the other up.
        let mirrored = [3, 2, 1, 0].map(|k: usize| rings[1].1[k]);
        join(rings[0].1, mirrored);
        (TriMesh::new(vertices, triangles).unwrap(), seen)
    }

    #[test]
    fn unseen_lattices_are_removed_and_wide_unseen_cloth_is_not() {
        let (mesh, first) = handle(6, 1);
        assert_eq!(tunnels(&mesh), 1);
        let seen: Vec<bool> = (0..mesh.vertices().len() as u32).map(|v| v < first).collect();
        let rest = removed(&mesh, &seen, &[]).expect("a handle");
        assert_eq!(tunnels(&rest), 0);
        assert!(rest.triangles().len() < mesh.triangles().len());
        assert_eq!(removed(&mesh, &vec![true; seen.len()], &[]), None, "frames see it");
        assert_eq!(removed(&rest, &seen, &[]), None, "no tunnel");
        // Twenty times as large it is cloth.
        let large = mesh.with_vertices(mesh.vertices().iter().map(|p| p * 20.0).collect()).unwrap();
        assert_eq!(removed(&large, &seen, &[]), None);
    }

    #[test]
    fn a_lattice_that_reaches_a_cuff_does_not_take_it_along() {
        // A sheet with the handle, bent round an arm so that a side of it is a cuff beside the handle.
        let (n, row, radius) = (40, 8, 0.05);
        let (mesh, first) = handle(n, row);
        let around = |p: &Point| {
            let angle = p.x / (0.01 * Real::from(n)) * std::f64::consts::TAU;
            let r = radius + p.y;
            Point::new(p.z, r * angle.cos(), r * angle.sin())
        };
        // The sides that meet are the same vertices.
        let last = n + 1;
        let same = |v: u32| if v < last * last && v % last == n { v - n } else { v };
        let bent = mesh.vertices().iter().map(around).collect();
        let triangles = mesh.triangles().iter().map(|t| t.map(same)).collect();
        let sleeve = TriMesh::new(bent, triangles).unwrap();
        assert_eq!(tunnels(&sleeve), 1);
        let arm = vec![vec![Point::new(1.0, 0.0, 0.0), Point::new(-1.0, 0.0, 0.0)]];
        let cuff = |mesh: &TriMesh| -> Vec<Real> {
            loops_about(mesh, &arm).map(|(_, walk)| length(mesh, &walk)).collect()
        };
        let whole = cuff(&sleeve);
        assert_eq!(whole.len(), 2, "cuff and armhole");
        // No frame sees the handle and what lies between it and the cuff.
        let seen: Vec<bool> = (0..sleeve.vertices().len() as u32)
            .map(|v| v < first && !(v <= row * last + 2 && (1..=2).contains(&(v % last))))
            .collect();
        let rest = removed(&sleeve, &seen, &arm).expect("the handle");
        assert_eq!((tunnels(&rest), cuff(&rest)), (0, whole));
        let torn = removed(&sleeve, &seen, &[]).expect("the handle and a part of the cuff");
        assert_ne!(cuff(&torn), cuff(&rest));
    }
}
