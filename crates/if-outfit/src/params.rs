//! Parameters of [`resolve`](crate::resolve::resolve), in four groups: what the user wants, how
//! hard the program tries, how cloth behaves, and the paper's method.

use if_core::math::Real;
use if_core::parameter::ParameterError;
use if_xpbd::air::AirParams;
use if_xpbd::params::SolverParams;
use serde::{Deserialize, Serialize};

/// Parameters of [`resolve`](crate::resolve::resolve). No field name stands in two groups, so that
/// a name alone is unique.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ResolveParams {
    /// What the result should be.
    pub goal: GoalParams,
    /// How hard the program tries.
    pub effort: EffortParams,
    /// How garments behave.
    pub cloth: ClothParams,
    /// Algorithm 1, which [`Method::Paper`] runs.
    pub paper: PaperParams,
}

/// What the result should be.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GoalParams {
    /// Gap between a layer and those below it, in metres: what settling aims at for vertices and long
    /// edges, while triangles between them may come nearer. A garment has settled once it is clean and
    /// little strained, so that of a gap of many millimetres less than half may be reached.
    pub clearance: Real,
    /// Layers of a clean result that come nearer than this are moved apart until no two triangles of
    /// theirs do, as far as there is room, in metres; a garment opens to itself, too, up to 0.1 mm.
    /// 0 leaves all where it is. The body stays.
    pub least_distance: Real,
    /// When garments are pressed in below the layers above them.
    pub tuck: Tuck,
    /// Vertices that stick out of a layer above by up to this much are pressed in, in metres.
    pub tuck_distance: Real,
    /// Whether triangles may be split, as a last resort.
    pub split: Split,
    /// What happens to intersections of a garment with itself.
    pub own: Own,
    /// What happens where the body meets itself or leaves no room for the cloth between.
    pub pinch: Pinch,
    /// The body is drawn back by at most this much, in metres ([`Pinch::Yield`]).
    pub body_depth: Real,
}

/// How hard the program tries.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EffortParams {
    /// How a garment settles before what is left is repaired.
    pub method: Method,
    /// Maximum number of rounds of a garment.
    pub rounds: usize,
    /// Rounds before all but the neighbourhoods of remaining intersections are held.
    pub settle_rounds: usize,
    /// Rounds in which a clean garment may relax while an edge is strained by more than
    /// `polish_strain`.
    pub polish_rounds: usize,
    /// Largest edge strain of a garment that needs no relaxing, as a share.
    pub polish_strain: Real,
    /// Maximum number of easing rounds of a clean garment; 0 leaves strained edges as they are.
    pub ease_rounds: usize,
    /// Edges of a clean garment that are strained by more than this share are eased, in rounds that
    /// end clean.
    pub ease_strain: Real,
    /// A garment's own intersections are taken apart where no more than one in a hundred of the edges near
    /// them is strained by more than this share.
    pub untangle_strain: Real,
    /// Sweeps of the solver in a round.
    pub sweeps: usize,
    /// A round that moves no vertex further than this has settled, in metres.
    pub tolerance: Real,
    /// Vertices up to this far along the surface from an intersection may move, in metres.
    pub influence: Real,
    /// The same during repairs, in metres.
    pub repair_influence: Real,
    /// Maximum correction of a violated contact per round, in metres.
    pub contact_step: Real,
    /// Contacts are kept for samples up to this far beyond the clearance, in metres.
    pub contact_margin: Real,
    /// Maximum push of a contact per sweep, in metres.
    pub max_push: Real,
    /// Maximum separation step per round for corners of an intersecting triangle pair, in metres.
    pub separation_step: Real,
    /// Factor on the gap of vertices whose triangles intersect repeatedly.
    pub gap_growth: Real,
    /// Edges longer than this get a contact sample in the middle, and their triangles too, in
    /// metres: three times longer ones at once, the others where something is left to repair.
    pub long_edge: Real,
    /// Cell size of the coarse grid of outward directions, in metres.
    pub outward_cell: Real,
}

/// How garments behave. Compliances are relative to unit masses and a time step of 1 s.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ClothParams {
    /// Compliance of edges: 0 is inextensible. A visit removes the share 2 / (2 + c) of a change
    /// of length.
    pub stretch_compliance: Real,
    /// Compliance of the distances across edges, which resist bending.
    pub bending_compliance: Real,
    /// Compliance of the anchors to the input: a visit removes the share 1 / (1 + c) of a
    /// displacement.
    pub anchor_compliance: Real,
    /// Edges that changed their length by more than this share are brought back to it.
    pub strain_limit: Real,
    /// Sheets of a garment that face each other within this distance move together, in metres.
    pub fold_distance: Real,
}

/// Algorithm 1 of the supplement, as [`Method::Paper`] runs it; nothing else reads these. Its gap δ is
/// [`GoalParams::clearance`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PaperParams {
    /// Δt, in seconds.
    pub time_step: Real,
    /// numSubSteps: substeps of a time step.
    pub substeps: u32,
    /// Maximum number of time steps of a garment. It stops before, once no vertex moves by more than 10 µm in
    /// one.
    pub steps: u32,
    /// β of the stretch constraint, in m/N.
    pub compliance: Real,
    /// Coulomb coefficient of friction of collisions.
    pub friction: Real,
    /// Vertices within this distance of the garment below keep a gap of air, in metres; 0 for no air
    /// constraint.
    pub air_distance: Real,
    /// The largest gap of air that is preserved, in metres; at least the clearance.
    pub air_gap: Real,
}

impl Default for GoalParams {
    fn default() -> Self {
        Self {
            clearance: 0.3e-3,
            least_distance: 0.0,
            tuck: Tuck::IfStuck,
            tuck_distance: 0.25,
            split: Split::Never,
            own: Own::Remove,
            pinch: Pinch::Keep,
            body_depth: 0.015,
        }
    }
}

impl Default for EffortParams {
    fn default() -> Self {
        Self {
            method: Method::Contacts,
            rounds: 100,
            settle_rounds: 16,
            polish_rounds: 12,
            polish_strain: 0.25,
            ease_rounds: 40,
            ease_strain: 0.5,
            untangle_strain: 0.5,
            sweeps: 15,
            tolerance: 3e-4,
            influence: 0.12,
            repair_influence: 0.04,
            contact_step: 2e-3,
            contact_margin: 2e-3,
            max_push: 2e-3,
            separation_step: 0.5e-3,
            gap_growth: 1.1,
            long_edge: 8e-3,
            outward_cell: 9e-3,
        }
    }
}

impl Default for ClothParams {
    fn default() -> Self {
        Self {
            stretch_compliance: 4.0,
            bending_compliance: 10.0,
            anchor_compliance: 200.0,
            strain_limit: 0.12,
            fold_distance: 6e-3,
        }
    }
}

impl Default for PaperParams {
    /// Those of [`SolverParams`] and [`AirParams`].
    fn default() -> Self {
        let (solver, air) = (SolverParams::default(), AirParams::default());
        Self {
            time_step: solver.time_step,
            substeps: solver.substeps,
            steps: solver.steps,
            compliance: solver.compliance,
            friction: solver.friction,
            air_distance: air.max_distance,
            air_gap: air.max_gap,
        }
    }
}

impl ResolveParams {
    /// Checks that every parameter is in its range.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range, with its group: `goal.clearance`.
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.goal.validate().map_err(|e| e.within("goal"))?;
        self.effort.validate().map_err(|e| e.within("effort"))?;
        self.cloth.validate().map_err(|e| e.within("cloth"))?;
        self.paper.validate().map_err(|e| e.within("paper"))
    }
}

impl GoalParams {
    fn validate(&self) -> Result<(), ParameterError> {
        let (gap, tuck) = (self.clearance, self.tuck_distance);
        check("clearance", gap, gap > 0.0 && gap < 0.1, "above 0 and below 0.1 m")?;
        let least = self.least_distance;
        check("least_distance", least, (0.0..=0.02).contains(&least), "from 0 to 0.02 m")?;
        check("tuck_distance", tuck, tuck > 0.0 && tuck < 0.5, "above 0 and below 0.5 m")?;
        let depth = self.body_depth;
        check("body_depth", depth, depth > 0.0 && depth <= 0.1, "above 0 and at most 0.1 m")
    }
}

impl EffortParams {
    fn validate(&self) -> Result<(), ParameterError> {
        let count =
            |name, n: usize| check(name, n as Real, (1..=10_000).contains(&n), "from 1 to 10,000");
        count("rounds", self.rounds)?;
        count("sweeps", self.sweeps)?;
        share("polish_strain", self.polish_strain)?;
        share("ease_strain", self.ease_strain)?;
        share("untangle_strain", self.untangle_strain)?;
        length("tolerance", self.tolerance)?;
        length("influence", self.influence)?;
        length("repair_influence", self.repair_influence)?;
        length("contact_step", self.contact_step)?;
        length("contact_margin", self.contact_margin)?;
        length("max_push", self.max_push)?;
        length("separation_step", self.separation_step)?;
        length("long_edge", self.long_edge)?;
        length("outward_cell", self.outward_cell)?;
        let growth = self.gap_growth;
        check("gap_growth", growth, (1.0..=2.0).contains(&growth), "from 1 to 2")
    }
}

impl ClothParams {
    fn validate(&self) -> Result<(), ParameterError> {
        let compliance =
            |name, c: Real| check(name, c, (0.0..=1e12).contains(&c), "from 0 (rigid) to 1e12");
        compliance("stretch_compliance", self.stretch_compliance)?;
        compliance("bending_compliance", self.bending_compliance)?;
        compliance("anchor_compliance", self.anchor_compliance)?;
        share("strain_limit", self.strain_limit)?;
        length("fold_distance", self.fold_distance)
    }
}

impl PaperParams {
    /// The parameters of the solver, with a gap of `clearance` metres.
    pub(crate) fn solver(&self, clearance: Real) -> SolverParams {
        let Self { time_step, substeps, steps, compliance, friction, .. } = *self;
        let default = SolverParams::default();
        SolverParams { time_step, substeps, steps, compliance, friction, clearance, ..default }
    }

    /// The parameters of the air constraint, if there is one, with a least gap of `clearance` metres.
    pub(crate) fn air(&self, clearance: Real) -> Option<AirParams> {
        let (max_distance, max_gap) = (self.air_distance, self.air_gap.max(clearance));
        let air = AirParams { max_distance, min_gap: clearance, max_gap, ..AirParams::default() };
        (max_distance > 0.0).then_some(air)
    }

    fn validate(&self) -> Result<(), ParameterError> {
        check("steps", self.steps.into(), (1..=10_000).contains(&self.steps), "from 1 to 10,000")?;
        let air = self.air_distance;
        check("air_distance", air, (0.0..=10.0).contains(&air), "from 0 (no air) to 10 m")?;
        length("air_gap", self.air_gap)?;
        self.solver(GoalParams::default().clearance).validate()
    }
}

fn check(
    name: &'static str,
    value: Real,
    ok: bool,
    range: &'static str,
) -> Result<(), ParameterError> {
    ParameterError::check(name, value, ok, range)
}

fn length(name: &'static str, value: Real) -> Result<(), ParameterError> {
    check(name, value, value > 0.0 && value <= 10.0, "above 0 and at most 10 m")
}

fn share(name: &'static str, value: Real) -> Result<(), ParameterError> {
    check(name, value, (0.0..=1e12).contains(&value), "a share from 0 to 1e12")
}

/// When the inner of two garments gives way to the outer one.
///
/// Layers settle from the body outwards, and as in the paper only the outer of two garments moves.
/// Where the outer one is the smaller, it would be stretched over what it should hold together.
/// Inner garments can instead be pressed in below the layers above first, as far as the body leaves
/// room.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Tuck {
    /// Never: a garment that gets stuck yields, stretched as far as necessary.
    Never,
    /// When a garment gets stuck over others that it met: those settle again, below it.
    #[default]
    IfStuck,
    /// In any outfit whose garments meet.
    Always,
}

/// How a garment settles over the layers below it. Verification and repair are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Method {
    /// Rounds of contacts with the triangles below, in which only neighbourhoods of intersections
    /// move.
    #[default]
    Contacts,
    /// As in the paper: Algorithm 1 on the field of the layers below, masked by the boxes of the
    /// garments among them (Appendix C). All of the garment moves.
    Paper,
}

/// When triangles are split into smaller ones.
///
/// A garment of large triangles cannot lie round a body or a layer of fine ones without standing
/// off, or stretching: a chord cuts through. Split triangles can follow. The garment then has more
/// vertices and triangles than the input: [`Resolved::splits`](crate::resolve::Resolved::splits)
/// says where they come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Split {
    /// Never: the triangles are those of the input.
    #[default]
    Never,
    /// Those of a garment that cannot be made clean otherwise.
    IfLeft,
    /// Also large ones with an edge that would be strained by more than half.
    IfStrained,
}

/// What happens to the intersections of a garment with itself that the input has.
///
/// New ones are removed in any case. Simulators refuse a garment that intersects itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Own {
    /// They are removed, by moving their neighbourhoods. What cannot be removed stays, and is named
    /// in the report.
    #[default]
    Remove,
    /// They stay.
    Keep,
}

/// What happens in pinches: where the body meets itself, as in the armpits and the groin of a posed
/// body, or leaves no room for the cloth between.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Pinch {
    /// The body stays as it is. What intersects in pinches is counted apart.
    #[default]
    Keep,
    /// The body yields: garments lie on one that is drawn back there, which is part of the result.
    Yield,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_names_the_group() {
        let mut params = ResolveParams::default();
        assert_eq!(params.validate(), Ok(()));
        params.cloth.strain_limit = Real::NAN;
        let error = params.validate().unwrap_err();
        assert_eq!(
            error.to_string(),
            "parameter `cloth.strain_limit` is NaN; it must be a share from 0 to 1e12"
        );
    }
}
