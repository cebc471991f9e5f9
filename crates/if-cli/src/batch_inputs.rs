//! What the outfits of a batch read: no output of one may replace an input of another, or results
//! would depend on which comes first.

use crate::outfit_file::OutfitSpec;
use crate::output_error::OutputError;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// The files that outfits read.
#[derive(Debug, Default)]
pub(crate) struct BatchInputs {
    /// For each file the outfits that read it, by their numbers, with their names.
    readers: HashMap<PathBuf, Vec<(usize, String)>>,
}

impl BatchInputs {
    /// The files of these outfits, each with its number.
    pub(crate) fn of<'a>(outfits: impl IntoIterator<Item = (usize, &'a OutfitSpec)>) -> Self {
        let mut inputs = Self::default();
        for (number, spec) in outfits {
            for path in spec.layers().filter_map(|layer| layer.path.canonicalize().ok()) {
                inputs.readers.entry(path).or_default().push((number, spec.name.clone()));
            }
        }
        inputs
    }

    /// Refuses outputs of outfit `number`, files called `names` in `out`, that another one reads.
    pub(crate) fn check(
        &self,
        number: usize,
        out: &Path,
        names: &[String],
    ) -> Result<(), OutputError> {
        for path in names.iter().map(|name| out.join(name)) {
            let target = path.canonicalize().ok();
            let readers = target.and_then(|target| self.readers.get(&target));
            let other = readers.into_iter().flatten().find(|(reader, _)| *reader != number);
            if let Some((_, outfit)) = other {
                return Err(OutputError::OverOther { path, outfit: outfit.clone() });
            }
        }
        Ok(())
    }
}
