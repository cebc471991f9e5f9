//! Reading whole files that are files: a pipe might never end, and neither might a device.

use std::fs;
use std::io;
use std::path::Path;

/// The bytes of a file.
///
/// # Errors
///
/// Of the file system; and for anything that is not a regular file, such as a folder, a pipe or a device.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("not a file"));
    }
    fs::read(path)
}

/// The text of a file.
///
/// # Errors
///
/// As [`read`], and for bytes that are no UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    String::from_utf8(read(path)?).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))
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
}
