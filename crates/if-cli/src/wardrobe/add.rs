//! `ifg wardrobe add`.

use super::opening::{Fault, open_or_begin, report};
use crate::cancel;
use crate::end::End;
use crate::errors::{ErrorChain, show};
use crate::outfit_file::file_name_of;
use crate::output_error::OutputError;
use crate::print::{note_lines, print};
use crate::progress::Line;
use crate::values::positive;
use clap::{Args, ValueEnum};
use if_body::SkinWeights;
use if_body::align::carried_field;
use if_mesh::baked::BakeParams;
use if_mesh::file::{Content, MeshFile, file_and_node};
use if_mesh::obj;
use if_outfit::digest::digest;
use if_pipeline::asset::{Beside, BodyRef, GarmentClass, LayerHint, Parts, Provenance};
use if_pipeline::wardrobe::{NewBody, Wardrobe, WardrobeBody};
use miette::{Diagnostic, Report};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[derive(Args, Debug)]
pub(crate) struct AddArgs {
    /// The wardrobe's folder; made where it is missing.
    #[arg(value_name = "WARDROBE")]
    pub(crate) root: PathBuf,
    /// Garments (.ply, .obj, .glb, .vrm, .gltf) in the canonical pose of the body, in metres or with --scale. Each is
    /// called after its file.
    #[arg(value_name = "GARMENTS", required_unless_present = "mesh")]
    pub(crate) garments: Vec<PathBuf>,
    /// The body that the garments were made on.
    #[arg(long, value_name = "NAME")]
    pub(crate) body: String,
    /// Adds the body, with this mesh (.ply, .obj, .glb, .vrm, .gltf), in metres or with
    /// --scale; it may be open.
    #[arg(long, value_name = "FILE")]
    pub(crate) mesh: Option<PathBuf>,
    /// A mesh (.ply, .obj, .glb, .vrm, .gltf) of the same body whose topology other bodies share.
    #[arg(long, value_name = "FILE", requires = "mesh")]
    pub(crate) template: Option<PathBuf>,
    /// Its joints: skeleton.json, or a glTF file with a skin.
    #[arg(long, value_name = "FILE", requires = "mesh")]
    pub(crate) skeleton: Option<PathBuf>,
    /// Factor from the units of all these files to metres, such as 0.01 for centimetres; the
    /// wardrobe is in metres.
    #[arg(long, value_name = "FACTOR", value_parser = positive, default_value_t = 1.0, allow_hyphen_values = true)]
    pub(crate) scale: f64,
    /// Put before each garment's name.
    #[arg(long, value_name = "TEXT", default_value = "")]
    pub(crate) prefix: String,
    /// Where the garments are worn; by default their names tell (jeans, tshirt, coat …).
    #[arg(long, value_enum)]
    pub(crate) class: Option<Class>,
    /// Place within the class, 0 next to the skin; by default their names tell.
    #[arg(long, value_name = "N")]
    pub(crate) order: Option<u8>,
    /// Bake the field of the clothed body beside each garment.
    #[arg(long)]
    pub(crate) bake: bool,
}

/// [`GarmentClass`] as an argument.
#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum Class {
    Legs,
    Skirt,
    Dress,
    Top,
    Outer,
    Other,
}

impl From<Class> for GarmentClass {
    fn from(class: Class) -> Self {
        match class {
            Class::Legs => Self::Legs,
            Class::Skirt => Self::Skirt,
            Class::Dress => Self::Dress,
            Class::Top => Self::Top,
            Class::Outer => Self::Outer,
            Class::Other => Self::Other,
        }
    }
}

/// A file that is no garment.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("cannot add `{file}`")]
#[diagnostic(
    code(ifg::wardrobe::garment),
    help(
        "give a PLY, OBJ or glTF file with triangles; PLY files may have the weights j0..j3 and w0..w3"
    )
)]
struct Unusable {
    file: String,
    source: ErrorChain,
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
    let of_body = [&args.mesh, &args.template, &args.skeleton].into_iter().flatten();
    keep_inputs(&args.root.join("bodies").join(&args.body), of_body)?;
    for path in &args.garments {
        let (file, _) = file_and_node(path);
        keep_inputs(&args.root.join("garments").join(name_of(args, path)), [&file])?;
    }
    let mut wardrobe = open_or_begin(&args.root)?;
    let body = match &args.mesh {
        Some(mesh) => {
            let (template, skeleton) = (args.template.as_deref(), args.skeleton.as_deref());
            let new =
                NewBody { template, skeleton, scale: args.scale, ..NewBody::new(&args.body, mesh) };
            let added = wardrobe
                .add_body(&new)
                .map_err(|e| report(format!("cannot add body `{}`", args.body), e))?;
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
        if cancel::is_requested() {
            return Ok(End::Cancelled);
        }
        let line = Line::new(&path.display().to_string(), k, args.garments.len());
        line.message("adding");
        let added = add(&mut wardrobe, args, path, (&body, loaded.as_ref()), &line);
        drop(line);
        match added {
            Ok(text) => print(&text)?,
            Err(_) if cancel::is_requested() => return Ok(End::Cancelled),
            Err(error) if End::of_error(&error) == End::Busy => return Err(error),
            Err(error) => {
                show(&error);
                end = End::Unusable;
            }
        }
    }
    Ok(if cancel::is_requested() { End::Cancelled } else { end })
}

/// Refuses to replace a folder that holds an input, unless that is one of a wardrobe's own files, which
/// get their names again.
fn keep_inputs<'a>(
    folder: &Path,
    inputs: impl IntoIterator<Item = &'a PathBuf>,
) -> Result<(), OutputError> {
    const OWN: [&str; 4] = ["body.ply", "template.ply", "skeleton.json", "garment.ply"];
    let Ok(whole) = folder.canonicalize() else { return Ok(()) };
    for input in inputs {
        let is_inside = input.canonicalize().is_ok_and(|file| {
            file.strip_prefix(&whole)
                .is_ok_and(|rest| !OWN.iter().any(|own| rest == Path::new(own)))
        });
        if is_inside {
            return Err(OutputError::AroundInput {
                path: folder.into(),
                input: input.display().to_string(),
            });
        }
    }
    Ok(())
}

/// The name of a garment: that of its node, or the stem of its file.
fn name_of(args: &AddArgs, path: &Path) -> String {
    let (file, node) = file_and_node(path);
    let name = match &node {
        Some(node) => file_name_of(node),
        None => file.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
    };
    format!("{}{name}", args.prefix)
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
    (body, loaded): (&BodyRef, Option<&WardrobeBody>),
    mut line: &Line,
) -> Result<String, Report> {
    let unusable = |source| Unusable { file: path.display().to_string(), source };
    let file = MeshFile::read(path).map_err(|e| unusable(ErrorChain::new(&e)))?;
    let (skin, beside, licence, lost) = match file.content() {
        Content::Ply(ply) => {
            let skin = ply
                .vertex_property("j0")
                .map(|_| SkinWeights::from_ply(ply, SkinWeights::MAX_JOINTS))
                .transpose();
            (
                skin.map_err(|e| unusable(ErrorChain::new(&e)))?,
                Beside::of(ply),
                ply.comments.clone(),
                Vec::new(),
            )
        }
        Content::Obj(obj) => {
            let (ply, lost) = obj::to_ply(obj).map_err(|e| unusable(ErrorChain::new(&e)))?;
            let lost = lost.iter().map(ToString::to_string).collect();
            (None, Beside::of(&ply), Vec::new(), lost)
        }
        Content::Gltf(_) => {
            let lost = "of the glTF file only the triangles are kept".to_owned();
            (None, Beside::default(), Vec::new(), vec![lost])
        }
        _ => (None, Beside::default(), Vec::new(), Vec::new()),
    };
    let mesh = file.mesh().scaled(args.scale).map_err(|e| unusable(ErrorChain::new(&e)))?;
    let name = name_of(args, path);
    let said = LayerHint::of_name(&name[args.prefix.len()..]);
    let hint = LayerHint {
        class: args.class.map_or(said.class, Into::into),
        order: args.order.unwrap_or(said.order),
    };
    let is_one_file =
        !matches!(file.content(), Content::Gltf(gltf) if gltf.beside().next().is_some());
    let provenance = Provenance {
        source: path.display().to_string(),
        sha256: is_one_file.then(|| digest(file.bytes()).sha256),
        tool: tool(args.scale),
        licence,
    };
    let baked = loaded
        .map(|body| carried_field(&body.mesh, &mesh, &BakeParams::default(), &mut line))
        .transpose()
        .map_err(|e| unusable(ErrorChain::new(&e)))?;
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
    let info =
        wardrobe.add(&parts).map_err(|e| report(format!("cannot add `{}`", path.display()), e))?;
    let told = format!(
        "{} ({:?}), {} triangles, {} openings\n",
        info.name,
        info.layer.class,
        info.triangles,
        info.openings.len()
    );
    Ok(told + &note_lines(&lost))
}
