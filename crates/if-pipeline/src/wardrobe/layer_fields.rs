//! What Algorithm 1 reads of the garments of a combination: distances to their meshes, or their
//! assets' φ.

use super::WardrobeError;
use super::dresser::Dressed;
use crate::asset::{AssetInfo, PhiField};
use if_body::align::Method;
use serde::{Deserialize, Serialize};

/// What [`Method::Paper`](if_outfit::Method::Paper) reads of the garments below the one that it
/// settles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Fields {
    /// Exact distances to their meshes.
    #[default]
    Meshes,
    /// φ of the assets that have one and are worn by the body they were made on; exact distances to
    /// the meshes of the others.
    Assets,
}

/// What is read of one garment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct GarmentField {
    /// The garment.
    pub garment: String,
    /// What is read.
    pub read: Read,
}

/// What is read of a garment, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Read {
    /// φ as a network.
    Network,
    /// φ as a grid.
    Bake,
    /// Its mesh: the asset has no φ.
    MeshWithoutPhi,
    /// Its mesh: the asset has φ of another body.
    MeshOnOtherBody,
}

impl std::fmt::Display for Read {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Network => "the asset's φ, a network",
            Self::Bake => "the asset's φ, a grid",
            Self::MeshWithoutPhi => "its mesh; the asset has no φ",
            Self::MeshOnOtherBody => "its mesh; φ belongs to another body",
        })
    }
}

/// The fields of the assets of an outfit, inner to outer, and what is read of each.
///
/// # Errors
///
/// A file of φ is missing, has changed, or is not a valid field.
pub(super) fn of_assets(
    dressed: &Dressed,
) -> Result<(Vec<Option<PhiField>>, Vec<GarmentField>), WardrobeError> {
    let (mut fields, mut read) = (Vec::new(), Vec::new());
    for garment in &dressed.garments {
        let asset = &garment.asset;
        let (field, what) = match (&asset.info.phi, garment.report.method) {
            (phi, _) if phi.network.is_none() && phi.baked.is_none() => {
                (None, Read::MeshWithoutPhi)
            }
            (_, Method::Same) => match asset.phi()? {
                Some(PhiField::Baked(baked)) => (Some(PhiField::Baked(baked)), Read::Bake),
                #[cfg(feature = "reconstruct")]
                Some(network) => (Some(network), Read::Network),
                None => (None, Read::MeshWithoutPhi),
            },
            _ => (None, Read::MeshOnOtherBody),
        };
        fields.push(field);
        read.push(GarmentField { garment: asset.info.name.clone(), read: what });
    }
    Ok((fields, read))
}

/// SHA-256 of the files of φ, which decide a result that reads them.
pub(super) fn hashes(info: &AssetInfo) -> Vec<String> {
    let files = [&info.phi.network, &info.phi.baked];
    files.into_iter().flatten().map(|file| file.content.sha256.clone()).collect()
}
