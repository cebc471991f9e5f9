//! Outputs that cannot be written, and what to do about it.

use crate::errors::ErrorChain;
use if_mesh::atomic::FileSetError;
use if_mesh::ply::WriteError;
use miette::Diagnostic;
use std::io;
use std::path::PathBuf;

/// Outputs cannot be written.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub(crate) enum OutputError {
    #[error("cannot write into output folder `{}`", path.display())]
    #[diagnostic(code(ifg::output::folder), help("{}", advice(source)))]
    Folder { path: PathBuf, source: io::Error },
    #[error("cannot write `{}`", path.display())]
    #[diagnostic(code(ifg::output::file), help("{}", advice(source)))]
    File { path: PathBuf, source: io::Error },
    #[error("cannot write `{}`", path.display())]
    #[diagnostic(
        code(ifg::output::mesh),
        help("the format of the input cannot hold the result; convert the input")
    )]
    Mesh { path: PathBuf, source: ErrorChain },
    #[error("another ifg is writing into `{}`", path.display())]
    #[diagnostic(code(ifg::output::busy), help("wait for it, or give --out another place"))]
    Busy { path: PathBuf },
    #[error("`{}` is in the way: it is not a file", path.display())]
    #[diagnostic(code(ifg::output::in_the_way), help("give --out another folder, or move it away"))]
    InTheWay { path: PathBuf },
    #[error("`{first}` and `{second}` would both be written to `{name}`")]
    #[diagnostic(
        code(ifg::output::same_name),
        help(
            "give the files different names: each is written under its own (case does not count)"
        )
    )]
    SameName { first: String, second: String, name: String },
    #[error("output `{}` is the input file `{written}` itself", path.display())]
    #[diagnostic(
        code(ifg::output::over_input),
        help("give --out another place{}", if *option { ", or allow it with --in-place" } else { "" })
    )]
    OverInput {
        path: PathBuf,
        written: String,
        /// Whether the command has --in-place.
        option: bool,
    },
    #[error("folder `{}` would be replaced, and input `{input}` is in it", path.display())]
    #[diagnostic(
        code(ifg::output::over_input),
        help("move it to another place, or give another name")
    )]
    AroundInput { path: PathBuf, input: String },
    #[error("output `{}` is an input of outfit `{outfit}` of the same batch", path.display())]
    #[diagnostic(code(ifg::output::over_input), help("give --out another place"))]
    OverOther { path: PathBuf, outfit: String },
    #[error("cannot write `{}`: its name does not end in .{extension}", path.display())]
    #[diagnostic(
        code(ifg::output::extension),
        help("give --out a name that ends in .{extension}: that is what is written")
    )]
    Extension { path: PathBuf, extension: &'static str },
    #[error("outfits are written to --out DIR when they come as meshes")]
    #[diagnostic(code(ifg::output::none), help("add --out DIR"))]
    NoFolder,
}

impl OutputError {
    /// Why a mesh was not written: by the file system, or by its format.
    pub(crate) fn of_mesh(path: PathBuf, error: WriteError) -> Self {
        match error {
            WriteError::Io(source) => Self::File { path, source },
            error => Self::Mesh { path, source: ErrorChain::new(&error) },
        }
    }
}

/// Whether a write failed for want of room.
pub(crate) fn has_no_room(error: &io::Error) -> bool {
    use io::ErrorKind::{FileTooLarge, QuotaExceeded, StorageFull};
    matches!(error.kind(), StorageFull | QuotaExceeded | FileTooLarge)
}

/// What to do about a failed write.
pub(crate) fn advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::FileTooLarge => {
            "make room there, allow larger files (`ulimit -f`), or give --out a folder on another disk"
        }
        _ if has_no_room(error) => "make room there, or give --out a folder on another disk",
        io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
            "give --out a folder that you may write to"
        }
        io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => {
            "a part of the path is a file; give --out another folder"
        }
        _ => "give --out another folder, or look at the disk",
    }
}

impl From<FileSetError> for OutputError {
    fn from(error: FileSetError) -> Self {
        match error {
            FileSetError::Folder { path, source } => Self::Folder { path, source },
            FileSetError::Busy { path } => Self::Busy { path },
            FileSetError::InTheWay { path } => Self::InTheWay { path },
            FileSetError::File { path, source } => Self::File { path, source },
            error => Self::File { path: PathBuf::new(), source: io::Error::other(error) },
        }
    }
}
