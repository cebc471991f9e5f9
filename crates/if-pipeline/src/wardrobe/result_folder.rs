//! The folders of results.

use super::combination::Combination;
use super::error::WardrobeError;
use super::result::{MatchParams, MatchResult, Matched, State, Timings};
use super::{Wardrobe, pages};
use crate::asset::FileInfo;
use if_mesh::{atomic, regular_file};
use if_outfit::digest::{digest, of_file};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs;
use std::io;
use std::path::Path;
use std::time::Instant;

const RESULT: &str = "result.json";
const TIMINGS: &str = "timings.json";
const REPORT: &str = "report.html";
const PICTURES: [&str; 2] = ["before.png", "after.png"];

/// Files of every result that are not in its list of outputs.
pub(super) const OWN: [&str; 3] = [RESULT, TIMINGS, REPORT];

/// All files that a result may have.
pub(super) fn names(combination: &Combination, params: &MatchParams) -> Vec<String> {
    let body = params.body.then_some(&combination.body);
    let meshes = combination
        .garments
        .iter()
        .chain(body)
        .filter(|_| params.meshes)
        .map(|name| mesh_name(name));
    let pictures = PICTURES.iter().filter(|_| params.picture_height > 0).map(ToString::to_string);
    OWN.iter().map(ToString::to_string).chain(meshes).chain(pictures).collect()
}

fn mesh_name(layer: &str) -> String {
    format!("{layer}.ply")
}

/// Number of digits of a key in the name of its folder.
const DIGITS: usize = 20;

/// The name of the folder of a key.
pub(super) fn folder_name(key: &str) -> &str {
    key.get(..DIGITS).unwrap_or(key)
}

/// The earlier result of a folder into which a result will be written.
#[derive(Debug, Default)]
pub(super) struct Earlier {
    /// State of the earlier result, if there is one.
    pub(super) state: Option<State>,
    /// Its files.
    pub(super) files: Vec<String>,
}

impl Earlier {
    /// Checks that files of these names can be written. A result of another version counts, too.
    ///
    /// # Errors
    ///
    /// A file of the user's is in the way, or the folder cannot be read.
    pub(super) fn of(out: &Path, names: &[String]) -> Result<Self, WardrobeError> {
        let fault = |source| WardrobeError::Folder { path: out.into(), source };
        let in_the_way =
            |path: &Path, what| Err(WardrobeError::InTheWay { path: path.into(), what });
        let found = match fs::metadata(out) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            found => found.map_err(fault)?,
        };
        if !found.is_dir() {
            return in_the_way(out, "it is a file, not a folder");
        }
        let path = out.join(RESULT);
        let text = match fs::read(&path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                for entry in fs::read_dir(out).map_err(fault)? {
                    if !atomic::is_hidden(&entry.map_err(fault)?.file_name().to_string_lossy()) {
                        return in_the_way(out, "it has other files, but no result");
                    }
                }
                return Ok(Self::default());
            }
            text => text.map_err(|source| WardrobeError::Folder { path: path.clone(), source })?,
        };
        let value: Value = serde_json::from_slice(&text).unwrap_or_default();
        let (Some(outputs), true) = (value["outputs"].as_array(), value["result"].is_u64()) else {
            return in_the_way(&path, "it is not a result");
        };
        let is_plain = |name: &&str| regular_file::inside(out, name).is_some();
        let listed = outputs.iter().filter_map(|output| output["file"].as_str()).filter(is_plain);
        let files: Vec<String> = OWN.into_iter().chain(listed).map(str::to_owned).collect();
        for name in names {
            let path = out.join(name);
            if path.is_dir() {
                return in_the_way(&path, "it is a folder");
            }
            if fs::symlink_metadata(&path).is_ok() && !files.contains(name) {
                return in_the_way(&path, "the result there does not name it");
            }
        }
        Ok(Self { state: State::deserialize(&value["state"]).ok(), files })
    }
}

/// Writes all files of a result into a folder. With `viewer` the page also has the meshes: some
/// megabytes.
pub(super) fn fill(
    folder: &Path,
    matched: &mut Matched,
    (params, viewer): (&MatchParams, bool),
    wardrobe: &Wardrobe,
) -> Result<(), WardrobeError> {
    let start = Instant::now();
    let mut outputs = Vec::new();
    let store = |name: &str, bytes: &[u8]| -> Result<FileInfo, WardrobeError> {
        let path = folder.join(name);
        fs::write(&path, bytes).map_err(|source| WardrobeError::Folder { path, source })?;
        Ok(FileInfo { file: name.into(), content: digest(bytes) })
    };
    let proven = matched.result.state == State::Clean || params.unproven;
    if let (true, true, Some(resolved)) = (params.meshes, proven, &matched.after) {
        for (k, garment) in resolved.outfit.garments.iter().enumerate() {
            let file = mesh_name(&garment.name);
            let path = folder.join(&file);
            resolved.write_garments(&[k], &path)?;
            let content =
                of_file(&path).map_err(|source| WardrobeError::Folder { path, source })?;
            outputs.push(FileInfo { file, content });
        }
        if params.body {
            // The names of layers differ, so this replaces no garment.
            let body = &resolved.outfit.body.name;
            outputs.push(store(&mesh_name(body), &wardrobe.body_file(body)?)?);
        }
    }
    let mut pngs = Vec::new();
    for (name, image) in PICTURES.iter().zip(matched.pictures.iter().flatten()) {
        let mut png = Vec::new();
        image.write_png(&mut png)?;
        outputs.push(store(name, &png)?);
        pngs.push(png);
    }
    matched.result.outputs = outputs;
    write_json(&folder.join(RESULT), &matched.result)?;
    let seconds = start.elapsed().as_secs_f64();
    matched.timings.write = seconds;
    matched.timings.total += seconds;
    write_json(&folder.join(TIMINGS), &matched.timings)?;
    let layers = match (&matched.before, &matched.after) {
        (Some(before), Some(after)) if viewer => Some([before, &after.outfit]),
        _ => None,
    };
    let page = pages::result(&matched.result, &matched.timings, &pngs, layers);
    let path = folder.join(REPORT);
    fs::write(&path, page).map_err(|source| WardrobeError::Folder { path, source })
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), WardrobeError> {
    let mut text = serde_json::to_vec_pretty(value)
        .map_err(|e| WardrobeError::Json { message: e.to_string() })?;
    text.push(b'\n');
    fs::write(path, text).map_err(|source| WardrobeError::Folder { path: path.into(), source })
}

/// Whether a folder is that of a result, finished or not.
pub(super) fn is_result(folder: &Path) -> bool {
    folder.join(RESULT).is_file()
}

/// The result in a folder, if all its files have the recorded hashes.
pub(super) fn read(folder: &Path) -> Option<MatchResult> {
    let result: MatchResult = serde_json::from_slice(&fs::read(folder.join(RESULT)).ok()?).ok()?;
    let intact = |file: &FileInfo| file.content.is_of(&folder.join(&file.file));
    result.outputs.iter().all(intact).then_some(result)
}

pub(super) fn read_timings(folder: &Path) -> Option<Timings> {
    serde_json::from_slice(&fs::read(folder.join(TIMINGS)).ok()?).ok()
}
