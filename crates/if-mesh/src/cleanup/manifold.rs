//! Surfaces that are manifold and wind one way: non-manifold edges cut, bow-ties split.

use super::degenerate::{self, DegenerateReport};
use super::twins::{NONE, Twins, ends, previous};
use super::work::{Derived, Work};
use if_core::math::{Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use serde::Serialize;

/// What was done to make a surface manifold.
#[derive(Clone, Debug, PartialEq, Eq, Default, Serialize)]
pub struct ManifoldReport {
    /// Triangles without area or standing twice.
    pub degenerate: DegenerateReport,
    /// Triangles turned over, so that neighbours wind the same way.
    pub turned_over: usize,
    /// Edges with neighbours that wind against each other all the same (a Möbius strip): cut.
    pub one_sided_edges: usize,
    /// Edges of more than two triangles: the two that go on flattest stay together, others in
    /// further pairs.
    pub crowded_edges: usize,
    /// Triangles dropped because cutting at their edges does not make them manifold.
    pub dropped: usize,
    /// Vertices added because several fans of triangles met in one (bow-ties).
    pub split_vertices: usize,
    /// Vertices of no triangle, dropped.
    pub unused_vertices: usize,
}

impl ManifoldReport {
    /// Nothing was to be done.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// Makes `mesh` manifold and consistently wound, without moving a vertex: at most two triangles at
/// an edge, one fan at a vertex, no triangle without area, none twice, no vertex without a
/// triangle.
///
/// Where more than two triangles meet at an edge, pairs are formed, the flattest first, and the
/// surface is cut between pairs; where fans of triangles meet in one vertex, each gets its own.
/// Vertices that are added lie where the others are. A mesh that is in order comes back bit by bit.
///
/// # Source
///
/// Cutting and vertex copies after Guéziec et al. 2001, *Cutting and Stitching*.
pub fn make_manifold(mesh: &TriMesh) -> (Derived, ManifoldReport) {
    let mut work = Work::new(mesh);
    let (report, _) = resolve(&mut work);
    (work.finish(), report)
}

/// [`make_manifold`] in place; with the twins of the result.
pub(super) fn resolve(work: &mut Work) -> (ManifoldReport, Twins) {
    let (degenerate, mut twins) = degenerate::mend(work);
    let mut report = ManifoldReport { degenerate, ..ManifoldReport::default() };
    if !twins.against.is_empty() {
        report.turned_over = orient(work, &twins);
        twins = Twins::new(work.points.len(), &work.triangles);
        report.one_sided_edges = twins.against.len();
    }
    report.crowded_edges = twins.crowded.len();
    loop {
        let cut = !twins.crowded.is_empty() || !twins.against.is_empty();
        pair_crowds(work, &mut twins);
        report.split_vertices += split_fans(work, &twins, 0..3 * work.triangles.len() as u32);
        if !cut {
            break;
        }
        twins = Twins::new(work.points.len(), &work.triangles);
        // Sheets that a cut edge does not separate, because they go together round both its ends.
        let left: Vec<u32> = twins
            .crowded
            .iter()
            .flat_map(|c| &c[1..])
            .chain(twins.against.iter().map(|a| &a[1]))
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
        twins = Twins::new(work.points.len(), &work.triangles);
    }
    report.unused_vertices = work.compact();
    (report, twins)
}

/// Turns triangles so that neighbours across edges of two wind the same way, the smaller area of
/// each part.
fn orient(work: &mut Work, twins: &Twins) -> usize {
    let n = work.triangles.len();
    let mut against = vec![NONE; 3 * n];
    for &[g, h] in &twins.against {
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
                for (neighbour, other) in [(twins.of[h], mine), (against[h], !mine)] {
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

/// Pairs half-edges of crowded edges: one of each direction, those whose triangles go on flattest
/// first.
fn pair_crowds(work: &Work, twins: &mut Twins) {
    for crowd in &twins.crowded {
        let away: Vec<Vector> = crowd.iter().map(|&h| across(work, h)).collect();
        let mut pairs: Vec<(Real, usize, usize)> = Vec::new();
        for i in 0..crowd.len() {
            for j in i + 1..crowd.len() {
                if ends(&work.triangles, crowd[i])[0] != ends(&work.triangles, crowd[j])[0] {
                    pairs.push((away[i].dot(&away[j]), i, j));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        for (_, i, j) in pairs {
            let (g, h) = (crowd[i], crowd[j]);
            if twins.of[g as usize] == NONE && twins.of[h as usize] == NONE {
                twins.of[g as usize] = h;
                twins.of[h as usize] = g;
            }
        }
    }
}

/// The unit vector in the triangle of `h` that points away from that edge; zero where there is
/// none.
fn across(work: &Work, h: u32) -> Vector {
    let [a, b] = ends(&work.triangles, h).map(|v| work.points[v as usize]);
    let c = work.points[ends(&work.triangles, previous(h))[0] as usize];
    let along = unit_or_zero(&(b - a));
    let to = c - a;
    unit_or_zero(&(to - along * along.dot(&to)))
}

/// Takes triangles out of a manifold mesh, which stays one: where several fans meet in a vertex
/// now, each gets its own. `gone` is ascending. Vertices of no triangle stay.
pub(super) fn take_out(work: &mut Work, twins: &Twins, gone: &[u32]) -> Twins {
    // What leaves the vertices of those triangles, and stays.
    let mut leaving = Vec::new();
    gone.iter().for_each(|t| (3 * t..3 * t + 3).for_each(|h| twins.around(h, |g| leaving.push(g))));
    leaving.sort_unstable();
    leaving.dedup();
    let mut before = 0;
    leaving.retain_mut(|h| {
        while before < gone.len() && gone[before] < *h / 3 {
            before += 1;
        }
        let stays = gone.get(before) != Some(&(*h / 3));
        *h -= 3 * before as u32;
        stays
    });
    let twins = twins.without(gone);
    work.remove(gone);
    split_fans(work, &twins, leaving);
    twins
}

/// Gives each fan of triangles its own vertex; the fan of the first triangle keeps the old one.
/// `leaving` are the half-edges that leave the vertices in question, ascending.
fn split_fans(work: &mut Work, twins: &Twins, leaving: impl IntoIterator<Item = u32>) -> usize {
    let mut seen = vec![false; 3 * work.triangles.len()];
    let mut taken = vec![false; work.points.len()];
    let mut added = 0;
    let mut fan = Vec::new();
    for h in leaving {
        if seen[h as usize] {
            continue;
        }
        twins.around(h, |g| seen[g as usize] = true);
        let v = work.triangles[h as usize / 3][h as usize % 3];
        if !std::mem::replace(&mut taken[v as usize], true) {
            continue;
        }
        fan.clear();
        twins.around(h, |g| fan.push(g));
        let new = work.copy(v);
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
    fn a_sound_mesh_comes_back_bit_by_bit() {
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
    fn at_a_fin_the_flat_sheet_stays_whole() {
        let fin = mesh(
            &[[0., 0., 0.], [0., 1., 0.], [1., 0., 0.], [-1., 0., 0.], [0., 0., 1.]],
            &[[0, 1, 4], [1, 0, 2], [0, 1, 3]],
        );
        let (cut, report) = make_manifold(&fin);
        assert_eq!((report.crowded_edges, report.split_vertices, report.dropped), (1, 2, 0));
        let twins = Twins::of_mesh(&cut.mesh);
        assert!(twins.crowded.is_empty());
        assert_eq!(twins.of[3], 6, "the two flat ones are neighbours");
        assert_eq!(twins.of[0], NONE);
    }

    #[test]
    fn triangles_that_wind_against_the_others_are_turned() {
        let good = icosphere(0.1, 1);
        let mut t = good.triangles().to_vec();
        [3, 17, 40].into_iter().for_each(|k: usize| t[k].swap(0, 1));
        let (mended, report) = make_manifold(&TriMesh::new(good.vertices().to_vec(), t).unwrap());
        assert_eq!((report.turned_over, report.one_sided_edges), (3, 0));
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
        assert_eq!(report.one_sided_edges, 1);
        assert!(cut.mesh.triangles().len() >= 2 * n - 1, "{report:?}");
        assert!(faults(&cut.mesh).iter().all(|f| !f.is_defect()), "{:?}", faults(&cut.mesh));
        assert!(!faults(&cut.mesh).iter().any(|f| matches!(f, Fault::Unused { .. })));
    }

    #[test]
    fn everything_at_once_ends_manifold() {
        // Eight triangles on one edge, in both directions, two of them the same.
        let mut v = vec![[0., 0., 0.], [0., 0., 1.]];
        v.extend((0..7).map(|k| [f64::from(k).cos(), f64::from(k).sin(), 0.5]));
        let mut t: Vec<[u32; 3]> =
            (2..9).map(|k| if k % 3 == 0 { [0, 1, k] } else { [1, 0, k] }).collect();
        t.push([0, 1, 5]);
        let (cut, report) = make_manifold(&mesh(&v, &t));
        assert_eq!(report.degenerate.doubled, 1);
        let twins = Twins::of_mesh(&cut.mesh);
        assert!(twins.crowded.is_empty() && twins.against.is_empty());
        assert_eq!(cut.mesh.triangles().len(), 7);
    }
}
