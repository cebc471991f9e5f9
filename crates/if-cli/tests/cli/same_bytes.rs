//! The same input gives the same bytes.

use crate::folder::Folder;
use serde_json::Value;

/// The files of an output folder, the receipt without its timings.
fn result(folder: &Folder, out: &str) -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    for (path, bytes) in folder.files() {
        if path.parent().is_some_and(|p| p.ends_with(out)) {
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            let bytes = if name == "receipt.json" {
                let mut receipt: Value = serde_json::from_slice(&bytes).unwrap();
                receipt.as_object_mut().unwrap().remove("timings").unwrap();
                serde_json::to_vec_pretty(&receipt).unwrap()
            } else {
                bytes
            };
            files.push((name, bytes));
        }
    }
    files
}

#[test]
fn two_runs_and_any_number_of_threads_give_the_same_bytes() {
    let folder = Folder::new();
    let run = |out: &str, threads: usize| {
        folder.ifg(&format!("fix outfit.toml --out {out} --threads {threads}")).expect(0);
        result(&folder, out)
    };
    let once = run("one", 1);
    assert_eq!(once.len(), 3, "two garments and a receipt");
    for (out, threads) in [("again", 1), ("two", 2), ("seven", 7)] {
        assert!(run(out, threads) == once, "{out}");
    }
}

#[test]
fn pictures_are_the_same_too() {
    let folder = Folder::new();
    let run = |out: &str, threads: usize| {
        folder
            .ifg_drawing(&format!("fix --body body.ply hoop.ply --out {out} --threads {threads}"))
            .expect(0);
        result(&folder, out)
    };
    let once = run("one", 1);
    assert_eq!(once.len(), 5, "a garment, two pictures, a page and a receipt");
    assert!(run("seven", 7) == once);
}
