//! Manifold, consistently oriented surfaces: non-manifold edges cut, bow-ties split.

use super::degenerate::remove_degenerate;
use super::edit_mesh::{Derived, EditMesh};
use super::half_edges::{HalfEdges, NONE, ends, previous};
use super::report::ManifoldReport;
use if_core::math::{Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use std::cmp::Ordering;

/// Makes `mesh` manifold and consistently oriented, without moving a vertex: at most two triangles
/// at an edge, one fan at a vertex, no triangle of zero area, no duplicates, no unused vertices.
///
/// Where more than two triangles meet at an edge, they are paired, the flattest pair first, and the
/// surface is cut between pairs. Where several fans meet in one vertex, each gets a copy of it. A
/// mesh that is manifold already is returned bit by bit.
///
/// # Source
///
/// Cutting and vertex copies after Guéziec et al. 2001, *Cutting and Stitching*.
pub fn make_manifold(mesh: &TriMesh) -> (Derived, ManifoldReport) {
    let mut work = EditMesh::new(mesh);
    let (report, _) = make_manifold_in_place(&mut work);
    (work.finish(), report)
}

/// [`make_manifold`] in place; also returns the half-edges of the result.
pub(super) fn make_manifold_in_place(work: &mut EditMesh) -> (ManifoldReport, HalfEdges) {
    let (degenerate, mut half_edges) = remove_degenerate(work);
    let mut report = ManifoldReport { degenerate, ..ManifoldReport::default() };
    if !half_edges.inconsistent.is_empty() {
        report.reoriented = orient(work, &half_edges);
        half_edges = HalfEdges::new(work.points.len(), &work.triangles);
        report.non_orientable_edges = half_edges.inconsistent.len();
    }
    report.non_manifold_edges = half_edges.non_manifold.len();
    loop {
        let cut = !half_edges.non_manifold.is_empty() || !half_edges.inconsistent.is_empty();
        pair_at_non_manifold_edges(work, &mut half_edges);
        report.split_vertices += split_fans(work, &half_edges, 0..3 * work.triangles.len() as u32);
        if !cut {
            break;
        }
        half_edges = HalfEdges::new(work.points.len(), &work.triangles);
        // Sheets that stay connected around both ends of a cut edge are dropped.
        let left: Vec<u32> = half_edges
            .non_manifold
            .iter()
            .flat_map(|c| &c[1..])
            .chain(half_edges.inconsistent.iter().map(|a| &a[1]))
            .copied()
            .collect();
        if left.is_empty() {
            break;
        }
        let mut gone: Vec<u32> = left.iter().map(|h| h / 3).collect();
        gone.sort_unstable();
        gone.dedup();
        work.remove(&gone);
        report.dropped += gone.len();
        half_edges = HalfEdges::new(work.points.len(), &work.triangles);
    }
    report.unused_vertices = work.compact();
    (report, half_edges)
}

/// Reorients triangles so that neighbours agree, in each component those of the smaller total area.
/// Returns how many.
fn orient(work: &mut EditMesh, half_edges: &HalfEdges) -> usize {
    let n = work.triangles.len();
    let mut against = vec![NONE; 3 * n];
    for &[g, h] in &half_edges.inconsistent {
        against[g as usize] = h;
        against[h as usize] = g;
    }
    let mut side: Vec<Option<bool>> = vec![None; n];
    let mut turned = 0;
    for seed in 0..n {
        if side[seed].is_some() {
            continue;
        }
        side[seed] = Some(false);
        let mut part = vec![seed];
        let mut areas = [0.0; 2];
        let mut at = 0;
        while at < part.len() {
            let t = part[at];
            let mine = side[t] == Some(true);
            areas[usize::from(mine)] += work.area(t);
            for h in 3 * t..3 * t + 3 {
                for (neighbour, other) in [(half_edges.twin[h], mine), (against[h], !mine)] {
                    let u = neighbour as usize / 3;
                    if neighbour != NONE && side[u].is_none() {
                        side[u] = Some(other);
                        part.push(u);
                    }
                }
            }
            at += 1;
        }
        let wrong = areas[1] <= areas[0];
        for t in part.into_iter().filter(|t| side[*t] == Some(wrong)) {
            work.triangles[t].swap(1, 2);
            turned += 1;
        }
    }
    turned
}

/// Pairs the half-edges of non-manifold edges: one of each direction, those whose triangles
/// continue each other flattest first.
fn pair_at_non_manifold_edges(work: &EditMesh, half_edges: &mut HalfEdges) {
    let HalfEdges { twin, non_manifold, .. } = half_edges;
    for run in non_manifold.iter() {
        let away: Vec<Vector> = run.iter().map(|&h| across(work, h)).collect();
        let starts: Vec<u32> = run.iter().map(|&h| ends(&work.triangles, h)[0]).collect();
        let mut is_free: Vec<bool> = run.iter().map(|&h| twin[h as usize] == NONE).collect();
        // Memory for all pairs would grow with the square of the run.
        let flattest = |is_free: &[bool], i: usize| {
            let others = if is_free[i] { i + 1..run.len() } else { 0..0 };
            let others = others.filter(|j| is_free[*j] && starts[i] != starts[*j]);
            others.map(|j| (away[i].dot(&away[j]), i, j)).min_by(flatter)
        };
        let mut best: Vec<_> = (0..run.len()).map(|i| flattest(&is_free, i)).collect();
        while let Some((_, i, j)) = best.iter().flatten().copied().min_by(flatter) {
            if !is_free[i] || !is_free[j] {
                // The next best of this one is no flatter: it waits until nothing is.
                best[i] = flattest(&is_free, i);
                continue;
            }
            let (g, h) = (run[i], run[j]);
            twin[g as usize] = h;
            twin[h as usize] = g;
            (is_free[i], is_free[j], best[i]) = (false, false, None);
        }
    }
}

/// Pairs of half-edges, the flattest first.
fn flatter(a: &(Real, usize, usize), b: &(Real, usize, usize)) -> Ordering {
    a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2)))
}

/// The unit vector in the triangle of `h` that points away from that edge; zero if undefined.
fn across(work: &EditMesh, h: u32) -> Vector {
    let [a, b] = ends(&work.triangles, h).map(|v| work.points[v as usize]);
    let c = work.points[ends(&work.triangles, previous(h))[0] as usize];
    let along = unit_or_zero(&(b - a));
    let to = c - a;
    unit_or_zero(&(to - along * along.dot(&to)))
}

/// Removes triangles from a manifold mesh and keeps it manifold: where several fans meet in a vertex
/// afterwards, each gets a copy of it. `gone` is ascending. Vertices of no triangle stay.
pub(super) fn remove_triangles(
    work: &mut EditMesh,
    half_edges: &HalfEdges,
    gone: &[u32],
) -> HalfEdges {
    // Half-edges that leave the vertices of the removed triangles, and stay, renumbered.
    let mut outgoing = Vec::new();
    gone.iter()
        .for_each(|t| (3 * t..3 * t + 3).for_each(|h| half_edges.around(h, |g| outgoing.push(g))));
    outgoing.sort_unstable();
    outgoing.dedup();
    let mut before = 0;
    outgoing.retain_mut(|h| {
        while before < gone.len() && gone[before] < *h / 3 {
            before += 1;
        }
        let stays = gone.get(before) != Some(&(*h / 3));
        *h -= 3 * before as u32;
        stays
    });
    let half_edges = half_edges.without(gone);
    work.remove(gone);
    split_fans(work, &half_edges, outgoing);
    half_edges
}

/// Gives each fan of triangles its own vertex; the fan of the first triangle keeps the old one.
/// `outgoing` are the half-edges that leave the vertices in question, ascending. Returns how many
/// vertices were added.
fn split_fans(
    work: &mut EditMesh,
    half_edges: &HalfEdges,
    outgoing: impl IntoIterator<Item = u32>,
) -> usize {
    let mut seen = vec![false; 3 * work.triangles.len()];
    let mut taken = vec![false; work.points.len()];
    let mut added = 0;
    let mut fan = Vec::new();
    for h in outgoing {
        if seen[h as usize] {
            continue;
        }
        half_edges.around(h, |g| seen[g as usize] = true);
        let v = work.triangles[h as usize / 3][h as usize % 3];
        if !std::mem::replace(&mut taken[v as usize], true) {
            continue;
        }
        fan.clear();
        half_edges.around(h, |g| fan.push(g));
        let new = work.add_copy(v);
        taken.push(true);
        fan.iter().for_each(|&g| work.triangles[g as usize / 3][g as usize % 3] = new);
        added += 1;
    }
    added
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attributes::Source;
    use crate::validate::{Fault, faults};
    use if_core::math::Point;
    use if_core::shapes::meshes::icosphere;

    fn mesh(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> TriMesh {
        TriMesh::new(points.iter().map(|p| Point::from(*p)).collect(), triangles.to_vec()).unwrap()
    }

    #[test]
    fn a_manifold_mesh_is_returned_bit_by_bit() {
        let ball = icosphere(0.3, 3);
        let (same, report) = make_manifold(&ball);
        assert_eq!(same.mesh, ball);
        assert!(report.is_empty() && same.sources[7] == Source::Vertex(7));
    }

    #[test]
    fn a_bow_tie_gets_a_vertex_for_each_fan() {
        let tie = mesh(
            &[[0., 0., 0.], [1., 1., 0.], [1., -1., 0.], [-1., 1., 0.], [-1., -1., 0.]],
            &[[0, 2, 1], [0, 3, 4]],
        );
        let (split, report) = make_manifold(&tie);
        assert_eq!((report.split_vertices, split.mesh.vertices().len()), (1, 6));
        assert_eq!(split.sources[5], Source::Vertex(0));
        assert_eq!(split.mesh.triangles(), [[0, 2, 1], [5, 3, 4]]);
    }

    #[test]
    fn at_a_fin_the_flat_sheet_stays_connected() {
        let fin = mesh(
            &[[0., 0., 0.], [0., 1., 0.], [1., 0., 0.], [-1., 0., 0.], [0., 0., 1.]],
            &[[0, 1, 4], [1, 0, 2], [0, 1, 3]],
        );
        let (cut, report) = make_manifold(&fin);
        assert_eq!((report.non_manifold_edges, report.split_vertices, report.dropped), (1, 2, 0));
        let half_edges = HalfEdges::of_mesh(&cut.mesh);
        assert!(half_edges.non_manifold.is_empty());
        assert_eq!(half_edges.twin[3], 6, "the two flat ones are neighbours");
        assert_eq!(half_edges.twin[0], NONE);
    }

    #[test]
    fn pages_of_a_book_are_paired_as_by_a_sorted_list_of_all_pairs() {
        let mut points = vec![[0., 0., 0.], [0., 0., 1.]];
        points.extend((1..=60).map(|k| {
            let a = 2.4 * f64::from(k * k % 61);
            [a.cos(), a.sin(), 0.5]
        }));
        // Some lie on others.
        points.extend_from_within(10..20);
        let page = |v: u32| if v.is_multiple_of(3) { [0, 1, v] } else { [1, 0, v] };
        let book = mesh(&points, &(2..72).map(page).collect::<Vec<_>>());
        let work = EditMesh::new(&book);
        let mut half_edges = HalfEdges::of_mesh(&book);
        let [run] = &half_edges.non_manifold[..] else { panic!("one edge") };
        let mut pairs: Vec<(Real, usize, usize)> = Vec::new();
        for (i, j) in (0..70).flat_map(|i| (i + 1..70).map(move |j| (i, j))) {
            if ends(book.triangles(), run[i])[0] != ends(book.triangles(), run[j])[0] {
                pairs.push((across(&work, run[i]).dot(&across(&work, run[j])), i, j));
            }
        }
        pairs.sort_by(flatter);
        let mut twin = half_edges.twin.clone();
        for (_, i, j) in pairs {
            let (g, h) = (run[i] as usize, run[j] as usize);
            if twin[g] == NONE && twin[h] == NONE {
                (twin[g], twin[h]) = (h as u32, g as u32);
            }
        }
        pair_at_non_manifold_edges(&work, &mut half_edges);
        assert_eq!(half_edges.twin, twin);
        assert!(twin.iter().filter(|h| **h != NONE).count() >= 40);
    }

    #[test]
    fn triangles_of_opposite_orientation_are_reoriented() {
        let good = icosphere(0.1, 1);
        let mut t = good.triangles().to_vec();
        [3, 17, 40].into_iter().for_each(|k: usize| t[k].swap(0, 1));
        let (mended, report) = make_manifold(&TriMesh::new(good.vertices().to_vec(), t).unwrap());
        assert_eq!((report.reoriented, report.non_orientable_edges), (3, 0));
        assert!(faults(&mended.mesh).is_empty() && mended.mesh.signed_volume() > 0.0);
    }

    #[test]
    fn a_moebius_strip_is_cut_once() {
        let n = 12;
        let point = |i: usize, side: Real| {
            let a = i as Real / n as Real * std::f64::consts::TAU;
            let r = 1.0 + 0.3 * side * (a / 2.0).cos();
            [r * a.cos(), r * a.sin(), 0.3 * side * (a / 2.0).sin()]
        };
        let v: Vec<[Real; 3]> = (0..n).flat_map(|i| [point(i, 1.0), point(i, -1.0)]).collect();
        let mut t = Vec::new();
        for i in 0..n as u32 {
            let (a, b) = (2 * i, 2 * i + 1);
            let (c, d) = if i + 1 < n as u32 { (a + 2, b + 2) } else { (1, 0) };
            t.extend([[a, b, c], [b, d, c]]);
        }
        let (cut, report) = make_manifold(&mesh(&v, &t));
        assert_eq!(report.non_orientable_edges, 1);
        assert!(cut.mesh.triangles().len() >= 2 * n - 1, "{report:?}");
        assert!(faults(&cut.mesh).iter().all(|f| !f.is_defect()), "{:?}", faults(&cut.mesh));
        assert!(!faults(&cut.mesh).iter().any(|f| matches!(f, Fault::Unused { .. })));
    }

    #[test]
    fn a_crowded_edge_with_duplicates_becomes_manifold() {
        // Eight triangles on one edge, in both directions, two of them the same.
        let mut v = vec![[0., 0., 0.], [0., 0., 1.]];
        v.extend((0..7).map(|k| [f64::from(k).cos(), f64::from(k).sin(), 0.5]));
        let mut t: Vec<[u32; 3]> =
            (2..9).map(|k| if k % 3 == 0 { [0, 1, k] } else { [1, 0, k] }).collect();
        t.push([0, 1, 5]);
        let (cut, report) = make_manifold(&mesh(&v, &t));
        assert_eq!(report.degenerate.duplicates, 1);
        let half_edges = HalfEdges::of_mesh(&cut.mesh);
        assert!(half_edges.non_manifold.is_empty() && half_edges.inconsistent.is_empty());
        assert_eq!(cut.mesh.triangles().len(), 7);
    }
}
