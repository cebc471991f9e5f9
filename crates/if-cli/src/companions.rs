//! Material libraries of OBJ files, and textures, which are copied with the garments.

use crate::file_record::{InputFile, OutputFile};
use crate::outfit_file::OutfitSpec;
use crate::output_error::OutputError;
use crate::receipt;
use crate::staging::Staging;
use if_mesh::file::{Content, MeshFile};
use if_mesh::obj::textures;
use if_outfit::digest::{FileDigest, digest};
use miette::Diagnostic;
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

/// A material library or texture cannot be copied.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub(crate) enum CompanionError {
    #[error("cannot read `{}`, which `{of}` names", path.display())]
    #[diagnostic(
        code(ifg::input::companion),
        help("make it readable, or take the entry that names it out of `{of}`")
    )]
    Read { path: PathBuf, of: String, source: io::Error },
    #[error(transparent)]
    #[diagnostic(transparent)]
    Output(#[from] OutputError),
}

/// A file to copy.
struct Companion {
    /// Its path.
    source: PathBuf,
    /// The garment that names it, and its file as the user wrote it.
    layer: String,
    of: String,
    content: FileDigest,
}

/// The material libraries and textures that the garments' files name.
pub(crate) struct Companions {
    /// By their paths relative to the garment, which become those in the output folder.
    found: BTreeMap<String, Companion>,
    /// Notes on missing files.
    pub(crate) missing: Vec<String>,
}

impl Companions {
    /// Those of an outfit with these files, the body's first.
    ///
    /// Only files in the garment's folder or below are taken. The names `taken` are those of other
    /// outputs.
    pub(crate) fn find<'f>(
        spec: &OutfitSpec,
        files: impl Iterator<Item = &'f MeshFile>,
        taken: &[String],
    ) -> Result<Self, CompanionError> {
        let mut found: BTreeMap<String, Companion> = BTreeMap::new();
        let mut missing = Vec::new();
        for (layer, file) in spec.garments.iter().zip(files.skip(1)) {
            let folder = layer.path.parent().unwrap_or(Path::new(""));
            let read = |path: &Path, of: &str| {
                fs::read(path).map_err(|source| CompanionError::Read {
                    path: path.into(),
                    of: of.into(),
                    source,
                })
            };
            let mut add =
                |name: String, source: PathBuf, bytes: &[u8]| -> Result<(), CompanionError> {
                    let content = digest(bytes);
                    let other =
                        found.get(&name).filter(|o| o.content != content).map(|o| o.of.clone());
                    let of_ours = taken
                        .iter()
                        .chain([&receipt::FILE.to_owned()])
                        .find(|n| n.eq_ignore_ascii_case(&name))
                        .cloned();
                    if let Some(first) = other.or(of_ours) {
                        return Err(OutputError::SameName {
                            first,
                            second: source.display().to_string(),
                            name,
                        }
                        .into());
                    }
                    let (layer, of) = (layer.name.clone(), layer.written.clone());
                    found.entry(name).or_insert(Companion { source, layer, of, content });
                    Ok(())
                };
            if let Content::Gltf(gltf) = file.content() {
                for image in gltf.images() {
                    match image.map_err(str::to_owned).and_then(|path| {
                        let is_file = folder.join(path).is_file();
                        is_file.then_some(path).ok_or_else(|| path.display().to_string())
                    }) {
                        Ok(image) => {
                            let path = folder.join(image);
                            let bytes = read(&path, &layer.written)?;
                            add(plain(image), path, &bytes)?;
                        }
                        Err(image) => missing.push(format!(
                            "{}: the image `{image}` is not in its folder, and not copied",
                            layer.written
                        )),
                    }
                }
            }
            let Content::Obj(obj) = file.content() else { continue };
            for line in obj.material_libraries() {
                let libraries = libraries_of(folder, &line);
                if libraries.is_empty() {
                    missing.push(format!(
                        "{}: the material library `{line}` is not in its folder, and not copied",
                        layer.written
                    ));
                }
                for library in libraries {
                    let path = folder.join(&library);
                    let text = read(&path, &layer.written)?;
                    let beside = Path::new(&library).parent().unwrap_or(Path::new(""));
                    for line in textures(&text) {
                        match texture_of(&folder.join(beside), &line) {
                            Some(name) => {
                                let path = folder.join(beside).join(&name);
                                let bytes = read(&path, &library)?;
                                add(plain(&beside.join(name)), path, &bytes)?;
                            }
                            None => missing.push(format!("{library}: the texture `{line}` is not in its folder, and not copied")),
                        }
                    }
                    add(plain(Path::new(&library)), path, &text)?;
                }
            }
        }
        missing.sort();
        missing.dedup();
        Ok(Self { found, missing })
    }

    /// Their records, in the order of their names.
    pub(crate) fn inputs(&self) -> impl Iterator<Item = InputFile> {
        let input = |(name, c): (&String, &Companion)| InputFile {
            layer: c.layer.clone(),
            file: name.clone(),
            content: c.content.clone(),
        };
        self.found.iter().map(input)
    }

    /// Copies them into the staging folder, under the same paths relative to the garment, and
    /// returns the copies. A file that lies where its copy would go is left alone.
    pub(crate) fn write(
        &self,
        (staging, out): (&Staging, &Path),
    ) -> Result<Vec<OutputFile>, CompanionError> {
        let mut written = Vec::new();
        for (name, Companion { source, of, .. }) in &self.found {
            let target = out.join(name);
            if matches!((target.canonicalize(), source.canonicalize()), (Ok(a), Ok(b)) if a == b) {
                continue;
            }
            let fault = |source| OutputError::File { path: target.clone(), source };
            let staged = staging.path(name);
            if let Some(parent) = staged.parent() {
                fs::create_dir_all(parent).map_err(fault)?;
            }
            let bytes = fs::read(source).map_err(|e| CompanionError::Read {
                path: source.clone(),
                of: of.clone(),
                source: e,
            })?;
            fs::write(&staged, bytes).map_err(fault)?;
            written.push(staging.describe(name, out)?);
        }
        Ok(written)
    }
}

/// The files of a `mtllib` line: one whose name holds spaces, or each word.
fn libraries_of(folder: &Path, line: &str) -> Vec<String> {
    if is_below(folder, line) {
        return vec![line.to_owned()];
    }
    line.split_whitespace().filter(|word| is_below(folder, word)).map(str::to_owned).collect()
}

/// The file of a texture's line: its longest end that is one.
fn texture_of(folder: &Path, line: &str) -> Option<String> {
    let starts = line.char_indices().filter(|(at, c)| {
        !c.is_whitespace() && line[..*at].chars().next_back().is_none_or(char::is_whitespace)
    });
    starts.map(|(at, _)| &line[at..]).find(|name| is_below(folder, name)).map(str::to_owned)
}

/// Whether `name` is a file in `folder` or below.
fn is_below(folder: &Path, name: &str) -> bool {
    let path = Path::new(name);
    path.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir))
        && folder.join(path).is_file()
}

/// The path without `.`, so that a file has one name.
fn plain(path: &Path) -> String {
    let parts = path.components().filter(|c| matches!(c, Component::Normal(_)));
    parts.collect::<PathBuf>().to_string_lossy().into_owned()
}
