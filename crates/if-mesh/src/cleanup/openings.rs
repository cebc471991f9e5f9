//! The choice between openings and holes, as parameters.

use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;

/// How openings (neck, cuffs, hem, front) are distinguished from holes (armpits, unseen surface).
///
/// A closed top, a dress or a pullover has 4 openings, an open jacket 3 (its hem, front and neck
/// are one), trousers 3, a skirt 2.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Openings {
    /// By shape: a loop at the end of a tube is an opening, one in a sheet is a hole. It is an
    /// opening if its [openness](super::LoopShape) is at least this share of the garment's area.
    Shape(Real),
    /// This many loops, those of the largest openness.
    Count(usize),
    /// Loops at least this long, in metres.
    Longer(Real),
    /// The loop nearest to each of these points, in metres, by its vertices or its
    /// [centre](super::LoopShape::center).
    Near(Vec<Point>),
    /// By the rest of the clothed body: a loop that bounds a large component of it is an opening.
    Complement(Box<Complement>),
    /// One after the other: each classifies the loops that all before it took for openings. A loop
    /// that any of them takes for a hole is one.
    Sequence(Vec<Openings>),
}

impl Default for Openings {
    /// By shape, from 0.1 % of the area. Of the loops of `data/clothed/*_raw.ply`, the least open
    /// opening (an armhole of the dress) has 0.14 %, the most open hole (a slit between the legs)
    /// 0.07 %.
    fn default() -> Self {
        Self::Shape(1e-3)
    }
}

impl Openings {
    /// Checks that all parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let not_negative = |name, x: Real| {
            ParameterError::check(name, x, x.is_finite() && x >= 0.0, "finite and not negative")
        };
        match self {
            Self::Shape(share) => not_negative("shape", *share),
            Self::Longer(length) => not_negative("longer", *length),
            Self::Near(points) => points.iter().enumerate().try_for_each(|(k, p)| {
                let worst = p.iter().find(|x| !x.is_finite());
                let value = worst.copied().unwrap_or(0.0);
                ParameterError::check("near", value, worst.is_none(), "a point in metres, finite")
                    .map_err(|e| e.at(k))
            }),
            Self::Complement(c) => c.validate().map_err(|e| e.within("complement")),
            Self::Sequence(policies) => policies.iter().enumerate().try_for_each(|(k, p)| {
                p.validate().map_err(|e| e.within(&format!("sequence[{k}]")))
            }),
            Self::Count(_) => Ok(()),
        }
    }
}

/// The clothed body that a garment was cut from.
///
/// The garment is a part of its surface. The complement falls into components: head, hands, legs,
/// and patches that belong to the garment but are missing in it. A loop that bounds a large
/// component is an opening.
#[derive(Clone, Debug)]
pub struct Complement {
    /// The clothed body's surface: closed, or what was scanned of it. Where it is missing, loops
    /// bound nothing.
    pub body: TriMesh,
    /// A component of the complement with less than this share of the garment's area is a missing
    /// patch of the garment.
    pub least_share: Real,
    /// For each vertex of the body, whether it certainly belongs to something else (skin, another
    /// garment). A small component with a majority of such vertices bounds an opening all the same.
    /// Empty if unknown.
    pub foreign: Vec<bool>,
    /// Distance up to which the garment covers the body, in metres; `None` for 1.5 mean edges of the
    /// garment.
    pub coverage: Option<Real>,
}

impl Complement {
    /// The complement in this clothed body. Components from 1.5 % of the garment's area bound
    /// openings: a hand without its cuff has 3 to 4 %, the largest armpit hole of
    /// `data/clothed/*_raw.ply` 0.5 %.
    pub fn new(body: TriMesh) -> Self {
        Self { body, least_share: 0.015, foreign: Vec::new(), coverage: None }
    }

    fn validate(&self) -> Result<(), ParameterError> {
        let check = ParameterError::check;
        let triangles = self.body.triangles().len();
        let body = "at least 1: the surface that the garment was cut from";
        check("body.triangles", triangles as Real, triangles > 0, body)?;
        let marks = self.foreign.len();
        let fits = marks == 0 || marks == self.body.vertices().len();
        check("foreign.len", marks as Real, fits, "one mark per vertex of the body, or none")?;
        for (name, value) in
            [("least_share", self.least_share), ("coverage", self.coverage.unwrap_or(0.0))]
        {
            check(name, value, value.is_finite() && value >= 0.0, "finite and not negative")?;
        }
        Ok(())
    }
}
