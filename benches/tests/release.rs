//! What a release must hold: permitted licences, dependencies that build with the stated Rust
//! version, and the recorded list of public items.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Licences that a program under MIT or Apache-2.0 may be linked with.
const PERMITTED: [&str; 11] = [
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "ISC",
    "MIT",
    "MIT-0",
    "Unicode-3.0",
    "Zlib",
];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Runs cargo in the workspace and returns what it printed.
fn cargo(args: &[&str], set: &[(&str, &str)]) -> Vec<u8> {
    let mut command = Command::new(env!("CARGO"));
    let out = command.current_dir(root()).args(args).envs(set.iter().copied()).output().unwrap();
    assert!(out.status.success(), "cargo {args:?}: {}", String::from_utf8_lossy(&out.stderr));
    out.stdout
}

fn metadata() -> Value {
    let json = cargo(&["metadata", "--locked", "--format-version", "1"], &[]);
    serde_json::from_slice(&json).unwrap()
}

fn packages(metadata: &Value) -> impl Iterator<Item = (&str, &Value)> {
    let all = metadata["packages"].as_array().unwrap();
    all.iter().map(|package| (package["name"].as_str().unwrap(), package))
}

/// Whether one alternative of a licence expression consists of permitted licences.
fn is_permitted(expression: &str) -> bool {
    // Expressions in use are alternatives of conjunctions; parentheses only group alternatives.
    let plain = expression.replace(['(', ')'], " ").replace('/', " OR ");
    let permitted = |name: &str| PERMITTED.contains(&name.trim());
    if expression.contains(") AND ") || expression.contains(" AND (") {
        return plain.split(" AND ").all(|part| part.split(" OR ").any(permitted));
    }
    plain.split(" OR ").any(|part| part.split(" AND ").all(permitted))
}

#[test]
fn licence_expressions_are_read_as_alternatives_of_conjunctions() {
    for fine in ["MIT", "MIT OR GPL-3.0", "MIT/Apache-2.0", "(MIT OR Apache-2.0) AND Unicode-3.0"] {
        assert!(is_permitted(fine), "{fine}");
    }
    for refused in ["GPL-3.0", "MIT AND GPL-3.0", "(MIT OR Apache-2.0) AND OFL-1.1", ""] {
        assert!(!is_permitted(refused), "{refused}");
    }
}

#[test]
fn all_packages_have_permitted_licences() {
    let metadata = metadata();
    let refused: Vec<String> = packages(&metadata)
        .filter(|(_, p)| !p["license"].as_str().is_some_and(is_permitted))
        .map(|(name, p)| format!("{name}: {}", p["license"]))
        .collect();
    assert_eq!(refused, [""; 0], "replace these packages, or permit their licences");
}

#[test]
fn no_package_needs_a_newer_rust_than_the_workspace() {
    let metadata = metadata();
    // 1.89 is 1.89.0.
    let version = |text: &str| -> Vec<u64> {
        let given = text.split('.').map(|n| n.parse().unwrap());
        given.chain(std::iter::repeat(0)).take(3).collect()
    };
    let (_, ours) = packages(&metadata).find(|(name, _)| *name == "if-core").unwrap();
    let ours = version(ours["rust_version"].as_str().unwrap());
    let newer: Vec<String> = packages(&metadata)
        .filter_map(|(name, p)| Some((name, p["rust_version"].as_str()?)))
        .filter(|(_, needed)| version(needed) > ours)
        .map(|(name, needed)| format!("{name} needs {needed}"))
        .collect();
    assert_eq!(newer, [""; 0], "hold these packages back (cargo update -p NAME --precise VERSION)");
}

/// The public items are those in `docs/public-api`; with `RECORD=1` they are written there.
///
/// rustdoc's JSON is unstable: of a compiler whose version of it is not known nothing is compared.
#[test]
#[ignore = "documents all crates; .ci/run full runs it"]
fn the_public_items_are_those_on_record() {
    let metadata = metadata();
    let target = PathBuf::from(metadata["target_directory"].as_str().unwrap());
    let folder = root().join("docs/public-api");
    let mut changed = String::new();
    let crates =
        ["core", "sparse", "mesh", "xpbd", "neural", "outfit", "body", "render", "pipeline"];
    for krate in crates.into_iter().chain(["garments"]) {
        let name = format!("if-{krate}");
        let json = ["--", "-Zunstable-options", "--output-format", "json"];
        let args = [&["rustdoc", "--quiet", "--locked", "--lib", "-p", &name][..], &json].concat();
        // Stable compilers take unstable options of rustdoc with this variable.
        cargo(&args, &[("RUSTC_BOOTSTRAP", "1")]);
        let Some(found) = items(&target.join(format!("doc/if_{krate}.json"))) else {
            eprintln!("nothing is compared: the package `public-api` does not know this compiler");
            return;
        };
        let path = folder.join(format!("{name}.txt"));
        if std::env::var_os("RECORD").is_some() {
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::write(&path, found.iter().map(|i| format!("{i}\n")).collect::<String>())
                .unwrap();
            continue;
        }
        let recorded = std::fs::read_to_string(&path).unwrap_or_default();
        let recorded: BTreeSet<String> = recorded.lines().map(str::to_owned).collect();
        for gone in recorded.difference(&found) {
            let _ = writeln!(changed, "- {gone}");
        }
        for new in found.difference(&recorded) {
            let _ = writeln!(changed, "+ {new}");
        }
    }
    assert!(
        changed.is_empty(),
        "the public items have changed; if that is wanted, record them with\n\
         RECORD=1 cargo test -p if-benches --test release -- --ignored\n{changed}"
    );
}

/// Traits that nobody relies on, or that follow from others.
const UNNAMED: [&str; 6] =
    ["Freeze", "RefUnwindSafe", "StructuralPartialEq", "UnsafeUnpin", "Unpin", "UnwindSafe"];

/// The public items of a crate with their signatures, and the traits of its types, by a file of
/// rustdoc; `None` if the compiler writes another version of these than is known.
fn items(path: &Path) -> Option<BTreeSet<String>> {
    let text = |with_derived: bool| -> Option<BTreeSet<String>> {
        let api = public_api::Builder::from_rustdoc_json(path)
            .omit_blanket_impls(true)
            .omit_auto_derived_impls(!with_derived)
            .omit_auto_trait_impls(!with_derived)
            .build();
        match api {
            Ok(api) => Some(api.items().map(ToString::to_string).collect()),
            Err(public_api::Error::SerdeJsonError(_)) => None,
            Err(error) => panic!("{}: {error}", path.display()),
        }
    };
    let is_named = |item: &String| {
        let head = item.split_once(" for ").map_or(item.as_str(), |(head, _)| head);
        item.starts_with("impl") && !UNNAMED.iter().any(|name| head.ends_with(&format!("::{name}")))
    };
    let derived = text(true)?.into_iter().filter(is_named);
    Some(text(false)?.into_iter().chain(derived).collect())
}
