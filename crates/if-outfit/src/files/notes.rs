//! What a person should know about the files of an outfit.

use super::OutfitFiles;
use crate::notes::{named, of_outfit};
use crate::outfit::Layer;
use if_mesh::file::{Content, MeshFile};
use if_mesh::validate::{Fault, faults};
use rayon::prelude::*;

/// Notes on all layers, the body first.
pub(super) fn of(files: &OutfitFiles) -> Vec<String> {
    let outfit = files.outfit();
    // An outfit from memory has no file of its body.
    let own = std::iter::once(files.body.as_ref().map(|(file, _)| &**file))
        .chain(files.files.iter().map(|f| Some(&**f)));
    let layers: Vec<(&Layer, Option<&MeshFile>)> = outfit.layers().zip(own).collect();
    let notes = layers.into_par_iter().flat_map_iter(|(layer, file)| {
        // Such a file has a vertex for each of its normals and texture coordinates.
        let is_split = file.is_some_and(|file| matches!(file.content(), Content::Gltf(_)));
        let is_meant = |fault: &&Fault| is_split && matches!(fault, Fault::Duplicates { .. });
        let faults = faults(&layer.mesh);
        let faults = faults.iter().filter(|fault| !is_meant(fault));
        let mut notes: Vec<String> = faults.map(ToString::to_string).collect();
        notes.extend(file.map_or(Vec::new(), of_file));
        named(layer, notes)
    });
    let notes: Vec<String> = notes.collect();
    of_outfit(outfit).chain(notes).collect()
}

fn of_file(file: &MeshFile) -> Vec<String> {
    let mut notes = Vec::new();
    if let Content::Obj(obj) = file.content()
        && let [_, _, ..] = obj.objects()
    {
        notes.push(of_objects(obj.objects()));
    }
    if let [first, ..] = file.collapsed_faces() {
        let n = file.collapsed_faces().len();
        notes.push(format!(
            "{n} faces use a vertex twice (the first is face {first}); they are written as they are"
        ));
    }
    let folded = file.folded_faces();
    if let [first, ..] = folded[..] {
        notes.push(format!(
            "{} faces are concave or far from flat (the first is face {first}), and their triangles around the first \
             corner, which are what is resolved and verified, fold over each other; split them into triangles first",
            folded.len()
        ));
    }
    if file.shared_normals() > 0 {
        notes.push(format!(
            "{} normals are shared by several vertices; they are written as they are",
            file.shared_normals()
        ));
    }
    notes
}

/// Objects that a note lists.
const LISTED: usize = 6;

/// A note on a file of several objects: a whole scene may have been exported in place of a garment.
fn of_objects(objects: &[String]) -> String {
    let names: Vec<String> = objects.iter().take(LISTED).map(|name| format!("`{name}`")).collect();
    let more = if objects.len() > LISTED { ", ..." } else { "" };
    format!(
        "the file has {} objects ({}{more}), which are one layer here; if they are not all parts of it, export \
         each layer alone (in Blender: Selected Only)",
        objects.len(),
        names.join(", ")
    )
}
