//! Which combinations a batch is working on. Those at which an earlier run was killed, as for want of memory,
//! come last: they may be so again.

use super::combination::Combination;
use if_outfit::digest::digest;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// Folder of a batch with an empty file for each combination at work.
const FOLDER: &str = ".ifg-begun";
/// Digits of a file's name.
const DIGITS: usize = 20;

/// A combination at work, until it is dropped or the process is killed.
pub(super) struct Begun(PathBuf);

impl Begun {
    /// Without the file, as on a full disk, the combination only loses its place in the next run.
    pub(super) fn mark(out: &Path, combination: &Combination) -> Self {
        let path = path(out, combination);
        let _ = fs::create_dir_all(out.join(FOLDER)).and_then(|()| File::create(&path));
        Self(path)
    }
}

impl Drop for Begun {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
        let _ = self.0.parent().map(fs::remove_dir); // unless others are at work
    }
}

/// Removes what is left of runs that were killed, when all is done.
pub(super) fn clear(out: &Path) {
    let _ = fs::remove_dir_all(out.join(FOLDER));
}

fn path(out: &Path, combination: &Combination) -> PathBuf {
    let name = digest(combination.to_string().as_bytes()).sha256;
    out.join(FOLDER).join(&name[..DIGITS])
}

/// The indices of the combinations in the order in which they are to be done.
pub(super) fn order(out: &Path, combinations: &[Combination]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..combinations.len()).collect();
    if out.join(FOLDER).is_dir() {
        order.sort_by_key(|k| path(out, &combinations[*k]).exists());
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_killed_run_was_at_comes_last_until_it_is_done() {
        let root = tempfile::tempdir().unwrap();
        let on = |garment: &str| Combination { body: "b".into(), garments: vec![garment.into()] };
        let list = ["coat", "vest", "hat"].map(on);
        assert_eq!(order(root.path(), &list), [0, 1, 2]);
        std::mem::forget(Begun::mark(root.path(), &list[0]));
        drop(Begun::mark(root.path(), &list[1]));
        assert_eq!(order(root.path(), &list), [1, 2, 0]);
        drop(Begun::mark(root.path(), &list[0]));
        assert_eq!(order(root.path(), &list), [0, 1, 2]);
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 0, "nothing is left");
    }
}
