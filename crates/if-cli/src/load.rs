//! Reads the files of an outfit, and words what is wrong with them.

use crate::errors::ErrorChain;
use crate::outfit_file::OutfitSpec;
use if_mesh::file::ReadError;
use if_mesh::gltf;
use if_outfit::files::{FilesError, LayerFile, OutfitFiles};
use if_outfit::outfit::OutfitError;
use miette::Diagnostic;
use std::path::PathBuf;

/// The files are not a valid outfit.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub(crate) enum LoadError {
    #[error("cannot read {role} `{layer}`")]
    #[diagnostic(code(ifg::input::mesh), help("{}", advice))]
    Mesh { role: &'static str, layer: String, advice: &'static str, source: ErrorChain },
    #[error("garment `{layer}` cannot move")]
    #[diagnostic(code(ifg::input::node), help("a body may be such a file: it never moves"))]
    Fixed { layer: String, source: ErrorChain },
    #[error("`{}` ({layer}) cannot be scaled by {scale}", path.display())]
    #[diagnostic(code(ifg::input::scale), help("look at --scale, or `scale` in the outfit file"))]
    Scale { layer: String, path: PathBuf, scale: f64, source: ErrorChain },
    #[error("the triangles of `{}` ({layer}) cannot be split", path.display())]
    #[diagnostic(
        code(ifg::input::split),
        help("leave `split` at \"never\", or store the file again as this asks for")
    )]
    Split { layer: String, path: PathBuf, source: ErrorChain },
    #[error("`{}` ({layer}) does not fit into an outfit", path.display())]
    #[diagnostic(code(ifg::input::outfit), help("{}", outfit_advice(source, *scale)))]
    Outfit { layer: String, path: PathBuf, scale: f64, source: OutfitError },
    #[error("the layers of outfit `{outfit}` do not come apart")]
    #[diagnostic(code(ifg::input::node), help("nodes have the names that the exporter gave them"))]
    Nodes { outfit: String, source: ErrorChain },
    #[error("outfit `{outfit}` cannot be resolved")]
    #[diagnostic(
        code(ifg::parameter),
        help("look at [params] in the outfit file, --clearance and --set")
    )]
    Resolve { outfit: String, source: ErrorChain },
}

impl LoadError {
    /// The error of the outfit that `spec` describes.
    pub(crate) fn new(spec: &OutfitSpec, error: FilesError) -> Self {
        let (outfit, scale) = (&spec.name, spec.scale);
        match error {
            FilesError::Read { role, layer, source } => {
                let (advice, source) = (reading_advice(&source), ErrorChain::new(&source));
                Self::Mesh { role, layer, advice, source }
            }
            FilesError::Fixed { layer, source } => {
                Self::Fixed { layer, source: ErrorChain::new(&source) }
            }
            FilesError::Scale { layer, path, scale, source } => {
                Self::Scale { layer, path, scale, source: ErrorChain::new(&source) }
            }
            FilesError::Split { layer, path, source } => {
                Self::Split { layer, path, source: ErrorChain::new(&source) }
            }
            FilesError::Outfit { layer, path, source } => {
                Self::Outfit { layer, path, scale, source }
            }
            error @ FilesError::SharedVertices { .. } => {
                Self::Nodes { outfit: outfit.into(), source: ErrorChain::new(&error) }
            }
            error => Self::Resolve { outfit: outfit.into(), source: ErrorChain::new(&error) },
        }
    }
}

/// What to do about an outfit of which the files were scaled by `given`.
fn outfit_advice(error: &OutfitError, given: f64) -> String {
    match error {
        OutfitError::Units { scale, .. } if given != 1.0 => match given * scale {
            1.0 => format!(
                "it was scaled by {given}; leave out --scale, or `scale` in the outfit file"
            ),
            both => format!("it was scaled by {given}; give --scale {both} instead"),
        },
        OutfitError::Units { unit, scale, .. } => {
            format!("if the files are in {unit}, add --scale {scale}; outputs then keep {unit}")
        }
        OutfitError::DuplicateName { .. } => {
            "give one of them another `name` in an outfit file".into()
        }
        OutfitError::IsBody { .. } => "give the garments after the body".into(),
        OutfitError::NoInside { .. } => {
            "give the body with --body, and garments after it; garments may be open".into()
        }
        OutfitError::TooLarge { .. } => {
            "repair that vertex, or give the garment in the units of the body".into()
        }
        OutfitError::TooSmall { .. } => "give the garment in the units of the body".into(),
        OutfitError::FarFromBody { .. } => {
            "all layers must be in the same units and the same place".into()
        }
        _ => "leave it out, or give a mesh that has triangles".into(),
    }
}

/// What to do about a file that cannot be read.
pub(crate) fn reading_advice(error: &ReadError) -> &'static str {
    match error {
        ReadError::Extension { .. } => "give a .ply, .obj, .glb, .gltf or .vrm file",
        ReadError::Io { .. } => {
            "look at the path; relative paths in an outfit file start at its folder"
        }
        ReadError::NotAFile { .. } => "give the path of a file",
        ReadError::Gltf { source, .. } if has_names(source) => "give one of these names",
        _ => "repair it at the place named, or export it again",
    }
}

/// Whether the error lists names that the file has in place of the one that was given.
fn has_names(error: &gltf::ReadError) -> bool {
    matches!(error, gltf::ReadError::NoNode { names, .. } if !names.is_empty())
}

/// Reads all layers and checks that they are a valid outfit.
pub(crate) fn load(spec: &OutfitSpec) -> Result<OutfitFiles, LoadError> {
    let mut layers =
        spec.layers().map(|layer| LayerFile { name: layer.name.clone(), path: layer.source() });
    let body = layers.next().expect("`layers` starts with the body");
    OutfitFiles::read(body, layers.collect(), spec.scale)
        .map_err(|error| LoadError::new(spec, error))
}
