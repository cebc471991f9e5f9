//! The body of several outfits of a run, which is closed once.

use crate::outfit_file::{LayerSpec, OutfitSpec};
use if_outfit::PreparedBody;
use if_outfit::files::OutfitFiles;
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Arc;

/// A body's file, its node there, and the bits of its scale.
type Key = (PathBuf, Option<String>, u64);

/// The bodies of a run. Results are the same without it: a body whose file was changed since is not used
/// ([`OutfitFiles::with_body`]).
#[derive(Default)]
pub(crate) struct SharedBody {
    /// How many outfits have each.
    all: HashMap<Key, usize>,
    last: Option<(Key, Arc<PreparedBody>)>,
}

impl SharedBody {
    pub(crate) fn of<'a>(specs: impl Iterator<Item = &'a OutfitSpec>) -> Self {
        let mut all = HashMap::new();
        specs.filter_map(key).for_each(|key| *all.entry(key).or_default() += 1);
        Self { all, last: None }
    }

    /// The outfit with its body prepared, if another one has it, too.
    pub(crate) fn with_body(&mut self, spec: &OutfitSpec, files: OutfitFiles) -> OutfitFiles {
        let Some(key) = key(spec) else { return files };
        if self.all.get(&key).is_none_or(|outfits| *outfits < 2) {
            return files;
        }
        let body = match self.last.take() {
            Some((last, body)) if last == key => body,
            _ => Arc::new(PreparedBody::new(&files.outfit().body.mesh)),
        };
        self.last = Some((key, Arc::clone(&body)));
        files.with_body(body)
    }
}

fn key(spec: &OutfitSpec) -> Option<Key> {
    let LayerSpec { path, node, .. } = &spec.body;
    Some((path.canonicalize().ok()?, node.clone(), spec.scale.to_bits()))
}
