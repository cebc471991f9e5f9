//! Files of checkpoints: what kind they are of, what they belong to, a body, and a hash of all that.

use super::error::ReconstructError;
use if_mesh::regular_file;
use sha2::{Digest, Sha256};
use std::io::{self, Write};
use std::path::Path;

/// The first bytes of a file.
pub(super) type Magic = [u8; 16];
/// A hash of everything that a body depends on.
pub(super) type Key = [u8; 32];

/// Writes the file atomically.
pub(super) fn write(
    path: &Path,
    (magic, key): (&Magic, &Key),
    body: &[u8],
) -> Result<(), ReconstructError> {
    let mut bytes = [&magic[..], key, body].concat();
    let digest = Sha256::digest(&bytes);
    bytes.extend_from_slice(&digest);
    if_mesh::atomic::write_file::<io::Error>(path, |file| file.write_all(&bytes))
        .map_err(|source| ReconstructError::Checkpoint { path: path.into(), source })
}

/// Reads the file, and what `parse` makes of its body; `None` if it is missing or has another key.
pub(super) fn read<T>(
    path: &Path,
    (magic, key): (&Magic, &Key),
    parse: impl FnOnce(&[u8]) -> Option<T>,
) -> Result<Option<T>, ReconstructError> {
    let bytes = match regular_file::read(path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(source) => return Err(ReconstructError::Checkpoint { path: path.into(), source }),
    };
    let broken = || ReconstructError::BrokenCheckpoint { path: path.into() };
    let (known, body) = opened(&bytes, magic).ok_or_else(broken)?;
    if known != key {
        return Ok(None);
    }
    parse(body).ok_or_else(broken).map(Some)
}

/// The key and the body of a file that is whole.
fn opened<'a>(bytes: &'a [u8], magic: &Magic) -> Option<(&'a [u8], &'a [u8])> {
    let (bytes, digest) = bytes.split_at_checked(bytes.len().checked_sub(32)?)?;
    if Sha256::digest(bytes)[..] != *digest {
        return None;
    }
    bytes.strip_prefix(magic)?.split_at_checked(32)
}
