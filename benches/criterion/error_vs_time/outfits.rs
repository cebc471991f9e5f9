//! Problem 15 of `docs/evidence/solver.md`: outfits that `resolve` makes clean, one parameter off
//! its default at a time. What is clean is clean exactly; the errors are how far vertices moved and
//! how much edges strained.

use crate::record::{Record, Run, timed};
use if_body::mannequin::{MannequinParams, layered};
use if_core::monitor::Silent;
use if_mesh::file::MeshFile;
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{ResolveError, ResolveParams, Split, Tuck, resolve};
use std::path::Path;

const DATA: &str = "../shared/data/body_a";

type Change = fn(&mut ResolveParams);

const CHANGES: [(&str, &str, Change); 30] = [
    ("default", "default", |_| ()),
    ("clearance", "clearance 0.1 mm", |p| p.goal.clearance = 1e-4),
    ("clearance", "clearance 1 mm", |p| p.goal.clearance = 1e-3),
    ("clearance", "clearance 2 mm", |p| p.goal.clearance = 2e-3),
    ("sweeps", "5 sweeps", |p| p.effort.sweeps = 5),
    ("sweeps", "8 sweeps", |p| p.effort.sweeps = 8),
    ("sweeps", "30 sweeps", |p| p.effort.sweeps = 30),
    ("sweeps", "60 sweeps", |p| p.effort.sweeps = 60),
    ("early stop", "tolerance 0.1 mm", |p| p.effort.tolerance = 1e-4),
    ("early stop", "tolerance 1 mm", |p| p.effort.tolerance = 1e-3),
    ("early stop", "no polish", |p| p.effort.polish_rounds = 0),
    ("early stop", "settle 8 rounds", |p| p.effort.settle_rounds = 8),
    ("early stop", "settle 32 rounds", |p| p.effort.settle_rounds = 32),
    ("sample density", "edges over 4 mm", |p| p.effort.long_edge = 4e-3),
    ("sample density", "edges over 16 mm", |p| p.effort.long_edge = 16e-3),
    ("sample density", "edges over 1 m", |p| p.effort.long_edge = 1.0),
    ("step", "step 1 mm", |p| p.effort.contact_step = 1e-3),
    ("step", "step 4 mm", |p| p.effort.contact_step = 4e-3),
    ("stretch", "compliance 1", |p| p.cloth.stretch_compliance = 1.0),
    ("stretch", "compliance 16", |p| p.cloth.stretch_compliance = 16.0),
    ("anchors", "compliance 50", |p| p.cloth.anchor_compliance = 50.0),
    ("anchors", "compliance 800", |p| p.cloth.anchor_compliance = 800.0),
    ("grid", "outward cell 4 mm", |p| p.effort.outward_cell = 4e-3),
    ("grid", "outward cell 10 mm", |p| p.effort.outward_cell = 10e-3),
    ("reach", "influence 60 mm", |p| p.effort.influence = 0.06),
    ("easing", "no easing", |p| p.effort.ease_rounds = 0),
    ("easing", "eased beyond 25 %", |p| p.effort.ease_strain = 0.25),
    ("tuck", "never", |p| p.goal.tuck = Tuck::Never),
    ("tuck", "always", |p| p.goal.tuck = Tuck::Always),
    ("split", "if strained", |p| p.goal.split = Split::IfStrained),
];

/// The built-in scene.
pub(crate) fn demo(record: &mut Record) {
    let resolution = if record.quick { 0.7 } else { 1.0 };
    let mut made = layered(&MannequinParams { resolution, ..Default::default() })
        .into_iter()
        .map(|(n, m)| Layer::new(n, m));
    let body = made.next().unwrap();
    sweep(record, "demo", &Outfit::new(body, made.collect()).unwrap());
}

pub(crate) fn o1(record: &mut Record) {
    real(record, "o1", &["jeans", "tshirt", "cardigan"]);
}

pub(crate) fn o5(record: &mut Record) {
    real(record, "o5", &["trousers", "tshirt", "sweater", "suit_jacket", "coat"]);
}

/// An outfit of `outfits.json`, its garments inner to outer.
fn real(record: &mut Record, name: &str, garments: &[&str]) {
    if record.quick || !Path::new(DATA).is_dir() {
        println!("{name}: skipped; it needs {DATA} and time");
        return;
    }
    let load = |file: String| MeshFile::read(Path::new(&file)).unwrap().mesh().clone();
    let layers =
        garments.iter().map(|g| Layer::new(*g, load(format!("{DATA}/garments/{g}.ply")))).collect();
    sweep(
        record,
        name,
        &Outfit::new(Layer::new("body", load(format!("{DATA}/body_clean.ply"))), layers).unwrap(),
    );
}

fn sweep(record: &mut Record, name: &str, outfit: &Outfit) {
    let changes = if record.quick { &CHANGES[..5] } else { &CHANGES[..] };
    for (method, setting, change) in changes {
        let mut params = ResolveParams::default();
        change(&mut params);
        let (ms, found) = timed(|| resolve(outfit, &params, &mut Silent));
        let (report, clean) = match found {
            Ok(done) => (done.report, true),
            Err(ResolveError::Unresolved { result, .. }) => (result.report, false),
            Err(error) => panic!("{name}, {setting}: {error}"),
        };
        assert!(clean || *method != "default", "{name} is not clean with the default parameters");
        let weight = |layer: &str| {
            let of = outfit
                .garments
                .iter()
                .find(|g| g.name == layer)
                .map_or(0, |g| g.mesh.vertices().len());
            of as f64
        };
        let total: f64 = report.layers.iter().map(|l| weight(&l.name)).sum();
        let moved =
            report.layers.iter().map(|l| l.moved.mean * weight(&l.name)).sum::<f64>() / total;
        let strain =
            (report.layers.iter().map(|l| l.strain.rms.powi(2) * weight(&l.name)).sum::<f64>()
                / total)
                .sqrt();
        let queries = report.layers.iter().map(|l| l.queries as u64).sum();
        let skipped = report.layers.iter().map(|l| l.skipped.queries as u64).sum();
        let setting = if clean { (*setting).to_owned() } else { format!("{setting} (not clean)") };
        for (what, error, unit) in [("moved", moved * 1e3, "mm mean"), ("strained", strain, "rms")]
        {
            let error = if clean { error } else { f64::INFINITY };
            let problem = format!("15 outfit {name}, {what}");
            let run = Run {
                problem: &problem,
                method,
                parameter: setting.clone(),
                unit,
                default: *method == "default",
            };
            record.push(run, ms, error, [queries, skipped]);
        }
    }
}
