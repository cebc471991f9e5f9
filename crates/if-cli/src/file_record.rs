//! Input and output files as receipts record them.

use if_outfit::digest::{FileDigest, of_file};
use serde::Serialize;
use std::io;
use std::path::Path;

/// An input file.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct InputFile {
    /// The layer's name.
    pub(crate) layer: String,
    /// The path as the user wrote it; of a file that a garment's file names, the path from the
    /// garment's folder.
    pub(crate) file: String,
    #[serde(flatten)]
    pub(crate) content: FileDigest,
}

/// An output file.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct OutputFile {
    /// Its name in the output folder.
    pub(crate) file: String,
    #[serde(flatten)]
    pub(crate) content: FileDigest,
    /// Whether it equals the input file byte for byte; `None` for pictures.
    pub(crate) unchanged: Option<bool>,
}

impl OutputFile {
    /// The record of the file at `path`, which will be called `name`.
    pub(crate) fn of(name: &str, path: &Path) -> io::Result<Self> {
        Ok(Self { file: name.to_owned(), content: of_file(path)?, unchanged: None })
    }
}
