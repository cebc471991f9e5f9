//! What becomes of the names of a capture, its body and its garments in a wardrobe.

use if_pipeline::asset::{AssetError, check_name};
use if_pipeline::capture::Capture;
use std::fs;
use std::path::Path;

/// Why garments have no names.
#[derive(Debug, thiserror::Error)]
pub(super) enum NameError {
    /// One is no folder's.
    #[error(transparent)]
    Name(#[from] AssetError),
    /// Two are the same.
    #[error(
        "garments `{first}` and `{second}` of the capture would both be called `{name}`; rename one in meta.json"
    )]
    Same { first: String, second: String, name: String },
}

/// What is a folder's name on any system, with `_` for anything else.
pub(super) fn fitting(name: &str) -> String {
    let fits =
        |c: char| if c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.') { c } else { '_' };
    name.chars().map(fits).collect::<String>().trim_matches('.').into()
}

/// The last part of a path, as a name for folders.
pub(super) fn last_name(path: &Path, otherwise: &str) -> String {
    let name = fs::canonicalize(path)
        .ok()
        .and_then(|p| p.file_name().map(|n| n.to_string_lossy().into_owned()));
    let name = fitting(&name.unwrap_or_default());
    if name.is_empty() { otherwise.into() } else { name }
}

/// What the assets of the capture's garments are called: the prefix and the garment's name, inner
/// to outer.
pub(super) fn assets(capture: &Capture, prefix: &str) -> Result<Vec<String>, NameError> {
    let garments = capture.garments();
    let names: Vec<String> =
        garments.iter().map(|garment| format!("{prefix}{}", fitting(garment))).collect();
    for (k, name) in names.iter().enumerate() {
        check_name(name)?;
        if let Some(first) = names[..k].iter().position(|n| n == name) {
            let (first, second) = (garments[first].clone(), garments[k].clone());
            return Err(NameError::Same { first, second, name: name.clone() });
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_name_becomes_a_folders() {
        for (name, fit) in [
            ("suit jacket", "suit_jacket"),
            ("Hemd.blau", "Hemd.blau"),
            ("Röcke", "R_cke"),
            ("..", ""),
        ] {
            assert_eq!(fitting(name), fit);
        }
        assert_eq!(last_name(Path::new("/nowhere/at/all"), "capture"), "capture");
    }
}
