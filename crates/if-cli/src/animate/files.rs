//! The files of an animation: their names, what is wrong with them before any work, and those that an
//! earlier run left.

use super::{MESHES, Options, REPORT, gltf, page, pictures};
use crate::outfit_file::{LayerSpec, OutfitSpec};
use crate::output_error::OutputError;
use std::collections::HashSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// The files that a run writes into its output folder.
pub(super) struct Names {
    /// The point cache of each layer.
    pub(super) caches: Vec<String>,
    /// The meshes, if they are asked for: for each frame that of each layer. One file may hold several.
    pub(super) meshes: Vec<Vec<String>>,
    others: Vec<String>,
}

impl Names {
    /// Those of a run over `frames` frames, none of which is an input or named twice.
    pub(super) fn new(
        spec: &OutfitSpec,
        args: &Options,
        frames: usize,
    ) -> Result<Self, OutputError> {
        let caches: Vec<String> =
            spec.layers().map(|layer| format!("{}.pc2", layer.file_stem())).collect();
        twice(spec, &caches, |_, _| false)?;
        let mut meshes = Vec::new();
        if args.meshes {
            let files: Vec<String> = spec.layers().map(|l| l.file_name.clone()).collect();
            twice(spec, &files, LayerSpec::is_in_file_of)?;
            meshes.extend((0..frames).map(|frame| {
                let folder = format!("{MESHES}/{:06}", args.source.number(frame));
                files.iter().map(|name| format!("{folder}/{name}")).collect()
            }));
        }
        let drawn = args.pictures.then_some([pictures::MOTION, pictures::STRIP, page::FILE]);
        let others = drawn.into_iter().flatten().chain(args.gltf.then_some(gltf::FILE));
        let others = others.chain([REPORT]).map(str::to_owned).collect();
        let names = Self { caches, meshes, others };
        let inputs = inputs(spec, args);
        if let Some(written) = named(&inputs, &args.out) {
            // The folder of bodies: what is written there would be a body of the next run.
            return Err(OutputError::OverInput { path: args.out.clone(), written, option: false });
        }
        for name in names.all() {
            let path = args.out.join(name);
            if let Some(written) = named(&inputs, &path) {
                return Err(OutputError::OverInput { path, written, option: false });
            }
        }
        Ok(names)
    }

    fn all(&self) -> impl Iterator<Item = &String> {
        self.caches.iter().chain(self.meshes.iter().flatten()).chain(&self.others)
    }
}

/// An input as the user wrote it, and where it is.
type Input = (String, PathBuf);

fn inputs(spec: &OutfitSpec, args: &Options) -> Vec<Input> {
    let layers = spec.layers().map(|l| (l.written.clone(), l.path.clone()));
    let motion = [Some(&args.source.motion), args.source.skeleton.as_ref()];
    let motion = motion.into_iter().flatten().map(|p| (p.display().to_string(), p.clone()));
    let placed = |(written, path): Input| Some((written, path.canonicalize().ok()?));
    layers.chain(motion).filter_map(placed).collect()
}

/// How the user wrote the input that lies at `path`, if one does.
fn named(inputs: &[Input], path: &Path) -> Option<String> {
    let path = path.canonicalize().ok()?;
    inputs.iter().find(|(_, input)| *input == path).map(|(written, _)| written.clone())
}

/// Two layers of one name, but for those that may share a file.
fn twice(
    spec: &OutfitSpec,
    names: &[String],
    share: impl Fn(&LayerSpec, &LayerSpec) -> bool,
) -> Result<(), OutputError> {
    let layers: Vec<&LayerSpec> = spec.layers().collect();
    for (k, name) in names.iter().enumerate() {
        let first =
            (0..k).find(|j| names[*j].eq_ignore_ascii_case(name) && !share(layers[k], layers[*j]));
        if let Some(first) = first {
            let [first, second] = [first, k].map(|l| layers[l].written.clone());
            return Err(OutputError::SameName { first, second, name: name.clone() });
        }
    }
    Ok(())
}

/// How the names of files end that a run writes beside its folders.
const WRITTEN: [&str; 4] = [".pc2", ".glb", ".png", ".html"];

/// The files of an earlier run by its report, which this one has not.
pub(super) struct Stale(Vec<PathBuf>);

impl Stale {
    /// Those in the output folder that are no input now. `names` are what this run writes.
    pub(super) fn of(spec: &OutfitSpec, args: &Options, names: &[String]) -> Self {
        let report = fs::read(args.out.join(REPORT)).unwrap_or_default();
        let report: serde_json::Value = serde_json::from_slice(&report).unwrap_or_default();
        let listed = report["outputs"].as_array().into_iter().flatten().filter_map(|n| n.as_str());
        let (inputs, new) = (inputs(spec, args), names.iter().map(String::as_str));
        let new: HashSet<&str> = new.collect();
        // What a report names is not trusted: it may be anybody's, and so may the report.
        let is_ours = report["tool"]["ifg"].is_string() && report["report"]["frames"].is_array();
        let ours = |name: &&str| {
            let parts: Vec<&str> = name.split(['/', '\\']).collect();
            let may_be = match parts[..] {
                [file] => WRITTEN.iter().any(|written| file.ends_with(written)),
                [folder, ..] => folder == MESHES && !parts.contains(&".."),
                [] => false,
            };
            is_ours && may_be
        };
        let old = listed.filter(|name| !new.contains(name)).filter(ours);
        let path = |name: &str| args.out.join(name);
        Self(old.map(path).filter(|path| named(&inputs, path).is_none()).collect())
    }

    /// Removes them, and folders of meshes that are empty then.
    pub(super) fn remove(self) -> Result<(), OutputError> {
        for path in self.0 {
            match fs::remove_file(&path) {
                Err(source) if source.kind() != io::ErrorKind::NotFound => {
                    return Err(OutputError::File { path, source });
                }
                _ => {}
            }
            for folder in path.ancestors().skip(1).take(2) {
                let is_of_meshes = folder.ancestors().any(|f| f.ends_with(MESHES));
                if !is_of_meshes || fs::remove_dir(folder).is_err() {
                    break;
                }
            }
        }
        Ok(())
    }
}
