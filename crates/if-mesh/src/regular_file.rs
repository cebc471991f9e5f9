//! Reading files that are files, a pipe might never end and neither might a device, and that lie where
//! they should.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// Opens a file.
///
/// # Errors
///
/// As [`read`].
pub fn open(path: &Path) -> io::Result<File> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("not a file"));
    }
    File::open(path)
}

/// The bytes of a file.
///
/// # Errors
///
/// Of the file system; and for anything that is not a regular file, such as a folder, a pipe or a device.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text of a file.
///
/// # Errors
///
/// As [`read`], and for bytes that are no UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    String::from_utf8(read(path)?).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))
}

/// The path of the file called `name` right inside a folder; `None` if the name leads elsewhere, such as
/// `../x`, `a/b` or `/x`.
pub fn inside(folder: &Path, name: &str) -> Option<PathBuf> {
    let mut parts = Path::new(name).components();
    let is_plain = matches!((parts.next(), parts.next()), (Some(Component::Normal(_)), None));
    is_plain.then(|| folder.join(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_and_devices_are_no_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("text");
        fs::write(&path, "text").unwrap();
        assert_eq!(read_to_string(&path).unwrap(), "text");
        assert_eq!(read(folder.path()).unwrap_err().to_string(), "not a file");
        if cfg!(unix) {
            assert_eq!(read(Path::new("/dev/zero")).unwrap_err().to_string(), "not a file");
        }
        fs::write(&path, [0xff]).unwrap();
        assert_eq!(read_to_string(&path).unwrap_err().kind(), io::ErrorKind::InvalidData);
        let missing = read(&folder.path().join("missing")).unwrap_err();
        assert_eq!(missing.kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn names_that_lead_elsewhere_are_not_inside() {
        let folder = Path::new("here");
        assert_eq!(inside(folder, "a.ply"), Some(folder.join("a.ply")));
        for name in ["", ".", "..", "../a", "a/b", "/a", "./../a"] {
            assert_eq!(inside(folder, name), None, "{name}");
        }
    }
}
