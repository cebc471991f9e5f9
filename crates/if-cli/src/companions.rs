//! Material libraries of OBJ files, and textures of all formats, which are copied with the layers that are written.

use crate::file_record::{InputFile, OutputFile};
use crate::outfit_file::{LayerSpec, OutfitSpec};
use crate::output_error::OutputError;
use crate::receipt;
use crate::staging::Staging;
use if_mesh::file::{Content, MeshFile};
use if_mesh::obj::textures;
use if_mesh::regular_file;
use if_outfit::digest::{FileDigest, digest};
use if_outfit::resolve::Pinch;
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
    /// The layer that names it, and its file as the user wrote it.
    layer: String,
    of: String,
    content: FileDigest,
    /// Whether no garment names it: it is copied with a body that was drawn back.
    is_of_body: bool,
}

/// The material libraries and textures that the files of garments name, and that of a body that may be
/// drawn back.
pub(crate) struct Companions {
    /// By their paths relative to the layer, which become those in the output folder.
    found: BTreeMap<String, Companion>,
    /// Notes on missing files of garments, and of such a body.
    missing: Vec<String>,
    missing_of_body: Vec<String>,
}

impl Companions {
    /// Those of an outfit with these files, the body's first.
    ///
    /// Only files in the layer's folder or below are taken. The names `taken` are those of other
    /// outputs in the folder `out`.
    pub(crate) fn find<'f>(
        spec: &OutfitSpec,
        files: impl Iterator<Item = &'f MeshFile>,
        (out, taken): (&Path, &[String]),
    ) -> Result<Self, CompanionError> {
        let mut found: BTreeMap<String, Companion> = BTreeMap::new();
        let (mut missing, mut missing_of_body) = (Vec::new(), Vec::new());
        let mut files = spec.layers().zip(files);
        let body = files.next();
        // Those of a body that is not written are not copied, but stay what they are.
        let of_body = body.and_then(|(body, file)| named_by(body, file, &mut vec![]).ok());
        let placed = |named: Named| named.source.canonicalize().ok();
        let of_body: Vec<PathBuf> = of_body.into_iter().flatten().filter_map(placed).collect();
        let may_yield = spec.params.goal.pinch == Pinch::Yield;
        // The body last: what a garment names as well is the garment's.
        let files =
            files.map(|file| (file, false)).chain(body.filter(|_| may_yield).map(|b| (b, true)));
        for ((layer, file), is_of_body) in files {
            let missing = if is_of_body { &mut missing_of_body } else { &mut missing };
            for Named { name, source, of } in named_by(layer, file, missing)? {
                let content = digest(&read(&source, &of)?);
                let other = found.get(&name).filter(|o| o.content != content);
                let other = other.map(|o| o.source.display().to_string());
                let of_ours = taken
                    .iter()
                    .chain([&receipt::FILE.to_owned()])
                    .find(|n| n.eq_ignore_ascii_case(&name))
                    .cloned();
                if let Some(first) = other.or(of_ours) {
                    if is_of_body {
                        missing.push(format!(
                            "{of}: `{name}` is not copied, as its place is taken (`{first}`)"
                        ));
                        continue;
                    }
                    let second = source.display().to_string();
                    return Err(OutputError::SameName { first, second, name }.into());
                }
                let target = out.join(&name);
                let over = target.canonicalize().ok().filter(|t| of_body.contains(t));
                if over.is_some() && source.canonicalize().ok() != over {
                    if is_of_body {
                        missing.push(format!("{of}: `{name}` is not copied over another one"));
                        continue;
                    }
                    let (path, written) = (target.clone(), target.display().to_string());
                    return Err(OutputError::OverInput { path, written, option: false }.into());
                }
                let (layer, of) = (layer.name.clone(), layer.written.clone());
                found.entry(name).or_insert(Companion { source, layer, of, content, is_of_body });
            }
        }
        for notes in [&mut missing, &mut missing_of_body] {
            notes.sort();
            notes.dedup();
        }
        Ok(Self { found, missing, missing_of_body })
    }

    /// Notes on missing files, of the body only where it is written.
    pub(crate) fn notes(self, body_is_written: bool) -> impl Iterator<Item = String> {
        let of_body = self.missing_of_body.into_iter().filter(move |_| body_is_written);
        self.missing.into_iter().chain(of_body)
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

    /// Copies them into the staging folder, under the same paths relative to the layer, and
    /// returns the copies: the body's only where it is written. A file that lies where its copy would
    /// go is left alone.
    pub(crate) fn write(
        &self,
        body_is_written: bool,
        (staging, out): (&Staging, &Path),
    ) -> Result<Vec<OutputFile>, CompanionError> {
        let mut written = Vec::new();
        let copied = self.found.iter().filter(|(_, c)| body_is_written || !c.is_of_body);
        for (name, Companion { source, of, .. }) in copied {
            let target = out.join(name);
            if matches!((target.canonicalize(), source.canonicalize()), (Ok(a), Ok(b)) if a == b) {
                continue;
            }
            let fault = |source| OutputError::File { path: target.clone(), source };
            let staged = staging.path(name);
            if let Some(parent) = staged.parent() {
                fs::create_dir_all(parent).map_err(fault)?;
            }
            fs::write(&staged, read(source, of)?).map_err(fault)?;
            written.push(staging.describe(name, out)?);
        }
        Ok(written)
    }
}

fn read(path: &Path, of: &str) -> Result<Vec<u8>, CompanionError> {
    regular_file::read(path).map_err(|source| CompanionError::Read {
        path: path.into(),
        of: of.into(),
        source,
    })
}

/// A file that another one names.
struct Named {
    /// Its path from the folder of the layer.
    name: String,
    /// Its path.
    source: PathBuf,
    /// The file that names it, as the user wrote it.
    of: String,
}

/// What the file of a layer names. Notes what is `missing`.
fn named_by(
    layer: &LayerSpec,
    file: &MeshFile,
    missing: &mut Vec<String>,
) -> Result<Vec<Named>, CompanionError> {
    let folder = layer.path.parent().unwrap_or(Path::new(""));
    let mut named = Vec::new();
    if let Content::Gltf(gltf) = file.content() {
        for image in gltf.images() {
            match image.map_err(str::to_owned).and_then(|path| {
                let is_file = folder.join(path).is_file();
                is_file.then_some(path).ok_or_else(|| path.display().to_string())
            }) {
                Ok(image) => named.push(Named {
                    name: plain(image),
                    source: folder.join(image),
                    of: layer.written.clone(),
                }),
                Err(image) => missing.push(format!(
                    "{}: the image `{image}` is not in its folder, and not copied",
                    layer.written
                )),
            }
        }
    }
    if let Content::Ply(ply) = file.content() {
        for line in ply.comments.iter().filter_map(|comment| texture_file(comment)) {
            match texture(folder, Path::new(""), line, &layer.written) {
                Ok(found) => named.push(found),
                Err(note) => missing.push(note),
            }
        }
    }
    let Content::Obj(obj) = file.content() else { return Ok(named) };
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
                match texture(folder, beside, &line, &library) {
                    Ok(found) => named.push(found),
                    Err(note) => missing.push(note),
                }
            }
            let (name, of) = (plain(Path::new(&library)), layer.written.clone());
            named.push(Named { name, source: path, of });
        }
    }
    Ok(named)
}

/// The texture that a line of `of` names, in the folder `beside` from that of the layer, or a note that it is missing.
fn texture(folder: &Path, beside: &Path, line: &str, of: &str) -> Result<Named, String> {
    let name = texture_of(&folder.join(beside), line).ok_or_else(|| {
        format!("{of}: the texture `{line}` is not in its folder, and not copied")
    })?;
    let name = beside.join(name);
    Ok(Named { source: folder.join(&name), name: plain(&name), of: of.to_owned() })
}

/// What a comment of a PLY file names as a texture, as MeshLab and programs for scans write it.
fn texture_file(comment: &str) -> Option<&str> {
    let (word, name) = comment.trim().split_once(char::is_whitespace)?;
    word.eq_ignore_ascii_case("TextureFile").then(|| name.trim())
}

/// The files of a `mtllib` line: one whose name holds spaces, or each word.
fn libraries_of(folder: &Path, line: &str) -> Vec<String> {
    if is_below(folder, line) {
        return vec![line.to_owned()];
    }
    line.split_whitespace().filter(|word| is_below(folder, word)).map(str::to_owned).collect()
}

/// Most bytes of a path that systems open.
const LONGEST: usize = 4096;

/// The file of a texture's line: its longest end that is one.
fn texture_of(folder: &Path, line: &str) -> Option<String> {
    let mut from = line.len().saturating_sub(LONGEST)..line.len();
    let line = &line[from.find(|at| line.is_char_boundary(*at)).unwrap_or(line.len())..];
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
