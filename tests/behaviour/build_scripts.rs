//! The scripts that hash sources for keys of caches.

/// A package holds its own script, so there are two. They must hash in the same way.
#[test]
fn the_scripts_that_hash_sources_are_one() {
    let scripts = ["if-outfit", "if-pipeline"].map(|name| {
        let path = format!("{}/crates/{name}/build.rs", env!("CARGO_MANIFEST_DIR"));
        std::fs::read_to_string(path).unwrap()
    });
    assert_eq!(scripts[0], scripts[1]);
}
