//! The content of an OBJ file.

use super::materials;
use crate::polygons::Polygons;
use if_core::math::Vector;
use if_core::mesh::TriMesh;

/// A mesh with the text of its OBJ file.
#[derive(Clone, Debug)]
pub struct ObjMesh {
    pub(super) mesh: TriMesh,
    pub(super) polygons: Option<Polygons>,
    pub(super) collapsed: Vec<u32>,
    pub(super) objects: Vec<String>,
    pub(super) text: Vec<u8>,
    /// The three coordinates on each `v` line.
    pub(super) vertices: Vec<Span>,
    /// The three coordinates on each `vn` line.
    pub(super) normals: Vec<NormalLine>,
}

/// A range of bytes in the text: from the first of three numbers to the last.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub(super) start: u32,
    pub(super) end: u32,
}

/// A `vn` line.
#[derive(Clone, Copy, Debug)]
pub(super) struct NormalLine {
    pub(super) span: Span,
    pub(super) value: Vector,
    pub(super) user: User,
}

/// The vertices that use a normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum User {
    None,
    One(u32),
    Several,
}

impl ObjMesh {
    /// All `v` lines in the file's order and units, and the faces as triangles. Weights and colours
    /// after the coordinates are ignored.
    pub fn mesh(&self) -> &TriMesh {
        &self.mesh
    }

    /// The faces of the file, if they are not the triangles of the mesh: a face of n corners is a fan
    /// of n − 2 triangles around its first corner.
    pub fn polygons(&self) -> Option<&Polygons> {
        self.polygons.as_ref()
    }

    /// Indices of `f` lines that use a vertex twice. The triangles of their fans that do so are
    /// missing in the mesh; the lines are written again.
    pub fn collapsed(&self) -> &[u32] {
        &self.collapsed
    }

    /// Names of the objects (`o` lines) that have faces, each once. All are one mesh.
    pub fn objects(&self) -> &[String] {
        &self.objects
    }

    /// The file, byte for byte.
    pub fn text(&self) -> &[u8] {
        &self.text
    }

    /// The contents of the `mtllib` lines: a file name that may contain spaces, or several names
    /// separated by spaces. Paths are relative to the folder of the file.
    pub fn material_libraries(&self) -> Vec<String> {
        materials::libraries(&self.text)
    }

    /// Number of `vn` lines that several vertices use. They cannot rotate with one vertex, so
    /// [`write()`](super::write()) keeps them, although vertices may have moved.
    pub fn shared_normals(&self) -> usize {
        self.normals.iter().filter(|n| n.user == User::Several).count()
    }
}
