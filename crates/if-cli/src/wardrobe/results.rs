//! What `match` and `batch` share: parameters and ends.

use crate::end::End;
use crate::inputs::ParamArgs;
use crate::outfit_file::override_params;
use crate::receipt;
use clap::ValueEnum;
use if_pipeline::wardrobe::matching::{Fields, MatchParams, State};
use miette::Report;

/// [`Fields`] as an argument.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FieldsArg {
    /// Exact distances to the meshes. The default.
    Meshes,
    /// The trained φ of assets that have one, on the body that they were made on.
    Assets,
}

impl From<FieldsArg> for Fields {
    fn from(arg: FieldsArg) -> Self {
        match arg {
            FieldsArg::Meshes => Self::Meshes,
            FieldsArg::Assets => Self::Assets,
        }
    }
}

/// Parameters of results, with those of the command line.
pub(super) fn match_params(
    args: &ParamArgs,
    fields: Option<FieldsArg>,
    picture_height: u32,
) -> Result<MatchParams, Report> {
    let default = MatchParams::default();
    let resolve = override_params(&default.resolve, args)?;
    let tool = receipt::versions();
    let fields = fields.map_or(Fields::default(), Into::into);
    Ok(MatchParams { resolve, fields, picture_height, tool, ..default })
}

/// The end of a command with one result; with `strict` it must be clean everywhere.
pub(crate) fn end_of(state: State, everywhere: bool, strict: bool) -> End {
    match state {
        State::Clean if strict && !everywhere => End::NotClean,
        State::Clean => End::Clean,
        State::Remaining => End::NotClean,
        State::Failed => End::Unusable,
    }
}
