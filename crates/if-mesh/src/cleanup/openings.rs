//! The choice between openings and holes, as parameters.

use if_core::intersect::segment_triangle;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;

/// How openings (neck, cuffs, hem, front) are distinguished from holes (armpits, unseen surface).
///
/// A closed top, a dress or a pullover has 4 openings, an open jacket 3 (its hem, front and neck
/// are one), trousers 3, a skirt 2. Sides of parted seams ([`FillReport::parted`](super::FillReport)) are
/// neither.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Openings {
    /// By shape: a loop at the end of a tube is an opening, one in a sheet is a hole. It is an
    /// opening if its [openness](super::LoopShape) is at least this share of the garment's area.
    Shape(Real),
    /// This many loops, those of the largest openness.
    Count(usize),
    /// Loops that one of these lines leads through, as an arm through a cuff; and of the others those of
    /// the largest openness, up to a number in all.
    Around(Around),
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
    /// opening (an armhole of the dress) has 0.15 %, the most open hole (in the trousers) 0.05 %.
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
            Self::Near(points) => all_finite("near", points),
            Self::Around(around) => around.validate().map_err(|e| e.within("around")),
            Self::Complement(c) => c.validate().map_err(|e| e.within("complement")),
            Self::Sequence(policies) => policies.iter().enumerate().try_for_each(|(k, p)| {
                p.validate().map_err(|e| e.within(&format!("sequence[{k}]")))
            }),
            Self::Count(_) => Ok(()),
        }
    }
}

fn all_finite(name: &'static str, points: &[Point]) -> Result<(), ParameterError> {
    points.iter().enumerate().try_for_each(|(k, p)| {
        let worst = p.iter().find(|x| !x.is_finite());
        let value = worst.copied().unwrap_or(0.0);
        ParameterError::check(name, value, worst.is_none(), "a point in metres, finite")
            .map_err(|e| e.at(k))
    })
}

/// What leads through openings.
///
/// A lid over a limb would cut it off, so its loop is an opening, however small it is beside a tear.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Around {
    /// Chains of points, in metres: from the middle of a person along the bones of a limb to its end and
    /// beyond.
    pub lines: Vec<Vec<Point>>,
    /// The number of openings, if they lead through fewer: those of the largest openness as well.
    pub count: usize,
}

impl Around {
    /// Whether one of the lines leads through the loop with these corners: it passes more often one way through the
    /// fan from its centre than the other.
    pub fn leads_through(&self, corners: &[Point], center: &Point) -> bool {
        let lid = |k: usize| [center, &corners[k], &corners[(k + 1) % corners.len()]];
        let passages = |from: &Point, to: &Point| -> i32 {
            let through = (0..corners.len()).filter_map(|k| segment_triangle(from, to, lid(k)));
            through.map(|passage| i32::from(passage.direction)).sum()
        };
        let of = |line: &[Point]| -> i32 { line.windows(2).map(|s| passages(&s[0], &s[1])).sum() };
        self.lines.iter().any(|line| of(line) != 0)
    }

    fn validate(&self) -> Result<(), ParameterError> {
        self.lines.iter().try_for_each(|line| all_finite("lines", line))
    }
}

/// The clothed body that a garment was cut from.
///
/// The garment is a part of its surface. The complement falls into components: head, hands, legs,
/// and patches that belong to the garment but are missing in it. A loop that bounds a large
/// component is an opening.
#[derive(Clone, Debug, PartialEq)]
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
