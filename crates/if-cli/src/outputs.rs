//! Which files an outfit becomes, and how they are written.

use crate::errors::Told;
use crate::hash;
use crate::load::Loaded;
use crate::outfit_file::{LayerSpec, OutfitSpec};
use crate::pictures;
use crate::receipt::{Output, Request};
use crate::staging::{OutputError, Staging};
use if_core::math::Point;
use if_mesh::file::WriteError;
use rayon::prelude::*;
use std::path::Path;

/// The files that a finished outfit has, without its receipt.
pub(crate) fn names(spec: &OutfitSpec, pictures: bool) -> Vec<String> {
    let drawn = if pictures { &[pictures::BEFORE, pictures::AFTER][..] } else { &[] };
    spec.garments
        .iter()
        .map(|l| l.file_name.clone())
        .chain(drawn.iter().map(ToString::to_string))
        .collect()
}

/// Faults that can be seen before anything is read: two outputs of one name, an output over an
/// input, something in the way.
pub(crate) fn check(
    spec: &OutfitSpec,
    out: &Path,
    names: &[String],
    in_place: bool,
) -> Result<(), OutputError> {
    for (k, layer) in spec.garments.iter().enumerate() {
        let same = |other: &&LayerSpec| other.file_name.eq_ignore_ascii_case(&layer.file_name);
        if let Some(first) = spec.garments[..k].iter().find(same) {
            return Err(OutputError::SameName {
                first: first.written.clone(),
                second: layer.written.clone(),
                name: layer.file_name.clone(),
            });
        }
    }
    for name in names {
        let path = out.join(name);
        let Ok(target) = path.canonicalize() else { continue };
        if !target.is_file() {
            return Err(OutputError::InTheWay { path });
        }
        let is_target = |input: &&LayerSpec| input.path.canonicalize().is_ok_and(|p| p == target);
        let garment = spec.garments.iter().find(is_target).filter(|_| !in_place);
        // No option allows writing over the body.
        let over = Some(&spec.body)
            .filter(is_target)
            .map(|body| (body, false))
            .or(garment.map(|g| (g, true)));
        if let Some((input, option)) = over {
            return Err(OutputError::OverInput { path, written: input.written.clone(), option });
        }
    }
    Ok(())
}

/// Writes all garments into the staging folder; those that did not move are copies of their files.
pub(crate) fn write_garments(
    spec: &OutfitSpec,
    loaded: &Loaded,
    positions: &[Vec<Point>],
    request: &Request,
    (staging, out): (&Staging, &Path),
) -> Result<Vec<Output>, OutputError> {
    let one = |(k, layer): (usize, &LayerSpec)| {
        let name = &layer.file_name;
        loaded.garment_file(k).write(&staging.path(name), &positions[k]).map_err(|error| {
            match error {
                WriteError::Io { source, .. } => OutputError::File { path: out.join(name), source },
                other => OutputError::Mesh { path: out.join(name), source: Told::new(&other) },
            }
        })?;
        let mut written = describe(name, staging, out)?;
        // The request's first input is the body.
        written.unchanged = Some(written.content == request.inputs[k + 1].content);
        Ok(written)
    };
    // All are written before the first fault is looked for, so that it is the same on any number of
    // threads.
    let written: Vec<_> = spec.garments.par_iter().enumerate().map(one).collect();
    written.into_iter().collect()
}

/// What a staged file holds.
pub(crate) fn describe(name: &str, staging: &Staging, out: &Path) -> Result<Output, OutputError> {
    let fault = |source| OutputError::File { path: out.join(name), source };
    let content = hash::of_file(&staging.path(name)).map_err(fault)?;
    Ok(Output { file: name.to_owned(), content, unchanged: None })
}
