//! Folders that are there whole or not at all.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Begins the names of folders that are being filled; readers skip them.
const PARTIAL: &str = ".ifg-whole-";
/// The file in a parent folder that its writer holds locked.
const LOCK: &str = ".ifg-lock";

/// How long to wait for a process that writes one folder, such as an asset, which takes it a fraction of a second.
pub const PATIENCE: Duration = Duration::from_secs(30);
/// Between two looks whether the other process is done.
const BETWEEN: Duration = Duration::from_millis(20);

/// The right to write into a folder of folders: one process at a time.
///
/// What a killed process left half-filled is removed when the right is taken.
#[derive(Debug)]
pub struct Writer {
    parent: PathBuf,
    /// Locked for as long as it is open.
    _lock: File,
}

impl Writer {
    /// Makes the folder where it is missing, and takes the right to write there; `None` where another process has it.
    ///
    /// # Errors
    ///
    /// What the system says about the folder.
    pub fn open(parent: &Path) -> io::Result<Option<Self>> {
        fs::create_dir_all(parent)?;
        let lock = File::create(parent.join(LOCK))?;
        match lock.try_lock() {
            Err(TryLockError::WouldBlock) => return Ok(None),
            // Where the file system has no locks, nothing is to be known.
            Err(TryLockError::Error(e)) if e.kind() != io::ErrorKind::Unsupported => return Err(e),
            _ => {}
        }
        for entry in fs::read_dir(parent)? {
            let entry = entry?;
            if is_partial(&entry.file_name().to_string_lossy()) && entry.file_type()?.is_dir() {
                fs::remove_dir_all(entry.path())?;
            }
        }
        Ok(Some(Self { parent: parent.into(), _lock: lock }))
    }

    /// As [`Writer::open`], but waits for at most `patience` where another process has the right.
    ///
    /// # Errors
    ///
    /// What the system says about the folder.
    pub fn wait(parent: &Path, patience: Duration) -> io::Result<Option<Self>> {
        let start = Instant::now();
        loop {
            match Self::open(parent)? {
                None if start.elapsed() < patience => std::thread::sleep(BETWEEN),
                opened => return Ok(opened),
            }
        }
    }

    /// The folder of folders.
    pub fn parent(&self) -> &Path {
        &self.parent
    }

    /// Fills the folder `name`: `fill` writes into a hidden folder beside it, which takes the name when all is there. A
    /// folder of this name is replaced then; a fault leaves it as it was.
    ///
    /// # Errors
    ///
    /// What `fill` returns, or what the system says.
    pub fn write<T, E: From<io::Error>>(&self, name: &str, fill: impl FnOnce(&Path) -> Result<T, E>) -> Result<T, E> {
        let partial = tempfile::Builder::new().prefix(PARTIAL).tempdir_in(&self.parent)?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // As any new folder; tempfile's are closed to others.
            fs::set_permissions(partial.path(), fs::Permissions::from_mode(0o755))?;
        }
        let filled = fill(partial.path())?;
        let target = self.parent.join(name);
        if target.exists() {
            let old = tempfile::Builder::new().prefix(PARTIAL).tempdir_in(&self.parent)?;
            fs::rename(&target, old.path().join("old"))?;
        }
        fs::rename(partial.keep(), &target)?;
        Ok(filled)
    }

    /// The whole folders, by name.
    ///
    /// # Errors
    ///
    /// What the system says.
    pub fn names(&self) -> io::Result<Vec<String>> {
        names(&self.parent)
    }
}

/// The whole folders in a folder, by name; none where it does not exist.
///
/// # Errors
///
/// What the system says.
pub fn names(parent: &Path) -> io::Result<Vec<String>> {
    let entries = match fs::read_dir(parent) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut names = Vec::new();
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        // A link to a folder counts as one.
        if !name.starts_with('.') && entry.path().is_dir() {
            names.push(name);
        }
    }
    names.sort_unstable();
    Ok(names)
}

fn is_partial(name: &str) -> bool {
    name.starts_with(PARTIAL)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_appears_whole_and_replaces_the_old_one() {
        let root = tempfile::tempdir().unwrap();
        let writer = Writer::open(&root.path().join("a/b")).unwrap().unwrap();
        let fill = |text: &'static str| move |folder: &Path| fs::write(folder.join("x"), text);
        writer.write("one", fill("first")).unwrap();
        let half = |folder: &Path| {
            fs::write(folder.join("x"), "ha")?;
            Err::<(), _>(io::Error::from(io::ErrorKind::StorageFull))
        };
        assert!(writer.write("one", half).is_err());
        assert!(writer.write("two", half).is_err());
        assert_eq!(writer.names().unwrap(), ["one"]);
        assert_eq!(fs::read(writer.parent().join("one/x")).unwrap(), b"first");
        writer.write("one", fill("second")).unwrap();
        assert_eq!(fs::read(writer.parent().join("one/x")).unwrap(), b"second");
        assert_eq!(fs::read_dir(writer.parent()).unwrap().count(), 2, "the folder and the lock");
    }

    #[test]
    fn one_writes_at_a_time_and_what_a_killed_one_left_is_removed() {
        let root = tempfile::tempdir().unwrap();
        fs::create_dir_all(root.path().join(".ifg-whole-left/deep")).unwrap();
        let writer = Writer::open(root.path()).unwrap().unwrap();
        assert!(!root.path().join(".ifg-whole-left").exists());
        assert!(Writer::open(root.path()).unwrap().is_none());
        drop(writer);
        assert!(Writer::open(root.path()).unwrap().is_some());
        assert!(names(&root.path().join("missing")).unwrap().is_empty());
    }

    #[test]
    fn who_waits_writes_after_the_other() {
        let root = tempfile::tempdir().unwrap();
        let first = Writer::open(root.path()).unwrap().unwrap();
        assert!(Writer::wait(root.path(), Duration::ZERO).unwrap().is_none());
        std::thread::scope(|scope| {
            let second = scope.spawn(|| Writer::wait(root.path(), PATIENCE).unwrap().is_some());
            std::thread::sleep(2 * BETWEEN);
            assert!(!second.is_finished());
            drop(first);
            assert!(second.join().unwrap());
        });
    }
}
