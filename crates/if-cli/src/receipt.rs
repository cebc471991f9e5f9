//! `receipt.json`: inputs, parameters, outputs, and the build of the program.
//!
//! Two runs on the same input with the same parameters give the same bytes, but for `timings`.

use crate::file_record::{InputFile, OutputFile};
use crate::outfit_file::{LayerSpec, OutfitSpec};
use crate::phases::Phase;
use if_mesh::file::MeshFile;
use if_outfit::digest::{digest, of_file};
use if_outfit::report::ResolveReport;
use if_outfit::{BUILD, Cleanness};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::Path;

/// The name of the file.
pub(crate) const FILE: &str = "receipt.json";

/// Everything that decides the result. Equal requests have equal results.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Request {
    /// Versions.
    pub(crate) tool: Value,
    /// As `resolve` got them.
    pub(crate) params: Value,
    /// From the units of the files to metres.
    pub(crate) scale: f64,
    /// The body, then the garments, inner to outer, then what these name: buffers, material libraries
    /// and textures.
    pub(crate) inputs: Vec<InputFile>,
}

/// Seconds spent, in the order spent.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timings {
    pub(crate) read: f64,
    pub(crate) resolve: f64,
    pub(crate) write: f64,
    pub(crate) pictures: f64,
    pub(crate) total: f64,
}

impl Request {
    /// The request of an outfit with these files (the body's first) and the files that they name.
    pub(crate) fn new<'f>(
        spec: &OutfitSpec,
        files: impl Iterator<Item = &'f MeshFile>,
        companions: impl Iterator<Item = InputFile>,
    ) -> Self {
        let input = |(layer, file): (&LayerSpec, &MeshFile)| InputFile {
            layer: layer.name.clone(),
            file: layer.written.clone(),
            content: digest(file.bytes()),
        };
        let inputs = spec.layers().zip(files).map(input).chain(companions).collect();
        Self { tool: tool(), params: json!(spec.params), scale: spec.scale, inputs }
    }

    /// The state in which this very request ended clean, if `out` holds its receipt, with all of
    /// `outputs` as it says.
    pub(crate) fn finished(&self, out: &Path, outputs: &[String]) -> Option<Cleanness> {
        let receipt = read(&out.join(FILE))?;
        let request = reread(self)?;
        let state = serde_json::from_value(receipt["state"].clone()).ok()?;
        let same = ["tool", "params", "scale", "inputs"]
            .iter()
            .all(|key| receipt.get(key) == request.get(key));
        let written = receipt["outputs"].as_array().map_or(&[][..], Vec::as_slice);
        let intact = |output: &Value| {
            let found = output["file"].as_str().and_then(|file| of_file(&out.join(file)).ok());
            found.is_some_and(|c| output["sha256"] == json!(c.sha256))
        };
        let all_there = outputs.iter().all(|name| written.iter().any(|o| o["file"] == json!(name)));
        let is_finished =
            same && state != Cleanness::NotClean && all_there && written.iter().all(intact);
        is_finished.then_some(state)
    }
}

/// What a receipt holds.
pub(crate) struct Receipt<'a> {
    pub(crate) outfit: &'a str,
    pub(crate) state: Cleanness,
    pub(crate) request: &'a Request,
    pub(crate) outputs: &'a [OutputFile],
    pub(crate) notes: &'a [String],
    pub(crate) report: &'a ResolveReport,
    pub(crate) timings: &'a Timings,
    /// If they were recorded.
    pub(crate) phases: Option<&'a Phase>,
    /// In bytes; `None` where the system does not count it.
    pub(crate) peak_memory: Option<u64>,
}

impl Receipt<'_> {
    /// The text of the file.
    pub(crate) fn text(&self) -> Result<String, serde_json::Error> {
        let Self { request, report, timings, phases, peak_memory, .. } = self;
        let mut measures = serde_json::to_value(report)?;
        drop_seconds(&mut measures);
        let layers: Map<String, Value> =
            report.layers.iter().map(|l| (l.name.clone(), json!(l.seconds))).collect();
        let mut receipt = json!({
            "receipt": 1,
            "outfit": self.outfit,
            "state": self.state,
            "tool": request.tool,
            "params": request.params,
            "scale": request.scale,
            "inputs": request.inputs,
            "outputs": self.outputs,
            "notes": self.notes,
            "report": measures,
            "timings": {
                "read": timings.read,
                "resolve": timings.resolve,
                "verify_before": report.before.seconds,
                "layers": layers,
                "verify_after": report.after.seconds,
                "write": timings.write,
                "pictures": timings.pictures,
                "total": timings.total,
                "threads": rayon::current_num_threads(),
            },
        });
        if let Some(bytes) = peak_memory {
            receipt["timings"]["peak_memory"] = json!(bytes);
        }
        if let Some(phases) = phases {
            receipt["timings"]["phases"] = json!(phases);
        }
        Ok(serde_json::to_string_pretty(&receipt)? + "\n")
    }
}

/// The build, and versions of everything that numbers depend on.
pub(crate) fn tool() -> Value {
    let mut tool = json!(BTreeMap::from(PROGRAM));
    tool["crates"] = json!(crates().collect::<BTreeMap<_, _>>());
    tool
}

/// The same in one list.
pub fn versions() -> BTreeMap<String, String> {
    PROGRAM.into_iter().chain(crates()).map(|(name, v)| (name.into(), v.into())).collect()
}

/// What this program was built of and for.
const PROGRAM: [(&str, &str); 4] = [
    ("ifg", env!("CARGO_PKG_VERSION")),
    ("build", BUILD),
    ("target", env!("IFG_TARGET")),
    ("rustc", env!("IFG_RUSTC")),
];

/// Names and versions of crates that can change a result.
fn crates() -> impl Iterator<Item = (&'static str, &'static str)> {
    env!("IFG_CRATES").split(',').filter_map(|c| c.split_once(' '))
}

/// Times differ between runs; they stand in `timings`.
fn drop_seconds(value: &mut Value) {
    match value {
        Value::Object(map) => {
            map.remove("seconds");
            map.values_mut().for_each(drop_seconds);
        }
        Value::Array(items) => items.iter_mut().for_each(drop_seconds),
        _ => {}
    }
}

fn read(path: &Path) -> Option<Value> {
    serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()
}

/// A value as it comes back from a file: numbers may lose their last bit on the way.
fn reread(value: &impl Serialize) -> Option<Value> {
    serde_json::from_str(&serde_json::to_string(value).ok()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes the receipt of an outfit that is clean everywhere.
    fn write(folder: &Path, request: &Request, outputs: &[OutputFile]) {
        let receipt = Receipt {
            outfit: "o",
            state: Cleanness::Everywhere,
            request,
            outputs,
            notes: &[],
            report: &ResolveReport::default(),
            timings: &Timings::default(),
            phases: None,
            peak_memory: None,
        };
        std::fs::write(folder.join(FILE), receipt.text().unwrap()).unwrap();
    }

    #[test]
    fn an_outfit_of_another_build_is_not_finished() {
        let out = tempfile::tempdir().unwrap();
        let of_build = |build: &str| {
            let mut tool = tool();
            tool["build"] = json!(build);
            Request { tool, params: json!({}), scale: 1.0, inputs: vec![] }
        };
        let request = of_build(BUILD);
        write(out.path(), &request, &[]);
        assert_eq!(request.finished(out.path(), &[]), Some(Cleanness::Everywhere));
        assert_eq!(of_build("0.1.0+0").finished(out.path(), &[]), None);
    }

    #[test]
    fn an_outfit_in_other_units_or_with_more_outputs_is_not_finished() {
        let out = tempfile::tempdir().unwrap();
        let scaled =
            |scale: f64| Request { tool: tool(), params: json!({}), scale, inputs: vec![] };
        let request = scaled(0.1);
        std::fs::write(out.path().join("shirt.ply"), "a shirt").unwrap();
        let content = digest(b"a shirt");
        write(
            out.path(),
            &request,
            &[OutputFile { file: "shirt.ply".into(), content, unchanged: None }],
        );
        let finished = |request: &Request, names: &[&str]| {
            let names: Vec<String> = names.iter().map(ToString::to_string).collect();
            request.finished(out.path(), &names).is_some()
        };
        assert!(finished(&request, &["shirt.ply"]));
        // The same numbers in other units, and a picture that was not drawn.
        assert!(!finished(&scaled(0.01), &["shirt.ply"]));
        assert!(!finished(&request, &["shirt.ply", "before.png"]));
    }

    #[test]
    fn a_receipt_holds_times_in_one_place_only() {
        let request = Request { tool: tool(), params: json!({}), scale: 1.0, inputs: vec![] };
        let with = |seconds: f64| {
            let mut report = ResolveReport::default();
            report.seconds = seconds;
            let timings = Timings { read: seconds, ..Default::default() };
            let phases = Phase { wall: seconds, ..Default::default() };
            let receipt = Receipt {
                outfit: "o",
                state: Cleanness::Everywhere,
                request: &request,
                outputs: &[],
                notes: &[],
                report: &report,
                timings: &timings,
                phases: Some(&phases),
                peak_memory: Some(seconds as u64),
            };
            let mut value: Value = serde_json::from_str(&receipt.text().unwrap()).unwrap();
            value.as_object_mut().unwrap().remove("timings").unwrap();
            value
        };
        assert_eq!(with(1.0), with(2.0));
        assert!(with(1.0)["tool"]["crates"]["if-pipeline"].is_string());
    }
}
