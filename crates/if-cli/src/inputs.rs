//! Arguments that several commands have: which outfits, and which parameters.

use crate::values::{assignment, length, positive};
use clap::{Args, ValueEnum};
use if_outfit::{Method, Own, Pinch};
use std::path::PathBuf;

/// Which outfits.
#[derive(Args, Debug, Clone)]
pub(crate) struct InputArgs {
    /// Outfit files (.toml); or, with --body, the garments (.ply, .obj, .glb, .gltf), innermost first.
    #[arg(required = true, value_name = "FILES")]
    pub(crate) files: Vec<PathBuf>,
    /// The body, in metres. It may be open or in several parts.
    #[arg(long, value_name = "MESH")]
    pub(crate) body: Option<PathBuf>,
    /// Factor from the units of the files to metres, such as 0.001 for millimetres; output files
    /// keep the units of the input.
    #[arg(long, value_name = "FACTOR", value_parser = positive)]
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
