//! What runs that go on will write into a wardrobe: two of them never write the same.

use if_mesh::atomic::{FolderWriter, PATIENCE};
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Folder of the wardrobe with a folder for each run, which that holds locked; it goes with the last.
const RUNS: &str = ".ifg-reconstruct";
/// What a run will write, in its folder.
const CLAIM: &str = "claim.json";

/// What a run will write.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Claim {
    /// Name of the clothed person.
    pub(super) clothed: String,
    /// The capture that it is of.
    pub(super) source: String,
    /// The file with what the run has reached.
    pub(super) state: PathBuf,
    /// Names of garments.
    pub(super) garments: Vec<String>,
}

impl Claim {
    /// Whether both would write the same. The clothed person of one capture is the same whoever writes
    /// it last: garments of several prefixes may be made at once.
    fn meets(&self, other: &Self) -> bool {
        self.state == other.state
            || self.clothed == other.clothed && self.source != other.source
            || self.garments.iter().any(|garment| other.garments.contains(garment))
    }
}

/// A claim that is held until it is dropped, or the process ends.
#[derive(Debug)]
pub(super) struct Running {
    runs: PathBuf,
    own: Option<FolderWriter>,
}

impl Running {
    /// Claims what a run will write into `wardrobe`; `None` if another process that runs writes some of
    /// it.
    ///
    /// # Errors
    ///
    /// What the system returns for the folder.
    pub(super) fn claim(wardrobe: &Path, claim: &Claim) -> io::Result<Option<Self>> {
        let runs = wardrobe.join(RUNS);
        let Some(register) = FolderWriter::wait(&runs, PATIENCE)? else { return Ok(None) };
        for name in register.names()? {
            let run = runs.join(name);
            if let Some(ended) = FolderWriter::open(&run)? {
                drop(ended);
                fs::remove_dir_all(run)?; // of a process that was killed
            } else if claimed(&run).is_none_or(|other| other.meets(claim)) {
                return Ok(None);
            }
        }
        let mut free = (1..).map(|k: u64| runs.join(k.to_string())).filter(|run| !run.exists());
        let run = free.next().expect("some number is free");
        let Some(own) = FolderWriter::open(&run)? else { return Ok(None) };
        // Dropped on a fault, it removes its folder again.
        let running = Self { runs, own: Some(own) };
        fs::write(run.join(CLAIM), serde_json::to_vec(claim)?)?;
        Ok(Some(running))
    }
}

/// The claim of a run; `None` if it cannot be read.
fn claimed(run: &Path) -> Option<Claim> {
    serde_json::from_slice(&fs::read(run.join(CLAIM)).ok()?).ok()
}

impl Drop for Running {
    fn drop(&mut self) {
        // What cannot be removed here the next run removes. Others wait meanwhile, so that none of them
        // finds a run without its claim.
        let register = FolderWriter::wait(&self.runs, PATIENCE);
        if let Some(own) = self.own.take() {
            let run = own.parent().to_path_buf();
            let _ = fs::remove_file(run.join(CLAIM));
            drop(own);
            let _ = fs::remove_dir(run);
        }
        drop(register);
        let _ = fs::remove_dir(&self.runs); // unless others run
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(clothed: &str, source: &str, garments: &[&str]) -> Claim {
        Claim {
            clothed: clothed.into(),
            source: source.into(),
            state: format!("{clothed}{garments:?}").into(),
            garments: garments.iter().map(ToString::to_string).collect(),
        }
    }

    #[test]
    fn runs_that_would_write_the_same_exclude_each_other() {
        let root = tempfile::tempdir().unwrap();
        let claim = |claim: &Claim| Running::claim(root.path(), claim).unwrap();
        let first = claim(&of("turn", "p1/turn", &["a_coat", "a_skirt"])).unwrap();
        for (other, is_free) in [
            (of("turn", "p1/turn", &["a_coat", "a_skirt"]), false), // the same once more
            (of("turn", "p2/turn", &["b_coat"]), false),            // another of the same name
            (of("walk", "p1/walk", &["a_skirt"]), false),           // the same garment
            (of("turn", "p1/turn", &["b_coat"]), true),             // another prefix
            (of("walk", "p1/walk", &["w_coat"]), true),
        ] {
            assert_eq!(claim(&other).is_some(), is_free, "{other:?}");
        }
        drop(first);
        assert!(claim(&of("turn", "p2/turn", &["a_coat"])).is_some());
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0, "nothing is left");
    }

    #[test]
    fn the_claim_of_a_killed_run_is_of_no_account() {
        let root = tempfile::tempdir().unwrap();
        let killed = of("turn", "p1/turn", &["coat"]);
        let run = root.path().join(RUNS).join("1");
        fs::create_dir_all(&run).unwrap();
        fs::write(run.join(CLAIM), serde_json::to_vec(&killed).unwrap()).unwrap();
        let again = Running::claim(root.path(), &of("turn", "p2/turn", &["coat"])).unwrap();
        assert!(again.is_some());
        assert!(Running::claim(root.path(), &killed).unwrap().is_none());
        drop(again);
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0);
    }
}
