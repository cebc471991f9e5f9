//! Mesh files of any format, chosen by the extension.

use crate::atomic::{FileSet, FileSetError};
use crate::attributes::AttributeError;
use crate::gltf::{self, Beside, GltfFiles, GltfMesh};
use crate::obj::{self, Normals, ObjMesh};
use crate::ply::{self, CoordinateType, PlyMesh, WriteParams, quantise};
use crate::split::SplitMesh;
use if_core::math::Point;
use if_core::mesh::{MeshError, TriMesh};
use std::path::{Path, PathBuf};
use std::{fs, io};

/// A mesh with its file. It is written with the same triangles, vertex order and attributes.
///
/// # Examples
///
/// ```
/// use if_mesh::file::MeshFile;
/// # let folder = tempfile::tempdir()?;
/// # let (shirt, out) = (folder.path().join("shirt.obj"), folder.path().join("out.obj"));
/// # std::fs::write(&shirt, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")?;
/// let file = MeshFile::read(&shirt)?;
/// let raised: Vec<_> = file.mesh().vertices().iter().map(|p| p + if_core::math::Vector::y() * 0.01).collect();
/// // Prove properties of the file for these positions:
/// let raised = file.positions_as_written(&raised);
/// file.write(&out, &raised)?;
/// assert_eq!(MeshFile::read(&out)?.mesh().vertices(), raised);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct MeshFile {
    /// The bytes of the file, unless `content` holds them.
    bytes: Vec<u8>,
    content: Content,
    /// Whether the content differs from `bytes`, so that no copy of them may be written.
    is_new: bool,
}

/// Content of a mesh file.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Content {
    /// A PLY file.
    Ply(PlyMesh),
    /// An OBJ file.
    Obj(ObjMesh),
    /// A glTF file, binary or JSON.
    Gltf(GltfMesh),
}

/// A path as `FILE.glb#NODE` in its parts (also of `.gltf` and `.vrm`). Any other path, and that of a file
/// which exists, is the file's alone.
///
/// # Examples
///
/// ```
/// use if_mesh::file::file_and_node;
/// let (file, node) = file_and_node("look/anna.glb#Coat".as_ref());
/// assert_eq!((file.to_str(), node.as_deref()), (Some("look/anna.glb"), Some("Coat")));
/// assert_eq!(file_and_node("coat.ply".as_ref()).1, None);
/// ```
pub fn file_and_node(path: &Path) -> (PathBuf, Option<String>) {
    const ENDS: [&str; 3] = [".glb#", ".gltf#", ".vrm#"];
    let whole = || (path.to_path_buf(), None);
    let Some(text) = path.to_str() else { return whole() };
    let lower = text.to_ascii_lowercase();
    let ends = ENDS.iter().filter_map(|end| Some(lower.find(end)? + end.len() - 1));
    let Some(at) = ends.min() else { return whole() };
    let (file, node) = text.split_at(at);
    if node.len() == 1 || path.exists() {
        return whole();
    }
    (file.into(), Some(node[1..].into()))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Ply,
    Obj,
    Glb,
    Gltf,
}

impl Format {
    /// By the extension, in upper or lower case.
    fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        match extension.as_str() {
            "ply" => Some(Self::Ply),
            "obj" => Some(Self::Obj),
            // Avatars in VRM are GLB files.
            "glb" | "vrm" => Some(Self::Glb),
            "gltf" => Some(Self::Gltf),
            _ => None,
        }
    }
}

/// Whether a file is read as glTF, by its extension.
///
/// # Examples
///
/// ```
/// use if_mesh::file::is_gltf;
/// assert!(is_gltf("anna.GLB".as_ref()) && is_gltf("anna.vrm".as_ref()));
/// assert!(!is_gltf("skeleton.json".as_ref()));
/// ```
pub fn is_gltf(path: &Path) -> bool {
    matches!(Format::of(path), Some(Format::Glb | Format::Gltf))
}

/// Errors of [`MeshFile::read`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum ReadError {
    /// The extension is not that of a supported format.
    #[error("{}: the extension must be .ply, .obj, .glb, .gltf or .vrm", path.display())]
    Extension { path: PathBuf },
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    /// The path is a folder, a pipe or a device.
    #[error("{}: not a file", path.display())]
    NotAFile { path: PathBuf },
    /// The PLY file is invalid.
    #[error("{}: {source}", path.display())]
    Ply { path: PathBuf, source: Box<ply::ReadError> },
    /// The OBJ file is invalid.
    #[error("{}: {source}", path.display())]
    Obj { path: PathBuf, source: Box<obj::ReadError> },
    /// The glTF file is invalid.
    #[error("{}: {source}", path.display())]
    Gltf { path: PathBuf, source: Box<gltf::ReadError> },
}

/// Errors of [`MeshFile::write`]. An existing file stays unchanged.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum WriteError {
    /// The extension is that of another format, which cannot hold the attributes.
    #[error("{}: the mesh came from {from} file, so the extension must be .{extension}", path.display())]
    Extension { path: PathBuf, from: &'static str, extension: &'static str },
    /// The file cannot be written.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    /// The PLY file cannot hold this.
    #[error("{}: {source}", path.display())]
    Ply { path: PathBuf, source: Box<ply::WriteError> },
    /// The OBJ file cannot hold this.
    #[error("{}: {source}", path.display())]
    Obj { path: PathBuf, source: Box<obj::WriteError> },
    /// The glTF file cannot hold this.
    #[error("{}: {source}", path.display())]
    Gltf { path: PathBuf, source: Box<gltf::WriteError> },
}

/// Errors of [`MeshFile::split`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SplitError {
    /// A property of a PLY file does not belong to the mesh.
    #[error(transparent)]
    Attributes(#[from] AttributeError),
    /// The OBJ file has lines or points with relative indices.
    #[error(transparent)]
    Obj(#[from] obj::ReadError),
    /// Coordinates are too large for a midpoint.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A glTF file cannot take more vertices.
    #[error("triangles of glTF files are not split; use PLY or OBJ, or finer triangles")]
    Gltf,
}

impl MeshFile {
    /// Reads a `.ply`, `.obj`, `.glb` or `.gltf` file; with `FILE.glb#NODE` only the node NODE of the
    /// scene ([`file_and_node`], [`gltf::read_layer`]).
    ///
    /// # Errors
    ///
    /// [`ReadError`]: the file, and the invalid line, byte or element.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let name = || path.to_path_buf();
        let (path, node) = &file_and_node(path);
        let format = Format::of(path).ok_or_else(|| ReadError::Extension { path: name() })?;
        let about = fs::metadata(path).map_err(|source| ReadError::Io { path: name(), source })?;
        if !about.is_file() {
            return Err(ReadError::NotAFile { path: name() }); // a pipe might never end
        }
        let bytes = fs::read(path).map_err(|source| ReadError::Io { path: name(), source })?;
        Ok(match format {
            Format::Ply => {
                let ply = ply::read_bytes(&bytes)
                    .map_err(|e| ReadError::Ply { path: name(), source: e.into() })?;
                Self { bytes, content: Content::Ply(ply), is_new: false }
            }
            Format::Obj => {
                let obj = obj::read_text(bytes)
                    .map_err(|e| ReadError::Obj { path: name(), source: e.into() })?;
                Self { bytes: Vec::new(), content: Content::Obj(obj), is_new: false }
            }
            Format::Glb | Format::Gltf => {
                let gltf = gltf::read_layer(bytes, node.as_deref(), Some(folder_of(path)));
                let gltf = gltf.and_then(|gltf| has_form(gltf, format));
                let gltf = gltf.map_err(|e| ReadError::Gltf { path: name(), source: e.into() })?;
                Self { bytes: Vec::new(), content: Content::Gltf(gltf), is_new: false }
            }
        })
    }

    /// A file for a mesh from memory. It is always written anew, never copied.
    pub fn from_ply(ply: PlyMesh) -> Self {
        Self { bytes: Vec::new(), content: Content::Ply(ply), is_new: true }
    }

    /// Vertices in the file's order and units, and triangles.
    pub fn mesh(&self) -> &TriMesh {
        match &self.content {
            Content::Ply(ply) => &ply.mesh,
            Content::Obj(obj) => obj.mesh(),
            Content::Gltf(gltf) => gltf.mesh(),
        }
    }

    /// The same file with its mesh split by `split`, which belongs to a mesh with the same triangles,
    /// in any units. Attributes of vertices, faces and corners are kept or interpolated
    /// ([`ply::split`], [`obj::split`]).
    ///
    /// # Errors
    ///
    /// [`SplitError`]: properties that do not belong to the mesh, an OBJ file with lines or points of
    /// relative indices, or a glTF file.
    ///
    /// # Panics
    ///
    /// If `split` belongs to a mesh with other triangles.
    pub fn split(&self, split: &SplitMesh) -> Result<Self, SplitError> {
        let mesh = split.apply(self.mesh().vertices())?;
        let content = match &self.content {
            Content::Ply(ply) => Content::Ply(ply::split(ply, split, mesh)?),
            Content::Obj(obj) => Content::Obj(obj::split(obj, split, &mesh)?),
            Content::Gltf(_) => return Err(SplitError::Gltf),
        };
        Ok(Self { bytes: self.bytes.clone(), content, is_new: true })
    }

    /// The content, with all attributes.
    pub fn content(&self) -> &Content {
        &self.content
    }

    /// The file as it was read, byte for byte: for hashes. Empty for a mesh from memory. The buffers
    /// of a `.gltf` file may be in other files ([`GltfMesh::beside`]).
    pub fn bytes(&self) -> &[u8] {
        match &self.content {
            Content::Ply(_) => &self.bytes,
            Content::Obj(obj) => obj.text(),
            Content::Gltf(gltf) => gltf.bytes(),
        }
    }

    /// Indices of the file's faces whose triangles fold over each other
    /// ([`Polygons::folded`](crate::polygons::Polygons::folded)): concave faces, for the most part.
    pub fn folded_faces(&self) -> Vec<usize> {
        let polygons = match &self.content {
            Content::Ply(ply) => ply.polygons.as_ref(),
            Content::Obj(obj) => obj.polygons(),
            Content::Gltf(_) => None,
        };
        polygons.map_or(Vec::new(), |polygons| polygons.folded(self.mesh().vertices()))
    }

    /// Indices of the file's faces that use a vertex twice, and so have fewer triangles than their
    /// corners suggest. They are written again.
    pub fn collapsed_faces(&self) -> &[u32] {
        match &self.content {
            Content::Ply(ply) => &ply.collapsed,
            Content::Obj(obj) => obj.collapsed(),
            Content::Gltf(gltf) => gltf.collapsed(),
        }
    }

    /// A texture coordinate for each vertex, its second component counted downwards from the upper edge
    /// of the picture, as glTF does. `None` if there are vertices without or one is not finite, and for
    /// OBJ files, where they are of corners.
    pub fn texture_coordinates(&self) -> Option<Vec<[f32; 2]>> {
        let found: Vec<[f32; 2]> = match &self.content {
            Content::Ply(ply) => {
                let upwards = ply.texture_coordinates()?;
                upwards.iter().map(|[u, v]| [*u, 1.0 - v]).collect()
            }
            Content::Obj(_) => return None,
            Content::Gltf(gltf) => gltf.texture_coordinates()?,
        };
        found.as_flattened().iter().all(|x| x.is_finite()).then_some(found)
    }

    /// Number of normals that several vertices share. They do not change when vertices move.
    pub fn shared_normals(&self) -> usize {
        match &self.content {
            Content::Ply(_) | Content::Gltf(_) => 0,
            Content::Obj(obj) => obj.shared_normals(),
        }
    }

    /// Whether positions are stored as single-precision numbers: PLY files with coordinates of 4 bytes,
    /// and glTF files in which nothing transforms the stored positions.
    pub fn is_single_precision(&self) -> bool {
        match &self.content {
            Content::Ply(ply) => ply.coordinates == CoordinateType::Float,
            Content::Obj(_) => false,
            Content::Gltf(gltf) => gltf.is_single_precision(),
        }
    }

    /// The positions as they will be read back: rounded to `f32` for a PLY file with coordinates of 4
    /// bytes, and in the nodes of a glTF file; else the same. Without moves, these are the positions of
    /// [`MeshFile::mesh`].
    pub fn positions_as_written(&self, positions: &[Point]) -> Vec<Point> {
        match &self.content {
            Content::Ply(ply) => quantise(positions, ply.coordinates),
            Content::Obj(_) => positions.to_vec(),
            Content::Gltf(gltf) => gltf.positions_as_written(positions),
        }
    }

    /// Checks that the vertices can be written elsewhere than they were read.
    ///
    /// # Errors
    ///
    /// Vertices that several nodes of a glTF file show.
    pub fn check_movable(&self) -> Result<(), gltf::WriteError> {
        match &self.content {
            Content::Gltf(gltf) => gltf.check_movable(),
            _ => Ok(()),
        }
    }

    /// Writes several layers of one glTF file, each with its vertices at its positions, as
    /// [`MeshFile::write`] does. A single layer may be of any format.
    ///
    /// # Errors
    ///
    /// As [`MeshFile::write`], and layers that are not of one glTF file.
    pub fn write_layers<'a>(
        layers: &[(&'a Self, &'a [Point])],
        path: &Path,
    ) -> Result<(), WriteError> {
        Self::write_layers_with(layers, path, Beside::Files)
    }

    /// As [`MeshFile::write_layers`], with the buffers that a glTF file has in other files embedded in it:
    /// so nothing beside it is written, or needed but for textures.
    ///
    /// # Errors
    ///
    /// As [`MeshFile::write_layers`].
    pub fn write_layers_embedded<'a>(
        layers: &[(&'a Self, &'a [Point])],
        path: &Path,
    ) -> Result<(), WriteError> {
        Self::write_layers_with(layers, path, Beside::Embedded)
    }

    /// As [`MeshFile::write_layers_embedded`], without the animations of a glTF file, which would pose meshes
    /// that are posed already: for a frame of a motion.
    ///
    /// # Errors
    ///
    /// As [`MeshFile::write_layers`].
    pub fn write_frame<'a>(
        layers: &[(&'a Self, &'a [Point])],
        path: &Path,
    ) -> Result<(), WriteError> {
        match gltfs(layers) {
            Some(gltfs) if is_gltf(path) => {
                put_gltf(gltf::write_frame(&gltfs, Normals::Follow), path)
            }
            _ => Self::write_layers_embedded(layers, path),
        }
    }

    fn write_layers_with<'a>(
        layers: &[(&'a Self, &'a [Point])],
        path: &Path,
        beside: Beside,
    ) -> Result<(), WriteError> {
        let Some(&(first, positions)) = layers.first() else { return Ok(()) };
        let has_others = beside == Beside::Embedded && matches!(first.content, Content::Gltf(_));
        if (layers.len() == 1 && !has_others) || Format::of(path) != Some(first.format()) {
            return first.write(path, positions); // reports the extension of another format
        }
        let fault = || gltf::WriteError::SeveralFiles.into();
        let gltfs =
            gltfs(layers).ok_or_else(|| WriteError::Gltf { path: path.into(), source: fault() })?;
        write_gltf(&gltfs, path, beside)
    }

    /// Writes the mesh with its vertices at `positions` and all its attributes, completely or not at
    /// all ([`crate::atomic`]). Normals rotate with the surface ([`Normals::Follow`]). Without moves,
    /// the file is a copy of the one that was read; else PLY is written as binary, and in an OBJ or
    /// glTF file only the coordinates of moved vertices change. The buffers that a `.gltf` file has in
    /// other files are written with it.
    ///
    /// # Errors
    ///
    /// [`WriteError`]: the extension of another format, positions of another number or not finite, or
    /// an error of the file system.
    pub fn write(&self, path: &Path, positions: &[Point]) -> Result<(), WriteError> {
        let name = || path.to_path_buf();
        let (from, extension) = match self.format() {
            Format::Ply => ("a PLY", "ply"),
            Format::Obj => ("an OBJ", "obj"),
            Format::Glb => ("a GLB", "glb"),
            Format::Gltf => ("a glTF", "gltf"),
        };
        if Format::of(path) != Some(self.format()) {
            return Err(WriteError::Extension { path: name(), from, extension });
        }
        let is_one_file = self.format() != Format::Gltf;
        if positions == self.mesh().vertices() && !self.is_new && is_one_file {
            let copy = |file: &mut fs::File| io::Write::write_all(file, self.bytes());
            return crate::atomic::write_file(path, copy)
                .map_err(|source| WriteError::Io { path: name(), source });
        }
        match &self.content {
            Content::Ply(ply) => {
                let params = WriteParams { coordinates: ply.coordinates, ..WriteParams::default() };
                ply::write_path(ply, positions, &params, path).map_err(|source| match source {
                    ply::WriteError::Io(source) => WriteError::Io { path: name(), source },
                    e => WriteError::Ply { path: name(), source: e.into() },
                })
            }
            Content::Obj(obj) => crate::atomic::write_file(path, |file| {
                obj::write(obj, positions, Normals::Follow, file)
            })
            .map_err(|source| match source {
                obj::WriteError::Io(source) => WriteError::Io { path: name(), source },
                e => WriteError::Obj { path: name(), source: e.into() },
            }),
            Content::Gltf(gltf) => write_gltf(&[(gltf, positions)], path, Beside::Files),
        }
    }

    fn format(&self) -> Format {
        match &self.content {
            Content::Ply(_) => Format::Ply,
            Content::Obj(_) => Format::Obj,
            Content::Gltf(gltf) if gltf.is_binary() => Format::Glb,
            Content::Gltf(_) => Format::Gltf,
        }
    }
}

/// The folder that paths in a file are relative to.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The file, if it is of the form that its name says.
fn has_form(gltf: GltfMesh, format: Format) -> Result<GltfMesh, gltf::ReadError> {
    let (found, extension) = match (gltf.is_binary(), format) {
        (true, Format::Gltf) => ("the file is binary", "glb"),
        (false, Format::Glb) => ("the file is JSON", "gltf"),
        _ => return Ok(gltf),
    };
    Err(gltf::ReadError::Form { found, extension })
}

/// The layers as glTF, if all of them are; `None` if there is none.
fn gltfs<'a>(layers: &[(&'a MeshFile, &'a [Point])]) -> Option<Vec<(&'a GltfMesh, &'a [Point])>> {
    let gltf = |(file, positions): &(&'a MeshFile, &'a [Point])| match &file.content {
        Content::Gltf(gltf) => Some((gltf, *positions)),
        _ => None,
    };
    layers.iter().map(gltf).collect::<Option<Vec<_>>>().filter(|all| !all.is_empty())
}

fn write_gltf(
    layers: &[(&GltfMesh, &[Point])],
    path: &Path,
    beside: Beside,
) -> Result<(), WriteError> {
    put_gltf(gltf::write_layers(layers, Normals::Follow, beside), path)
}

/// Stores the files that a glTF file was written as.
fn put_gltf(files: Result<GltfFiles, gltf::WriteError>, path: &Path) -> Result<(), WriteError> {
    let files = files.map_err(|e| WriteError::Gltf { path: path.into(), source: e.into() })?;
    let io = |path: &Path, source| WriteError::Io { path: path.into(), source };
    let fill = |file: &mut fs::File| io::Write::write_all(file, &files.bytes);
    if files.beside.is_empty() {
        return crate::atomic::write_file(path, fill).map_err(|source| io(path, source));
    }
    // All appear together, the file itself last.
    let name = path.file_name().unwrap_or_default();
    if files.beside.iter().any(|(relative, _)| relative.as_os_str().eq_ignore_ascii_case(name)) {
        let source = gltf::WriteError::Overlap.into(); // a buffer that is the file itself
        return Err(WriteError::Gltf { path: path.into(), source });
    }
    let whole = |error: FileSetError| match error {
        FileSetError::Folder { source, .. } => io(path, source),
        FileSetError::File { path, source } => io(&path, source),
        other => io(path, io::Error::other(other)),
    };
    let set = FileSet::open_for(folder_of(path), name).map_err(whole)?;
    let put = |relative: &Path, bytes: &[u8]| {
        let staged = set.path(relative);
        let parent = staged.parent().map_or(Ok(()), fs::create_dir_all);
        parent.and_then(|()| fs::write(&staged, bytes)).map_err(|source| io(relative, source))
    };
    for (relative, bytes) in &files.beside {
        put(relative, bytes)?;
    }
    put(name.as_ref(), &files.bytes)?;
    let beside = files.beside.iter().map(|(relative, _)| relative.as_path());
    set.commit(&beside.chain([name.as_ref()]).collect::<Vec<_>>()).map_err(whole)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attributes::{Column, Property};
    use if_core::math::Vector;

    const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        property uchar label\nelement face 1\nproperty list uchar int vertex_index\nend_header\n0 0 0 7\n1 0 0 8\n0 0.1 0 9\n3 0 1 2\n";

    #[test]
    fn positions_as_written_are_what_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let (path, out) = (folder.path().join("a.PLY"), folder.path().join("b.ply"));
        fs::write(&path, PLY).unwrap();
        let file = MeshFile::read(&path).unwrap();
        assert_eq!(file.positions_as_written(file.mesh().vertices()), file.mesh().vertices());
        let moved: Vec<Point> =
            file.mesh().vertices().iter().map(|p| p + Vector::repeat(0.01)).collect();
        let foretold = file.positions_as_written(&moved);
        assert_ne!(foretold, moved);
        file.write(&out, &moved).unwrap();
        let again = MeshFile::read(&out).unwrap();
        assert_eq!(again.mesh().vertices(), foretold);
        let Content::Ply(ply) = again.content() else { panic!("a PLY file") };
        assert_eq!(ply.vertex_property("label").unwrap().values, ply::Column::U8(vec![7, 8, 9]));
    }

    #[test]
    fn without_moves_the_file_is_copied() {
        let folder = tempfile::tempdir().unwrap();
        let (path, out) = (folder.path().join("a.ply"), folder.path().join("b.ply"));
        fs::write(&path, PLY).unwrap();
        let file = MeshFile::read(&path).unwrap();
        file.write(&out, file.mesh().vertices()).unwrap();
        assert_eq!(fs::read(&out).unwrap(), PLY.as_bytes());
        assert_eq!(file.bytes(), PLY.as_bytes());
    }

    #[test]
    fn errors_name_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let inside = |name: &str| folder.path().join(name);
        for (name, text) in [
            ("a.stl", ""),
            ("noextension", ""),
            ("empty.ply", ""),
            ("empty.obj", ""),
            ("bad.obj", "v 1 2 x\n"),
        ] {
            fs::write(inside(name), text).unwrap();
            let fault = MeshFile::read(&inside(name)).unwrap_err().to_string();
            assert!(fault.contains(name), "{fault}");
        }
        assert!(matches!(MeshFile::read(&inside("missing.ply")), Err(ReadError::Io { .. })));
        fs::create_dir(inside("folder.ply")).unwrap();
        assert!(matches!(MeshFile::read(&inside("folder.ply")), Err(ReadError::NotAFile { .. })));
        fs::write(inside("a.ply"), PLY).unwrap();
        let file = MeshFile::read(&inside("a.ply")).unwrap();
        assert!(matches!(
            file.write(&inside("a.obj"), file.mesh().vertices()),
            Err(WriteError::Extension { .. })
        ));
        assert!(matches!(
            file.write(&inside("no/a.ply"), file.mesh().vertices()),
            Err(WriteError::Io { .. })
        ));
        let too_far = vec![Point::new(1e39, 0.0, 0.0); 3];
        assert!(matches!(file.write(&inside("a.ply"), &too_far), Err(WriteError::Ply { .. })));
        assert_eq!(fs::read(inside("a.ply")).unwrap(), PLY.as_bytes());
    }

    #[test]
    fn texture_coordinates_of_ply_files_count_downwards() {
        let with = |names: [&str; 2]| {
            let property =
                |(name, at): (&str, f32)| Property::new(name, Column::F32(vec![at, 0.5, 1.0]));
            let properties = names.into_iter().zip([0.25, 0.125]).map(property).collect();
            let mesh = ply::read_bytes(PLY.as_bytes()).unwrap().mesh;
            let ply = PlyMesh { vertex_properties: properties, ..PlyMesh::new(mesh) };
            MeshFile::from_ply(ply).texture_coordinates()
        };
        for names in [["s", "t"], ["u", "v"], ["texture_u", "texture_v"]] {
            assert_eq!(with(names), Some(vec![[0.25, 0.875], [0.5, 0.5], [1.0, 0.0]]), "{names:?}");
        }
        assert_eq!(with(["s", "v"]), None);
    }
}
