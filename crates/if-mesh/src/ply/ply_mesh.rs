//! The content of a PLY file.

use super::params::CoordinateType;
use crate::attributes::Property;
use crate::polygons::Polygons;
use if_core::mesh::TriMesh;

/// A mesh with everything that its PLY file holds.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct PlyMesh {
    /// Vertices in the file's order, and triangles.
    pub mesh: TriMesh,
    /// Type of x, y and z in the file. [`CoordinateType::Double`], which loses nothing, if they are
    /// neither all `float` nor all `double`.
    pub coordinates: CoordinateType,
    /// All properties of the vertices except x, y and z.
    pub vertex_properties: Vec<Property>,
    /// The faces of the file, if they are not the triangles of `mesh`: a face of n corners is a fan
    /// of n − 2 triangles around its first corner.
    pub polygons: Option<Polygons>,
    /// Indices of faces that use a vertex twice. The triangles of their fans that do so are missing
    /// in `mesh`; the faces stay in `polygons` and are written again.
    pub collapsed: Vec<u32>,
    /// All properties of the faces except their vertices: one record per face of the file.
    pub face_properties: Vec<Property>,
    /// All other elements.
    pub other_elements: Vec<Element>,
    /// `comment` lines, without that word.
    pub comments: Vec<String>,
    /// `obj_info` lines, without that word.
    pub obj_info: Vec<String>,
}

impl PlyMesh {
    /// A mesh without properties, with coordinates of four bytes.
    pub fn new(mesh: TriMesh) -> Self {
        Self { mesh, ..Self::default() }
    }

    /// The vertex property of this name.
    pub fn vertex_property(&self, name: &str) -> Option<&Property> {
        self.vertex_properties.iter().find(|p| p.name == name)
    }

    /// The texture coordinates of each vertex, its properties `s` and `t`, `u` and `v`, or `texture_u`
    /// and `texture_v`; `None` if there are none.
    pub fn texture_coordinates(&self) -> Option<Vec<[f32; 2]>> {
        let column = |name: &str| {
            let property = self.vertex_property(name)?;
            let values = property.values.to_f64();
            (values.len() == self.mesh.vertices().len()).then_some(values)
        };
        let names = [["s", "t"], ["u", "v"], ["texture_u", "texture_v"]];
        let [u, v] = names.iter().find_map(|[u, v]| Some([column(u)?, column(v)?]))?;
        Some(u.iter().zip(&v).map(|(u, v)| [*u as f32, *v as f32]).collect())
    }
}

/// An element that is neither `vertex` nor `face`.
#[derive(Clone, Debug, PartialEq)]
pub struct Element {
    /// Its name in the header.
    pub name: String,
    /// Number of records.
    pub count: usize,
    /// Its properties, in the file's order.
    pub properties: Vec<Property>,
}
