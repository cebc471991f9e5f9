//! The output files of an outfit, and how they are written.

use crate::errors::ErrorChain;
use crate::file_record::OutputFile;
use crate::outfit_file::{LayerSpec, OutfitSpec};
use crate::output_error::OutputError;
use crate::pictures;
use crate::staging::Staging;
use if_mesh::file::{MeshFile, WriteError};
use if_outfit::Pinch;
use if_outfit::digest::digest;
use if_outfit::files::{OutfitFiles, ResolvedFiles, drawn_back_name};
use rayon::prelude::*;
use std::path::Path;

/// The page of an outfit.
pub(crate) const PAGE: &str = "report.html";

/// The files that a finished outfit has, without its receipt.
pub(crate) fn names(spec: &OutfitSpec, pictures: bool) -> Vec<String> {
    let drawn = if pictures { &[pictures::BEFORE, pictures::AFTER, PAGE][..] } else { &[] };
    let files = spec.files().into_iter().map(|(name, _)| name.to_owned());
    files.chain(drawn.iter().map(ToString::to_string)).collect()
}

/// The same files, and the body that may be drawn back.
pub(crate) fn possible(spec: &OutfitSpec, names: &[String]) -> Vec<String> {
    let body = drawn_back_name(Path::new(&spec.body.file_name));
    let body = (spec.params.goal.pinch == Pinch::Yield).then_some(body);
    names.iter().cloned().chain(body).collect()
}

/// Errors that can be found before anything is read: two outputs of one name, an output over an
/// input, something in the way.
pub(crate) fn check(
    spec: &OutfitSpec,
    out: &Path,
    names: &[String],
    in_place: bool,
) -> Result<(), OutputError> {
    for (k, layer) in spec.garments.iter().enumerate() {
        let same = |other: &&LayerSpec| other.file_name.eq_ignore_ascii_case(&layer.file_name);
        let first = spec.garments[..k].iter().find(same);
        if names.iter().filter(|n| n.eq_ignore_ascii_case(&layer.file_name)).count() > 1 {
            // The last name is that of the body that was drawn back.
            return Err(OutputError::SameName {
                first: spec.body.written.clone(),
                second: layer.written.clone(),
                name: layer.file_name.clone(),
            });
        }
        if let Some(first) = first.filter(|first| !layer.is_in_file_of(first)) {
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
        // No option allows writing over the body, but for a file in which it stays as it is.
        let stays = spec.garments.iter().any(|g| g.is_in_file_of(&spec.body));
        let over = Some(&spec.body)
            .filter(|body| is_target(body) && !stays)
            .map(|body| (body, false))
            .or(garment.map(|g| (g, true)));
        if let Some((input, option)) = over {
            return Err(OutputError::OverInput { path, written: input.written.clone(), option });
        }
    }
    Ok(())
}

/// Writes all garments into the staging folder, and a body that was drawn back; those that did not
/// move are copies of their files.
pub(crate) fn write_garments(
    spec: &OutfitSpec,
    files: &OutfitFiles,
    resolved: &ResolvedFiles,
    (staging, out): (&Staging, &Path),
) -> Result<Vec<OutputFile>, OutputError> {
    let inputs: Vec<&MeshFile> = files.files().skip(1).collect(); // the body's comes first
    let fault = |name: &str, error: WriteError| match error {
        WriteError::Io { source, .. } => OutputError::File { path: out.join(name), source },
        other => OutputError::Mesh { path: out.join(name), source: ErrorChain::new(&other) },
    };
    let one = |(name, ks): &(&str, Vec<usize>)| {
        resolved.write_garments(ks, &staging.path(name)).map_err(|e| fault(name, e))?;
        let mut written = staging.describe(name, out)?;
        written.unchanged = Some(written.content == digest(inputs[ks[0]].bytes()));
        Ok::<_, OutputError>(written)
    };
    // All are written before the first error is returned, so that it is the same on any number of
    // threads.
    let written: Vec<_> = spec.files().par_iter().map(one).collect();
    let mut written = written.into_iter().collect::<Result<Vec<_>, _>>()?;
    if let Some(name) = resolved.drawn_back_file_name() {
        resolved.write_drawn_back(&staging.path(&name)).map_err(|e| fault(&name, e))?;
        written.push(staging.describe(&name, out)?);
    }
    Ok(written)
}
