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
        let weights = ["j0", "j1", "j2", "j3", "w0", "w1", "w2", "w3"];
        self.0.vertex_properties.retain(|property| !weights.contains(&property.name.as_str()));
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
