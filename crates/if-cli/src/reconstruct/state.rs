//! What a stopped run has reached: its checkpoints, hidden files of the wardrobe.

use if_mesh::atomic::remove_partial_of;
use if_pipeline::reconstruct::{ReconstructError, fields_checkpoint};
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

/// How the name of the file ends.
const STATE: &str = "reconstruct.state";
/// How all versions of checkpoints begin.
const BEGINNING: &[u8] = b"ifg ";

/// The checkpoints of a run. Nobody else writes them.
pub(super) struct State(PathBuf);

impl State {
    /// Those of capture `name` whose garments get a prefix, if it is not the usual one.
    pub(super) fn of(wardrobe: &Path, name: &str, prefix: Option<&str>) -> Self {
        let prefix = prefix.map_or(String::new(), |prefix| format!("{prefix}."));
        Self(wardrobe.join(format!(".{name}.{prefix}{STATE}")))
    }

    pub(super) fn path(&self) -> &Path {
        &self.0
    }

    fn files(&self) -> [PathBuf; 2] {
        [self.0.clone(), fields_checkpoint(&self.0)]
    }

    /// Removes half-written files of a run that was killed.
    pub(super) fn remove_partial(&self) {
        self.files().iter().for_each(|file| remove_partial_of(file));
    }

    /// Removes the files, which are of no use any more.
    pub(super) fn remove(&self) {
        for file in self.files() {
            let _ = fs::remove_file(file);
        }
    }

    /// Calls `work`, and once more for each checkpoint that is damaged, or of another version, without
    /// it; `aside` prints a note.
    ///
    /// # Errors
    ///
    /// Those of `work`.
    pub(super) fn with<T>(
        &self,
        mut work: impl FnMut(&Path) -> Result<T, ReconstructError>,
        aside: impl Fn(&str),
    ) -> Result<T, ReconstructError> {
        loop {
            match work(&self.0) {
                Err(ReconstructError::BrokenCheckpoint { path })
                    if is_checkpoint(&path) && fs::remove_file(&path).is_ok() =>
                {
                    aside(&format!(
                        "note: `{}` is damaged, or of another version of ifg: its part of the work starts anew",
                        path.display()
                    ));
                }
                result => return result,
            }
        }
    }
}

/// Whether a file may be a damaged checkpoint: it begins as those do, or has lost its beginning, as
/// after a power cut. Another one is not ours.
fn is_checkpoint(path: &Path) -> bool {
    let mut beginning = [0; BEGINNING.len()];
    let read = File::open(path).and_then(|mut file| file.read(&mut beginning));
    read.is_ok_and(|n| {
        BEGINNING.starts_with(&beginning[..n]) || beginning.iter().all(|byte| *byte == 0)
    })
}
