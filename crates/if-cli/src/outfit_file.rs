//! The layers and parameters of outfits: from an outfit file (TOML, `docs/reference/outfit.md`) or from the command line.

use crate::inputs::{InputArgs, ParamArgs, given_twice, last_part};
use if_mesh::file::file_and_node;
use if_mesh::regular_file;
use if_outfit::NamedParameterError;
use if_outfit::resolve::ResolveParams;
use miette::{Diagnostic, NamedSource, SourceSpan};
use serde::Deserialize;
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml::Spanned;

/// One outfit as the user gave it. Of its files only the outfit file has been read.
#[derive(Clone, Debug)]
pub(crate) struct OutfitSpec {
    /// Its name in reports: the stem of the outfit file.
    pub(crate) name: String,
    pub(crate) body: LayerSpec,
    /// Inner to outer.
    pub(crate) garments: Vec<LayerSpec>,
    pub(crate) params: ResolveParams,
    /// From the units of the files to metres.
    pub(crate) scale: f64,
}

impl OutfitSpec {
    /// The body, then the garments, inner to outer.
    pub(crate) fn layers(&self) -> impl Iterator<Item = &LayerSpec> {
        std::iter::once(&self.body).chain(&self.garments)
    }

    /// `o1: jeans < tshirt < cardigan over body`.
    pub(crate) fn title(&self) -> String {
        let garments: Vec<&str> = self.garments.iter().map(|l| l.name.as_str()).collect();
        format!("{}: {} over {}", self.name, garments.join(" < "), self.body.name)
    }

    /// The garments by the file into which their results are written, each with the file's name:
    /// one garment, or several nodes of one glTF file.
    pub(crate) fn files(&self) -> Vec<(&str, Vec<usize>)> {
        let mut files: Vec<(&str, Vec<usize>)> = Vec::new();
        for (k, layer) in self.garments.iter().enumerate() {
            let name = layer.file_name.as_str();
            match files.iter_mut().find(|(other, _)| other.eq_ignore_ascii_case(name)) {
                Some((_, ks)) => ks.push(k),
                None => files.push((name, vec![k])),
            }
        }
        files
    }
}

/// One mesh file, or a node of a glTF file.
#[derive(Clone, Debug)]
pub(crate) struct LayerSpec {
    /// Its name in reports: its node, or the stem of its file, unless the outfit file names it.
    pub(crate) name: String,
    /// The file.
    pub(crate) path: PathBuf,
    /// The node of the glTF file, as in `FILE.glb#NODE`.
    pub(crate) node: Option<String>,
    /// The path as the user wrote it.
    pub(crate) written: String,
    /// The name of the file into which its result is written.
    pub(crate) file_name: String,
}

impl LayerSpec {
    /// The path with the node, as [`if_mesh::file::MeshFile::read`] takes it.
    pub(crate) fn source(&self) -> PathBuf {
        match &self.node {
            Some(node) => {
                let mut path = self.path.clone().into_os_string();
                path.push(format!("#{node}"));
                path.into()
            }
            None => self.path.clone(),
        }
    }

    /// Whether both are nodes of one file.
    pub(crate) fn is_in_file_of(&self, other: &Self) -> bool {
        let one = || self.path.canonicalize().ok() == other.path.canonicalize().ok();
        self.node.is_some() && other.node.is_some() && self.node != other.node && one()
    }

    /// A name for files that hold this layer alone: that of its node without characters that file
    /// names cannot have, or the stem of its file.
    pub(crate) fn file_stem(&self) -> String {
        match &self.node {
            Some(node) => file_name_of(node),
            None => stem(Path::new(&self.file_name)),
        }
    }
}

/// The name of a node without characters that file names cannot have, and without the dots that hide a file.
pub(crate) fn file_name_of(node: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_. ".contains(c) { c } else { '_' };
    let shown = node.trim_start_matches('.');
    let dots = node.len() - shown.len();
    "_".repeat(dots).chars().chain(shown.chars().map(plain)).collect()
}

/// The command line or an outfit file does not describe an outfit.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub(crate) enum SpecError {
    #[error("cannot read outfit file `{}`", path.display())]
    #[diagnostic(
        code(ifg::outfit_file::read),
        help("give the path of an outfit file (.toml), or --body and garments")
    )]
    Read { path: PathBuf, source: std::io::Error },
    #[error("outfit file `{}`: {message}", path.display())]
    #[diagnostic(
        code(ifg::outfit_file::syntax),
        help(
            "the format is specified in docs/reference/outfit.md; `body` and one [[garment]] are needed"
        )
    )]
    Syntax {
        path: PathBuf,
        message: String,
        #[source_code]
        text: Arc<NamedSource<String>>, // A pointer, because results carry it along.
        #[label("here")]
        at: Option<SourceSpan>,
    },
    #[error("the name of `{}` is not UTF-8", path.display())]
    #[diagnostic(
        code(ifg::input::file_name),
        help("rename the file: its result is called after it, in reports too")
    )]
    FileName { path: PathBuf },
    #[error("outfit file `{}`: scale is {value}", path.display())]
    #[diagnostic(
        code(ifg::outfit_file::scale),
        help("give a positive number, such as 0.001 for files in millimetres")
    )]
    Scale { path: PathBuf, value: f64 },
    #[error("outfit file `{}` has no garment", path.display())]
    #[diagnostic(
        code(ifg::outfit_file::empty),
        help("add one [[garment]] with `file = \"…\"` for each, innermost first")
    )]
    NoGarment { path: PathBuf },
    #[error("`{}` is not an outfit file, and there is no body", path.display())]
    #[diagnostic(
        code(ifg::arguments::body),
        help("give the body with --body, or outfit files that end in .toml")
    )]
    NoBody { path: PathBuf },
    #[error("`{}` is an outfit file; it names its own body", path.display())]
    #[diagnostic(
        code(ifg::arguments::body),
        help("leave out --body, or give garment meshes (.ply, .obj, .glb, .vrm, .gltf)")
    )]
    TwoBodies { path: PathBuf },
    #[error("`{}` names no file", path.display())]
    #[diagnostic(
        code(ifg::arguments::file_name),
        help("give the path of a mesh file (.ply, .obj, .glb, .vrm, .gltf)")
    )]
    NoFileName { path: PathBuf },
    #[error("parameter `{name}` is given twice on the command line")]
    #[diagnostic(
        code(ifg::arguments::parameter),
        help("give it once, by --set or by the option of its name")
    )]
    Twice { name: String },
    #[error(transparent)]
    #[diagnostic(
        code(ifg::arguments::parameter),
        help("parameters and their defaults are listed in docs/reference/parameters.md")
    )]
    Parameter(NamedParameterError),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OutfitToml {
    body: PathBuf,
    #[serde(default)]
    garment: Vec<GarmentToml>,
    #[serde(default)]
    params: BTreeMap<Spanned<String>, Spanned<toml::Value>>,
    scale: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GarmentToml {
    file: PathBuf,
    name: Option<String>,
}

/// The outfits that the arguments name: one for each outfit file, or one of body and garments.
pub(crate) fn outfits(input: &InputArgs, params: &ParamArgs) -> Vec<Result<OutfitSpec, SpecError>> {
    let is_toml = |path: &Path| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let with = |spec| with_args(spec, input.scale, params);
    match &input.body {
        Some(body) => vec![from_meshes(body, &input.files, is_toml).and_then(with)],
        None => input
            .files
            .iter()
            .map(|path| {
                if is_toml(path) {
                    read(path).and_then(with)
                } else {
                    Err(SpecError::NoBody { path: path.clone() })
                }
            })
            .collect(),
    }
}

/// The outfit with the values of the command line in place of those of its file.
pub(crate) fn with_args(
    spec: OutfitSpec,
    scale: Option<f64>,
    params: &ParamArgs,
) -> Result<OutfitSpec, SpecError> {
    Ok(OutfitSpec {
        scale: scale.unwrap_or(spec.scale),
        params: override_params(&spec.params, params)?,
        ..spec
    })
}

/// One outfit of meshes named on the command line.
fn from_meshes(
    body: &Path,
    files: &[PathBuf],
    is_toml: impl Fn(&Path) -> bool,
) -> Result<OutfitSpec, SpecError> {
    if let Some(path) = files.iter().find(|path| is_toml(path)) {
        return Err(SpecError::TwoBodies { path: path.clone() });
    }
    let here = Path::new("");
    Ok(OutfitSpec {
        name: "outfit".into(),
        body: layer(here, body, None)?,
        garments: files.iter().map(|path| layer(here, path, None)).collect::<Result<_, _>>()?,
        params: ResolveParams::default(),
        scale: 1.0,
    })
}

/// Reads one outfit file. Relative paths in it are relative to its folder.
pub(crate) fn read(path: &Path) -> Result<OutfitSpec, SpecError> {
    let text = regular_file::read_to_string(path)
        .map_err(|source| SpecError::Read { path: path.into(), source })?;
    let syntax = |message: String, at: Option<std::ops::Range<usize>>| SpecError::Syntax {
        path: path.into(),
        message,
        at: at.map(SourceSpan::from),
        text: Arc::new(NamedSource::new(path.display().to_string(), text.clone())),
    };
    let parsed: OutfitToml =
        toml::from_str(&text).map_err(|error| syntax(error.message().to_owned(), error.span()))?;
    if parsed.garment.is_empty() {
        return Err(SpecError::NoGarment { path: path.into() });
    }
    let scale = parsed.scale.unwrap_or(1.0);
    if !(scale.is_finite() && scale > 0.0) {
        return Err(SpecError::Scale { path: path.into(), value: scale });
    }
    let mut params = ResolveParams::default();
    let mut given = HashSet::new();
    for (key, value) in &parsed.params {
        let at = key.span().start..value.span().end;
        let fields = value.get_ref().as_table().map(|fields| fields.keys().collect::<Vec<_>>());
        for name in fields.unwrap_or_else(|| vec![key.get_ref()]) {
            let name = last_part(name);
            if !given.insert(name.to_owned()) {
                return Err(syntax(format!("parameter `{name}` is given twice"), Some(at)));
            }
        }
        params = params
            .with(key.get_ref(), value.get_ref())
            .map_err(|error| syntax(error.to_string(), Some(at)))?;
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let garments = parsed.garment.into_iter().map(|g| layer(folder, &g.file, g.name));
    Ok(OutfitSpec {
        name: stem(path),
        body: layer(folder, &parsed.body, None)?,
        garments: garments.collect::<Result<_, _>>()?,
        params,
        scale,
    })
}

fn layer(folder: &Path, file: &Path, name: Option<String>) -> Result<LayerSpec, SpecError> {
    let (path, node) = file_and_node(&folder.join(file));
    let file_name = path.file_name().ok_or_else(|| SpecError::NoFileName { path: file.into() })?;
    let unnamed = || SpecError::FileName { path: file.into() };
    let of_file = || node.clone().unwrap_or_else(|| stem(&path));
    Ok(LayerSpec {
        name: name.unwrap_or_else(of_file),
        written: file.display().to_string(),
        file_name: file_name.to_str().ok_or_else(unnamed)?.to_owned(),
        node,
        path,
    })
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The parameters with those of the command line in place of their own.
pub(crate) fn override_params(
    params: &ResolveParams,
    args: &ParamArgs,
) -> Result<ResolveParams, SpecError> {
    if let Some(name) = given_twice(&args.set, &args.options()) {
        return Err(SpecError::Twice { name: name.to_owned() });
    }
    let mut params = params.clone();
    for (key, value) in &args.set {
        params = params.with(key, value).map_err(SpecError::Parameter)?;
    }
    if let Some(clearance) = args.clearance {
        params.goal.clearance = clearance;
    }
    if let Some(least_distance) = args.least_distance {
        params.goal.least_distance = least_distance;
    }
    if let Some(own) = args.own {
        params.goal.own = own.into();
    }
    if let Some(method) = args.method {
        params.effort.method = method.into();
    }
    Ok(params)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_nodes_make_files_that_are_shown() {
        for (node, expected) in
            [("../Jeans", "___Jeans"), (".hidden", "_hidden"), ("a.b c", "a.b c"), ("..", "__")]
        {
            assert_eq!(file_name_of(node), expected);
        }
    }
}
