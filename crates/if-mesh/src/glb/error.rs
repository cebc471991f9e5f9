//! Errors of the GLB reader and writer.

use if_core::mesh::MeshError;
use std::io;

/// Errors of [`super::read()`]. Indices count from 0, as in the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum ReadError {
    /// The first bytes are not those of a GLB file.
    #[error("not a GLB file of version 2: it must begin with `glTF` and the number 2")]
    Magic,
    /// A length in the file is larger than the file.
    #[error("the file ends too early: {what} needs {needed} bytes, and there are {found}")]
    Truncated { what: &'static str, needed: u64, found: u64 },
    /// The first chunk is not JSON.
    #[error("the first chunk of the file must be JSON")]
    NoJson,
    /// The JSON is not that of a glTF file.
    #[error("the JSON of the file: {0}")]
    Json(#[from] serde_json::Error),
    /// An index is out of range.
    #[error("{what} {index} does not exist; there are {count}, and 0 is the first")]
    Index { what: &'static str, index: usize, count: usize },
    /// Data outside of the file.
    #[error("buffer {buffer} is not in the file; export one .glb file with all its data")]
    External { buffer: usize },
    /// Compressed or quantised meshes.
    #[error("{extension} is not supported; export without mesh compression and quantisation")]
    Extension { extension: String },
    /// An accessor of another kind than its use needs.
    #[error("accessor {accessor} holds {found}; {what} must be {expected}")]
    Accessor { accessor: usize, what: &'static str, expected: &'static str, found: String },
    /// An accessor without data of its own.
    #[error(
        "accessor {accessor} is sparse or has no data; export without sparse accessors and without \
         mesh compression"
    )]
    Sparse { accessor: usize },
    /// Values that are not finite, or out of their range.
    #[error("accessor {accessor}, element {element}: {found} is invalid; {expected}")]
    Value { accessor: usize, element: usize, expected: &'static str, found: String },
    /// A node below two others, or below itself.
    #[error("node {node} is reached twice; the nodes of a scene must be a tree")]
    NotATree { node: usize },
    /// A transform that cannot be inverted.
    #[error("node {node}: its transform is not finite or flattens space; apply it before export")]
    Transform { node: usize },
    /// Vertices that two nodes show.
    #[error(
        "nodes {first} and {second} show the same vertices, which cannot move apart; give each its \
         own copy of the mesh before export"
    )]
    Shared { first: usize, second: usize },
    /// Data that is used too often.
    #[error("the file uses its data {what} too often")]
    TooMuch { what: &'static str },
    /// There is no triangle.
    #[error("the scene, or the node chosen of it, has no triangles")]
    NoTriangles,
    /// No node of the scene has the name that was asked for.
    #[error("the scene has no node `{name}`; its nodes with meshes are {}", listed(names))]
    NoNode { name: String, names: Vec<String> },
    /// Several nodes of the scene have the name that was asked for.
    #[error("nodes {first} and {second} are both named `{name}`; rename one before export")]
    SameName { name: String, first: usize, second: usize },
    /// The surface is not a valid mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Some of the names, for a message.
fn listed(names: &[String]) -> String {
    const SHOWN: usize = 12;
    let mut text: Vec<String> = names.iter().take(SHOWN).map(|name| format!("`{name}`")).collect();
    match names.len() {
        0 => text.push("without names".into()),
        n if n > SHOWN => text.push(format!("and {} more", n - SHOWN)),
        _ => {}
    }
    text.join(", ")
}

/// Errors of [`super::write()`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum WriteError {
    /// The destination returned an error.
    #[error("cannot write the file: {0}")]
    Io(#[from] io::Error),
    /// Layers of several files.
    #[error("only layers of one file can be written into one file")]
    SeveralFiles,
    /// The positions do not belong to the mesh, or are not finite.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A position is beyond the range of single precision in its node.
    #[error("vertex {vertex}: its position cannot be stored in single precision")]
    Range { vertex: usize },
    /// The positions share bytes with other data.
    #[error("the file's positions overlap other data of the file; export it anew")]
    Overlap,
}
