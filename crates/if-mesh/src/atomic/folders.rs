//! Folders that appear whole or not at all, and files that appear in a folder together.

use super::lock::{LOCK, lock, share};
use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Prefix of folders that are being filled; readers skip them.
const PARTIAL: &str = ".ifg-whole-";
/// Prefix of a folder that is being replaced, until the new one has its name.
const OLD: &str = ".ifg-old-";
/// Prefix of all temporary names of this module.
pub(super) const HIDDEN: &str = ".ifg-";

/// How long to wait for another process that writes one folder, which takes a fraction of a second.
pub const PATIENCE: Duration = Duration::from_secs(30);
/// Time between two attempts to lock.
const BETWEEN: Duration = Duration::from_millis(20);
/// Writes folders into a folder, each whole or not at all. One process at a time may do so.
///
/// When it is opened, folders that a killed process left half-filled are removed, and folders that
/// it had moved away get their names back.
#[derive(Debug)]
pub struct FolderWriter {
    parent: PathBuf,
    /// Locked for as long as it is open.
    _lock: File,
    /// Folders that were made for this, innermost first: they go again where nothing came into
    /// them.
    made: Vec<PathBuf>,
    /// Held while a folder takes the place of another: threads may write the same one.
    exchange: Mutex<()>,
}

impl FolderWriter {
    /// Creates the folder if it is missing, and locks it; `None` if another process holds the lock.
    ///
    /// # Errors
    ///
    /// What the system returns for the folder.
    pub fn open(parent: &Path) -> io::Result<Option<Self>> {
        let missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
        let made = parent.ancestors().take_while(missing).map(Path::to_path_buf).collect();
        let Some(lock) = lock(parent)? else { return Ok(None) };
        let writer = Self { parent: parent.into(), _lock: lock, made, exchange: Mutex::new(()) };
        for entry in fs::read_dir(parent)? {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.starts_with(PARTIAL) && entry.file_type()?.is_dir() {
                fs::remove_dir_all(entry.path())?;
            } else if let Some(name) = name.strip_prefix(OLD) {
                let target = parent.join(name);
                if is_there(&target) {
                    remove(&entry.path())
                } else {
                    fs::rename(entry.path(), target)
                }?;
            }
        }
        Ok(Some(writer))
    }

    /// As [`FolderWriter::open`], but waits for at most `patience` if another process holds the lock.
    ///
    /// # Errors
    ///
    /// What the system returns for the folder.
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

    /// Fills the folder `name`: `fill` writes into a hidden folder beside it, which takes the name
    /// when all is there. A folder of this name is replaced then, when the new one has reached the
    /// disk; a fault leaves it as it was, and what a kill leaves between the two [`FolderWriter::open`]
    /// and [`restore`] put right.
    ///
    /// # Errors
    ///
    /// The error of `fill`, or of the file system.
    pub fn write<T, E: From<io::Error>>(
        &self,
        name: &str,
        fill: impl FnOnce(&Path) -> Result<T, E>,
    ) -> Result<T, E> {
        let partial = self.partial()?;
        let filled = fill(partial.path())?;
        let (target, old) = (self.parent.join(name), self.parent.join(format!("{OLD}{name}")));
        let one = self.exchange.lock().unwrap_or_else(PoisonError::into_inner);
        if is_there(&target) {
            sync(partial.path())?;
            exchange(partial.path(), &target, &old)?;
            sync_names(&self.parent);
            let _ = remove(&old); // the next writer does it else
        } else {
            fs::rename(partial.path(), &target)?;
        }
        drop(one);
        let _ = partial.keep(); // it has another name now
        Ok(filled)
    }

    /// Puts files into the folder itself. `fill` writes them into a hidden folder there, and
    /// returns their names; when all are there they are moved up in this order. Before that those
    /// of `earlier` are removed that are not among them. Files of other names stay as they are, and
    /// a fault of `fill` leaves everything as it was.
    ///
    /// # Errors
    ///
    /// The error of `fill`, or of the file system.
    pub fn write_files<T, E: From<io::Error>>(
        &self,
        earlier: &[String],
        fill: impl FnOnce(&Path) -> Result<(T, Vec<String>), E>,
    ) -> Result<T, E> {
        let partial = self.partial()?;
        let (filled, names) = fill(partial.path())?;
        if !earlier.is_empty() {
            sync(partial.path())?;
        }
        for name in earlier.iter().filter(|name| !names.contains(name)) {
            match fs::remove_file(self.parent.join(name)) {
                Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e.into()),
                _ => {}
            }
        }
        for name in &names {
            fs::rename(partial.path().join(name), self.parent.join(name))?;
        }
        Ok(filled)
    }

    /// A hidden folder.
    fn partial(&self) -> io::Result<TempDir> {
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // As any new folder, less what the user's mask takes; tempfile's are closed to others.
            builder.permissions(fs::Permissions::from_mode(0o777));
        }
        builder.prefix(PARTIAL).tempdir_in(&self.parent)
    }

    /// The whole folders, by name.
    ///
    /// # Errors
    ///
    /// An error of the file system.
    pub fn names(&self) -> io::Result<Vec<String>> {
        names(&self.parent)
    }
}

impl Drop for FolderWriter {
    fn drop(&mut self) {
        // It is still locked: who has opened it by now sees that another file, or none, has its
        // name. Where that cannot be seen it stays.
        #[cfg(unix)]
        let _ = fs::remove_file(self.parent.join(LOCK));
        for folder in &self.made {
            let _ = fs::remove_dir(folder);
        }
    }
}

/// Keeps a [`FolderWriter`] out of a folder while it is held, by any number of processes.
#[derive(Debug)]
pub struct FolderShare(#[expect(dead_code, reason = "held")] File);

impl FolderShare {
    /// Creates the folder if it is missing, and shares its lock; `None` if a writer holds it.
    ///
    /// # Errors
    ///
    /// What the system returns for the folder.
    pub fn open(parent: &Path) -> io::Result<Option<Self>> {
        Ok(share(parent)?.map(Self))
    }
}

/// Moves `target` away to `old`, and `new` to `target`. A fault leaves `target` as it was.
fn exchange(new: &Path, target: &Path, old: &Path) -> io::Result<()> {
    if is_there(old) {
        remove(old)?; // `target` is the newer one
    }
    fs::rename(target, old)?;
    fs::rename(new, target).inspect_err(|_| {
        let _ = fs::rename(old, target); // the next writer does it else
    })
}

/// Forces a folder with all that it holds onto the disk.
fn sync(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            sync(&entry.path())?;
        } else {
            OpenOptions::new().write(true).open(entry.path())?.sync_all()?;
        }
    }
    sync_names(folder);
    Ok(())
}

/// The names in a folder. Not all systems can do that, and nothing can be done about it then.
fn sync_names(folder: &Path) {
    if cfg!(unix) {
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
}

/// Whether anything has this name, also a link to nowhere.
fn is_there(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok()
}

/// Removes a folder, a file or a link.
fn remove(path: &Path) -> io::Result<()> {
    if fs::symlink_metadata(path)?.is_dir() {
        fs::remove_dir_all(path)
    } else {
        fs::remove_file(path)
    }
}

/// Gives folders their names back that a killed process had moved away to replace them. For
/// readers: writers get it from [`FolderWriter::open`]. Does nothing in a read-only folder.
pub fn restore(parent: &Path) {
    let Ok(entries) = fs::read_dir(parent) else { return };
    let is_away =
        |name: &str| name.strip_prefix(OLD).is_some_and(|name| !is_there(&parent.join(name)));
    if entries.flatten().any(|entry| is_away(&entry.file_name().to_string_lossy())) {
        // Another process may be just between the two steps.
        drop(FolderWriter::wait(parent, PATIENCE));
    }
}

/// Whether a name is a temporary one of this module.
pub fn is_hidden(name: &str) -> bool {
    name.starts_with(HIDDEN)
}

/// Names of the complete folders in a folder, in order; empty if it does not exist.
///
/// # Errors
///
/// An error of the file system.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_appears_whole_and_replaces_the_old_one() {
        let root = tempfile::tempdir().unwrap();
        let writer = FolderWriter::open(&root.path().join("a/b")).unwrap().unwrap();
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
        let writer = FolderWriter::open(root.path()).unwrap().unwrap();
        assert!(!root.path().join(".ifg-whole-left").exists());
        assert!(FolderWriter::open(root.path()).unwrap().is_none());
        drop(writer);
        assert!(FolderWriter::open(root.path()).unwrap().is_some());
        #[cfg(unix)]
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0, "the lock is gone");
        assert!(names(&root.path().join("missing")).unwrap().is_empty());
    }

    #[test]
    fn who_waits_writes_after_the_other() {
        let root = tempfile::tempdir().unwrap();
        let first = FolderWriter::open(root.path()).unwrap().unwrap();
        assert!(FolderWriter::wait(root.path(), Duration::ZERO).unwrap().is_none());
        std::thread::scope(|scope| {
            let second =
                scope.spawn(|| FolderWriter::wait(root.path(), PATIENCE).unwrap().is_some());
            std::thread::sleep(2 * BETWEEN);
            assert!(!second.is_finished());
            drop(first);
            assert!(second.join().unwrap());
        });
    }

    /// As a kill between the two renames leaves it.
    fn away(root: &Path) {
        drop(fs::remove_dir_all(root));
        fs::create_dir_all(root.join(".ifg-old-coat")).unwrap();
        fs::write(root.join(".ifg-old-coat/x"), "old").unwrap();
        fs::create_dir_all(root.join(".ifg-whole-new")).unwrap();
    }

    #[test]
    fn a_folder_that_was_being_replaced_at_a_kill_gets_its_name_again() {
        let root = tempfile::tempdir().unwrap();
        let root = &root.path().join("garments");
        away(root);
        let writer = FolderWriter::open(root).unwrap().unwrap();
        assert_eq!(fs::read(root.join("coat/x")).unwrap(), b"old");
        assert_eq!(fs::read_dir(root).unwrap().count(), 2, "the folder and the lock");
        drop(writer);
        away(root);
        restore(root);
        assert_eq!(names(root).unwrap(), ["coat"]);
        // The new one was there already: the old one goes.
        fs::create_dir(root.join(".ifg-old-coat")).unwrap();
        fs::write(root.join(".ifg-old-coat/x"), "older").unwrap();
        drop(FolderWriter::open(root).unwrap());
        assert!(!root.join(".ifg-old-coat").exists());
        assert_eq!(fs::read(root.join("coat/x")).unwrap(), b"old");
        restore(&root.join("missing"));
        assert!(!root.join("missing").exists());
    }

    #[test]
    fn an_exchange_that_fails_leaves_the_old_folder() {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| root.path().join(name);
        fs::create_dir(at("coat")).unwrap();
        fs::write(at("coat/x"), "old").unwrap();
        assert!(exchange(&at("missing"), &at("coat"), &at(".ifg-old-coat")).is_err());
        assert_eq!(fs::read(at("coat/x")).unwrap(), b"old");
        // `fill` has thrown its folder away: the same through the door that others use.
        let writer = FolderWriter::open(root.path()).unwrap().unwrap();
        assert!(writer.write("coat", |folder| fs::remove_dir_all(folder)).is_err());
        assert_eq!(fs::read(at("coat/x")).unwrap(), b"old");
    }

    #[test]
    fn files_are_put_beside_those_of_others() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("a/b");
        drop(FolderWriter::open(&out).unwrap());
        #[cfg(unix)]
        assert!(!root.path().join("a").exists(), "nothing was written: the folders go again");
        let put = |earlier: &[&str], names: &'static [&'static str]| {
            let writer = FolderWriter::open(&out).unwrap().unwrap();
            let fill = |folder: &Path| -> io::Result<_> {
                names.iter().try_for_each(|name| fs::write(folder.join(name), "new"))?;
                Ok(((), names.iter().map(ToString::to_string).collect()))
            };
            writer.write_files(&earlier.iter().map(ToString::to_string).collect::<Vec<_>>(), fill)
        };
        put(&[], &["x", "y"]).unwrap();
        fs::create_dir(out.join("sub")).unwrap();
        fs::write(out.join("mine"), "keep").unwrap();
        put(&["x", "y", "gone"], &["y", "z"]).unwrap();
        assert_eq!(fs::read(out.join("mine")).unwrap(), b"keep");
        assert!(
            !out.join("x").exists()
                && out.join("y").exists()
                && out.join("z").exists()
                && out.join("sub").exists()
        );
        let writer = FolderWriter::open(&out).unwrap().unwrap();
        let fault = writer.write_files(&["y".to_owned()], |_| {
            Err::<((), _), _>(io::Error::from(io::ErrorKind::StorageFull))
        });
        assert!(fault.is_err() && out.join("y").exists());
    }

    #[test]
    fn several_share_a_folder_and_keep_its_writer_out() {
        let root = tempfile::tempdir().unwrap();
        let open = || FolderWriter::open(root.path()).unwrap();
        let first = FolderShare::open(root.path()).unwrap().unwrap();
        let second = FolderShare::open(root.path()).unwrap().unwrap();
        assert!(open().is_none());
        drop(first);
        assert!(open().is_none());
        drop(second);
        let writer = open().unwrap();
        assert!(FolderShare::open(root.path()).unwrap().is_none());
        drop(writer);
        assert!(FolderShare::open(root.path()).unwrap().is_some());
    }

    /// Without the look whether the locked file still has its name, two of them hold a lock at once
    /// now and then.
    #[cfg(unix)]
    #[test]
    fn locks_that_are_removed_exclude_all_the_same() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        let root = tempfile::tempdir().unwrap();
        let (inside, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..200 {
                        let Some(writer) = FolderWriter::open(root.path()).unwrap() else {
                            continue;
                        };
                        most.fetch_max(inside.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                        std::thread::yield_now();
                        inside.fetch_sub(1, Ordering::SeqCst);
                        drop(writer);
                    }
                });
            }
        });
        assert_eq!(most.into_inner(), 1);
    }
}
