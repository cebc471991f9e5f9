//! Classification of boundary loops as openings or holes.

use super::boundary_loop::LoopShape;
use super::edit_mesh::EditMesh;
use super::half_edges::ends;
use super::openings::Openings;
use super::parted::parted;
use if_core::math::{Point, Real};

/// Classification of a boundary loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LoopKind {
    /// An opening.
    Opening,
    /// A hole.
    Hole,
    /// The side of a parted seam.
    Seam,
}

/// The kind of each loop. Sides of parted seams are no loops for `openings`.
pub(super) fn kinds(
    openings: &Openings,
    work: &EditMesh,
    loops: &[Vec<u32>],
    shapes: &[LoopShape],
) -> Vec<LoopKind> {
    let parted = parted(work, loops);
    let others: Vec<usize> = (0..loops.len()).filter(|k| !parted[*k]).collect();
    let mut kinds = vec![LoopKind::Seam; loops.len()];
    let found = openings.classify_some(work, loops, shapes, &others);
    others.iter().zip(found).for_each(|(k, kind)| kinds[*k] = kind);
    kinds
}

impl Openings {
    /// The kind of each loop, none of which is the side of a parted seam.
    fn classify(&self, work: &EditMesh, loops: &[Vec<u32>], shapes: &[LoopShape]) -> Vec<LoopKind> {
        let kind = |open: bool| if open { LoopKind::Opening } else { LoopKind::Hole };
        match self {
            Self::Shape(share) => {
                let area: Real = (0..work.triangles.len()).map(|t| work.area(t)).sum();
                shapes
                    .iter()
                    .map(|s| kind(s.openness >= share * area && s.openness > 0.0))
                    .collect()
            }
            Self::Count(count) => most_open(shapes, vec![LoopKind::Hole; shapes.len()], *count),
            Self::Around(around) => {
                let is_around = |(boundary, shape): (&Vec<u32>, &LoopShape)| {
                    let at = |h: &u32| work.points[ends(&work.triangles, *h)[0] as usize];
                    let corners: Vec<Point> = boundary.iter().map(at).collect();
                    kind(around.leads_through(&corners, &shape.center.into()))
                };
                let kinds = loops.iter().zip(shapes).map(is_around).collect();
                most_open(shapes, kinds, around.count)
            }
            Self::Longer(least) => shapes.iter().map(|s| kind(s.length >= *least)).collect(),
            Self::Near(points) => {
                let mut kinds = vec![LoopKind::Hole; shapes.len()];
                for p in points {
                    let distance = |k: usize| {
                        let at = |h: &u32| work.points[ends(&work.triangles, *h)[0] as usize];
                        let places = loops[k].iter().map(at).chain([shapes[k].center.into()]);
                        places.map(|q| (q - p).norm_squared()).fold(Real::INFINITY, Real::min)
                    };
                    let near = (0..loops.len())
                        .map(|k| (distance(k), k))
                        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    if let Some((_, k)) = near {
                        kinds[k] = LoopKind::Opening;
                    }
                }
                kinds
            }
            Self::Complement(c) => c.classify(work, loops).into_iter().map(kind).collect(),
            Self::Sequence(policies) => {
                let mut open: Vec<usize> = (0..loops.len()).collect();
                for policy in policies {
                    let kinds = policy.classify_some(work, loops, shapes, &open);
                    open = open
                        .into_iter()
                        .zip(kinds)
                        .filter(|(_, v)| *v == LoopKind::Opening)
                        .map(|(k, _)| k)
                        .collect();
                }
                let mut kinds = vec![LoopKind::Hole; loops.len()];
                open.iter().for_each(|&k| kinds[k] = LoopKind::Opening);
                kinds
            }
        }
    }

    /// The kinds of `some` of the loops, as if there were no others.
    fn classify_some(
        &self,
        work: &EditMesh,
        loops: &[Vec<u32>],
        shapes: &[LoopShape],
        some: &[usize],
    ) -> Vec<LoopKind> {
        let loops: Vec<Vec<u32>> = some.iter().map(|&k| loops[k].clone()).collect();
        let shapes: Vec<LoopShape> = some.iter().map(|&k| shapes[k]).collect();
        self.classify(work, &loops, &shapes)
    }
}

/// As many openings as `count`, if there are fewer in `kinds`: the most open holes, too.
fn most_open(shapes: &[LoopShape], mut kinds: Vec<LoopKind>, count: usize) -> Vec<LoopKind> {
    let open = kinds.iter().filter(|kind| **kind == LoopKind::Opening).count();
    let mut order: Vec<usize> = (0..shapes.len()).filter(|k| kinds[*k] == LoopKind::Hole).collect();
    order.sort_by(|&a, &b| {
        let (x, y) = (&shapes[a], &shapes[b]);
        y.openness.total_cmp(&x.openness).then(y.length.total_cmp(&x.length)).then(a.cmp(&b))
    });
    let more = count.saturating_sub(open);
    order.iter().take(more).for_each(|&k| kinds[k] = LoopKind::Opening);
    kinds
}

#[cfg(test)]
mod tests {
    use super::super::half_edges::{HalfEdges, boundary_loops};
    use super::super::openings::Around;
    use super::*;
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::tube;

    /// A tube with two holes in its side, and the kinds of its four loops.
    fn classified(openings: &Openings) -> Vec<(usize, bool)> {
        kinds_of(tube(0.1, 0.4, 40, 20, false), openings)
    }

    /// The edges of the loops of a tube with two holes in its side, and whether each is an opening.
    fn kinds_of(tube: TriMesh, openings: &Openings) -> Vec<(usize, bool)> {
        let mut triangles = tube.triangles().to_vec();
        triangles.drain(600..604);
        triangles.drain(300..302);
        let mesh = TriMesh::new(tube.vertices().to_vec(), triangles).unwrap();
        let (work, half_edges) = (EditMesh::new(&mesh), HalfEdges::of_mesh(&mesh));
        let loops = boundary_loops(mesh.triangles(), &half_edges);
        let shapes: Vec<LoopShape> =
            loops.iter().map(|boundary| LoopShape::new(&work, &half_edges, boundary)).collect();
        let kinds = openings.classify(&work, &loops, &shapes);
        shapes.iter().zip(kinds).map(|(s, v)| (s.edges, v == LoopKind::Opening)).collect()
    }

    #[test]
    fn a_wide_opening_is_nearest_to_its_middle_though_a_hole_lies_between() {
        let tube = tube(0.1, 0.4, 40, 20, false);
        let flare = |p: &Point| if p.y == 0.0 { Point::new(3.0 * p.x, 0.0, 3.0 * p.z) } else { *p };
        let wide = tube.with_vertices(tube.vertices().iter().map(flare).collect()).unwrap();
        let middle = Openings::Near(vec![Point::new(0.0, 0.001, 0.0)]);
        let open: Vec<usize> =
            kinds_of(wide, &middle).iter().filter(|l| l.1).map(|l| l.0).collect();
        assert_eq!(open, [40]);
    }

    #[test]
    fn what_a_limb_leads_through_is_open_before_wider_holes() {
        // A tube whose far end is narrow, with a wide tear in its side.
        let tube = tube(0.1, 0.4, 40, 20, false);
        let narrow = |p: &Point| {
            let r = 1.0 - 0.9 * p.y / 0.4;
            Point::new(r * p.x, p.y, r * p.z)
        };
        let sleeve = tube.with_vertices(tube.vertices().iter().map(narrow).collect()).unwrap();
        let is_torn = |t: &[u32; 3]| {
            let at = t.map(|v| sleeve.vertices()[v as usize]);
            at.iter().all(|p| p.y < 0.29 && p.y > 0.05 && p.x > 0.0)
        };
        let kept = sleeve.triangles().iter().copied().filter(|t| !is_torn(t)).collect();
        let mesh = TriMesh::new(sleeve.vertices().to_vec(), kept).unwrap();
        let (work, half_edges) = (EditMesh::new(&mesh), HalfEdges::of_mesh(&mesh));
        let loops = boundary_loops(mesh.triangles(), &half_edges);
        let shape = |boundary: &Vec<u32>| LoopShape::new(&work, &half_edges, boundary);
        let shapes: Vec<LoopShape> = loops.iter().map(shape).collect();
        let open = |openings: &Openings| -> Vec<Real> {
            let kinds = openings.classify(&work, &loops, &shapes);
            let open = shapes.iter().zip(kinds).filter(|(_, kind)| *kind == LoopKind::Opening);
            let mut heights: Vec<Real> = open.map(|(shape, _)| shape.center[1]).collect();
            heights.sort_by(Real::total_cmp);
            heights
        };
        let tear = open(&Openings::Count(2))[1];
        assert!(tear > 0.1 && tear < 0.3, "more open than the cuff");
        // An arm that looks out of the tear on its way.
        let along =
            [[0.0, -0.5, 0.0], [0.0, 0.1, 0.0], [0.3, 0.15, 0.0], [0.0, 0.2, 0.0], [0.0, 0.6, 0.0]];
        let arm = along.map(Point::from).to_vec();
        let around =
            |lines: Vec<Vec<Point>>, count| open(&Openings::Around(Around { lines, count }));
        approx::assert_abs_diff_eq!(
            around(vec![arm.clone()], 2)[..],
            [0.0, 0.4][..],
            epsilon = 1e-12
        );
        assert_eq!(around(vec![arm.clone()], 0).len(), 2, "never a lid over a limb");
        assert_eq!(around(vec![arm.clone()], 3)[1], tear);
        assert_eq!(around(vec![arm[..2].to_vec()], 1), [0.0], "it ends within");
        assert_eq!(around(Vec::new(), 2), open(&Openings::Count(2)));
        let bad = Openings::Around(Around {
            lines: vec![vec![Point::new(0.0, Real::NAN, 0.0)]],
            count: 1,
        });
        assert_eq!(bad.validate().unwrap_err().name, "around.lines[0]");
    }

    #[test]
    fn each_policy_of_a_sequence_classifies_what_the_earlier_ones_leave() {
        let open = |openings: &Openings| -> Vec<usize> {
            let mut open: Vec<usize> =
                classified(openings).iter().filter(|l| l.1).map(|l| l.0).collect();
            open.sort_unstable();
            open
        };
        let upper = Openings::Near(vec![Point::new(0.0, 1.0, 0.0)]);
        assert_eq!(classified(&Openings::Sequence(Vec::new())).iter().filter(|l| l.1).count(), 4);
        assert_eq!(open(&Openings::Sequence(vec![Openings::default()])), [40, 40]);
        assert_eq!(
            open(&Openings::Sequence(vec![Openings::Longer(0.06), Openings::default()])),
            [40, 40]
        );
        assert_eq!(open(&Openings::Sequence(vec![upper.clone(), Openings::Count(3)])), [40]);
        // The count applies to the loops that are left: the larger hole, not an end of the tube.
        let holes =
            classified(&Openings::default()).iter().filter(|l| !l.1).map(|l| l.0).max().unwrap();
        let at_holes =
            Openings::Near(vec![Point::new(-0.1, 0.15, 0.0), Point::new(0.0, 0.07, -0.1)]);
        assert!(open(&at_holes).iter().all(|n| *n < 40));
        assert_eq!(open(&Openings::Sequence(vec![at_holes, Openings::Count(1)])), [holes]);
        let bad = Openings::Sequence(vec![Openings::Count(1), Openings::Longer(-1.0)]);
        assert_eq!(bad.validate().unwrap_err().name, "sequence[1].longer");
    }
}
