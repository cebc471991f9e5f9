//! Matching: one combination, aligned, resolved, drawn, and written atomically as a folder.
//!
//! ```text
//! KEY/
//!   result.json       input and result: the same bytes in every run
//!   GARMENT.ply       one per garment, if free of intersections
//!   before.png, after.png
//!   timings.json, report.html   seconds, different in every run
//! ```
//!
//! The key is the hash of all that decides the result: the build of this program, versions,
//! parameters, the hashes of body and garments in their order.

pub use super::layer_fields::{Fields, GarmentField, Read};
pub use super::result::{
    Fault, MatchParams, MatchRequest, MatchResult, Matched, RequestedGarment, State, Timings,
};

use super::WardrobeError;
use super::begun::Begun;
use super::combination::Combination;
use super::dresser::{Dressed, Dresser};
use super::layer_fields;
use super::result::FORMAT;
use super::result_folder::{self, folder_name};
use crate::asset::PhiField;
use crate::build::BUILD;
use if_core::mesh::TriMesh;
use if_core::monitor::{Cancelled, Monitor};
use if_core::parameter::ParameterError;
use if_mesh::atomic::FolderWriter;
use if_mesh::file::MeshFile;
use if_outfit::FieldOfGarment;
use if_outfit::digest::digest;
use if_outfit::files::{FilesError, OutfitFiles};
use if_outfit::outfit::Outfit;
use if_outfit::resolve::ResolveError;
use if_render::{View, preview};
use serde::Serialize;
use std::path::Path;
use std::time::Instant;

/// The views of the pictures.
const VIEWS: [View; 3] = [View::FRONT, View::BACK, View::HALF];

/// Checks the parameters of matching and of the alignment.
pub(super) fn check(dresser: &Dresser, params: &MatchParams) -> Result<(), ParameterError> {
    dresser.params().validate().map_err(|e| e.within("align"))?;
    params.validate()
}

/// The key of a combination, and everything that it is the hash of.
///
/// # Errors
///
/// The wardrobe does not have the body or a garment.
pub(super) fn request(
    dresser: &Dresser,
    combination: &Combination,
    params: &MatchParams,
) -> Result<(String, MatchRequest), WardrobeError> {
    let wardrobe = dresser.wardrobe();
    let body = wardrobe.body_info(&combination.body)?.clone();
    let mut garments = Vec::new();
    for name in &combination.garments {
        let info = wardrobe.garment_info(name)?;
        let own = wardrobe.body_like(name, &info.body)?;
        garments.push(RequestedGarment {
            name: name.clone(),
            mesh: info.garment.content.sha256.clone(),
            skinned: info.skinned,
            phi: match params.fields {
                Fields::Meshes => Vec::new(),
                Fields::Assets => layer_fields::hashes(info),
            },
            body: own.clone(),
        });
    }
    let (format, build, params) = (FORMAT, BUILD.to_owned(), params.clone());
    let align = *dresser.params();
    let request = MatchRequest { format, build, params, align, body, garments };
    Ok((key(&request)?, request))
}

/// The key of a request.
fn key(request: &impl Serialize) -> Result<String, WardrobeError> {
    let text = serde_json::to_string(request)
        .map_err(|e| WardrobeError::Json { message: e.to_string() })?;
    Ok(digest(text.as_bytes()).sha256)
}

/// Aligns and resolves a combination. Failures are part of the result.
///
/// # Errors
///
/// Parameters out of range, a body or garment that the wardrobe does not have (nothing can be
/// recorded without a key), and [`WardrobeError::Cancelled`].
pub fn run(
    dresser: &Dresser,
    combination: &Combination,
    params: &MatchParams,
    monitor: &mut dyn Monitor,
) -> Result<Matched, WardrobeError> {
    check(dresser, params)?;
    let start = Instant::now();
    let (key, request) = request(dresser, combination, params)?;
    let mut matched = Matched {
        result: MatchResult {
            result: FORMAT,
            key,
            combination: combination.clone(),
            state: State::Failed,
            error: None,
            alignments: Vec::new(),
            turned: Vec::new(),
            fields: Vec::new(),
            report: None,
            request,
            outputs: Vec::new(),
        },
        before: None,
        after: None,
        pictures: None,
        timings: Timings::default(),
    };
    let dressed = dresser.dress(combination);
    matched.timings.align = start.elapsed().as_secs_f64();
    match dressed.and_then(|dressed| settle(dressed, params, &mut matched, monitor)) {
        Ok(()) => {}
        Err(error) if error.is_passing() => return Err(error),
        Err(error) => {
            matched.result.error =
                Some(Fault { kind: error.kind().into(), message: error.to_string() })
        }
    }
    matched.timings.total = start.elapsed().as_secs_f64();
    Ok(matched)
}

/// Resolves and draws.
fn settle(
    dressed: Dressed,
    params: &MatchParams,
    matched: &mut Matched,
    monitor: &mut dyn Monitor,
) -> Result<(), WardrobeError> {
    let start = Instant::now();
    matched.result.alignments = dressed.garments.iter().map(|g| g.report).collect();
    matched.result.turned = dressed.garments.iter().map(|g| g.turned.clone()).collect();
    let (fields, read) = match params.fields {
        Fields::Meshes => (dressed.garments.iter().map(|_| None).collect(), Vec::new()),
        Fields::Assets => layer_fields::of_assets(&dressed)?,
    };
    matched.result.fields = read;
    let fields: Vec<FieldOfGarment<'_>> =
        fields.iter().map(|f| f.as_ref().map(PhiField::field)).collect();
    let files = dressed.garments.iter().map(|g| MeshFile::from_ply(g.asset.file())).collect();
    let files = OutfitFiles::from_memory(dressed.outfit, files).with_body(dressed.body);
    let outcome = files.resolve_on_fields(&fields, &params.resolve, monitor);
    matched.timings.resolve = start.elapsed().as_secs_f64();
    matched.before = Some(files.outfit().clone());
    let resolved = match outcome {
        Ok(resolved) => {
            matched.result.state = State::Clean;
            resolved
        }
        Err(FilesError::Unresolved { unresolved, result }) => {
            let fault = Fault { kind: "remaining".into(), message: unresolved.to_string() };
            matched.result.state = State::Remaining;
            matched.result.error = Some(fault);
            *result
        }
        Err(FilesError::Resolve(ResolveError::Cancelled { .. })) => {
            return Err(WardrobeError::Cancelled(Cancelled));
        }
        Err(FilesError::Resolve(error)) => return Err(WardrobeError::Resolve(error)),
        Err(error) => return Err(WardrobeError::Files(error)),
    };
    matched.result.report = Some(resolved.report.clone().without_seconds());
    if params.picture_height > 0
        && let Some(before) = &matched.before
    {
        let drawing = Instant::now();
        let size = [params.picture_height * 5 / 8, params.picture_height];
        let draw = |outfit| preview(&meshes(outfit), &VIEWS, size);
        matched.pictures = Some(rayon::join(|| draw(before), || draw(&resolved.outfit)).into());
        matched.timings.pictures = drawing.elapsed().as_secs_f64();
    }
    matched.after = Some(resolved);
    Ok(())
}

fn meshes(outfit: &Outfit) -> Vec<&TriMesh> {
    outfit.layers().map(|l| &l.mesh).collect()
}

/// Resolves a combination of a batch in the folder `batch`, or takes what `results` holds of it already.
/// Returns `true` in the second case.
///
/// # Errors
///
/// As [`run`], and errors of the folder.
pub(super) fn run_into(
    (batch, results, others): (&Path, &FolderWriter, Option<&Path>),
    dresser: &Dresser,
    combination: &Combination,
    params: &MatchParams,
    again: bool,
    monitor: &mut dyn Monitor,
) -> Result<(MatchResult, bool), WardrobeError> {
    let (key, _) = request(dresser, combination, params)?;
    let name = folder_name(&key);
    let mut places = std::iter::once(results.parent()).chain(others);
    if !again && let Some(found) = places.find_map(|place| finished(&place.join(name), &key)) {
        return Ok((found, true));
    }
    let _begun = Begun::mark(batch, combination);
    let mut matched = run(dresser, combination, params, monitor)?;
    results.write(name, |folder| {
        result_folder::fill(folder, &mut matched, (params, false), dresser.wardrobe())
    })?;
    Ok((matched.result, false))
}

/// Where a result of [`run_into_folder`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placed {
    /// The folder had it before.
    Before,
    /// It was written.
    Written,
    /// It was not written: the folder has a better one, such as a clean result instead of a failure.
    Nowhere,
}

/// Resolves a combination into a folder of the user's, or takes what that holds of it already.
///
/// The files of an earlier result are replaced, other files stay. A result that is worse than the
/// earlier one (failed rather than clean) is not written, unless `params.unproven` is set.
///
/// # Errors
///
/// As [`run`]. The combination is invalid, another process writes there, or a file of the user's is
/// in the way; these errors occur before the work.
pub fn run_into_folder(
    out: &Path,
    dresser: &Dresser,
    combination: &Combination,
    params: &MatchParams,
    again: bool,
    monitor: &mut dyn Monitor,
) -> Result<(MatchResult, Placed), WardrobeError> {
    combination.check()?;
    check(dresser, params)?;
    dresser.wardrobe().keep_out(out)?;
    let (key, _) = request(dresser, combination, params)?;
    if !again && let Some(found) = finished(out, &key) {
        return Ok((found, Placed::Before));
    }
    let names = result_folder::names(combination, params);
    // Before the lock: a folder of the user's must not be changed at all.
    result_folder::Earlier::of(out, &names)?;
    let opened = FolderWriter::open(out)
        .map_err(|source| WardrobeError::Folder { path: out.into(), source })?;
    let writer = opened.ok_or_else(|| WardrobeError::Busy { path: out.into() })?;
    let earlier = result_folder::Earlier::of(out, &names)?;
    let mut matched = run(dresser, combination, params, monitor)?;
    let state = matched.result.state;
    let is_asked_for = params.unproven && state == State::Remaining;
    if !is_asked_for && earlier.state.is_some_and(|there| there < state) {
        return Ok((matched.result, Placed::Nowhere));
    }
    writer.write_files(&earlier.files, |folder| {
        let params = (params, params.picture_height > 0);
        result_folder::fill(folder, &mut matched, params, dresser.wardrobe())?;
        // The list of outputs comes first: files on it never count as the user's.
        let outputs = matched.result.outputs.iter().map(|output| output.file.clone());
        Ok::<_, WardrobeError>((
            (),
            result_folder::OWN.map(str::to_owned).into_iter().chain(outputs).collect(),
        ))
    })?;
    Ok((matched.result, Placed::Written))
}

/// Whether a folder has a result that a later run will take.
pub(super) fn is_finished(folder: &Path) -> bool {
    result_folder::read(folder).is_some_and(|found| finished(folder, &found.key).is_some())
}

/// The result in a folder, if it is that of `key` and its files have the recorded hashes. `None` for
/// failures by unreadable files of the wardrobe, which may have been restored.
pub(super) fn finished(folder: &Path, key: &str) -> Option<MatchResult> {
    let lasts = |r: &MatchResult| {
        r.error.as_ref().is_none_or(|e| !matches!(e.kind.as_str(), "asset" | "body"))
    };
    result_folder::read(folder).filter(|r| r.key == key && r.result == FORMAT && lasts(r))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn another_build_has_another_key() {
        let request = |build: &str| json!({"format": FORMAT, "build": build, "params": {}});
        assert_eq!(key(&request(BUILD)).unwrap(), key(&request(BUILD)).unwrap());
        let other = format!("{BUILD}0");
        assert_ne!(key(&request(BUILD)).unwrap(), key(&request(&other)).unwrap());
        let (version, sources) = BUILD.split_once('+').unwrap();
        assert_eq!((version, sources.len()), (env!("CARGO_PKG_VERSION"), 16));
    }
}
