//! A file that appears whole or not at all.

use super::folders::HIDDEN;
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// How the names of files end that are being written.
const PART: &str = ".part";

/// Writes a file through `fill`: into a temporary file of the same folder, which takes the name
/// `path` only after everything was written. A fault leaves what stood at `path` as it was.
///
/// The file gets the permissions that any new file gets. A symbolic link is followed. The data are
/// handed to the operating system, not forced onto the disk.
///
/// # Errors
///
/// The error of `fill` or of the file system; `AlreadyExists` if `path` is not a file, such as a
/// folder or a device.
///
/// # Examples
///
/// ```
/// use std::io::Write;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("report.txt");
/// if_mesh::atomic::write_file(&path, |file| file.write_all(b"all of it"))?;
/// assert_eq!(std::fs::read(&path)?, b"all of it");
/// # Ok::<(), std::io::Error>(())
/// ```
pub fn write_file<E: From<io::Error>>(
    path: &Path,
    fill: impl FnOnce(&mut File) -> Result<(), E>,
) -> Result<(), E> {
    let target = match fs::symlink_metadata(path) {
        Ok(found) if found.is_symlink() => fs::canonicalize(path)?,
        Ok(found) if !found.is_file() => {
            return Err(io::Error::new(
                ErrorKind::AlreadyExists,
                "a folder or device of this name is in the way",
            )
            .into());
        }
        _ => path.to_path_buf(),
    };
    let folder = match target.parent() {
        Some(p) if !p.as_os_str().is_empty() => p.to_path_buf(),
        _ => PathBuf::from("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(HIDDEN).suffix(PART);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666)); // less the user's umask
    }
    // The error of tempfile names the temporary file, which means nothing to the user.
    let mut part = builder.tempfile_in(folder).map_err(|e| io::Error::new(e.kind(), plain(&e)))?;
    fill(part.as_file_mut())?;
    part.persist(target).map_err(|e| e.error)?;
    Ok(())
}

/// Removes what processes that were killed left of files in `folder`. Nobody else may write there.
///
/// # Errors
///
/// What the system returns for the folder.
pub fn remove_partial(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with(HIDDEN) && name.ends_with(PART) && entry.file_type()?.is_file() {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}

fn plain(error: &io::Error) -> String {
    match error.kind() {
        ErrorKind::NotFound => "the folder does not exist".into(),
        ErrorKind::PermissionDenied => "the folder may not be written to".into(),
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_fault_on_the_way_leaves_the_old_file_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ply");
        fs::write(&path, "old").unwrap();
        let full = |file: &mut File| {
            file.write_all(b"half of the n")?;
            Err(io::Error::from(ErrorKind::StorageFull))
        };
        assert_eq!(write_file(&path, full).unwrap_err().kind(), ErrorKind::StorageFull);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        // What a killed process leaves.
        fs::write(folder.path().join(".ifg-x1.part"), "half").unwrap();
        fs::write(folder.path().join("mine.part"), "whole").unwrap();
        remove_partial(folder.path()).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn a_folder_that_is_missing_or_in_the_way_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let nothing = |_: &mut File| Ok::<(), io::Error>(());
        assert_eq!(
            write_file(&folder.path().join("no/such/a.ply"), nothing).unwrap_err().kind(),
            ErrorKind::NotFound
        );
        assert_eq!(
            write_file(folder.path(), nothing).unwrap_err().kind(),
            ErrorKind::AlreadyExists
        );
    }

    #[cfg(unix)]
    #[test]
    fn the_file_is_readable_by_others_and_a_link_stays_a_link() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (path, link, plain) =
            (folder.path().join("a"), folder.path().join("b"), folder.path().join("c"));
        let text = |file: &mut File| file.write_all(b"text");
        write_file(&path, text).unwrap();
        fs::write(&plain, "made as any file is made").unwrap();
        let mode = |p: &Path| fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(&path), mode(&plain));
        symlink(&path, &link).unwrap();
        write_file(&link, |file: &mut File| file.write_all(b"more text")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&path).unwrap(), b"more text");
    }
}
