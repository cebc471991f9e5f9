//! Which boundary loops are openings of the garment, and which are holes.

use super::complement::{Complement, ComplementError};
use super::rim::LoopShape;
use super::twins::ends;
use super::work::Work;
use if_core::math::{Point, Real};

/// How openings (neck, cuffs, hem, front) are told from holes (armpits, what nobody saw).
///
/// A closed top, a dress or a pullover has 4 openings, an open jacket 3 (its hem, front and neck
/// are one), trousers 3, a skirt 2.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Openings {
    /// By shape: a loop where a tube ends is an opening, one in a sheet is a hole. It is an opening
    /// if its
    /// [openness](LoopShape) is at least this share of the garment's area.
    Shape(Real),
    /// As many as the garment has, those of the largest openness.
    Count(usize),
    /// Loops at least this long, in metres, whatever they look like.
    Longer(Real),
    /// The loop nearest to each of these points, in metres.
    Near(Vec<Point>),
    /// By what is not the garment: a loop that bounds a large part of the rest of the clothed body
    /// is an opening.
    Complement(Box<Complement>),
    /// One after the other: each judges the loops that all before it take for openings. What any of
    /// them calls a hole is one.
    Each(Vec<Openings>),
}

impl Default for Openings {
    /// By shape, from 0.1 % of the area. Of the loops of `data/clothed/*_raw.ply`, the least open
    /// opening (an armhole of the dress) has 0.14 %, the most open hole (a slit between the legs)
    /// 0.07 %.
    fn default() -> Self {
        Self::Shape(1e-3)
    }
}

/// What a loop is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// An opening.
    Opening,
    /// A hole.
    Hole,
}

/// Why openings cannot be told.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum OpeningsError {
    /// A share or length below zero, or not finite.
    #[error("{name} is {value}; give a number of at least 0")]
    Negative { name: &'static str, value: Real },
    /// A point that is nowhere.
    #[error("point {index} is not finite; give three numbers in metres")]
    Point { index: usize },
    /// The clothed body is of no use.
    #[error(transparent)]
    Complement(#[from] ComplementError),
}

impl Openings {
    /// Whether all numbers make sense.
    ///
    /// # Errors
    ///
    /// The first that does not.
    pub fn validate(&self) -> Result<(), OpeningsError> {
        let at_least_zero = |name, value: Real| {
            if value.is_finite() && value >= 0.0 {
                Ok(())
            } else {
                Err(OpeningsError::Negative { name, value })
            }
        };
        match self {
            Self::Shape(share) => at_least_zero("the share of an opening", *share),
            Self::Longer(length) => at_least_zero("the length of an opening", *length),
            Self::Near(points) => {
                match points.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
                    Some(index) => Err(OpeningsError::Point { index }),
                    None => Ok(()),
                }
            }
            Self::Complement(c) => Ok(c.validate()?),
            Self::Each(policies) => policies.iter().try_for_each(Self::validate),
            Self::Count(_) => Ok(()),
        }
    }

    /// The verdict on each loop.
    pub(super) fn judge(
        &self,
        work: &Work,
        rims: &[Vec<u32>],
        shapes: &[LoopShape],
    ) -> Vec<Verdict> {
        let of = |open: bool| if open { Verdict::Opening } else { Verdict::Hole };
        match self {
            Self::Shape(share) => {
                let area: Real = (0..work.triangles.len()).map(|t| work.area(t)).sum();
                shapes.iter().map(|s| of(s.openness >= share * area && s.openness > 0.0)).collect()
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
                let mut verdicts = vec![Verdict::Hole; shapes.len()];
                order.iter().take(*count).for_each(|&k| verdicts[k] = Verdict::Opening);
                verdicts
            }
            Self::Longer(least) => shapes.iter().map(|s| of(s.length >= *least)).collect(),
            Self::Near(points) => {
                let mut verdicts = vec![Verdict::Hole; shapes.len()];
                for p in points {
                    let distance = |rim: &[u32]| {
                        let at = |h: u32| work.points[ends(&work.triangles, h)[0] as usize];
                        rim.iter()
                            .map(|&h| (at(h) - p).norm_squared())
                            .fold(Real::INFINITY, Real::min)
                    };
                    let near = (0..rims.len())
                        .map(|k| (distance(&rims[k]), k))
                        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    if let Some((_, k)) = near {
                        verdicts[k] = Verdict::Opening;
                    }
                }
                verdicts
            }
            Self::Complement(c) => c.judge(work, rims).into_iter().map(of).collect(),
            Self::Each(policies) => {
                let mut open: Vec<usize> = (0..rims.len()).collect();
                for policy in policies {
                    let rims: Vec<Vec<u32>> = open.iter().map(|&k| rims[k].clone()).collect();
                    let shapes: Vec<LoopShape> = open.iter().map(|&k| shapes[k]).collect();
                    let verdicts = policy.judge(work, &rims, &shapes);
                    open = open
                        .into_iter()
                        .zip(verdicts)
                        .filter(|(_, v)| *v == Verdict::Opening)
                        .map(|(k, _)| k)
                        .collect();
                }
                let mut verdicts = vec![Verdict::Hole; rims.len()];
                open.iter().for_each(|&k| verdicts[k] = Verdict::Opening);
                verdicts
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::twins::{Twins, loops};
    use super::*;
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::tube;

    /// A tube with two holes in its side, and the verdicts on its four loops.
    fn judged(openings: &Openings) -> Vec<(usize, bool)> {
        let tube = tube(0.1, 0.4, 40, 20, false);
        let mut triangles = tube.triangles().to_vec();
        triangles.drain(600..604);
        triangles.drain(300..302);
        let mesh = TriMesh::new(tube.vertices().to_vec(), triangles).unwrap();
        let (work, twins) = (Work::new(&mesh), Twins::of_mesh(&mesh));
        let rims = loops(mesh.triangles(), &twins);
        let shapes: Vec<LoopShape> =
            rims.iter().map(|rim| LoopShape::new(&work, &twins, rim)).collect();
        let verdicts = openings.judge(&work, &rims, &shapes);
        shapes.iter().zip(verdicts).map(|(s, v)| (s.edges, v == Verdict::Opening)).collect()
    }

    #[test]
    fn of_several_policies_each_has_the_say_over_what_the_others_leave() {
        let open = |openings: &Openings| -> Vec<usize> {
            let mut open: Vec<usize> =
                judged(openings).iter().filter(|l| l.1).map(|l| l.0).collect();
            open.sort_unstable();
            open
        };
        let upper = Openings::Near(vec![Point::new(0.0, 1.0, 0.0)]);
        assert_eq!(judged(&Openings::Each(Vec::new())).iter().filter(|l| l.1).count(), 4);
        assert_eq!(open(&Openings::Each(vec![Openings::default()])), [40, 40]);
        assert_eq!(
            open(&Openings::Each(vec![Openings::Longer(0.06), Openings::default()])),
            [40, 40]
        );
        assert_eq!(open(&Openings::Each(vec![upper.clone(), Openings::Count(3)])), [40]);
        // The count is of what is left: the larger of the two holes, not an end of the tube.
        let holes =
            judged(&Openings::default()).iter().filter(|l| !l.1).map(|l| l.0).max().unwrap();
        let at_holes =
            Openings::Near(vec![Point::new(-0.1, 0.15, 0.0), Point::new(0.0, 0.07, -0.1)]);
        assert!(open(&at_holes).iter().all(|n| *n < 40));
        assert_eq!(open(&Openings::Each(vec![at_holes, Openings::Count(1)])), [holes]);
        let bad = Openings::Each(vec![Openings::Count(1), Openings::Longer(-1.0)]);
        assert!(matches!(bad.validate(), Err(OpeningsError::Negative { .. })));
    }
}
