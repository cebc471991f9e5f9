//! Outfits as files: read, checked, resolved, verified exactly as they are stored, and written back.
//!
//! [`OutfitFiles::read`] takes mesh files (PLY, OBJ, glTF) in any unit. [`OutfitFiles::resolve`]
//! resolves the outfit in metres, brings the result into the units and the precision of each file, splits
//! attributes where triangles were split, and verifies exactly the positions that a reader of the
//! files gets. [`ResolvedFiles::write`] writes each garment back with its triangles, their order and
//! all its attributes, in the format it came in. A garment that did not move is a byte-for-byte
//! copy.
//!
//! # Examples
//!
//! ```
//! # use if_body::mannequin::{self, Garment, MannequinParams};
//! # use if_mesh::ply::{PlyMesh, WriteParams, write_path};
//! # let folder = tempfile::tempdir()?;
//! # let scene = MannequinParams { resolution: 0.7, ..Default::default() };
//! # let store = |name: &str, mesh| -> Result<_, Box<dyn std::error::Error>> {
//! #     let (path, ply) = (folder.path().join(name), PlyMesh::new(mesh));
//! #     write_path(&ply, ply.mesh.vertices(), &WriteParams::default(), &path)?;
//! #     Ok(path)
//! # };
//! # let body = store("body.ply", mannequin::body(&scene))?;
//! # let tshirt = store("tshirt.ply", mannequin::garment(Garment::Tshirt, &scene))?;
//! # let out = folder.path().join("out");
//! use if_core::monitor::Silent;
//! use if_outfit::files::{LayerFile, OutfitFiles};
//! use if_outfit::resolve::ResolveParams;
//!
//! let files = OutfitFiles::read(LayerFile::new(body), vec![LayerFile::new(tshirt)], 1.0)?;
//! let resolved = files.resolve(&ResolveParams::default(), &mut Silent)?;
//! resolved.write(&out)?; // out/tshirt.ply
//! assert!(resolved.report.is_proven());
//! # assert!(out.join("tshirt.ply").is_file());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod error;
mod notes;
mod resolved;

pub use error::FilesError;
pub use resolved::{ResolvedFiles, drawn_back_name};

use crate::distances;
use crate::layer_fields::FieldOfGarment;
use crate::outfit::{Layer, Outfit, OutfitError};
use crate::prepared_body::PreparedBody;
use crate::report::Verification;
use crate::resolve::{ResolveError, ResolveParams, Resolved, resolve_over};
use crate::storage::Storage;
use crate::unresolved::Unresolved;
use crate::verify::{verify, verify_result};
use if_core::math::{Point, Real};
use if_core::monitor::Monitor;
use if_mesh::file::{Content, MeshFile, file_and_node};
use if_mesh::split::SplitMesh;
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use tracing::trace_span;

/// A mesh file and the name of its layer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LayerFile {
    /// What reports and errors call the layer.
    pub name: String,
    /// The file (`.ply`, `.obj`, `.glb`, `.gltf`), or a node of a glTF file as `FILE.glb#NODE`
    /// ([`if_mesh::file::file_and_node`]).
    pub path: PathBuf,
}

impl LayerFile {
    /// A layer named after its file, without the extension, or after its node.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        let path = path.into();
        let (file, node) = file_and_node(&path);
        let stem = || file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let name = node.unwrap_or_else(stem);
        Self { name, path }
    }
}

/// An outfit and the files that hold it.
#[derive(Clone, Debug)]
pub struct OutfitFiles {
    /// In metres.
    outfit: Outfit,
    /// The body's file and its path; `None` for an outfit from memory.
    body: Option<(Arc<MeshFile>, PathBuf)>,
    /// Of the garments, inner to outer.
    files: Vec<Arc<MeshFile>>,
    /// Of the garments' files; empty for those from memory.
    paths: Vec<PathBuf>,
    /// From the units of the files to metres.
    scale: Real,
    /// The body, if it was prepared.
    prepared: Option<Arc<PreparedBody>>,
}

impl OutfitFiles {
    /// Reads a body and its garments, inner to outer, and checks that they are a valid outfit.
    /// `scale` is the factor from the units of the files to metres, such as 0.001 for millimetres.
    /// What is verified are positions in metres, as f64: unless the factor is a power of two, they are
    /// rounded, by 1e-16 of a coordinate, and what merely touches in the file may be apart.
    ///
    /// # Errors
    ///
    /// A scale that is not positive, a file that cannot be read, two layers that have vertices of a
    /// glTF file in common, or an invalid outfit ([`Outfit::new`]).
    pub fn read(
        body: LayerFile,
        garments: Vec<LayerFile>,
        scale: Real,
    ) -> Result<Self, FilesError> {
        if !(scale.is_finite() && scale > 0.0) {
            return Err(FilesError::ScaleRange { scale });
        }
        let layers: Vec<&LayerFile> = std::iter::once(&body).chain(&garments).collect();
        let read = |(k, layer): (usize, &&LayerFile)| {
            let role = if k == 0 { "body" } else { "garment" };
            MeshFile::read(&layer.path).map_err(|source| FilesError::Read {
                role,
                layer: layer.name.clone(),
                source,
            })
        };
        // All are read before the first error is returned, so that it is the same on any number of
        // threads.
        let files: Vec<_> = layers.par_iter().enumerate().map(read).collect();
        let mut files = files.into_iter().collect::<Result<Vec<_>, _>>()?;
        check_nodes(&layers, &files)?;
        let in_metres = |(layer, file): (&&LayerFile, &MeshFile)| to_layer(layer, file, scale);
        let mut meshes = layers.iter().zip(&files).map(in_metres).collect::<Result<Vec<_>, _>>()?;
        let outfit = Outfit::new(meshes.remove(0), meshes).map_err(|source| {
            let LayerFile { name: layer, path } = faulty(&body, &garments, &source).clone();
            FilesError::Outfit { layer, path, source }
        })?;
        let body = Some((Arc::new(files.remove(0)), file_and_node(&body.path).0));
        let files = files.into_iter().map(Arc::new).collect();
        let paths = garments.iter().map(|layer| file_and_node(&layer.path).0).collect();
        Ok(Self { outfit, body, files, paths, scale, prepared: None })
    }

    /// An outfit from memory whose garments will be stored as `files`, in metres. Each file has the
    /// triangles and the vertex order of its garment; its vertices may be elsewhere, such as in
    /// another pose.
    ///
    /// Each garment's [`Layer::storage`] is set to that of its file.
    ///
    /// # Panics
    ///
    /// If the files are not as many as the garments.
    pub fn from_memory(mut outfit: Outfit, files: Vec<MeshFile>) -> Self {
        assert_eq!(outfit.garments.len(), files.len(), "one file for each garment");
        for (garment, file) in outfit.garments.iter_mut().zip(&files) {
            garment.storage = Storage::of(file);
        }
        let paths = vec![PathBuf::new(); files.len()];
        let files = files.into_iter().map(Arc::new).collect();
        Self { outfit, body: None, files, paths, scale: 1.0, prepared: None }
    }

    /// The same outfit with its body prepared, so that it is not closed for each of many outfits. A
    /// body with another mesh is not used.
    pub fn with_body(self, body: Arc<PreparedBody>) -> Self {
        Self { prepared: Some(body), ..self }
    }

    /// The outfit in metres.
    pub fn outfit(&self) -> &Outfit {
        &self.outfit
    }

    /// The body's file, then the garments', inner to outer. An outfit from memory has no file of
    /// its body.
    pub fn files(&self) -> impl Iterator<Item = &MeshFile> {
        self.body.iter().map(|(file, _)| file).chain(&self.files).map(Arc::as_ref)
    }

    /// What a person should know about the meshes. None of it stops the work.
    pub fn notes(&self) -> Vec<String> {
        notes::of(self)
    }

    /// Verifies the outfit as it is stored, without changing it ([`verify`]).
    ///
    /// # Errors
    ///
    /// None that [`OutfitFiles::read`] has not returned before; an outfit from memory may be
    /// invalid.
    pub fn verify(&self) -> Result<Verification, OutfitError> {
        verify(&self.outfit)
    }

    /// Resolves the outfit ([`resolve`](crate::resolve()), and verifies exactly what [`ResolvedFiles::write`] stores.
    ///
    /// # Errors
    ///
    /// [`FilesError::Unresolved`] if intersections remain, with the result as far as it came; as
    /// [`resolve`](crate::resolve()) otherwise; a file whose vertices cannot move, or
    /// that cannot hold its split triangles.
    pub fn resolve(
        &self,
        params: &ResolveParams,
        monitor: &mut dyn Monitor,
    ) -> Result<ResolvedFiles, FilesError> {
        let fields = vec![None; self.outfit.garments.len()];
        self.resolve_on_fields(&fields, params, monitor)
    }

    /// [`OutfitFiles::resolve`] of garments that come with fields
    /// ([`resolve_on_fields`](crate::resolve_on_fields)).
    ///
    /// # Errors
    ///
    /// As [`OutfitFiles::resolve`].
    ///
    /// # Panics
    ///
    /// As [`resolve_on_fields`](crate::resolve_on_fields).
    pub fn resolve_on_fields(
        &self,
        fields: &[FieldOfGarment<'_>],
        params: &ResolveParams,
        monitor: &mut dyn Monitor,
    ) -> Result<ResolvedFiles, FilesError> {
        for (garment, file) in self.outfit.garments.iter().zip(&self.files) {
            let layer = garment.name.clone();
            file.check_movable().map_err(|source| FilesError::Fixed { layer, source })?;
        }
        let body = self.prepared.as_deref();
        let found = resolve_over(&self.outfit, body, fields, params, monitor);
        let Resolved { outfit, mut report, splits } = match found {
            Ok(resolved) => resolved,
            Err(ResolveError::Unresolved { result, .. }) => *result,
            Err(error) => return Err(FilesError::Resolve(error)),
        };
        let _phase = trace_span!("rounding").entered();
        let mut fine = self.split(&splits)?;
        let body = match report.drawn_back {
            Some(_) => fine.draw_back(&outfit.body)?,
            None => None,
        };
        let positions = fine.positions(&outfit);
        let stored = fine.outfit_of(&positions)?;
        // Files in other units round differently, and so may vertices that splitting made, in one
        // step here where the solver made them in several.
        if splits.iter().any(Option::is_some) || stored != outfit {
            verify_result(&mut report, &fine.outfit, &stored);
            if params.goal.least_distance > 0.0 {
                distances::measure_primitives(&stored, &mut report.after);
            }
            report.compare_distances(params.goal.clearance);
        }
        let unresolved = Unresolved::of(&fine.outfit, (&stored, &report));
        let body = fine.body.zip(body).map(|((file, path), positions)| (file, path, positions));
        let resolved = ResolvedFiles::new(stored, report, fine.files, fine.paths, positions)
            .with_drawn_back(body);
        match unresolved {
            None => Ok(resolved),
            Some(unresolved) => {
                let (unresolved, result) = (Box::new(unresolved), Box::new(resolved));
                Err(FilesError::Unresolved { unresolved, result })
            }
        }
    }

    /// Takes over a body that was drawn back, as a reader of its file gets it, and returns its
    /// positions in the units of the file.
    fn draw_back(&mut self, body: &Layer) -> Result<Option<Vec<Point>>, FilesError> {
        let Some((file, path)) = &self.body else {
            self.outfit.body = body.clone();
            return Ok(None);
        };
        let positions = stored(&self.outfit.body, body, file, self.scale);
        let in_metres = positions.iter().map(|p| p * self.scale).collect();
        let mesh = body.mesh.with_vertices(in_metres).map_err(|source| {
            let (layer, path) = (body.name.clone(), path.clone());
            FilesError::Scale { layer, path, scale: self.scale, source }
        })?;
        self.outfit.body.mesh = mesh;
        Ok(Some(positions))
    }

    /// The same outfit with triangles split, in the files too.
    fn split(&self, splits: &[Option<SplitMesh>]) -> Result<Self, FilesError> {
        let mut fine = self.clone();
        for (k, split) in splits.iter().enumerate() {
            let Some(split) = split else { continue };
            let file = self.files[k].split(split).map_err(|source| FilesError::Split {
                layer: self.outfit.garments[k].name.clone(),
                path: self.paths[k].clone(),
                source,
            })?;
            fine.files[k] = Arc::new(file);
            fine.outfit.garments[k].mesh = split.mesh.clone();
        }
        Ok(fine)
    }

    /// The positions of each garment of `moved` as a reader of its file gets them, in the units of
    /// the file. Vertices that did not move keep the bits of the file.
    fn positions(&self, moved: &Outfit) -> Vec<Vec<Point>> {
        let garments = self.outfit.garments.iter().zip(&moved.garments).zip(&self.files);
        garments.map(|((came, moved), file)| stored(came, moved, file, self.scale)).collect()
    }

    /// The outfit in metres of positions in the units of the files.
    fn outfit_of(&self, positions: &[Vec<Point>]) -> Result<Outfit, FilesError> {
        let mut outfit = self.outfit.clone();
        for (k, (garment, positions)) in outfit.garments.iter_mut().zip(positions).enumerate() {
            let in_metres = positions.iter().map(|p| p * self.scale).collect();
            garment.mesh = garment.mesh.with_vertices(in_metres).map_err(|source| {
                let layer = garment.name.clone();
                FilesError::Scale { layer, path: self.paths[k].clone(), scale: self.scale, source }
            })?;
        }
        Ok(outfit)
    }
}

/// The positions of a layer as a reader of its file gets them, in the units of the file.
fn stored(came: &Layer, moved: &Layer, file: &MeshFile, scale: Real) -> Vec<Point> {
    let vertices = came.mesh.vertices().iter().zip(moved.mesh.vertices());
    let back = |((came, moved), original): ((&Point, &Point), &Point)| {
        // The file of a garment from memory may hold another pose.
        let is_original = moved == came && original * scale == *came;
        if is_original { *original } else { moved / scale }
    };
    let back: Vec<Point> = vertices.zip(file.mesh().vertices()).map(back).collect();
    file.positions_as_written(&back)
}

/// Two layers must not have vertices of a glTF file in common.
fn check_nodes(layers: &[&LayerFile], files: &[MeshFile]) -> Result<(), FilesError> {
    for (k, (second, file)) in layers.iter().zip(files).enumerate() {
        for (first, other) in layers[..k].iter().zip(files) {
            let (Content::Gltf(a), Content::Gltf(b)) = (other.content(), file.content()) else {
                continue;
            };
            let [a_path, b_path] = [first, second].map(|l| file_and_node(&l.path).0.canonicalize());
            let is_one_file = a_path.ok().zip(b_path.ok()).is_some_and(|(a, b)| a == b);
            if is_one_file && a.shares_vertices_with(b) {
                return Err(FilesError::SharedVertices {
                    first: first.name.clone(),
                    second: second.name.clone(),
                    path: file_and_node(&second.path).0,
                });
            }
        }
    }
    Ok(())
}

/// A layer in metres.
fn to_layer(layer: &LayerFile, file: &MeshFile, scale: Real) -> Result<Layer, FilesError> {
    let LayerFile { name, path } = layer.clone();
    let mesh = file.mesh().scaled(scale).map_err(|source| FilesError::Scale {
        layer: name.clone(),
        path,
        scale,
        source,
    })?;
    // What is stored in other units is not rounded in metres. `OutfitFiles::resolve` rounds and
    // verifies it at the end.
    let storage = if scale == 1.0 { Storage::of(file) } else { Storage::F64 };
    Ok(Layer { storage, ..Layer::new(name, mesh) })
}

/// The layer that the error is about.
fn faulty<'a>(
    body: &'a LayerFile,
    garments: &'a [LayerFile],
    error: &OutfitError,
) -> &'a LayerFile {
    match error {
        OutfitError::Empty { layer }
        | OutfitError::IsBody { layer }
        | OutfitError::DuplicateName { layer }
        | OutfitError::TooLarge { layer, .. }
        | OutfitError::TooSmall { layer, .. }
        | OutfitError::FarFromBody { layer, .. } => {
            garments.iter().rfind(|garment| garment.name == *layer).unwrap_or(body)
        }
        _ => body,
    }
}

#[cfg(test)]
mod tests;
