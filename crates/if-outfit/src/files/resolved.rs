//! A resolved outfit with the files that will hold it.

use super::FilesError;
use crate::outfit::Outfit;
use crate::report::ResolveReport;
use if_core::math::Point;
use if_mesh::file::{Content, MeshFile, WriteError};
use if_mesh::regular_file;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A resolved outfit, verified exactly as it is stored.
#[derive(Clone, Debug)]
pub struct ResolvedFiles {
    /// The outfit in metres, as a reader of the written files gets it.
    pub outfit: Outfit,
    /// What was found and done.
    pub report: ResolveReport,
    /// Of the garments, with triangles split where the garment's were.
    files: Vec<Arc<MeshFile>>,
    paths: Vec<PathBuf>,
    /// Of each garment, in the units of its file.
    positions: Vec<Vec<Point>>,
    /// The body's file, its path and its positions in the units of the file; `None` if the body stayed
    /// as it was, or came from memory.
    drawn_back: Option<(Arc<MeshFile>, PathBuf, Vec<Point>)>,
}

/// What follows the name of the body's file in that of the body that was drawn back.
const DRAWN_BACK: &str = "_drawn_back";

/// The name of the file for a body that was drawn back, from that of the body.
pub fn drawn_back_name(body: &Path) -> String {
    let part = |part: Option<&OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    format!("{}{DRAWN_BACK}.{}", part(body.file_stem()), part(body.extension()))
}

impl ResolvedFiles {
    pub(super) fn new(
        outfit: Outfit,
        report: ResolveReport,
        files: Vec<Arc<MeshFile>>,
        paths: Vec<PathBuf>,
        positions: Vec<Vec<Point>>,
    ) -> Self {
        Self { outfit, report, files, paths, positions, drawn_back: None }
    }

    pub(super) fn with_drawn_back(
        self,
        drawn_back: Option<(Arc<MeshFile>, PathBuf, Vec<Point>)>,
    ) -> Self {
        Self { drawn_back, ..self }
    }

    /// The name of the file for a body that was drawn back ([`Pinch::Yield`](crate::Pinch::Yield)),
    /// such as `body_drawn_back.ply`; `None` if the body stayed as it was, or came from memory.
    pub fn drawn_back_file_name(&self) -> Option<String> {
        self.drawn_back.as_ref().map(|(_, path, _)| drawn_back_name(path))
    }

    /// Writes a body that was drawn back to `path`, whole or not at all, with all attributes of its
    /// file; garments that are nodes of that file are where they are now, too, and buffers that a `.gltf`
    /// file has in other files are embedded. Does nothing if
    /// [`ResolvedFiles::drawn_back_file_name`] is `None`.
    ///
    /// # Errors
    ///
    /// As [`ResolvedFiles::write_garments`].
    pub fn write_drawn_back(&self, path: &Path) -> Result<(), WriteError> {
        match &self.drawn_back {
            Some((body, _, positions)) => {
                let with_body =
                    (0..self.files.len()).filter(|k| in_one_file(body, &self.files[*k]));
                let garments = with_body.map(|k| (&*self.files[k], &self.positions[k][..]));
                let layers = std::iter::once((&**body, &positions[..])).chain(garments);
                MeshFile::write_layers_embedded(&layers.collect::<Vec<_>>(), path)
            }
            None => Ok(()),
        }
    }

    /// Writes the garments `ks`, counted from the innermost, to `path`, whole or not at all
    /// ([`MeshFile::write_layers`]): one garment, or several that are nodes of one glTF file. If none
    /// of them moved, the file is a byte-for-byte copy.
    ///
    /// # Errors
    ///
    /// An extension of another format than the garments came in, garments of several files, or a
    /// fault of the file system.
    ///
    /// # Panics
    ///
    /// If there is no such garment.
    pub fn write_garments(&self, ks: &[usize], path: &Path) -> Result<(), WriteError> {
        let layers = ks.iter().map(|&k| (&*self.files[k], &self.positions[k][..]));
        MeshFile::write_layers(&layers.collect::<Vec<_>>(), path)
    }

    /// The garments by the file that holds them, each with the file's name: one garment, or all
    /// nodes of a glTF file. Garments from memory go to `NAME.ply`.
    ///
    /// # Errors
    ///
    /// Two files of one name (case does not count), those with the buffers of `.gltf` files and that of a
    /// body that was drawn back ([`ResolvedFiles::drawn_back_file_name`]) included, or a garment from
    /// memory whose name is no file's.
    pub fn output_files(&self) -> Result<Vec<(PathBuf, Vec<usize>)>, FilesError> {
        let mut found: Vec<(PathBuf, Vec<usize>)> = Vec::new();
        for k in 0..self.files.len() {
            let name = self.file_name(k)?;
            let same = |(other, _): &&mut (PathBuf, Vec<usize>)| {
                other.as_os_str().eq_ignore_ascii_case(&name)
            };
            match found.iter_mut().find(same) {
                None => found.push((name, vec![k])),
                Some((_, ks)) if in_one_file(&self.files[ks[0]], &self.files[k]) => ks.push(k),
                Some((_, ks)) => {
                    let [first, second] = [ks[0], k].map(|k| self.outfit.garments[k].name.clone());
                    return Err(FilesError::SameFile { first, second, file: name });
                }
            }
        }
        self.check_names(&found)?;
        Ok(found)
    }

    /// Writes all garments into `folder`, each under the name of the file it came from, then a body
    /// that was drawn back, and returns the paths of the files ([`ResolvedFiles::output_files`],
    /// [`ResolvedFiles::drawn_back_file_name`]).
    ///
    /// # Errors
    ///
    /// As [`ResolvedFiles::output_files`], or a folder or file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, FilesError> {
        let names = self.output_files()?;
        std::fs::create_dir_all(folder)
            .map_err(|source| FilesError::Folder { path: folder.into(), source })?;
        let write = |(name, ks): &(PathBuf, Vec<usize>)| {
            let path = folder.join(name);
            let layer = || self.outfit.garments[ks[0]].name.clone();
            self.write_garments(ks, &path)
                .map_err(|source| FilesError::Write { layer: layer(), source })?;
            Ok(path)
        };
        // All are written before the first error is returned, so that it is the same on any number
        // of threads.
        let written: Vec<_> = names.par_iter().map(write).collect();
        let mut written = written.into_iter().collect::<Result<Vec<_>, _>>()?;
        if let Some(name) = self.drawn_back_file_name() {
            let path = folder.join(name);
            let layer = self.outfit.body.name.clone();
            self.write_drawn_back(&path).map_err(|source| FilesError::Write { layer, source })?;
            written.push(path);
        }
        Ok(written)
    }

    /// Checks that no two of all files to be written have one name.
    fn check_names(&self, found: &[(PathBuf, Vec<usize>)]) -> Result<(), FilesError> {
        let mut all: Vec<(&Path, &str)> = Vec::new();
        let drawn_back = self.drawn_back_file_name().map(PathBuf::from);
        let drawn_back = drawn_back.iter().map(|body| (body.as_path(), &self.outfit.body));
        let garments = found.iter().flat_map(|(name, ks)| {
            let beside = match self.files[ks[0]].content() {
                Content::Gltf(gltf) => Some(gltf.beside().map(|(path, _)| path)),
                _ => None,
            };
            // Several buffers may be in one file.
            let beside: BTreeSet<&Path> = beside.into_iter().flatten().collect();
            let names = std::iter::once(name.as_path()).chain(beside);
            names.map(|name| (name, &self.outfit.garments[ks[0]]))
        });
        for (name, layer) in garments.chain(drawn_back) {
            let same = |(other, _): &&(&Path, &str)| {
                other.as_os_str().eq_ignore_ascii_case(name.as_os_str())
            };
            if let Some((_, first)) = all.iter().find(same) {
                let [first, second] = [first, &layer.name[..]].map(String::from);
                return Err(FilesError::SameFile { first, second, file: name.into() });
            }
            all.push((name, &layer.name));
        }
        Ok(())
    }

    fn file_name(&self, k: usize) -> Result<PathBuf, FilesError> {
        if let Some(name) = self.paths[k].file_name() {
            return Ok(name.into());
        }
        let layer = &self.outfit.garments[k].name;
        regular_file::inside(Path::new(""), &format!("{layer}.ply"))
            .ok_or_else(|| FilesError::FileName { layer: layer.clone() })
    }
}

/// Whether two layers are nodes of one file.
fn in_one_file(first: &MeshFile, second: &MeshFile) -> bool {
    match (first.content(), second.content()) {
        (Content::Gltf(a), Content::Gltf(b)) => a.is_in_file_of(b) && !a.shares_vertices_with(b),
        _ => false,
    }
}
