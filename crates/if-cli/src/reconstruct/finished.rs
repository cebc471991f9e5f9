//! What a finished run was made of and wrote, so that the same command does not do it again.

use super::{CLOTHED, ReconstructArgs, written::Written};
use crate::errors;
use crate::print::{print, print_json};
use crate::receipt::versions;
use if_outfit::digest::{FileDigest, of_file};
use if_pipeline::BUILD;
use if_pipeline::asset::Provenance;
use if_pipeline::capture::Capture;
use miette::IntoDiagnostic;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

/// The record of a run, in the folder of the clothed person.
const FILE: &str = "receipt.json";
/// Folders of the wardrobe that a run writes into, beside that of the clothed person.
const GARMENTS: &str = "garments";
const BODIES: &str = "bodies";
/// The report, beside the record.
pub(super) const REPORT: &str = "report.json";

/// Digests by file, with `/` between folders.
type Files = BTreeMap<String, FileDigest>;

/// All that decides what a run makes. Equal requests have equal results.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Request {
    /// The build, and versions of everything that numbers depend on.
    tool: BTreeMap<String, String>,
    /// The folder of the capture.
    source: String,
    /// Those that change what is made.
    options: Value,
    inputs: Files,
}

/// A run that is finished.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Finished {
    #[serde(flatten)]
    request: Request,
    pub(super) wrote: Written,
    pub(super) warnings: Vec<String>,
    /// Everything written, from the wardrobe's folder.
    outputs: Files,
}

impl Request {
    /// That of a run; `body` are the files of the template body.
    pub(super) fn new<'a>(
        args: &ReconstructArgs,
        (capture, made_of): (&Capture, &Provenance),
        body: impl Iterator<Item = &'a Path>,
    ) -> io::Result<Self> {
        let mut tool = versions();
        tool.insert("build".into(), BUILD.into());
        let mut inputs = Files::new();
        for path in capture.files() {
            inputs.insert(name(capture.folder(), &path), of_file(&path)?);
        }
        for path in body {
            let file = path.file_name().unwrap_or_default().to_string_lossy();
            inputs.insert(format!("--body/{file}"), of_file(path)?);
        }
        Ok(Self { tool, source: made_of.source.clone(), options: json!(args), inputs })
    }

    /// The run of this very request with the clothed person of that name, if the wardrobe has all that
    /// it wrote, as it wrote it.
    pub(super) fn finished(&self, wardrobe: &Path, clothed: &str) -> Option<Finished> {
        let path = wardrobe.join(CLOTHED).join(clothed).join(FILE);
        let finished: Finished = serde_json::from_slice(&fs::read(path).ok()?).ok()?;
        let is_intact = |(file, digest): (&String, &FileDigest)| digest.is_of(&wardrobe.join(file));
        (finished.request == *self && finished.outputs.iter().all(is_intact)).then_some(finished)
    }

    /// Records in `folder`, which becomes that of the clothed person, what was written.
    pub(super) fn record(
        self,
        folder: &Path,
        wardrobe: &Path,
        wrote: &Written,
        warnings: &[String],
    ) -> io::Result<()> {
        let mut outputs = Files::new();
        let garments = wrote.garments.iter().map(|garment| format!("{GARMENTS}/{garment}"));
        for within in garments.chain([format!("{BODIES}/{}", wrote.body)]) {
            add(&mut outputs, &wardrobe.join(&within), &within)?;
        }
        add(&mut outputs, folder, &wrote.clothed)?;
        let (wrote, warnings) = (wrote.clone(), warnings.to_vec());
        let finished = Finished { request: self, wrote, warnings, outputs };
        fs::write(folder.join(FILE), serde_json::to_vec_pretty(&finished)?)
    }
}

impl Finished {
    /// Tells of the run as it did itself, or, for people, that it is finished.
    pub(super) fn tell(&self, name: &str, args: &ReconstructArgs) -> miette::Result<()> {
        if args.json {
            let path = args.out.join(&self.wrote.clothed).join(REPORT);
            let report = fs::read(path).into_diagnostic()?;
            let report: Map<String, Value> = serde_json::from_slice(&report).into_diagnostic()?;
            print_json(&self.wrote.with(&report))?;
            self.warnings.iter().for_each(|text| errors::note(text));
            return Ok(());
        }
        let mut text = format!("{name}: finished before, skipped (--again does it again)\n");
        self.warnings.iter().for_each(|warning| text += &format!("  {warning}\n"));
        print(&(text + &self.wrote.line(&args.out)))
    }
}

/// Adds the digests of all files in a folder, which they are named from as `within`.
fn add(files: &mut Files, folder: &Path, within: &str) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let name = format!("{within}/{}", name(folder, &path));
        if path.is_dir() {
            add(files, &path, &name)?;
        } else {
            files.insert(name, of_file(&path)?);
        }
    }
    Ok(())
}

/// The name of a file from a folder that it is in.
fn name(folder: &Path, path: &Path) -> String {
    let parts = path.strip_prefix(folder).unwrap_or(path);
    let parts: Vec<_> = parts.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("/")
}
