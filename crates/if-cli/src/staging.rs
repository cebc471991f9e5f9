//! Output files that appear whole, and together, at the end.
//!
//! Everything is written into a hidden folder inside the output folder, and renamed when all of it
//! is there. A run that ends early, for whatever reason, leaves what stood in the output folder.

use crate::cancel;
use crate::errors::ErrorChain;
use if_mesh::whole_folder;
use miette::Diagnostic;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// The hidden folder.
const PARTIAL: &str = ".ifg-partial";

/// Why outputs cannot be written.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub(crate) enum OutputError {
    #[error("cannot write into output folder `{}`", path.display())]
    #[diagnostic(code(ifg::output::folder), help("{}", advice(source)))]
    Folder { path: PathBuf, source: io::Error },
    #[error("cannot write `{}`", path.display())]
    #[diagnostic(code(ifg::output::file), help("{}", advice(source)))]
    File { path: PathBuf, source: io::Error },
    #[error("cannot write `{}`", path.display())]
    #[diagnostic(
        code(ifg::output::mesh),
        help("the format of the input cannot hold the result; convert the input")
    )]
    Mesh { path: PathBuf, source: ErrorChain },
    #[error("another ifg is writing into `{}`", path.display())]
    #[diagnostic(code(ifg::output::busy), help("wait for it, or give --out another place"))]
    Busy { path: PathBuf },
    #[error("`{}` is in the way: it is not a file", path.display())]
    #[diagnostic(code(ifg::output::in_the_way), help("give --out another folder, or move it away"))]
    InTheWay { path: PathBuf },
    #[error("`{first}` and `{second}` would both be written to `{name}`")]
    #[diagnostic(
        code(ifg::output::same_name),
        help(
            "give the files different names: each is written under its own (case does not count)"
        )
    )]
    SameName { first: String, second: String, name: String },
    #[error("output `{}` is the input file `{written}` itself", path.display())]
    #[diagnostic(
        code(ifg::output::over_input),
        help("give --out another place{}", if *option { ", or allow it with --in-place" } else { "" })
    )]
    OverInput {
        path: PathBuf,
        written: String,
        /// Whether the command has --in-place.
        option: bool,
    },
    #[error("cannot write `{}`: its name does not end in .{extension}", path.display())]
    #[diagnostic(
        code(ifg::output::extension),
        help("give --out a name that ends in .{extension}: that is what is written")
    )]
    Extension { path: PathBuf, extension: &'static str },
    #[error("outfits are written to --out DIR when they come as meshes")]
    #[diagnostic(code(ifg::output::none), help("add --out DIR"))]
    NoFolder,
}

/// What to do about a failed write.
fn advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => {
            "make room there, or give --out a folder on another disk"
        }
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "give --out a folder that you may write to"
        }
        io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => {
            "a part of the path is a file; give --out another folder"
        }
        _ => "give --out another folder, or look at the disk",
    }
}

/// An output folder, or some files in one, being written. Dropped before [`Staging::commit`], it
/// leaves no trace.
pub(crate) struct Staging {
    out: PathBuf,
    partial: PathBuf,
    /// Holds the lock for as long as it is open.
    _lock: File,
    /// Folders that were made for this run, innermost first.
    made: Vec<PathBuf>,
}

impl Staging {
    /// Makes the folder where it is missing, and takes the right to write there.
    ///
    /// What a killed run has left there is removed.
    pub(crate) fn open(out: &Path) -> Result<Self, OutputError> {
        Self::in_hidden(out, out.join(PARTIAL), out)
    }

    /// The same for one file in a folder, with what comes beside it: other runs may write other
    /// files there at the same time.
    pub(crate) fn open_for(out: &Path, name: &OsStr) -> Result<Self, OutputError> {
        let mut hidden = OsString::from(format!("{PARTIAL}-"));
        hidden.push(name);
        Self::in_hidden(out, out.join(hidden), &out.join(name))
    }

    /// Writes into `partial`, on behalf of `whole`.
    fn in_hidden(out: &Path, partial: PathBuf, whole: &Path) -> Result<Self, OutputError> {
        let fault = |source| OutputError::Folder { path: out.into(), source };
        let missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
        let made = out.ancestors().take_while(missing).map(Path::to_path_buf).collect();
        fs::create_dir_all(out).map_err(fault)?;
        let lock = whole_folder::lock(&partial).map_err(fault)?;
        let lock = lock.ok_or_else(|| OutputError::Busy { path: whole.into() })?;
        for entry in fs::read_dir(&partial).map_err(fault)? {
            let path = entry.map_err(fault)?.path();
            if !path.ends_with(whole_folder::LOCK) {
                if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }
                    .map_err(fault)?;
            }
        }
        cancel::guard(&partial);
        Ok(Self { out: out.into(), partial, _lock: lock, made })
    }

    /// Where to write the file that will be called `name`.
    pub(crate) fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.partial.join(name)
    }

    /// Moves the files into place, in the order given; none where something is in the way of one.
    pub(crate) fn commit(mut self, names: &[impl AsRef<Path>]) -> Result<(), OutputError> {
        for name in names {
            free(&self.out.join(name))?;
        }
        for name in names {
            let path = self.out.join(name);
            let folder = path.parent().unwrap_or(&self.out);
            let moved =
                fs::create_dir_all(folder).and_then(|()| fs::rename(self.path(name), &path));
            moved.map_err(|source| OutputError::File { path, source })?;
        }
        self.made.clear();
        Ok(())
    }
}

/// Whether a file can be moved to `path`: no folder stands there, and no file where one of its
/// folders must be.
fn free(path: &Path) -> Result<(), OutputError> {
    if path.exists() && !path.is_file() {
        return Err(OutputError::InTheWay { path: path.into() });
    }
    let above = path.ancestors().skip(1).find(|folder| folder.exists());
    if above.is_some_and(|folder| !folder.is_dir()) {
        return Err(OutputError::File {
            path: path.into(),
            source: io::ErrorKind::NotADirectory.into(),
        });
    }
    Ok(())
}

impl Drop for Staging {
    fn drop(&mut self) {
        // Nothing can be done about a fault here, and the next run cleans up.
        let _ = fs::remove_dir_all(&self.partial);
        for folder in &self.made {
            let _ = fs::remove_dir(folder);
        }
        cancel::unguard(&self.partial);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{read_dir, write};

    #[test]
    fn files_appear_together_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("a/b");
        let staging = Staging::open(&out).unwrap();
        write(staging.path("x"), "x").unwrap();
        assert_eq!(read_dir(&out).unwrap().count(), 1);
        drop(staging);
        assert!(!folder.path().join("a").exists());
        let staging = Staging::open(&out).unwrap();
        write(staging.path("x"), "x").unwrap();
        write(staging.path("y"), "y").unwrap();
        staging.commit(&["y", "x"]).unwrap();
        assert_eq!(read_dir(&out).unwrap().count(), 2);
    }

    #[test]
    fn where_something_is_in_the_way_of_one_file_none_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path().join("a"), "old").unwrap();
        fs::create_dir(folder.path().join("b")).unwrap();
        write(folder.path().join("file"), "old").unwrap();
        let commit = |names: &[&str]| {
            let staging = Staging::open(folder.path()).unwrap();
            for name in names {
                let path = staging.path(name);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                write(path, "new").unwrap();
            }
            staging.commit(names)
        };
        let fault = commit(&["a", "b"]).unwrap_err();
        assert!(matches!(&fault, OutputError::InTheWay { path } if path.ends_with("b")), "{fault}");
        for below in ["file/c", "file/c/d"] {
            let fault = commit(&["a", "new/x", below]).unwrap_err();
            assert!(
                matches!(&fault, OutputError::File { path, .. } if path.ends_with(below)),
                "{fault}"
            );
        }
        assert_eq!(fs::read(folder.path().join("a")).unwrap(), b"old");
        assert!(!folder.path().join("new").exists());
        commit(&["a", "new/x"]).unwrap();
        assert_eq!(fs::read(folder.path().join("a")).unwrap(), b"new");
    }

    #[test]
    fn what_a_killed_run_left_is_removed_and_a_running_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let partial = folder.path().join(PARTIAL);
        fs::create_dir(&partial).unwrap();
        write(partial.join("half"), "ha").unwrap();
        let staging = Staging::open(folder.path()).unwrap();
        assert!(!staging.path("half").exists());
        assert!(matches!(Staging::open(folder.path()), Err(OutputError::Busy { .. })));
        drop(staging);
        assert!(Staging::open(folder.path()).is_ok());
        let one = Staging::open_for(folder.path(), "a".as_ref()).unwrap();
        let other = Staging::open_for(folder.path(), "b".as_ref()).unwrap();
        assert!(
            matches!(Staging::open_for(folder.path(), "a".as_ref()), Err(OutputError::Busy { path }) if path.ends_with("a"))
        );
        drop((one, other));
        assert_eq!(read_dir(folder.path()).unwrap().count(), 0);
    }
}
