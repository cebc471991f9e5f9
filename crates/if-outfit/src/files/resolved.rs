//! A resolved outfit with the files that will hold it.

use super::FilesError;
use crate::outfit::Outfit;
use crate::report::ResolveReport;
use if_core::math::Point;
use if_mesh::file::{Content, MeshFile, WriteError};
use rayon::prelude::*;
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
}

impl ResolvedFiles {
    pub(super) fn new(
        outfit: Outfit,
        report: ResolveReport,
        files: Vec<Arc<MeshFile>>,
        paths: Vec<PathBuf>,
        positions: Vec<Vec<Point>>,
    ) -> Self {
        Self { outfit, report, files, paths, positions }
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
    /// Two files of one name (case does not count).
    pub fn output_files(&self) -> Result<Vec<(PathBuf, Vec<usize>)>, FilesError> {
        let mut found: Vec<(PathBuf, Vec<usize>)> = Vec::new();
        for k in 0..self.files.len() {
            let name = self.file_name(k);
            let same = |(other, _): &&mut (PathBuf, Vec<usize>)| {
                other.as_os_str().eq_ignore_ascii_case(&name)
            };
            match found.iter_mut().find(same) {
                None => found.push((name, vec![k])),
                Some((_, ks)) if self.is_one_file(ks[0], k) => ks.push(k),
                Some((_, ks)) => {
                    let [first, second] = [ks[0], k].map(|k| self.outfit.garments[k].name.clone());
                    return Err(FilesError::SameFile { first, second, file: name });
                }
            }
        }
        Ok(found)
    }

    /// Writes all garments into `folder`, each under the name of the file it came from, and returns
    /// the paths of the files ([`ResolvedFiles::output_files`]).
    ///
    /// # Errors
    ///
    /// Two files of one name, or a folder or file that cannot be written.
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
        written.into_iter().collect()
    }

    /// Whether two garments are nodes of one file.
    fn is_one_file(&self, first: usize, second: usize) -> bool {
        match (self.files[first].content(), self.files[second].content()) {
            (Content::Gltf(a), Content::Gltf(b)) => {
                a.is_in_file_of(b) && !a.shares_vertices_with(b)
            }
            _ => false,
        }
    }

    fn file_name(&self, k: usize) -> PathBuf {
        let of_memory = || format!("{}.ply", self.outfit.garments[k].name).into();
        self.paths[k].file_name().map(OsStr::to_owned).map_or_else(of_memory, PathBuf::from)
    }
}
