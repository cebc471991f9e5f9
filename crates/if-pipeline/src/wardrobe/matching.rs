//! One combination: aligned, resolved, drawn, and written as a folder that is there whole or not at
//! all.
//!
//! ```text
//! KEY/
//!   result.json       what went in, what came out: the same bytes whenever and wherever it is made
//!   GARMENT.ply       one a garment, where nothing is left that intersects
//!   before.png, after.png
//!   timings.json, report.html   seconds: these differ from run to run
//! ```
//!
//! The key is the hash of all that decides the result: versions, parameters, the hashes of body and
//! garments in their order.

use super::combination::Combination;
use super::dresser::{Dressed, Dresser};
use super::result_folder;
use super::{Wardrobe, WardrobeError};
use if_body::align::{AlignParams, AlignReport};
use if_core::mesh::TriMesh;
use if_core::monitor::{Cancelled, Monitor};
use if_mesh::file::MeshFile;
use if_mesh::whole_folder::Writer;
use if_outfit::content::content;
use if_outfit::files::{FilesError, OutfitFiles, ResolvedFiles};
use if_outfit::outfit::Outfit;
use if_outfit::report::ResolveReport;
use if_outfit::resolve::{ResolveError, ResolveParams};
use if_render::preview;
use if_render::{Image, View};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::ops::RangeInclusive;
use std::path::Path;
use std::time::Instant;

/// What is made of a combination, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MatchParams {
    /// How garments are aligned.
    pub align: AlignParams,
    /// How the outfit is resolved.
    pub resolve: ResolveParams,
    /// Whether meshes are written.
    pub meshes: bool,
    /// Whether the body is written beside them.
    pub body: bool,
    /// Whether meshes are written even where intersections are left.
    pub unproven: bool,
    /// Height of the pictures in pixels; 0 draws none.
    pub picture_height: u32,
    /// Names and versions of everything that results depend on, for keys and records.
    pub tool: Value,
}

/// Heights of pictures that are drawn, in pixels.
pub const PICTURE_HEIGHTS: RangeInclusive<u32> = 16..=8192;

impl MatchParams {
    /// Whether the numbers make sense: before anything is aligned, and kept as a failure.
    ///
    /// # Errors
    ///
    /// A height of pictures that cannot be drawn, a parameter of the alignment or of resolving that
    /// is out of range.
    pub fn validate(&self) -> Result<(), WardrobeError> {
        if self.picture_height != 0 && !PICTURE_HEIGHTS.contains(&self.picture_height) {
            return Err(WardrobeError::PictureHeight { height: self.picture_height });
        }
        self.align.validate().map_err(|e| e.within("align"))?;
        Ok(self.resolve.validate().map_err(|e| e.within("resolve"))?)
    }
}

impl Default for MatchParams {
    fn default() -> Self {
        Self {
            align: AlignParams::default(),
            resolve: ResolveParams::default(),
            meshes: true,
            body: false,
            unproven: false,
            picture_height: 480,
            tool: json!({"if-pipeline": env!("CARGO_PKG_VERSION")}),
        }
    }
}

/// How a combination ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// No intersections.
    Clean,
    /// Some are left.
    Remaining,
    /// An error.
    Failed,
}

/// What becomes of a combination: `result.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatchResult {
    /// The version of the format.
    pub result: u32,
    /// What decides the result, as a hash.
    pub key: String,
    /// Which garments on which body.
    pub combination: Combination,
    /// How it ended.
    pub state: State,
    /// What was wrong.
    pub error: Option<Fault>,
    /// Of each garment, inner to outer.
    pub alignments: Vec<AlignReport>,
    /// The outfit before and after; its seconds are zero.
    pub report: Option<ResolveReport>,
    /// Everything that the key is made of.
    pub request: Value,
    /// The files beside this one that are the same in each run.
    pub outputs: Vec<crate::asset::FileInfo>,
}

/// An error as it is recorded.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fault {
    /// Its kind: [`WardrobeError::kind`].
    pub kind: String,
    /// What it says.
    pub message: String,
}

/// Seconds, in the order spent: `timings.json`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timings {
    /// Reading and aligning; next to nothing where the dresser had it already.
    pub align: f64,
    /// Resolving, its verification included.
    pub resolve: f64,
    /// Drawing.
    pub pictures: f64,
    /// Writing.
    pub write: f64,
    /// All.
    pub total: f64,
}

/// A combination that was done, in memory.
#[derive(Clone, Debug)]
pub struct Matched {
    /// What is recorded.
    pub result: MatchResult,
    /// As it was aligned, where it got so far.
    pub before: Option<Outfit>,
    /// As it was resolved, as far as it went, with the files of its garments.
    pub after: Option<ResolvedFiles>,
    /// Pictures of the two.
    pub pictures: Option<[Image; 2]>,
    /// Seconds.
    pub timings: Timings,
}

/// From where outfits are drawn.
const VIEWS: [View; 3] = [View::FRONT, View::BACK, View::HALF];

/// The name of a combination's folder, and everything that it is made of.
///
/// # Errors
///
/// A body or garment that the wardrobe does not have.
pub fn request(
    wardrobe: &Wardrobe,
    combination: &Combination,
    params: &MatchParams,
) -> Result<(String, Value), WardrobeError> {
    let body = wardrobe.body_info(&combination.body)?;
    let mut garments = Vec::new();
    for name in &combination.garments {
        let info = wardrobe.garment_info(name)?;
        let own = wardrobe.body_like(name, &info.body)?;
        garments.push(json!({"name": name, "mesh": info.garment.content.sha256, "skinned": info.skinned, "body": own}));
    }
    let request = json!({"format": FORMAT, "params": params, "body": body, "garments": garments});
    let text = serde_json::to_string(&request)
        .map_err(|e| WardrobeError::Json { message: e.to_string() })?;
    Ok((content(text.as_bytes()).sha256, request))
}

/// The version of `result.json`.
pub const FORMAT: u32 = 1;
/// The digits of a key that name a folder.
const DIGITS: usize = 20;

/// The folder of a key, below that of all results.
pub fn folder_name(key: &str) -> &str {
    key.get(..DIGITS).unwrap_or(key)
}

/// Aligns and resolves a combination. What is wrong with it is part of the result.
///
/// # Errors
///
/// Parameters out of range, or a body or garment that the wardrobe does not have, so that nothing
/// can be recorded under a key; and [`WardrobeError::Cancelled`].
pub fn run(
    dresser: &Dresser,
    combination: &Combination,
    params: &MatchParams,
    monitor: &mut dyn Monitor,
) -> Result<Matched, WardrobeError> {
    params.validate()?;
    let start = Instant::now();
    let (key, request) = request(dresser.wardrobe(), combination, params)?;
    let mut matched = Matched {
        result: MatchResult {
            result: FORMAT,
            key,
            combination: combination.clone(),
            state: State::Failed,
            error: None,
            alignments: Vec::new(),
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
    let files = dressed.garments.iter().map(|g| MeshFile::from_ply(g.asset.file())).collect();
    let files = OutfitFiles::from_memory(dressed.outfit, files);
    let outcome = files.resolve(&params.resolve, monitor);
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
        matched.pictures =
            Some([before, &resolved.outfit].map(|o| preview(&meshes(o), &VIEWS, size)));
        matched.timings.pictures = drawing.elapsed().as_secs_f64();
    }
    matched.after = Some(resolved);
    Ok(())
}

fn meshes(outfit: &Outfit) -> Vec<&TriMesh> {
    outfit.layers().map(|l| &l.mesh).collect()
}

/// Resolves a combination, or takes what `results` holds of it already. Returns `true` in the second
/// case.
///
/// # Errors
///
/// As [`run`], or what the system says about the folder.
pub fn run_into(
    results: &Writer,
    dresser: &Dresser,
    combination: &Combination,
    params: &MatchParams,
    again: bool,
    monitor: &mut dyn Monitor,
) -> Result<(MatchResult, bool), WardrobeError> {
    let (key, _) = request(dresser.wardrobe(), combination, params)?;
    let name = folder_name(&key);
    if !again && let Some(found) = finished(&results.parent().join(name), &key) {
        return Ok((found, true));
    }
    let mut matched = run(dresser, combination, params, monitor)?;
    results.write(name, |folder| {
        result_folder::fill(folder, &mut matched, params, dresser.wardrobe())
    })?;
    Ok((matched.result, false))
}

/// Where a result of [`run_into_folder`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Placed {
    /// It stood in the folder before.
    Before,
    /// It was written there.
    Written,
    /// It was not written: the folder holds a better one, such as a clean one where this has
    /// failed.
    Nowhere,
}

/// Resolves a combination into a folder of the user's, or takes what that holds of it already.
///
/// The files of a result that stands there are replaced, those of others stay. A result that is
/// worse than the one there (failed rather than clean, say) is not written, unless `params` ask for
/// meshes that are not proven.
///
/// # Errors
///
/// As [`run`]; a combination that is none; another process that writes there, or a file of the
/// user's where one of the result would go: all these before anything is done.
pub fn run_into_folder(
    out: &Path,
    dresser: &Dresser,
    combination: &Combination,
    params: &MatchParams,
    again: bool,
    monitor: &mut dyn Monitor,
) -> Result<(MatchResult, Placed), WardrobeError> {
    combination.check()?;
    params.validate()?;
    let (key, _) = request(dresser.wardrobe(), combination, params)?;
    if !again && let Some(found) = finished(out, &key) {
        return Ok((found, Placed::Before));
    }
    let names = result_folder::names(combination, params);
    result_folder::Earlier::of(out, &names)?; // a folder of the user's is not even locked
    let opened =
        Writer::open(out).map_err(|source| WardrobeError::Folder { path: out.into(), source })?;
    let writer = opened.ok_or_else(|| WardrobeError::Busy { path: out.into() })?;
    let earlier = result_folder::Earlier::of(out, &names)?;
    let mut matched = run(dresser, combination, params, monitor)?;
    let state = matched.result.state;
    let is_asked_for = params.unproven && state == State::Remaining;
    if !is_asked_for && earlier.state.is_some_and(|there| there < state) {
        return Ok((matched.result, Placed::Nowhere));
    }
    writer.write_files(&earlier.files, |folder| {
        result_folder::fill(folder, &mut matched, params, dresser.wardrobe())?;
        // The list of the others comes first: what stands on it is never taken for a file of the
        // user's.
        let outputs = matched.result.outputs.iter().map(|output| output.file.clone());
        Ok::<_, WardrobeError>((
            (),
            result_folder::OWN.map(str::to_owned).into_iter().chain(outputs).collect(),
        ))
    })?;
    Ok((matched.result, Placed::Written))
}

/// The result that a folder holds, where it is that of `key` and all its files are as it says. One
/// that failed because a file of the wardrobe could not be read is none: the file may be back.
pub fn finished(folder: &Path, key: &str) -> Option<MatchResult> {
    let lasts = |r: &MatchResult| {
        r.error.as_ref().is_none_or(|e| !matches!(e.kind.as_str(), "asset" | "body"))
    };
    result_folder::read(folder).filter(|r| r.key == key && r.result == FORMAT && lasts(r))
}

/// The seconds that a result took, where its folder tells.
pub fn timings(folder: &Path) -> Option<Timings> {
    result_folder::read_timings(folder)
}
