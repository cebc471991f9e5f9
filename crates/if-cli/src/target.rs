//! The file that a command writes, with the files beside it: checked and locked before the work
//! begins.

use crate::output_error::OutputError;
use crate::staging::Staging;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// A file that a command read.
#[derive(Clone, Copy)]
pub(crate) struct Input<'a> {
    pub(crate) path: &'a Path,
    /// Whether the output may take its place, as --in-place says; `None` where the command has no
    /// such option.
    pub(crate) in_place: Option<bool>,
}

/// A file that is to be written, and others beside it. Dropped before [`Target::commit`], it leaves
/// no trace.
pub(crate) struct Target {
    folder: PathBuf,
    /// The file, then what comes beside it.
    names: Vec<OsString>,
    staging: Staging,
}

impl Target {
    /// Checks that `out` can be written, creates its folder if it is missing, and locks it. If `out`
    /// is a link to a file, that file is written.
    ///
    /// What comes beside it has its name with an ending of `beside` in place of the extension.
    pub(crate) fn open(
        out: &Path,
        extension: &'static str,
        beside: &[&str],
        inputs: &[Input<'_>],
    ) -> Result<Self, OutputError> {
        if !out.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension)) {
            return Err(OutputError::Extension { path: out.into(), extension });
        }
        let found = out.canonicalize().ok().filter(|found| found != out && out.is_symlink());
        let real = found.as_deref().unwrap_or(out);
        let stem = real.file_stem().unwrap_or_default();
        let mut names = vec![real.file_name().unwrap_or_default().to_owned()];
        names.extend(beside.iter().map(|ending| {
            let mut name = stem.to_owned();
            name.push(ending);
            name
        }));
        let folder = real
            .parent()
            .filter(|p| !p.as_os_str().is_empty())
            .unwrap_or(Path::new("."))
            .to_path_buf();
        // With the folder made, `none/../x` is `x`.
        let staging = Staging::open_for(&folder, &names[0])?;
        for name in &names {
            let path = plain(&folder, name);
            let Ok(target) = path.canonicalize() else { continue };
            if !target.is_file() {
                return Err(OutputError::InTheWay { path });
            }
            if let Some(input) =
                inputs.iter().find(|i| is_same(i.path, &target) && i.in_place != Some(true))
            {
                let (written, option) =
                    (input.path.display().to_string(), input.in_place.is_some());
                return Err(OutputError::OverInput { path, written, option });
            }
        }
        Ok(Self { folder, names, staging })
    }

    /// Where to write file `k`: 0 is the file itself.
    pub(crate) fn staged(&self, k: usize) -> PathBuf {
        self.staging.path(&self.names[k])
    }

    /// Where file `k` will be.
    pub(crate) fn path(&self, k: usize) -> PathBuf {
        plain(&self.folder, &self.names[k])
    }

    /// Writes the file and moves it into place; may be called again. If that fails, the file that
    /// was there stays.
    pub(crate) fn put(
        &self,
        fill: impl FnOnce(&mut File) -> io::Result<()>,
    ) -> Result<(), OutputError> {
        let staged = self.staged(0);
        let written = File::create(&staged)
            .and_then(|mut file| fill(&mut file))
            .and_then(|()| fs::rename(&staged, self.path(0)));
        written.map_err(|source| {
            // Half a file would take the room of the next one on a full disk.
            let _ = fs::remove_file(&staged);
            OutputError::File { path: self.path(0), source }
        })
    }

    /// Moves all files into place, and returns their paths.
    pub(crate) fn commit(self) -> Result<Vec<PathBuf>, OutputError> {
        let paths = (0..self.names.len()).map(|k| self.path(k)).collect();
        // The file itself comes last: where it is, all is.
        let names: Vec<&OsString> = self.names.iter().skip(1).chain(self.names.first()).collect();
        self.staging.commit(&names)?;
        Ok(paths)
    }
}

/// The path without `./` before it.
fn plain(folder: &Path, name: &OsStr) -> PathBuf {
    if folder == Path::new(".") { PathBuf::from(name) } else { folder.join(name) }
}

/// Whether a path leads to the file with this canonical path.
pub(crate) fn is_same(path: &Path, file: &Path) -> bool {
    path.canonicalize().is_ok_and(|p| p == file)
}
