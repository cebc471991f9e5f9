//! Errors of the glTF reader and writer.

use if_core::mesh::MeshError;
use std::io;
use std::path::PathBuf;

/// Errors of [`super::read()`]. Indices count from 0, as in the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum ReadError {
    /// The first bytes are not those of a glTF file.
    #[error(
        "not a glTF file: it must begin with `glTF` and the number 2 (.glb), or be a JSON object \
         (.gltf)"
    )]
    Magic,
    /// The file is of the other form than its name says.
    #[error("{found}; give it a name that ends in .{extension}")]
    Form { found: &'static str, extension: &'static str },
    /// Another version of the format.
    #[error("`asset.version` is `{found}`; export glTF 2.0")]
    Version { found: String },
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
    /// Data that are nowhere.
    #[error("buffer {buffer} has no data; export one .glb file without mesh compression")]
    External { buffer: usize },
    /// A URI that is not followed.
    #[error("buffer {buffer} is at `{uri}`; {expected}")]
    Uri { buffer: usize, uri: String, expected: &'static str },
    /// A file with data cannot be read.
    #[error("buffer {buffer}: cannot read `{}`: {source}", path.display())]
    Beside { buffer: usize, path: PathBuf, source: io::Error },
    /// Compressed meshes, and instances without nodes.
    #[error(
        "the file needs it for this layer or another: {extension} is not supported; export without mesh compression and GPU instancing"
    )]
    Extension { extension: String },
    /// An accessor of another kind than its use needs.
    #[error("accessor {accessor} holds {found}; {what} must be {expected}")]
    Accessor { accessor: usize, what: &'static str, expected: &'static str, found: String },
    /// An accessor without data of its own.
    #[error("accessor {accessor} has no data in the file; export without mesh compression")]
    NoData { accessor: usize },
    /// Values that are not finite, or out of their range.
    #[error("accessor {accessor}, element {element}: {found} is invalid; {expected}")]
    Value { accessor: usize, element: usize, expected: &'static str, found: String },
    /// A node below two others, or below itself.
    #[error("node {node} is reached twice; the nodes of a scene must be a tree")]
    NotATree { node: usize },
    /// A transform that cannot be inverted.
    #[error("node {node}: its transform is not finite or flattens space; apply it before export")]
    Transform { node: usize },
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
    /// Layers of several files.
    #[error("only layers of one glTF file can be written into one file")]
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
    /// The JSON has text or numbers that cannot be written again.
    #[error("the JSON of the file: {0}")]
    Json(#[from] serde_json::Error),
    /// Vertices that two nodes show.
    #[error(
        "nodes {first} and {second} show the same vertices, which cannot move apart; give each its \
         own copy of the mesh before export"
    )]
    Shared { first: usize, second: usize },
    /// A GLB file of 4 GiB.
    #[error("the file would be larger than 4 GiB, which a GLB file cannot be")]
    TooLarge,
}
