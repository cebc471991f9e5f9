//! φ of an asset as a field.

use super::{Asset, AssetError};
use if_core::field::SignedDistance;
use if_mesh::baked::Baked;
#[cfg(feature = "reconstruct")]
use if_neural::{Network, NeuralField};

/// φ of the person whose garment an asset is, in metres and in the canonical pose of the body it was
/// made on. Right round the garment; the other clothes of that person are in it, too.
#[derive(Debug)]
#[non_exhaustive]
pub enum PhiField {
    /// A network.
    #[cfg(feature = "reconstruct")]
    Network(Box<NeuralField<Network>>),
    /// A narrow-band grid.
    Baked(Box<Baked>),
}

impl PhiField {
    /// The field.
    pub fn field(&self) -> &dyn SignedDistance {
        match self {
            #[cfg(feature = "reconstruct")]
            Self::Network(field) => field.as_ref(),
            Self::Baked(field) => field.as_ref(),
        }
    }
}

impl Asset {
    /// φ, if the asset has it: the network if there is one (feature `reconstruct`), else the grid.
    ///
    /// # Errors
    ///
    /// The file is missing, has changed, or is not a valid field; without the feature `reconstruct` a network
    /// and no grid.
    pub fn phi(&self) -> Result<Option<PhiField>, AssetError> {
        #[cfg(feature = "reconstruct")]
        if let (Some(bytes), Some(file)) = (self.network()?, &self.info.phi.network) {
            let invalid = |message: String| AssetError::Network {
                path: self.folder.join(&file.file),
                message,
            };
            let (network, frame) = if_neural::files::read_network(bytes.as_slice())
                .map_err(|e| invalid(e.to_string()))?;
            let field = NeuralField::new(network, frame).map_err(|e| invalid(e.to_string()))?;
            return Ok(Some(PhiField::Network(Box::new(field))));
        }
        #[cfg(not(feature = "reconstruct"))]
        if let (Some(file), None) = (&self.info.phi.network, &self.info.phi.baked) {
            return Err(AssetError::Network {
                path: self.folder.join(&file.file),
                message: "networks need the feature `reconstruct` of if-pipeline".into(),
            });
        }
        Ok(self.baked()?.map(|baked| PhiField::Baked(Box::new(baked))))
    }
}
