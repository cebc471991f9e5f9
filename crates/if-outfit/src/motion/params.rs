//! Parameters of following a motion.

use if_core::math::Real;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// Parameters of [`Walker`](super::Walker).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WalkParams {
    /// Distance to keep between primitives, in metres, where the rest state has room for it.
    pub gap: Real,
    /// Share of their distance in the rest state that near primitives keep, up to `gap`.
    pub share: Real,
    /// Distance beyond `gap` at which primitives are watched in a step, in metres.
    pub margin: Real,
    /// Weight of the body's displacement beside that of garments.
    pub body_weight: Real,
    /// Length over which displacements of the body fade, in metres.
    pub body_length: Real,
    /// Distance from its own overlaps up to which the body yields, in metres. A step that is not
    /// clean so lets it yield near what is left as well, and at last everywhere.
    pub body_reach: Real,
    /// Length over which displacements of garments fade, in metres.
    pub garment_length: Real,
    /// Maximum sweeps of one solve.
    pub sweeps: usize,
    /// Maximum solves of one step, each with what still intersected held apart, before the step is
    /// halved.
    pub solves: usize,
    /// Times that a step may be halved.
    pub halvings: u32,
}

impl Default for WalkParams {
    fn default() -> Self {
        Self {
            gap: 1e-3,
            share: 0.5,
            margin: 4e-3,
            body_weight: 10.0,
            body_length: 0.025,
            body_reach: 0.05,
            garment_length: 0.02,
            sweeps: 60,
            solves: 5,
            halvings: 5,
        }
    }
}

/// Share of the gaps of a walk that [`WalkParams::approaching`] keeps. With all of them means are pushed
/// back to where the walked states were, and tremble as these do; with half of this no less.
const APPROACH: Real = 0.3;

impl WalkParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range or NaN.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = ParameterError::check;
        let length = "above 0 and at most 0.1 m";
        let is_length = |x: Real| x > 0.0 && x <= 0.1;
        check("gap", self.gap, is_length(self.gap), length)?;
        check("share", self.share, self.share > 0.0 && self.share < 1.0, "above 0 and below 1")?;
        check("margin", self.margin, is_length(self.margin), length)?;
        ParameterError::check_positive("body_weight", self.body_weight)?;
        check("body_length", self.body_length, is_length(self.body_length), length)?;
        let is_reach = self.body_reach >= 0.0 && self.body_reach <= 10.0;
        check("body_reach", self.body_reach, is_reach, "from 0 to 10 m")?;
        check("garment_length", self.garment_length, is_length(self.garment_length), length)?;
        let count = |name, n: usize, most: usize, range| {
            check(name, n as Real, (1..=most).contains(&n), range)
        };
        count("sweeps", self.sweeps, 10_000, "from 1 to 10000")?;
        count("solves", self.solves, 100, "from 1 to 100")?;
        check("halvings", self.halvings.into(), self.halvings <= 20, "at most 20")
    }

    /// Distance up to which primitives are watched.
    pub(super) fn watched(&self) -> Real {
        self.gap + self.margin
    }

    /// Those by which layers come nearer to one another than in a walk, and watch as far.
    pub(super) fn approaching(self) -> Self {
        let gap = self.gap * APPROACH;
        Self { gap, share: self.share * APPROACH, margin: self.watched() - gap, ..self }
    }
}
