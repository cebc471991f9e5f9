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
    let folded = ply.polygons.as_ref().map_or(Vec::new(), |p| p.folded(ply.mesh.vertices()));
    if let Some(first) = folded.first() {
        let count = folded.len();
        notes.push(format!(
            "the triangles of {count} concave faces fold over each other, the first of them of face {first}; split these faces into triangles first"
        ));
    }
    if let Some(first) = ply.collapsed.first() {
        let count = ply.collapsed.len();
        notes.push(format!(
            "{count} faces that name a vertex twice are left out, the first of them face {first}"
        ));
    }
    notes
}

/// Notes on what the field of a mesh leaves out, and what it takes for its inside.
pub(crate) fn assumed(field: &MeshSdf) -> Vec<String> {
    let left_out = match field.inner_parts() {
        0 => None,
        1 => Some("a part that lies inside another one was left out".into()),
        n => Some(format!("{n} parts that lie inside others were left out")),
    };
    let united = match field.own_pairs() {
        0 => None,
        n => Some(format!(
            "the mesh intersects itself in {n} pairs of triangles: what any of its parts encloses is inside"
        )),
    };
    left_out.into_iter().chain(united).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn concave_faces_are_named_with_what_is_not_kept() {
        let of = |face: &str| {
            let text = format!(
                "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                 element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n2 2 0\n0 4 0\n1 2 0\n4 {face}\n"
            );
            not_kept(&if_mesh::ply::read_bytes(text.as_bytes()).unwrap())
        };
        let [written, folded] = &of("0 1 2 3")[..] else { panic!("two notes") };
        assert!(written.contains("written as triangles"), "{written}");
        assert!(
            folded.contains("1 concave faces fold over each other, the first of them of face 0")
        );
        let other = of("3 0 1 2");
        assert_eq!(&other[..], std::slice::from_ref(written), "the same face from its notch");
    }
}
