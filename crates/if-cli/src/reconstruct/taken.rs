//! Names of a wardrobe that something else has: it is not replaced.

use super::{CLOTHED, Fault, PROVENANCE, fault};
use if_pipeline::asset::Provenance;
use if_pipeline::wardrobe::{Part, Wardrobe};
use std::fs;
use std::io;
use std::path::Path;

/// A garment or a clothed person that is somebody else's.
#[derive(Debug, thiserror::Error)]
enum Taken {
    #[error("the wardrobe has {what}, made of another capture, `{source_of}`")]
    OfAnother { what: String, source_of: String },
    #[error(
        "the wardrobe has {what}, made of this capture when it had another meta.json: it may be another person's"
    )]
    OfEarlier { what: String },
}

/// What something was made of, compared with a capture.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Origin {
    This,
    /// The same path, with another description.
    Earlier,
    Another,
}

impl Origin {
    /// Another path is another capture, unless that is gone and this one has its content. (Captures of one
    /// person in other clothes may differ in their pictures alone.)
    fn of(made: &Provenance, this: &Provenance) -> Self {
        let is_same = made.sha256 == this.sha256;
        if made.source != this.source {
            let is_moved = is_same && !Path::new(&made.source).exists();
            return if is_moved { Self::This } else { Self::Another };
        }
        let is_known = made.sha256.is_some() && this.sha256.is_some();
        if is_same || !is_known { Self::This } else { Self::Earlier }
    }
}

/// A capture, and what it would write.
pub(super) struct Names<'a> {
    pub(super) capture: &'a Path,
    pub(super) made_of: &'a Provenance,
    /// Of the clothed person.
    pub(super) clothed: &'a str,
    pub(super) garments: &'a [String],
    /// Whether it may take the place of what was made of it before its description was changed.
    pub(super) replace: bool,
}

impl Names<'_> {
    /// Refuses a capture whose garments or whose clothed person would replace those of another one, or of
    /// the same with another description.
    pub(super) fn refuse_taken(&self, wardrobe: &Wardrobe) -> Result<(), Fault> {
        for garment in self.garments {
            let Some(info) = wardrobe.garments().get(garment) else { continue };
            let help = "give --prefix a text of its own";
            self.refuse(format!("a garment `{garment}`"), &info.provenance, help)?;
        }
        let folder = wardrobe.root().join(CLOTHED).join(self.clothed);
        let made = fs::read(folder.join(PROVENANCE)).ok();
        match made.and_then(|bytes| serde_json::from_slice::<Provenance>(&bytes).ok()) {
            Some(made) => {
                let help = "give the folder of the capture another name";
                self.refuse(format!("a clothed person `{}`", self.clothed), &made, help)?;
            }
            None if fs::symlink_metadata(&folder).is_ok() => return self.unknown(&folder),
            None => {}
        }
        let mut unreadable = wardrobe.faults().iter().filter(|f| f.part == Part::Garment);
        match unreadable.find(|f| self.garments.contains(&f.name)) {
            Some(fault) => self.unknown(&wardrobe.root().join("garments").join(&fault.name)),
            None => Ok(()),
        }
    }

    /// Refuses to replace `what`, unless it is of this capture.
    fn refuse(&self, what: String, made: &Provenance, help: &'static str) -> Result<(), Fault> {
        match Origin::of(made, self.made_of) {
            Origin::This => Ok(()),
            Origin::Earlier if self.replace => Ok(()),
            Origin::Earlier => {
                let help = "if meta.json was corrected, add --replace; if it is another person, give --out another wardrobe, or the folder of the capture another name";
                Err(fault(self.context(), help)(Taken::OfEarlier { what }))
            }
            Origin::Another => {
                let taken = Taken::OfAnother { what, source_of: made.source.clone() };
                Err(fault(self.context(), help)(taken))
            }
        }
    }

    /// Refuses to replace what cannot be known.
    fn unknown(&self, path: &Path) -> Result<(), Fault> {
        let found = io::Error::other(format!("`{}` is in the way", path.display()));
        let help = "it is none of a reconstruction, or cannot be read: move it away";
        Err(fault(self.context(), help)(found))
    }

    fn context(&self) -> String {
        format!("`{}` cannot be added", self.capture.display())
    }
}
