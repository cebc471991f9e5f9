//! `ifg clean`: a garment without isolated elements and holes, its boundary smooth.

use crate::args::{CleanArgs, Openness};
use crate::cancel;
use crate::end::End;
use crate::errors::{self, Told};
use crate::pictures;
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::staging::{OutputError, Staging};
use crate::{announce, table};
use if_core::field::SignedDistance;
use if_core::mesh::{MeshError, TriMesh};
use if_mesh::attributes::{AttributeError, VertexAttributes};
use if_mesh::cleanup::boundary::SmoothParams;
use if_mesh::cleanup::complement::Complement;
use if_mesh::cleanup::components::ComponentParams;
use if_mesh::cleanup::holes::FillParams;
use if_mesh::cleanup::openings::Openings;
use if_mesh::cleanup::{CleanupError, CleanupParams, CleanupReport, Step, cleanup_with};
use if_mesh::file::{Content, MeshFile};
use if_mesh::ply::{self, CoordinateType, PlyMesh, WriteParams};
use if_mesh::sdf::{MeshSdf, SdfError};
use if_mesh::validate::faults;
use miette::{Diagnostic, Report};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Why a mesh was not cleaned.
#[derive(Debug, thiserror::Error, Diagnostic)]
enum CleanError {
    #[error("cannot read `{}`", path.display())]
    #[diagnostic(code(ifg::input::mesh), help("repair it at the place named, or export it again"))]
    Read { path: PathBuf, source: Told },
    #[error("cannot write `{}`: clean meshes are written as .ply", path.display())]
    #[diagnostic(code(ifg::output::extension), help("give --out a name that ends in .ply"))]
    Extension { path: PathBuf },
    #[error("the properties of `{}` do not fit its vertices", path.display())]
    #[diagnostic(code(ifg::input::attributes), help("export it again"))]
    Attributes { path: PathBuf, source: AttributeError },
    #[error("`{}` cannot be projected onto", path.display())]
    #[diagnostic(code(ifg::input::body), help("--project needs a closed --body, wound outwards"))]
    Body { path: PathBuf, source: SdfError },
    #[error("--project needs --body")]
    #[diagnostic(code(ifg::arguments), help("add --body CLOTHED.ply: its surface is what is projected onto"))]
    NoBody,
    #[error("nothing was cleaned")]
    #[diagnostic(code(ifg::input::params), help("look at the options"))]
    Params { source: CleanupError },
    #[error("nothing is left of `{}`", path.display())]
    #[diagnostic(code(ifg::input::empty), help("it has no triangle with an area; look at the file"))]
    Empty { path: PathBuf },
    #[error("the result cannot be written with coordinates of 4 bytes")]
    #[diagnostic(code(ifg::output::range), help("scale the mesh to metres"))]
    Precision { source: MeshError },
}

/// Runs the command.
pub(crate) fn run(args: &CleanArgs) -> Result<End, Report> {
    let start = Instant::now();
    let (out, names) = outputs(args)?;
    let line = Line::new(&args.file.display().to_string(), 0, 1);
    line.say("reading");
    let file = read(&args.file)?;
    let body = args.body.as_deref().map(read).transpose()?;
    let field = match (&body, args.project) {
        (Some(body), true) => Some(
            MeshSdf::closed(body.mesh())
                .map_err(|source| CleanError::Body { path: args.body.clone().unwrap_or_default(), source })?,
        ),
        (None, true) => return Err(CleanError::NoBody.into()),
        _ => None,
    };
    let mesh = file.mesh();
    let mut ply = match file.content() {
        Content::Ply(ply) => ply.clone(),
        _ => PlyMesh { coordinates: CoordinateType::Double, ..PlyMesh::new(mesh.clone()) },
    };
    let notes = notes(&file, &ply);
    let attributes = VertexAttributes::new(mesh.vertices().len(), std::mem::take(&mut ply.vertex_properties))
        .map_err(|source| CleanError::Attributes { path: args.file.clone(), source })?;
    let params = params(args, body.as_ref().map(MeshFile::mesh), ply.coordinates == CoordinateType::Float);
    let say = &mut |step: Step| {
        line.say(match step {
            Step::Manifold => "making it manifold",
            Step::Components => "removing isolated elements",
            Step::Holes => "filling holes",
            Step::Boundary => "smoothing the boundary",
        });
    };
    let field = field.as_ref().map(|f| f as &dyn SignedDistance);
    let clean = cleanup_with(mesh, &attributes, field, &params, say).map_err(|source| CleanError::Params { source })?;
    if clean.mesh.triangles().is_empty() {
        return Err(CleanError::Empty { path: args.file.clone() }.into());
    }
    if cancel::asked() {
        errors::note(&format!("cancelled; `{}` was not written", args.out.display()));
        return Ok(End::Cancelled);
    }
    line.say("writing");
    let staging = Staging::open(&out)?;
    let positions = ply::quantise(clean.mesh.vertices(), ply.coordinates);
    (ply.mesh, ply.polygons, ply.collapsed) = (clean.mesh, None, Vec::new());
    ply.face_properties.clear();
    ply.other_elements.clear();
    ply.vertex_properties = clean.attributes.into_properties();
    let how = WriteParams { coordinates: ply.coordinates, ..WriteParams::default() };
    ply::write_path(&ply, &positions, &how, &staging.path(&names[0]))
        .map_err(|e| OutputError::Mesh { path: args.out.clone(), source: Told::new(&e) })?;
    if let [_, before, after] = &names[..] {
        let written = ply.mesh.with_vertices(positions).map_err(|source| CleanError::Precision { source })?;
        for (mesh, name) in [(mesh, before), (&written, after)] {
            let fault = |source| OutputError::File { path: out.join(name), source };
            pictures::draw_one(mesh, &staging.path(name)).map_err(fault)?;
        }
    }
    let written: Vec<&str> = names.iter().map(String::as_str).collect();
    staging.commit(&written)?;
    drop(line);
    say_it(args, &clean.report, &notes, &names, start.elapsed().as_secs_f64())
}

fn read(path: &Path) -> Result<MeshFile, CleanError> {
    MeshFile::read(path).map_err(|e| CleanError::Read { path: path.into(), source: Told::new(&e) })
}

/// The output folder, and the names of the mesh and of the pictures.
fn outputs(args: &CleanArgs) -> Result<(PathBuf, Vec<String>), Report> {
    let is_ply = args.out.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply"));
    let (Some(name), true) = (args.out.file_name(), is_ply) else {
        return Err(CleanError::Extension { path: args.out.clone() }.into());
    };
    let folder = args.out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if let (Ok(input), Ok(output)) = (args.file.canonicalize(), args.out.canonicalize()) {
        if !output.is_file() {
            return Err(OutputError::InTheWay { path: args.out.clone() }.into());
        }
        if input == output && !args.in_place {
            let written = args.file.display().to_string();
            return Err(OutputError::OverInput { path: args.out.clone(), written }.into());
        }
    }
    let stem = args.out.file_stem().unwrap_or(name).to_string_lossy().into_owned();
    let mut names = vec![name.to_string_lossy().into_owned()];
    if !args.no_pictures {
        names.extend([format!("{stem}_{}", pictures::BEFORE), format!("{stem}_{}", pictures::AFTER)]);
    }
    Ok((folder.to_path_buf(), names))
}

fn params(args: &CleanArgs, body: Option<&TriMesh>, single_precision: bool) -> CleanupParams {
    let Openness { openings, longer, open_at } = &args.open;
    let openings = match (openings, longer, body) {
        (Some(count), _, _) => Openings::Count(*count),
        (_, Some(length), _) => Openings::Longer(*length),
        _ if !open_at.is_empty() => Openings::Near(open_at.clone()),
        (_, _, Some(body)) => Openings::Complement(Box::new(Complement::new(body.clone()))),
        _ => Openings::default(),
    };
    let components = ComponentParams { least_share: args.least_share / 100.0, most: args.parts };
    let (boundary, surface_passes) = (!args.no_smooth, args.surface_passes);
    let smooth = SmoothParams { boundary, surface_passes, ..SmoothParams::default() };
    CleanupParams {
        components: Some(components),
        openings,
        fill: (!args.no_fill).then(FillParams::default),
        smooth: (boundary || surface_passes > 0).then_some(smooth),
        single_precision,
    }
}

/// What a person should know about the input.
fn notes(file: &MeshFile, ply: &PlyMesh) -> Vec<String> {
    let mut notes: Vec<String> = faults(file.mesh()).iter().map(|f| format!("the input: {f}")).collect();
    if matches!(file.content(), Content::Obj(_)) {
        notes.push("texture coordinates, normals and groups of the OBJ file are not kept".into());
    }
    let faces: Vec<&str> = ply.face_properties.iter().map(|p| p.name.as_str()).collect();
    if !faces.is_empty() {
        notes.push(format!("properties of faces are not kept: {}", faces.join(", ")));
    }
    let others: Vec<&str> = ply.other_elements.iter().map(|e| e.name.as_str()).collect();
    if !others.is_empty() {
        notes.push(format!("elements beside vertices and faces are not kept: {}", others.join(", ")));
    }
    if ply.polygons.is_some() {
        notes.push("faces of more than three corners are written as triangles".into());
    }
    notes
}

fn say_it(args: &CleanArgs, report: &CleanupReport, notes: &[String], names: &[String], seconds: f64) -> Result<End, Report> {
    if args.json {
        print_json(&json!({
            "mesh": args.file.display().to_string(),
            "state": "clean",
            "written": names,
            "notes": notes,
            "report": report,
            "seconds": seconds,
        }))?;
        return Ok(End::Clean);
    }
    let mut text = format!("{}\n\n", args.file.display());
    text += &table::cleaned(report, table::coloured());
    text += &announce::notes(notes);
    text += &format!("Wrote {}, {seconds:.2} s\n", names.join(", "));
    print(&text)?;
    Ok(End::Clean)
}
