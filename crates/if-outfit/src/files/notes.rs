//! What a person should know about the files of an outfit.

use super::OutfitFiles;
use crate::outfit::{Layer, orientation_note};
use if_mesh::file::MeshFile;
use if_mesh::validate::faults;
use rayon::prelude::*;

/// Notes on all layers, the body first.
pub(super) fn of(files: &OutfitFiles) -> Vec<String> {
    let body = &files.outfit().body;
    let orientation = orientation_note(&body.mesh).map(|note| format!("`{}`: {note}", body.name));
    let layers: Vec<(&Layer, &MeshFile)> = files.outfit().layers().zip(files.files()).collect();
    let notes = layers.into_par_iter().flat_map_iter(|(layer, file)| on_layer(layer, file));
    orientation.into_iter().chain(notes.collect::<Vec<_>>()).collect()
}

fn on_layer(layer: &Layer, file: &MeshFile) -> Vec<String> {
    let mut notes: Vec<String> = faults(&layer.mesh).iter().map(ToString::to_string).collect();
    if let [first, ..] = file.collapsed_faces() {
        let n = file.collapsed_faces().len();
        notes.push(format!(
            "{n} faces use a vertex twice (the first is face {first}); they are written as they are"
        ));
    }
    if file.shared_normals() > 0 {
        notes.push(format!(
            "{} normals are shared by several vertices; they are written as they are",
            file.shared_normals()
        ));
    }
    notes.iter().map(|note| format!("`{}`: {note}", layer.name)).collect()
}
