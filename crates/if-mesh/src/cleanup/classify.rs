//! Classification of boundary loops as openings or holes.

use super::boundary_loop::LoopShape;
use super::edit_mesh::EditMesh;
use super::half_edges::ends;
use super::openings::Openings;
use if_core::math::Real;

/// Classification of a boundary loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LoopKind {
    /// An opening.
    Opening,
    /// A hole.
    Hole,
}

impl Openings {
    /// The kind of each loop.
    pub(super) fn classify(
        &self,
        work: &EditMesh,
        loops: &[Vec<u32>],
        shapes: &[LoopShape],
    ) -> Vec<LoopKind> {
        let kind = |open: bool| if open { LoopKind::Opening } else { LoopKind::Hole };
        match self {
            Self::Shape(share) => {
                let area: Real = (0..work.triangles.len()).map(|t| work.area(t)).sum();
                shapes
                    .iter()
                    .map(|s| kind(s.openness >= share * area && s.openness > 0.0))
                    .collect()
            }
            Self::Count(count) => {
                let mut order: Vec<usize> = (0..shapes.len()).collect();
                order.sort_by(|&a, &b| {
                    let (x, y) = (&shapes[a], &shapes[b]);
                    y.openness
                        .total_cmp(&x.openness)
                        .then(y.length.total_cmp(&x.length))
                        .then(a.cmp(&b))
                });
                let mut kinds = vec![LoopKind::Hole; shapes.len()];
                order.iter().take(*count).for_each(|&k| kinds[k] = LoopKind::Opening);
                kinds
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
                    let loops: Vec<Vec<u32>> = open.iter().map(|&k| loops[k].clone()).collect();
                    let shapes: Vec<LoopShape> = open.iter().map(|&k| shapes[k]).collect();
                    let kinds = policy.classify(work, &loops, &shapes);
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
}

#[cfg(test)]
mod tests {
    use super::super::half_edges::{HalfEdges, boundary_loops};
    use super::*;
    use if_core::math::Point;
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
