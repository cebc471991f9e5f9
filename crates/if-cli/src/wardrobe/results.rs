//! What `match` and `batch` share: parameters and ends.

use crate::end::End;
use crate::inputs::ParamArgs;
use crate::outfit_file::override_params;
use crate::receipt;
use if_outfit::resolve::ResolveParams;
use if_pipeline::wardrobe::matching::{MatchParams, State};
use miette::Report;

/// Parameters of results, with those of the command line.
pub(crate) fn match_params(args: &ParamArgs, picture_height: u32) -> Result<MatchParams, Report> {
    let resolve = override_params(&ResolveParams::default(), args)?;
    let tool = receipt::versions();
    Ok(MatchParams { resolve, picture_height, tool, ..MatchParams::default() })
}

/// The end of a command with one result.
pub(crate) fn end_of(state: State) -> End {
    match state {
        State::Clean => End::Clean,
        State::Remaining => End::NotClean,
        State::Failed => End::Unusable,
    }
}
