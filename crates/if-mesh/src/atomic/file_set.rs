//! Files that appear in a folder together.

use super::lock::{LOCK, lock};
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// The hidden folder.
const PARTIAL: &str = ".ifg-partial";
/// Before the number of a file that is being replaced.
const OLD: &str = ".old-";

/// Files cannot be written together.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // The messages name the fields.
pub enum FileSetError {
    /// The file system rejects the folder.
    #[error("cannot write into folder `{}`: {source}", path.display())]
    Folder { path: PathBuf, source: io::Error },
    /// The file system rejects a file.
    #[error("cannot write `{}`: {source}", path.display())]
    File { path: PathBuf, source: io::Error },
    /// Another process writes the same files.
    #[error("another process is writing `{}`; wait for it", path.display())]
    Busy { path: PathBuf },
    /// Something that is not a file has the name of one.
    #[error("`{}` is in the way: it is not a file", path.display())]
    InTheWay { path: PathBuf },
}

/// Files of one folder that are written into a hidden folder inside it, and appear together in
/// [`FileSet::commit`]. Dropped before that, nothing has changed.
#[derive(Debug)]
pub struct FileSet {
    out: PathBuf,
    partial: PathBuf,
    /// Holds the lock for as long as it is open.
    _lock: File,
    /// Folders that were created for this, innermost first.
    made: Vec<PathBuf>,
}

impl FileSet {
    /// Creates the folder if it is missing, and locks it. Files that a killed process left in its
    /// hidden folder are removed.
    ///
    /// # Errors
    ///
    /// Another process holds the lock, or an error of the file system.
    pub fn open(out: &Path) -> Result<Self, FileSetError> {
        Self::in_hidden(out, out.join(PARTIAL), out)
    }

    /// The same for one file and what belongs to it: other processes may write other files there at
    /// the same time.
    ///
    /// # Errors
    ///
    /// As [`FileSet::open`].
    pub fn open_for(out: &Path, name: &OsStr) -> Result<Self, FileSetError> {
        let mut hidden = OsString::from(format!("{PARTIAL}-"));
        hidden.push(name);
        Self::in_hidden(out, out.join(hidden), &out.join(name))
    }

    /// Writes into `partial`, on behalf of `whole`.
    fn in_hidden(out: &Path, partial: PathBuf, whole: &Path) -> Result<Self, FileSetError> {
        let fault = |source| FileSetError::Folder { path: out.into(), source };
        let made = missing_folders(out);
        fs::create_dir_all(out).map_err(fault)?;
        let lock = lock(&partial).map_err(fault)?;
        let lock = lock.ok_or_else(|| FileSetError::Busy { path: whole.into() })?;
        for entry in fs::read_dir(&partial).map_err(fault)? {
            let path = entry.map_err(fault)?.path();
            if !path.ends_with(LOCK) {
                if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }
                    .map_err(fault)?;
            }
        }
        Ok(Self { out: out.into(), partial, _lock: lock, made })
    }

    /// Whether a killed process has left files of [`FileSet::open`] in a folder, or a running one
    /// writes there.
    pub fn is_begun(out: &Path) -> bool {
        out.join(PARTIAL).is_dir()
    }

    /// The hidden folder.
    pub fn hidden(&self) -> &Path {
        &self.partial
    }

    /// Where to write the file that will be called `name`.
    pub fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.partial.join(name)
    }

    /// Moves the files to their names, in the order given; none of them if something is in the way
    /// of one. If a move fails, those before it are undone.
    ///
    /// # Errors
    ///
    /// Something in the way, or an error of the file system.
    pub fn commit(mut self, names: &[impl AsRef<Path>]) -> Result<(), FileSetError> {
        for name in names {
            free(&self.out.join(name))?;
        }
        let mut done = Vec::with_capacity(names.len());
        for name in names {
            let path = self.out.join(name);
            let old = self.path(format!("{OLD}{}", done.len()));
            match Moved::to(path.clone(), &self.path(name), old) {
                Ok(moved) => done.push(moved),
                Err(source) => {
                    done.into_iter().rev().for_each(Moved::undo);
                    return Err(FileSetError::File { path, source });
                }
            }
        }
        self.made.clear();
        Ok(())
    }
}

/// A file that was moved to its name.
struct Moved {
    path: PathBuf,
    /// What had the name before.
    old: Option<PathBuf>,
    /// Folders that were created for it, innermost first.
    made: Vec<PathBuf>,
}

impl Moved {
    /// Moves `new` to `path`, where a file is kept as `old`. Whoever reads `path` finds one or the
    /// other.
    fn to(path: PathBuf, new: &Path, old: PathBuf) -> io::Result<Self> {
        let mut moved = Self { path, old: None, made: Vec::new() };
        let result = moved.make_way(old).and_then(|()| fs::rename(new, &moved.path));
        match result {
            Ok(()) => Ok(moved),
            Err(error) => {
                remove_empty(&moved.made);
                Err(error)
            }
        }
    }

    fn make_way(&mut self, old: PathBuf) -> io::Result<()> {
        if let Some(folder) = self.path.parent() {
            self.made = missing_folders(folder);
            fs::create_dir_all(folder)?;
        }
        if self.path.exists() {
            // Not all file systems have links, and none has them to another one.
            fs::hard_link(&self.path, &old).or_else(|_| fs::copy(&self.path, &old).map(|_| ()))?;
            self.old = Some(old);
        }
        Ok(())
    }

    /// What cannot be undone stays: the error that is returned is the first one.
    fn undo(self) {
        let _ = match &self.old {
            Some(old) => fs::rename(old, &self.path),
            None => fs::remove_file(&self.path),
        };
        remove_empty(&self.made);
    }
}

/// The folders on the way to `folder`, and itself, that are not there, innermost first.
fn missing_folders(folder: &Path) -> Vec<PathBuf> {
    let is_missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
    folder.ancestors().take_while(is_missing).map(Path::to_path_buf).collect()
}

/// Removes folders, innermost first, as far as they are empty.
fn remove_empty(folders: &[PathBuf]) {
    for folder in folders {
        let _ = fs::remove_dir(folder);
    }
}

/// Checks that a file can be moved to `path`: it is not a folder, and none of its folders is a
/// file.
fn free(path: &Path) -> Result<(), FileSetError> {
    if path.exists() && !path.is_file() {
        return Err(FileSetError::InTheWay { path: path.into() });
    }
    let above = path.ancestors().skip(1).find(|folder| folder.exists());
    if above.is_some_and(|folder| !folder.is_dir()) {
        return Err(FileSetError::File {
            path: path.into(),
            source: io::ErrorKind::NotADirectory.into(),
        });
    }
    Ok(())
}

impl Drop for FileSet {
    fn drop(&mut self) {
        // The next writer cleans up what cannot be removed here.
        let _ = fs::remove_dir_all(&self.partial);
        remove_empty(&self.made);
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
        let staging = FileSet::open(&out).unwrap();
        write(staging.path("x"), "x").unwrap();
        assert_eq!(read_dir(&out).unwrap().count(), 1);
        drop(staging);
        assert!(!folder.path().join("a").exists());
        let staging = FileSet::open(&out).unwrap();
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
            let staging = FileSet::open(folder.path()).unwrap();
            for name in names {
                let path = staging.path(name);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                write(path, "new").unwrap();
            }
            staging.commit(names)
        };
        let fault = commit(&["a", "b"]).unwrap_err();
        assert!(
            matches!(&fault, FileSetError::InTheWay { path } if path.ends_with("b")),
            "{fault}"
        );
        for below in ["file/c", "file/c/d"] {
            let fault = commit(&["a", "new/x", below]).unwrap_err();
            assert!(
                matches!(&fault, FileSetError::File { path, .. } if path.ends_with(below)),
                "{fault}"
            );
        }
        assert_eq!(fs::read(folder.path().join("a")).unwrap(), b"old");
        assert!(!folder.path().join("new").exists());
        commit(&["a", "new/x"]).unwrap();
        assert_eq!(fs::read(folder.path().join("a")).unwrap(), b"new");
    }

    /// A file that is missing cannot be moved, as one to another file system cannot.
    #[test]
    fn where_a_move_fails_those_before_it_are_undone() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path().join("a"), "old").unwrap();
        let staging = FileSet::open(folder.path()).unwrap();
        for name in ["a", "new/x/y"] {
            fs::create_dir_all(staging.path(name).parent().unwrap()).unwrap();
            write(staging.path(name), "new").unwrap();
        }
        let fault = staging.commit(&["a", "new/x/y", "other/missing"]).unwrap_err();
        assert!(
            matches!(&fault, FileSetError::File { path, .. } if path.ends_with("missing")),
            "{fault}"
        );
        assert_eq!(fs::read(folder.path().join("a")).unwrap(), b"old");
        assert_eq!(read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn what_a_killed_run_left_is_removed_and_a_running_one_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let partial = folder.path().join(PARTIAL);
        fs::create_dir(&partial).unwrap();
        write(partial.join("half"), "ha").unwrap();
        assert!(FileSet::is_begun(folder.path()));
        let staging = FileSet::open(folder.path()).unwrap();
        assert!(!staging.path("half").exists());
        assert!(matches!(FileSet::open(folder.path()), Err(FileSetError::Busy { .. })));
        drop(staging);
        assert!(FileSet::open(folder.path()).is_ok());
        let one = FileSet::open_for(folder.path(), "a".as_ref()).unwrap();
        let other = FileSet::open_for(folder.path(), "b".as_ref()).unwrap();
        assert!(
            matches!(FileSet::open_for(folder.path(), "a".as_ref()), Err(FileSetError::Busy { path }) if path.ends_with("a"))
        );
        drop((one, other));
        assert!(!FileSet::is_begun(folder.path()));
        assert_eq!(read_dir(folder.path()).unwrap().count(), 0);
    }
}
