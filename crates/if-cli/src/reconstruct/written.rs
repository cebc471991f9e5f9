//! What a run wrote into a wardrobe, by name.

use serde::{Deserialize, Serialize};
use std::path::Path;

/// Names in the wardrobe.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Written {
    /// The body, which another run may have added before.
    pub(super) body: String,
    /// Inner to outer.
    pub(super) garments: Vec<String>,
    /// The folder of the clothed person.
    pub(super) clothed: String,
}

/// A report with what was written.
#[derive(Serialize)]
pub(super) struct WithWritten<'a, R> {
    wrote: &'a Written,
    #[serde(flatten)]
    report: &'a R,
}

impl Written {
    pub(super) fn with<'a, R: Serialize>(&'a self, report: &'a R) -> WithWritten<'a, R> {
        WithWritten { wrote: self, report }
    }

    /// A line for people.
    pub(super) fn line(&self, wardrobe: &Path) -> String {
        let garments = match self.garments.is_empty() {
            true => String::new(),
            false => format!(", garments {}", self.garments.join(", ")),
        };
        format!("  {}: body {}{garments}, and {}\n", wardrobe.display(), self.body, self.clothed)
    }
}
