//! `--order auto`: the order of garments from where they lie.

use crate::load::load;
use crate::outfit_file::OutfitSpec;
use if_outfit::files::OutfitFiles;
use if_outfit::order::{OrderProposal, SURE, propose_order};
use miette::{Diagnostic, IntoDiagnostic, Report};
use std::fmt::Write;

/// The order is not clear from the meshes.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error(
    "the order of `{first}` and `{second}` in `{outfit}` is ambiguous: confidence {confidence:.2}, below {SURE:.2}"
)]
#[diagnostic(
    code(ifg::order::ambiguous),
    help(
        "give the garments innermost first, without --order auto; `ifg check --order auto` prints all pairs"
    )
)]
pub(crate) struct AmbiguousOrder {
    outfit: String,
    first: String,
    second: String,
    confidence: f64,
}

/// What is proposed for the outfit of `files`.
pub(crate) fn proposed(files: &OutfitFiles) -> Result<OrderProposal, Report> {
    propose_order(files.outfit()).into_diagnostic()
}

/// The outfit with its garments in the order proposed.
///
/// # Errors
///
/// Files that are not a valid outfit, or an ambiguous pair.
pub(crate) fn ordered(spec: &OutfitSpec) -> Result<OutfitSpec, Report> {
    let found = proposed(&load(spec)?)?;
    match found.ambiguous() {
        Some(pair) => Err(AmbiguousOrder {
            outfit: spec.name.clone(),
            first: pair.inner.clone(),
            second: pair.outer.clone(),
            confidence: pair.confidence,
        }
        .into()),
        None => Ok(with_order(spec, &found)),
    }
}

/// The outfit with its garments in this order.
pub(crate) fn with_order(spec: &OutfitSpec, found: &OrderProposal) -> OutfitSpec {
    let garments = found.order.iter().map(|k| spec.garments[*k].clone()).collect();
    OutfitSpec { garments, ..spec.clone() }
}

/// The proposal as text.
pub(crate) fn text(found: &OrderProposal) -> String {
    let state = if found.ambiguous().is_some() { "ambiguous" } else { "clear" };
    let mut text = format!(
        "Proposed order, innermost first: {} (confidence {:.2}: {state})\n",
        found.names.join(" < "),
        found.confidence
    );
    for pair in &found.pairs {
        let _ = writeln!(
            text,
            "  {} < {}: confidence {:.2} over {:.2} m²",
            pair.inner, pair.outer, pair.confidence, pair.area
        );
    }
    text
}
