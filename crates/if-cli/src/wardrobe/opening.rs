//! Opening a wardrobe, and errors of wardrobes with advice.

use crate::errors::ErrorChain;
use crate::output_error::{OutputError, advice};
use if_outfit::outfit::OutfitError;
use if_pipeline::asset::AssetError;
use if_pipeline::wardrobe::{Unreadable, Wardrobe, WardrobeError};
use miette::{Diagnostic, Report};
use std::path::Path;

/// An error of a wardrobe.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{context}")]
#[diagnostic(code(ifg::wardrobe), help("{help}"))]
pub(crate) struct Fault {
    context: String,
    help: String,
    source: ErrorChain,
}

/// An error of a wardrobe, with what it prevents. Another process that writes there is an error of its own.
pub(super) fn report(context: impl Into<String>, error: WardrobeError) -> Report {
    match error {
        WardrobeError::Busy { path } => OutputError::Busy { path }.into(),
        error => Fault::new(context, &error).into(),
    }
}

impl Fault {
    pub(crate) fn new(context: impl Into<String>, error: &WardrobeError) -> Self {
        let help = match error {
            WardrobeError::Body { source: OutfitError::Units { unit, scale, .. }, .. } => {
                &format!("if the files are in {unit}, add --scale {scale}")
            }
            WardrobeError::Parameter(p) if p.name == "scale" => "look at --scale",
            WardrobeError::Misfit(OutfitError::DuplicateName { .. }) => {
                "give another name, or rename the file"
            }
            WardrobeError::Asset(AssetError::Name { .. }) => {
                "a garment is called as its file: rename that; a body as --body has it"
            }
            WardrobeError::Scale { .. } | WardrobeError::Misfit(_) => {
                "look at --scale, and whether --body is the body that it was made on"
            }
            WardrobeError::NoBody { .. } | WardrobeError::NoGarment { .. } => {
                "`ifg wardrobe list` lists what is there"
            }
            WardrobeError::ForeignBody { .. } => {
                "add the body with `ifg wardrobe add --body NAME --mesh FILE`"
            }
            WardrobeError::NoWardrobe { .. } => {
                "look at the path; `ifg wardrobe add` makes a wardrobe"
            }
            WardrobeError::InTheWay { .. } => "give --out another folder, or move it away",
            WardrobeError::Body { .. }
            | WardrobeError::BodyFile(_)
            | WardrobeError::BodyMesh { .. } => {
                "the body must be one PLY, OBJ or glTF mesh in metres"
            }
            WardrobeError::Folder { source, .. } | WardrobeError::Io(source) => advice(source),
            WardrobeError::NotUpright { .. } => "rotate the files, and add them again",
            WardrobeError::Parameter(_) | WardrobeError::Resolve(_) => {
                "give a value in the range that is named; docs/reference/parameters.md lists them"
            }
            WardrobeError::NoGarments { .. }
            | WardrobeError::Twice { .. }
            | WardrobeError::Outfit(_) => {
                "name the body, and different garments from inner to outer"
            }
            _ => "formats are specified in docs/reference/wardrobe.md",
        };
        Self { context: context.into(), help: help.to_owned(), source: ErrorChain::new(error) }
    }
}

/// Opens an existing wardrobe, and prints what cannot be read in it.
pub(crate) fn open(root: &Path) -> Result<Wardrobe, Report> {
    opened(root, Wardrobe::open_existing(root))
}

/// The same where a wardrobe may be new.
pub(crate) fn open_or_begin(root: &Path) -> Result<Wardrobe, Report> {
    opened(root, Wardrobe::open(root))
}

fn opened(root: &Path, wardrobe: Result<Wardrobe, WardrobeError>) -> Result<Wardrobe, Report> {
    let wardrobe = wardrobe
        .map_err(|e| Fault::new(format!("cannot open wardrobe `{}`", root.display()), &e))?;
    for Unreadable { part, name, error } in wardrobe.faults() {
        crate::errors::note(&format!("{part} `{name}` is left out: {error}"));
    }
    Ok(wardrobe)
}
