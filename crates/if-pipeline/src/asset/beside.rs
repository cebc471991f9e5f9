//! The content of a garment's file other than positions, triangles and weights.

use if_body::SkinWeights;
use if_core::mesh::TriMesh;
use if_mesh::ply::{CoordinateType, PlyMesh};

/// The content of a garment's file other than positions, triangles and weights: texture coordinates,
/// colours, materials, polygons, comments. Wardrobes and their results preserve it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Beside(PlyMesh);

impl Beside {
    /// The content of a file without its mesh.
    pub fn of(ply: &PlyMesh) -> Self {
        Self(PlyMesh {
            mesh: TriMesh::default(),
            coordinates: CoordinateType::Float,
            vertex_properties: ply.vertex_properties.clone(),
            polygons: ply.polygons.clone(),
            collapsed: ply.collapsed.clone(),
            face_properties: ply.face_properties.clone(),
            other_elements: ply.other_elements.clone(),
            comments: ply.comments.clone(),
            obj_info: ply.obj_info.clone(),
        })
    }

    /// The content without skinning weights: joints are numbers in one skeleton.
    pub(crate) fn without_weights(mut self) -> Self {
        let is_weight = |name: &str| {
            let (kind, slot) = name.split_at_checked(1).unwrap_or_default();
            matches!(kind, "j" | "w") && matches!(slot, "0" | "1" | "2" | "3")
        };
        self.0.vertex_properties.retain(|property| !is_weight(&property.name));
        self
    }

    /// The file with a mesh of as many vertices and the same triangles. Weights replace those of the
    /// file.
    pub fn file(&self, mesh: TriMesh, skin: Option<&SkinWeights>) -> PlyMesh {
        let mut file = PlyMesh { mesh, ..self.0.clone() };
        if let Some(skin) = skin {
            let properties = skin.to_properties();
            file.vertex_properties.retain(|old| properties.iter().all(|new| new.name != old.name));
            file.vertex_properties.extend(properties);
        }
        file
    }
}
