//! Output files that appear whole, and together, at the end ([`FileSet`]), also after a sudden end
//! by Ctrl-C.

use crate::cancel;
use crate::file_record::OutputFile;
use crate::output_error::OutputError;
use if_mesh::atomic::FileSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// An output folder, or some files in one, being written. Dropped before [`Staging::commit`], or
/// when a second Ctrl-C ends the program, nothing has changed.
pub(crate) struct Staging {
    files: FileSet,
    _guard: Guard,
}

/// Registers the hidden folder for a sudden end.
struct Guard(PathBuf);

impl Drop for Guard {
    fn drop(&mut self) {
        cancel::unguard(&self.0);
    }
}

impl Staging {
    /// All files of a folder ([`FileSet::open`]).
    pub(crate) fn open(out: &Path) -> Result<Self, OutputError> {
        Ok(Self::guarded(FileSet::open(out)?))
    }

    /// One file and what comes beside it ([`FileSet::open_for`]).
    pub(crate) fn open_for(out: &Path, name: &OsStr) -> Result<Self, OutputError> {
        Ok(Self::guarded(FileSet::open_for(out, name)?))
    }

    fn guarded(files: FileSet) -> Self {
        let hidden = files.hidden().to_path_buf();
        cancel::guard(&hidden);
        Self { files, _guard: Guard(hidden) }
    }

    /// Where to write the file that will be called `name`.
    pub(crate) fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.files.path(name)
    }

    /// The record of the file that will be called `name` in `out`.
    pub(crate) fn describe(&self, name: &str, out: &Path) -> Result<OutputFile, OutputError> {
        OutputFile::of(name, &self.path(name))
            .map_err(|source| OutputError::File { path: out.join(name), source })
    }

    /// Moves the files to their names, in the order given ([`FileSet::commit`]).
    pub(crate) fn commit(self, names: &[impl AsRef<Path>]) -> Result<(), OutputError> {
        Ok(self.files.commit(names)?)
    }
}
