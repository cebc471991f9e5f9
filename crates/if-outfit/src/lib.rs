//! Layered outfits made intersection-free, and proven so.
//!
//! An [`Outfit`] is a body and its garments, inner to outer. [`resolve()`] settles one garment
//! after the other over all layers below it, and returns the outfit only if exact predicates find no
//! intersection; else its [`ResolveError`] names what remains. [`verify()`] checks and changes
//! nothing. A [`motion::Walker`] follows a motion from one clean state to the next.
//! [`propose_order()`] proposes which garment is the inner one. [`files::OutfitFiles`] does the same
//! from files to files. [`report`] holds what was found and done.
//!
#![doc = include_str!("../README.md")]

mod algorithm1;
mod attempt;
mod bridges;
mod build;
pub mod cleanness;
mod cloth;
mod coarse;
mod contact_groups;
mod contacts;
pub mod digest;
mod distances;
mod dressing;
mod elastic_groups;
mod facing_sheets;
pub mod files;
mod findings;
mod giving_way;
mod incremental_verification;
mod layer_fields;
pub mod motion;
mod moving_apart;
pub mod named_parameters;
pub mod notes;
mod obstacle;
pub mod order;
pub mod outfit;
mod params;
mod phases;
pub mod pinch;
mod prepared_body;
mod progress;
mod repair;
pub mod report;
pub mod resolve;
mod separating_plane;
mod settle;
mod sewn;
mod splitting;
pub mod storage;
pub mod unresolved;
mod untangle;
mod upper_layers;
pub mod verify;
mod way;
mod ways_in;
mod ways_out;
mod welded;
mod workpiece;

pub use build::BUILD;
pub use cleanness::Cleanness;
pub use layer_fields::FieldOfGarment;
pub use named_parameters::{NamedParameterError, with_parameter};
pub use notes::notes;
pub use obstacle::Obstacle;
pub use order::{OrderProposal, propose_order};
pub use outfit::{Layer, Outfit, OutfitError};
pub use params::{
    ClothParams, EffortParams, GoalParams, Method, Own, PaperParams, Pinch, ResolveParams, Split,
    Tuck,
};
pub use prepared_body::PreparedBody;
pub use report::{ResolveReport, Verification};
pub use resolve::{ResolveError, Resolved, resolve, resolve_on_fields};
pub use storage::Storage;
pub use verify::verify;
