//! Parameters of the clean-up's steps.

use super::openings::Openings;
use if_core::math::Real;
use if_core::parameter::ParameterError;

/// Parameters of [`cleanup`](super::cleanup()).
#[derive(Clone, Debug, PartialEq)]
pub struct CleanupParams {
    /// Which parts are isolated elements; `None` keeps all parts.
    pub components: Option<ComponentParams>,
    /// Which boundary loops are openings; all others are holes.
    pub openings: Openings,
    /// How holes are filled; `None` leaves them open.
    pub fill: Option<FillParams>,
    /// How the loops of openings are smoothed; `None` leaves them as they are.
    pub smooth: Option<SmoothParams>,
    /// Rounds all new positions to `f32`, for files with coordinates of 4 bytes: the guarantees
    /// then hold for the file. Positions of the input are not rounded.
    pub single_precision: bool,
}

impl Default for CleanupParams {
    /// All three steps, openings by shape, double precision.
    fn default() -> Self {
        Self {
            components: Some(ComponentParams::default()),
            openings: Openings::default(),
            fill: Some(FillParams::default()),
            smooth: Some(SmoothParams::default()),
            single_precision: false,
        }
    }
}

impl CleanupParams {
    /// Checks that all parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let group = |name: &'static str| move |e: ParameterError| e.within(name);
        let components = self.components.as_ref().map_or(Ok(()), ComponentParams::validate);
        components.map_err(group("components"))?;
        self.fill.as_ref().map_or(Ok(()), FillParams::validate).map_err(group("fill"))?;
        self.smooth.as_ref().map_or(Ok(()), SmoothParams::validate).map_err(group("smooth"))?;
        self.openings.validate().map_err(group("openings"))
    }
}

/// Which parts of a mesh are isolated elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ComponentParams {
    /// A part is kept if it has at least this share of the area of the largest part, from 0 to 1.
    pub least_share: Real,
    /// At most this many parts are kept, the largest; `None` for no limit.
    pub most: Option<usize>,
}

impl Default for ComponentParams {
    /// 1 % of the largest: on the extractions of `data/clothed` the largest stray part has 0.07 %
    /// (clean votes).
    fn default() -> Self {
        Self { least_share: 0.01, most: None }
    }
}

impl ComponentParams {
    /// Checks that all parameters are in range.
    ///
    /// # Errors
    ///
    /// `least_share` is not between 0 and 1.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let share = self.least_share;
        ParameterError::check("least_share", share, (0.0..=1.0).contains(&share), "from 0 to 1")
    }
}

/// How holes are filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FillParams {
    /// Loops of up to this many edges get the minimum-weight triangulation, in O(n³); longer ones
    /// are closed by ear clipping.
    pub exact_up_to: usize,
    /// Refines the patch until its edges are as long as those around it.
    pub refine: bool,
    /// Fairs the patch so that it continues the slope of the surface around it (biharmonic). Needs
    /// `refine`.
    pub fair: bool,
    /// Maximum number of new vertices per hole.
    pub most_vertices: usize,
    /// How often a hole that no patch fits is widened by the triangles on its boundary and tried
    /// again. Scans are often bent inwards or through themselves at the border of what was not
    /// seen.
    pub widenings: usize,
}

impl Default for FillParams {
    fn default() -> Self {
        Self { exact_up_to: 128, refine: true, fair: true, most_vertices: 20_000, widenings: 3 }
    }
}

impl FillParams {
    /// Checks that all parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        // The minimum-weight triangulation of 1,024 edges takes 46 MB and some seconds.
        at_most("exact_up_to", self.exact_up_to, 1024, "at most 1,024 edges")?;
        at_most("most_vertices", self.most_vertices, 10_000_000, "at most 10 million vertices")?;
        at_most("widenings", self.widenings, 1000, "at most 1,000")
    }
}

/// Upper limit of passes, rounds and rings: a hundred times what flattens a scan's noise, while the
/// work still ends.
pub const MAX_PASSES: usize = 10_000;

/// How boundary loops are smoothed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SmoothParams {
    /// Smooths the loops. Without it they stay as they are, and only the passes over the surface
    /// are made.
    pub boundary: bool,
    /// λ: share of the way to the mean of its neighbours by which a vertex moves.
    pub lambda: Real,
    /// μ: share of the way back, below −λ, so that loops do not shrink.
    pub mu: Real,
    /// A loop whose roughness is at most this is smooth and left alone. Roughness is the root mean
    /// square of the turning angle from edge to edge, in radians, above that of the regular polygon
    /// of as many edges.
    pub roughness: Real,
    /// Maximum number of passes (one step of λ, one of μ) over a loop in a round.
    pub passes: usize,
    /// Maximum number of rounds: where vertices were held back and a loop is still rough, it is
    /// smoothed again from its present shape.
    pub rounds: usize,
    /// Rings of vertices beside the loop that move with it, with a falloff; more where the loop
    /// moves far.
    pub rings: usize,
    /// Removes the ears of rough loops first. Smoothing would flatten a triangle with two boundary
    /// edges: its inner edge is flipped, or it is removed. Narrow notches are filled.
    pub trim: bool,
    /// Passes of Laplacian smoothing (λ without μ) over all vertices that are not on a loop,
    /// against the noise of a scan. 0, as in the paper, leaves the surface as it is.
    pub surface_passes: usize,
}

impl Default for SmoothParams {
    fn default() -> Self {
        Self {
            boundary: true,
            lambda: 0.5,
            mu: -0.53,
            roughness: 0.2,
            passes: 50,
            rounds: 4,
            rings: 3,
            trim: true,
            surface_passes: 0,
        }
    }
}

impl SmoothParams {
    /// Checks that all parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let Self { lambda, mu, roughness, .. } = *self;
        let check = ParameterError::check;
        check("lambda", lambda, (0.0..=1.0).contains(&lambda), "from 0 to 1")?;
        let below_lambda = "from −1.1 to 0, a little below −λ";
        check("mu", mu, (-1.1..=0.0).contains(&mu), below_lambda)?;
        let angle = "an angle from 0.001 to 10 radians";
        check("roughness", roughness, (1e-3..=10.0).contains(&roughness), angle)?;
        for (name, value) in [
            ("passes", self.passes),
            ("rounds", self.rounds),
            ("rings", self.rings),
            ("surface_passes", self.surface_passes),
        ] {
            at_most(name, value, MAX_PASSES, "at most 10,000")?;
        }
        Ok(())
    }
}

fn at_most(
    name: &'static str,
    value: usize,
    limit: usize,
    range: &'static str,
) -> Result<(), ParameterError> {
    ParameterError::check(name, value as Real, value <= limit, range)
}
