//! Digests of files: size and SHA-256.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::io;
use std::path::Path;

/// Size and SHA-256 of a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileDigest {
    /// Its size.
    pub bytes: u64,
    /// 64 hexadecimal digits.
    pub sha256: String,
}

impl FileDigest {
    /// Whether there is a file at `path`, and this is its digest.
    pub fn is_of(&self, path: &Path) -> bool {
        of_file(path).is_ok_and(|found| found == *self)
    }
}

/// Of bytes in memory.
pub fn digest(bytes: &[u8]) -> FileDigest {
    let mut parts = DigestOfParts::default();
    parts.add(bytes);
    parts.finish()
}

/// The digest of bytes that come in parts, of which none is kept.
#[derive(Clone, Debug, Default)]
pub struct DigestOfParts {
    bytes: u64,
    sha256: Sha256,
}

impl DigestOfParts {
    /// Adds bytes after those before.
    pub fn add(&mut self, part: &[u8]) {
        self.bytes += part.len() as u64;
        self.sha256.update(part);
    }

    /// The digest of all.
    pub fn finish(self) -> FileDigest {
        let mut sha256 = String::with_capacity(64);
        for byte in self.sha256.finalize() {
            let _ = write!(sha256, "{byte:02x}"); // Writing to a string cannot fail.
        }
        FileDigest { bytes: self.bytes, sha256 }
    }
}

/// Of a file.
///
/// # Errors
///
/// What the system says.
pub fn of_file(path: &Path) -> io::Result<FileDigest> {
    std::fs::read(path).map(|bytes| digest(&bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_that_of_the_standard() {
        let found = digest(b"abc");
        let mut parts = DigestOfParts::default();
        [&b"a"[..], b"", b"bc"].iter().for_each(|part| parts.add(part));
        assert_eq!(parts.finish(), found);
        assert_eq!(found.bytes, 3);
        // FIPS 180-2, appendix B.1.
        assert_eq!(
            found.sha256,
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }
}
