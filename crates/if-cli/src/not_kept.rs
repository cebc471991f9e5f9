//! Notes on what an output does not keep of its input.

use if_mesh::ply::PlyMesh;
use if_mesh::polygons::Polygons;
use if_mesh::sdf::MeshSdf;

/// Notes on what is lost where only the vertices of a PLY file are kept.
pub(crate) fn not_kept(ply: &PlyMesh) -> Vec<String> {
    let mut notes = Vec::new();
    let faces: Vec<&str> = ply.face_properties.iter().map(|p| p.name.as_str()).collect();
    if !faces.is_empty() {
        notes.push(format!("properties of faces are not kept: {}", faces.join(", ")));
    }
    let others: Vec<&str> = ply.other_elements.iter().map(|e| e.name.as_str()).collect();
    if !others.is_empty() {
        notes.push(format!(
            "elements beside vertices and faces are not kept: {}",
            others.join(", ")
        ));
    }
    if ply.polygons.iter().flat_map(Polygons::iter).any(|face| face.len() > 3) {
        notes.push("faces of more than three corners are written as triangles".into());
    }
    if let Some(first) = ply.collapsed.first() {
        let count = ply.collapsed.len();
        notes.push(format!(
            "{count} faces that name a vertex twice are left out, the first of them face {first}"
        ));
    }
    notes
}

/// A note on parts that the field of a mesh leaves out.
pub(crate) fn inner_parts(field: &MeshSdf) -> Option<String> {
    match field.inner_parts() {
        0 => None,
        1 => Some("a part that lies inside another one was left out".into()),
        n => Some(format!("{n} parts that lie inside others were left out")),
    }
}
