//! What OBJ files name: material libraries and their textures, which are copied along.

use crate::load::Loaded;
use crate::outfit_file::OutfitSpec;
use crate::outputs;
use crate::receipt::{self, Output};
use crate::staging::{OutputError, Staging};
use if_mesh::file::Content;
use if_mesh::obj::textures;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Component, Path, PathBuf};

/// A file to copy.
struct Companion {
    /// Where it lies.
    source: PathBuf,
    /// The garment's file that names it, as the user wrote it.
    of: String,
}

/// Copies the material libraries and textures that the garments' OBJ files name into the staging folder, under the same paths relative to
/// the garment. Returns them, and what was not there.
///
/// Only files in the garment's folder or below are copied; a file that lies where its copy would go is left alone. The names `taken` are
/// those of other outputs.
pub(crate) fn write(
    spec: &OutfitSpec,
    loaded: &Loaded,
    taken: &[String],
    (staging, out): (&Staging, &Path),
) -> Result<(Vec<Output>, Vec<String>), OutputError> {
    let mut found: BTreeMap<String, Companion> = BTreeMap::new();
    let mut notes = Vec::new();
    for (k, layer) in spec.garments.iter().enumerate() {
        let Content::Obj(obj) = loaded.garment_file(k).content() else { continue };
        let folder = layer.path.parent().unwrap_or(Path::new(""));
        let mut add = |name: String, source: PathBuf| -> Result<(), OutputError> {
            let other = found.get(&name).filter(|o| !same_content(&o.source, &source)).map(|o| o.of.clone());
            let of_ours = taken.iter().chain([&receipt::FILE.to_owned()]).find(|n| n.eq_ignore_ascii_case(&name)).cloned();
            if let Some(first) = other.or(of_ours) {
                return Err(OutputError::SameName { first, second: source.display().to_string(), name });
            }
            found.entry(name).or_insert(Companion { source, of: layer.written.clone() });
            Ok(())
        };
        for line in obj.material_libraries() {
            let libraries = libraries_of(folder, &line);
            if libraries.is_empty() {
                notes.push(format!("{}: the material library `{line}` is not in its folder, and not copied", layer.written));
            }
            for library in libraries {
                let path = folder.join(&library);
                let text = fs::read(&path).map_err(|source| OutputError::File { path: path.clone(), source })?;
                let beside = Path::new(&library).parent().unwrap_or(Path::new(""));
                for line in textures(&text) {
                    match texture_of(&folder.join(beside), &line) {
                        Some(name) => add(plain(&beside.join(&name)), folder.join(beside).join(name))?,
                        None => notes.push(format!("{library}: the texture `{line}` is not in its folder, and not copied")),
                    }
                }
                add(plain(Path::new(&library)), path)?;
            }
        }
    }
    notes.sort();
    notes.dedup();
    let mut written = Vec::new();
    for (name, Companion { source, .. }) in found {
        let target = out.join(&name);
        if matches!((target.canonicalize(), source.canonicalize()), (Ok(a), Ok(b)) if a == b) {
            continue;
        }
        let fault = |source| OutputError::File { path: target.clone(), source };
        let staged = staging.path(&name);
        if let Some(parent) = staged.parent() {
            fs::create_dir_all(parent).map_err(fault)?;
        }
        let bytes = fs::read(&source).map_err(|e| OutputError::File { path: source.clone(), source: e })?;
        fs::write(&staged, bytes).map_err(fault)?;
        written.push(outputs::describe(&name, staging, out)?);
    }
    Ok((written, notes))
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
    let starts = line
        .char_indices()
        .filter(|(at, c)| !c.is_whitespace() && line[..*at].chars().next_back().is_none_or(char::is_whitespace));
    starts.map(|(at, _)| &line[at..]).find(|name| is_below(folder, name)).map(str::to_owned)
}

/// Whether `name` is a file in `folder` or below.
fn is_below(folder: &Path, name: &str) -> bool {
    let path = Path::new(name);
    path.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir)) && folder.join(path).is_file()
}

/// The path without `.`, so that a file has one name.
fn plain(path: &Path) -> String {
    let parts = path.components().filter(|c| matches!(c, Component::Normal(_)));
    parts.collect::<PathBuf>().to_string_lossy().into_owned()
}

fn same_content(a: &Path, b: &Path) -> bool {
    a == b || matches!((fs::read(a), fs::read(b)), (Ok(a), Ok(b)) if a == b)
}
