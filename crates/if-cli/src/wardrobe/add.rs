//! `ifg wardrobe add`.

use super::args::AddArgs;
use super::{Fault, open_or_begin};
use crate::announce;
use crate::cancel;
use crate::end::End;
use crate::errors::{Told, show};
use crate::print::print;
use crate::progress::Line;
use crate::staging::OutputError;
use if_body::SkinWeights;
use if_body::align::carried_field;
use if_core::monitor::Silent;
use if_mesh::baked::BakeParams;
use if_mesh::file::{Content, MeshFile};
use if_mesh::obj;
use if_outfit::content::content;
use if_pipeline::asset::{Beside, BodyRef, LayerHint, Parts, Provenance};
use if_pipeline::wardrobe::{NewBody, Wardrobe, WardrobeBody};
use miette::{Diagnostic, Report};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Joints that a byte of a PLY file can name.
const JOINTS: usize = 256;

/// A file that is no garment.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("cannot add `{file}`")]
#[diagnostic(
    code(ifg::wardrobe::garment),
    help("give a PLY or OBJ file with triangles; weights are j0..j3 and w0..w3")
)]
struct Unusable {
    file: String,
    source: Told,
}

/// Runs the command. The fault of one garment does not stop the others.
pub(super) fn run(args: &AddArgs) -> Result<End, Report> {
    let mut seen: BTreeMap<String, &PathBuf> = BTreeMap::new();
    for path in &args.garments {
        let name = name_of(args, path);
        if let Some(first) = seen.insert(name.to_lowercase(), path) {
            let [first, second] = [first, path].map(|p| p.display().to_string());
            return Err(OutputError::SameName { first, second, name }.into());
        }
    }
    let mut wardrobe = open_or_begin(&args.root)?;
    let body = match &args.mesh {
        Some(mesh) => {
            let (template, skeleton) = (args.template.as_deref(), args.skeleton.as_deref());
            let new =
                NewBody { template, skeleton, scale: args.scale, ..NewBody::new(&args.body, mesh) };
            let added = wardrobe
                .add_body(&new)
                .map_err(|e| Fault::new(format!("cannot add body `{}`", args.body), &e))?;
            print(&format!("body {}\n", args.body))?;
            added
        }
        None => wardrobe
            .body_info(&args.body)
            .map_err(|e| Fault::new("cannot add garments", &e))?
            .reference(),
    };
    let loaded = match args.bake {
        true => Some(wardrobe.body(&args.body).map_err(|e| Fault::new("cannot bake", &e))?),
        false => None,
    };
    let mut end = End::Clean;
    for (k, path) in args.garments.iter().enumerate() {
        if cancel::asked() {
            return Ok(End::Cancelled);
        }
        let line = Line::new(&path.display().to_string(), k, args.garments.len());
        line.say("adding");
        let added = add(&mut wardrobe, args, path, &body, loaded.as_ref());
        drop(line);
        match added {
            Ok(text) => print(&text)?,
            Err(error) => {
                show(&error);
                end = End::Unusable;
            }
        }
    }
    Ok(if cancel::asked() { End::Cancelled } else { end })
}

/// What a garment is called.
fn name_of(args: &AddArgs, path: &Path) -> String {
    format!("{}{}", args.prefix, path.file_stem().unwrap_or_default().to_string_lossy())
}

/// What made the garment's file, and from which units.
fn tool(scale: f64) -> String {
    let tool = format!("ifg {}", env!("CARGO_PKG_VERSION"));
    if scale == 1.0 { tool } else { format!("{tool}, --scale {scale}") }
}

fn add(
    wardrobe: &mut Wardrobe,
    args: &AddArgs,
    path: &Path,
    body: &BodyRef,
    loaded: Option<&WardrobeBody>,
) -> Result<String, Report> {
    let unusable = |source| Unusable { file: path.display().to_string(), source };
    let file = MeshFile::read(path).map_err(|e| unusable(Told::new(&e)))?;
    let (skin, beside, licence, lost) = match file.content() {
        Content::Ply(ply) => {
            let skin =
                ply.vertex_property("j0").map(|_| SkinWeights::from_ply(ply, JOINTS)).transpose();
            (
                skin.map_err(|e| unusable(Told::new(&e)))?,
                Beside::of(ply),
                ply.comments.clone(),
                Vec::new(),
            )
        }
        Content::Obj(obj) => {
            let (ply, lost) = obj::to_ply(obj).map_err(|e| unusable(Told::new(&e)))?;
            (None, Beside::of(&ply), Vec::new(), lost)
        }
        _ => (None, Beside::default(), Vec::new(), Vec::new()),
    };
    let mesh = file.mesh().scaled(args.scale).map_err(|e| unusable(Told::new(&e)))?;
    let name = name_of(args, path);
    let said = LayerHint::of_name(&name[args.prefix.len()..]);
    let hint = LayerHint {
        class: args.class.map_or(said.class, Into::into),
        order: args.order.unwrap_or(said.order),
    };
    let provenance = Provenance {
        source: path.display().to_string(),
        sha256: Some(content(file.bytes()).sha256),
        tool: tool(args.scale),
        licence,
    };
    let baked = loaded
        .map(|body| carried_field(&body.mesh, &mesh, &BakeParams::default(), &mut Silent))
        .transpose()
        .map_err(|e| unusable(Told::new(&e)))?;
    let parts = Parts {
        name: &name,
        hint,
        body,
        mesh: &mesh,
        skin: skin.as_ref(),
        beside: Some(&beside),
        provenance: &provenance,
        network: None,
        baked: baked.as_ref(),
    };
    let info = wardrobe
        .add(&parts)
        .map_err(|e| Fault::new(format!("cannot add `{}`", path.display()), &e))?;
    let told = format!(
        "{} ({:?}), {} triangles, {} openings\n",
        info.name,
        info.layer.class,
        info.triangles,
        info.openings.len()
    );
    Ok(told + &announce::notes(&lost.iter().map(ToString::to_string).collect::<Vec<_>>()))
}
