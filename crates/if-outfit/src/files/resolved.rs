//! A resolved outfit with the files that will hold it.

use super::FilesError;
use crate::outfit::Outfit;
use crate::report::ResolveReport;
use if_core::math::Point;
use if_mesh::file::{MeshFile, WriteError};
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

    /// Writes garment `k`, counted from the innermost, to `path`, whole or not at all
    /// ([`MeshFile::write`]). A garment that did not move is a byte-for-byte copy.
    ///
    /// # Errors
    ///
    /// An extension of another format than the garment came in, or a fault of the file system.
    ///
    /// # Panics
    ///
    /// If there is no garment `k`.
    pub fn write_garment(&self, k: usize, path: &Path) -> Result<(), WriteError> {
        self.files[k].write(path, &self.positions[k])
    }

    /// Writes all garments into `folder`, each under the name of the file it came from, and returns
    /// their paths. Garments from memory are written to `NAME.ply`.
    ///
    /// # Errors
    ///
    /// Two garments with one file name (case does not count), or a folder or file that cannot be
    /// written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, FilesError> {
        let names: Vec<PathBuf> = (0..self.files.len()).map(|k| self.file_name(k)).collect();
        for (k, name) in names.iter().enumerate() {
            let same = |other: &PathBuf| other.as_os_str().eq_ignore_ascii_case(name);
            if let Some(j) = names[..k].iter().position(same) {
                let [first, second] = [j, k].map(|k| self.outfit.garments[k].name.clone());
                return Err(FilesError::SameFile { first, second, file: name.clone() });
            }
        }
        std::fs::create_dir_all(folder)
            .map_err(|source| FilesError::Folder { path: folder.into(), source })?;
        let write = |(k, name): (usize, &PathBuf)| {
            let path = folder.join(name);
            let layer = || self.outfit.garments[k].name.clone();
            self.write_garment(k, &path)
                .map_err(|source| FilesError::Write { layer: layer(), source })?;
            Ok(path)
        };
        // All are written before the first error is returned, so that it is the same on any number
        // of threads.
        let written: Vec<_> = names.par_iter().enumerate().map(write).collect();
        written.into_iter().collect()
    }

    fn file_name(&self, k: usize) -> PathBuf {
        let of_memory = || format!("{}.ply", self.outfit.garments[k].name).into();
        self.paths[k].file_name().map(OsStr::to_owned).map_or_else(of_memory, PathBuf::from)
    }
}
