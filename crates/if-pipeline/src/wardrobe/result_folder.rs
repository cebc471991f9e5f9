//! The files of a result.

use super::matching::{MatchParams, MatchResult, Matched, State, Timings};
use super::{WardrobeError, pages};
use crate::asset::FileInfo;
use crate::content::{content, of_file};
use crate::outfit::Layer;
use if_mesh::ply::{self, PlyMesh, WriteParams};
use serde::Serialize;
use std::fs;
use std::path::Path;
use std::time::Instant;

const RESULT: &str = "result.json";
const TIMINGS: &str = "timings.json";
const REPORT: &str = "report.html";
const PICTURES: [&str; 2] = ["before.png", "after.png"];

/// Writes all files of a result into a folder.
pub(super) fn fill(folder: &Path, matched: &mut Matched, params: &MatchParams) -> Result<(), WardrobeError> {
    let start = Instant::now();
    let mut outputs = Vec::new();
    let mut store = |name: &str, bytes: &[u8]| -> Result<(), WardrobeError> {
        let path = folder.join(name);
        fs::write(&path, bytes).map_err(|source| WardrobeError::Folder { path, source })?;
        outputs.push(FileInfo { file: name.into(), content: content(bytes) });
        Ok(())
    };
    let proven = matched.result.state == State::Clean || params.unproven;
    if let (true, true, Some(outfit)) = (params.meshes, proven, &matched.after) {
        let garments = outfit.garments.iter().enumerate();
        for (k, layer) in garments {
            let skin = matched.skins.get(k).and_then(Option::as_ref);
            store(&format!("{}.ply", layer.name), &mesh_bytes(folder, layer, skin)?)?;
        }
        if params.body {
            // No garment bears its name, or it would be no outfit.
            store(&format!("{}.ply", outfit.body.name), &mesh_bytes(folder, &outfit.body, None)?)?;
        }
    }
    let mut pngs = Vec::new();
    for (name, image) in PICTURES.iter().zip(matched.pictures.iter().flatten()) {
        let mut png = Vec::new();
        image.write_png(&mut png)?;
        store(name, &png)?;
        pngs.push(png);
    }
    matched.result.outputs = outputs;
    write_json(&folder.join(RESULT), &matched.result)?;
    let seconds = start.elapsed().as_secs_f64();
    matched.timings.write = seconds;
    matched.timings.total += seconds;
    write_json(&folder.join(TIMINGS), &matched.timings)?;
    let page = pages::result(&matched.result, &matched.timings, &pngs);
    let path = folder.join(REPORT);
    fs::write(&path, page).map_err(|source| WardrobeError::Folder { path, source })
}

fn mesh_bytes(folder: &Path, layer: &Layer, skin: Option<&crate::skin_weights::SkinWeights>) -> Result<Vec<u8>, WardrobeError> {
    let vertex_properties = skin.map_or(Vec::new(), crate::skin_weights::SkinWeights::to_properties);
    let ply = PlyMesh { vertex_properties, ..PlyMesh::new(layer.mesh.clone()) };
    let mut bytes = Vec::new();
    ply::write(&ply, layer.mesh.vertices(), &WriteParams::default(), &mut bytes)
        .map_err(|e| WardrobeError::Write { path: folder.join(&layer.name), source: e.into() })?;
    Ok(bytes)
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), WardrobeError> {
    let mut text = serde_json::to_vec_pretty(value).map_err(|e| WardrobeError::Json { message: e.to_string() })?;
    text.push(b'\n');
    fs::write(path, text).map_err(|source| WardrobeError::Folder { path: path.into(), source })
}

/// The result that a folder holds, where all its files are as it says.
pub(super) fn read(folder: &Path) -> Option<MatchResult> {
    let result: MatchResult = serde_json::from_slice(&fs::read(folder.join(RESULT)).ok()?).ok()?;
    let intact = |file: &FileInfo| of_file(&folder.join(&file.file)).is_ok_and(|found| found == file.content);
    result.outputs.iter().all(intact).then_some(result)
}

pub(super) fn read_timings(folder: &Path) -> Option<Timings> {
    serde_json::from_slice(&fs::read(folder.join(TIMINGS)).ok()?).ok()
}
