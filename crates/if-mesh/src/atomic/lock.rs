//! Locks of folders between processes.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::Path;

/// The file in a folder that its writer holds locked.
pub(super) const LOCK: &str = ".ifg-lock";

/// Attempts to lock a folder whose lock is removed just then. Each time another writer has finished
/// in between, or the system reports that a new file is missing, as in `/proc`.
const TRIES: usize = 100;

/// Locks a folder, which is created if it is missing; `None` if another process holds the lock. The
/// holder may delete the lock and its folder.
///
/// # Errors
///
/// An error of the file system.
pub(super) fn lock(parent: &Path) -> io::Result<Option<File>> {
    lock_by(parent, File::try_lock)
}

/// The same together with others that share it; `None` if another process holds it for itself. Nobody
/// who shares may delete it.
pub(super) fn share(parent: &Path) -> io::Result<Option<File>> {
    lock_by(parent, File::try_lock_shared)
}

fn lock_by(
    parent: &Path,
    try_lock: fn(&File) -> Result<(), TryLockError>,
) -> io::Result<Option<File>> {
    let path = parent.join(LOCK);
    let mut tries = 0..TRIES;
    loop {
        fs::create_dir_all(parent)?;
        let file = match File::create(&path) {
            // Another holder has just removed the folder.
            Err(e) if e.kind() == io::ErrorKind::NotFound && tries.next().is_some() => continue,
            file => file?,
        };
        match try_lock(&file) {
            Err(TryLockError::WouldBlock) => return Ok(None),
            // Without locks in the file system, exclusion cannot be checked.
            Err(TryLockError::Error(e)) if e.kind() != io::ErrorKind::Unsupported => return Err(e),
            _ => {}
        }
        if is_at(&file, &path)? {
            return Ok(Some(file));
        }
        if tries.next().is_none() {
            return Ok(None);
        }
    }
}

/// Whether the file still has this name: a writer that is done removes its lock.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    let own = file.metadata()?;
    match fs::metadata(path) {
        Ok(found) => Ok((found.dev(), found.ino()) == (own.dev(), own.ino())),
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(e) => Err(e),
    }
}

#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> io::Result<bool> {
    Ok(true) // never removed
}
