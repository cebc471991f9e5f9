//! A file that appears whole or not at all.

use super::folders::HIDDEN;
use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// How the names of files end that are being written.
const PART: &str = ".part";
/// Random letters and digits in such a name.
const RANDOM: usize = 6;
/// Bytes of a file's name that its temporary name repeats: with what comes around them it stays below
/// the 255 bytes that file systems allow.
const REPEATED: usize = 200;

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
    let folder = folder_of(&target);
    let prefix = prefix(&target);
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).rand_bytes(RANDOM).suffix(PART);
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

/// Removes what processes that were killed left of the file `path`: it has not taken its name yet.
/// Nobody else may write this file; others may write other files there. Where that is not allowed it
/// stays.
pub fn remove_partial_of(path: &Path) {
    let prefix = prefix(path);
    let is_part = |name: &str| {
        let random = name.strip_prefix(&prefix).and_then(|rest| rest.strip_suffix(PART));
        random.is_some_and(|r| r.len() == RANDOM && r.bytes().all(|b| b.is_ascii_alphanumeric()))
    };
    let Ok(entries) = fs::read_dir(folder_of(path)) else { return };
    for entry in entries.flatten() {
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if is_file && is_part(&entry.file_name().to_string_lossy()) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// How the temporary names of a file begin.
fn prefix(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let fits = |(at, c): &(usize, char)| at + c.len_utf8() <= REPEATED;
    let repeated: String = name.char_indices().take_while(fits).map(|(_, c)| c).collect();
    format!("{HIDDEN}{repeated}-")
}

/// The folder of a file.
fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p.to_path_buf(),
        _ => PathBuf::from("."),
    }
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
    fn what_is_left_of_one_file_is_removed_and_nothing_of_others() {
        let folder = tempfile::tempdir().unwrap();
        let names = || {
            let entries = fs::read_dir(folder.path()).unwrap();
            let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
            names.collect::<Vec<_>>()
        };
        let long = "\u{e9}".repeat(120); // 240 bytes
        for name in ["state", &long] {
            let path = folder.path().join(name);
            // What a kill leaves: the temporary file as it is while it is filled.
            let kill = |file: &mut File| -> io::Result<()> {
                let left = names().into_iter().find(|name| name.ends_with(PART)).unwrap();
                file.write_all(b"half")?;
                fs::copy(folder.path().join(&left), folder.path().join("copy"))?;
                fs::write(folder.path().join("name"), &left)?;
                Err(io::Error::from(ErrorKind::Interrupted))
            };
            write_file(&path, kill).unwrap_err();
            let left = fs::read_to_string(folder.path().join("name")).unwrap();
            fs::rename(folder.path().join("copy"), folder.path().join(&left)).unwrap();
            remove_partial_of(&path.with_file_name("other"));
            assert!(names().contains(&left));
            remove_partial_of(&path);
            assert!(!names().contains(&left), "{left}");
        }
        let others = [".ifg-state-2-abc123.part", ".ifg-abc123.part", ".ifg-state-abc123", "state"];
        for name in others {
            fs::write(folder.path().join(name), "of others").unwrap();
        }
        remove_partial_of(&folder.path().join("state"));
        assert!(others.iter().all(|name| folder.path().join(name).exists()));
        remove_partial_of(&folder.path().join("missing/state"));
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
