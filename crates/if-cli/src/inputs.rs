//! Arguments that several commands have: which outfits, and which parameters.

use crate::values::{assignment, length, positive};
use clap::{Args, ValueEnum};
use if_outfit::{Method, Own, Pinch};
use std::path::PathBuf;

/// Which outfits.
#[derive(Args, Debug, Clone)]
pub(crate) struct InputArgs {
    /// Outfit files (.toml), of which `animate` takes one; or, with --body, the garments (.ply, .obj, .glb, .vrm,
    /// .gltf), innermost first.
    #[arg(required = true, value_name = "FILES")]
    pub(crate) files: Vec<PathBuf>,
    /// The body, in metres. It may be open or in several parts.
    #[arg(long, value_name = "MESH")]
    pub(crate) body: Option<PathBuf>,
    /// Factor from the units of the files to metres, such as 0.001 for millimetres; output files
    /// keep the units of the input.
    #[arg(long, value_name = "FACTOR", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) scale: Option<f64>,
    /// Exit with 0 only if the outfit is clean everywhere: body and garments must not intersect
    /// themselves either.
    #[arg(long)]
    pub(crate) strict: bool,
    /// Order of the garments: as given, innermost first, or proposed from where they lie.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) order: Order,
    /// Print reports as JSON on stdout, one line an outfit, and no tables.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Where the order of the garments comes from.
#[derive(ValueEnum, Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Order {
    /// As given, innermost first.
    #[default]
    Given,
    /// Proposed from where they lie. `check` prints it; `fix` uses it unless it is ambiguous.
    Auto,
}

/// Parameters of `resolve`.
#[derive(Args, Debug, Clone, Default)]
pub(crate) struct ParamArgs {
    /// Gap to keep between layers at vertices and long edges, with a unit: 0.5mm, 0.0005m; metres
    /// without one.
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    pub(crate) clearance: Option<f64>,
    /// Move the layers of a clean result apart until no two come nearer than this, as far as there
    /// is room, with a unit, such as 0.1mm: for simulators that need a gap to start from.
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    pub(crate) least_distance: Option<f64>,
    /// What happens to intersections of a garment with itself that the input has.
    #[arg(long, value_enum)]
    pub(crate) own: Option<OwnArg>,
    /// How a garment settles before what is left is repaired.
    #[arg(long, value_enum)]
    pub(crate) method: Option<MethodArg>,
    /// Any other parameter, as in the `params` table of an outfit file; may be given more than
    /// once.
    #[arg(long, value_name = "KEY=VALUE", value_parser = assignment)]
    pub(crate) set: Vec<(String, toml::Value)>,
}

impl ParamArgs {
    /// The options that are given and stand for parameters of these names.
    pub(crate) fn options(&self) -> Vec<&'static str> {
        let given = [
            ("clearance", self.clearance.is_some()),
            ("least_distance", self.least_distance.is_some()),
            ("own", self.own.is_some()),
            ("method", self.method.is_some()),
        ];
        given.into_iter().filter(|(_, is_given)| *is_given).map(|(name, _)| name).collect()
    }
}

/// The first parameter that an assignment and one of these options gives, or two assignments give.
pub(crate) fn given_twice<'a>(
    set: &'a [(String, toml::Value)],
    options: &[&str],
) -> Option<&'a str> {
    let names: Vec<&str> = set.iter().map(|(key, _)| last_part(key)).collect();
    let is_known = |k: usize| options.contains(&names[k]) || names[..k].contains(&names[k]);
    (0..names.len()).find(|k| is_known(*k)).map(|k| names[k])
}

/// The name of a parameter without that of its group.
pub(crate) fn last_part(key: &str) -> &str {
    key.rsplit('.').next().unwrap_or(key)
}

/// [`Pinch`] as an argument.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PinchArg {
    /// The body is drawn back there, and written beside the garments.
    Yield,
    /// The body stays as it is; what intersects there is counted apart.
    Keep,
}

impl From<PinchArg> for Pinch {
    fn from(arg: PinchArg) -> Self {
        match arg {
            PinchArg::Yield => Self::Yield,
            PinchArg::Keep => Self::Keep,
        }
    }
}

/// [`Method`] as an argument.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MethodArg {
    /// Rounds of contacts near intersections. The default.
    Contacts,
    /// As in the paper: Algorithm 1 on the masked field of the layers below moves all of it.
    Paper,
}

impl From<MethodArg> for Method {
    fn from(arg: MethodArg) -> Self {
        match arg {
            MethodArg::Contacts => Self::Contacts,
            MethodArg::Paper => Self::Paper,
        }
    }
}

/// [`Own`] as an argument.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OwnArg {
    /// They are removed; what cannot be removed stays, and is named.
    Remove,
    /// They stay.
    Keep,
}

impl From<OwnArg> for Own {
    fn from(arg: OwnArg) -> Self {
        match arg {
            OwnArg::Remove => Self::Remove,
            OwnArg::Keep => Self::Keep,
        }
    }
}
