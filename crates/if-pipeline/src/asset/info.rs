//! Metadata of garments: `asset.json`.

use super::LayerHint;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_mesh::seams::weld;
use if_outfit::digest::FileDigest;
use serde::{Deserialize, Serialize};

/// Metadata of a garment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AssetInfo {
    /// The version of the format.
    pub asset: u32,
    /// Its name.
    pub name: String,
    /// Its layer.
    pub layer: LayerHint,
    /// The body it was made on.
    pub body: BodyRef,
    /// Vertices of the mesh.
    pub vertices: usize,
    /// Triangles of the mesh.
    pub triangles: usize,
    /// Whether the mesh has skinning weights.
    pub skinned: bool,
    /// The mesh.
    pub garment: FileInfo,
    /// φ, if stored.
    pub phi: Phi,
    /// Openings: neck, cuffs, hem; the longest first.
    pub openings: Vec<Opening>,
    /// Its origin.
    pub provenance: Provenance,
}

/// A body by name and content.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyRef {
    /// Its name.
    pub name: String,
    /// Hash of its mesh file, which identifies the body.
    pub sha256: String,
}

/// A file of the asset's folder.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileInfo {
    /// Its name.
    pub file: String,
    /// Its size and hash.
    #[serde(flatten)]
    pub content: FileDigest,
}

/// The signed distance field of the body in this garment, in the canonical pose.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Phi {
    /// As a network.
    pub network: Option<FileInfo>,
    /// As a narrow-band grid.
    pub baked: Option<FileInfo>,
}

/// A boundary loop.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Opening {
    /// Number of edges.
    pub edges: usize,
    /// Its length, in metres.
    pub length: Real,
    /// The mean of its vertices, in metres.
    pub center: [Real; 3],
}

/// The origin of a garment.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Provenance {
    /// The file, as given by the user, or the whole path of the capture.
    pub source: String,
    /// Its hash, if it is one file.
    pub sha256: Option<String>,
    /// The program that made the asset, with its version.
    pub tool: String,
    /// Comments of the source, such as its licence.
    pub licence: Vec<String>,
}

/// The files of an asset with their hashes, in a fixed order; those that it has not are empty.
pub(crate) fn files<'a>(info: &'a AssetInfo) -> [(&'a str, String); 3] {
    let of = |file: Option<&'a FileInfo>| match file {
        Some(file) => (file.file.as_str(), file.content.sha256.clone()),
        None => Default::default(),
    };
    let (network, baked) = (info.phi.network.as_ref(), info.phi.baked.as_ref());
    [of(Some(&info.garment)), of(network), of(baked)]
}

/// The boundary loops of a mesh with its seams closed, the longest first.
pub(super) fn openings(mesh: &TriMesh) -> Vec<Opening> {
    let welded = weld(mesh);
    let mesh = welded.as_ref().map_or(mesh, |welded| &welded.mesh);
    let at = |v: &u32| mesh.vertices()[*v as usize];
    let mut found: Vec<Opening> = Edges::new(mesh)
        .boundary_loops(mesh)
        .iter()
        .map(|walk| {
            let n = walk.len();
            let length = (0..n).map(|k| (at(&walk[(k + 1) % n]) - at(&walk[k])).norm()).sum();
            let sum: Vector = walk.iter().map(|v| at(v).coords).sum();
            let center = Point::from(sum / n.max(1) as Real);
            Opening { edges: n, length, center: [center.x, center.y, center.z] }
        })
        .collect();
    found.sort_by(|a, b| b.length.total_cmp(&a.length));
    found
}
