//! Which boundary loops are openings of the garment, and which are holes.

use super::complement::{Complement, ComplementError};
use super::rim::LoopShape;
use super::twins::ends;
use super::work::Work;
use if_core::math::{Point, Real};
use serde::Serialize;

/// How openings (neck, cuffs, hem, front) are told from holes (armpits, what nobody saw).
///
/// A closed top, a dress or a pullover has 4 openings, an open jacket 3 (its hem, front and neck are one), trousers
/// 3, a skirt 2.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Openings {
    /// By shape: a loop where a tube ends is an opening, one in a sheet is a hole. It is an opening if its
    /// [openness](LoopShape) is at least this share of the garment's area.
    Shape(Real),
    /// As many as the garment has, those of the largest openness.
    Count(usize),
    /// Loops at least this long, in metres, whatever they look like.
    Longer(Real),
    /// The loop nearest to each of these points, in metres.
    Near(Vec<Point>),
    /// By what is not the garment: a loop that bounds a large part of the rest of the clothed body is an opening.
    Complement(Box<Complement>),
}

impl Default for Openings {
    /// By shape, from 0.1 % of the area. Of the loops of `data/clothed/*_raw.ply`, the least open opening (an armhole of
    /// the dress) has 0.14 %, the most open hole (a slit between the legs) 0.07 %.
    fn default() -> Self {
        Self::Shape(1e-3)
    }
}

/// Why a loop is an opening or a hole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
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
            if value.is_finite() && value >= 0.0 { Ok(()) } else { Err(OpeningsError::Negative { name, value }) }
        };
        match self {
            Self::Shape(share) => at_least_zero("the share of an opening", *share),
            Self::Longer(length) => at_least_zero("the length of an opening", *length),
            Self::Near(points) => match points.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
                Some(index) => Err(OpeningsError::Point { index }),
                None => Ok(()),
            },
            Self::Complement(c) => Ok(c.validate()?),
            Self::Count(_) => Ok(()),
        }
    }

    /// The verdict on each loop.
    pub(super) fn judge(&self, work: &Work, rims: &[Vec<u32>], shapes: &[LoopShape]) -> Vec<Verdict> {
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
                    y.openness.total_cmp(&x.openness).then(y.length.total_cmp(&x.length)).then(a.cmp(&b))
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
                        rim.iter().map(|&h| (at(h) - p).norm_squared()).fold(Real::INFINITY, Real::min)
                    };
                    let near =
                        (0..rims.len()).map(|k| (distance(&rims[k]), k)).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    if let Some((_, k)) = near {
                        verdicts[k] = Verdict::Opening;
                    }
                }
                verdicts
            }
            Self::Complement(c) => c.judge(work, rims).into_iter().map(of).collect(),
        }
    }
}
