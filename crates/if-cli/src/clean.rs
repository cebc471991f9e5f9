//! `ifg clean`: a garment without isolated elements and holes, its boundary smooth.

use crate::cancel;
use crate::end::End;
use crate::errors::ErrorChain;
use crate::load::reading_advice;
use crate::not_kept::not_kept;
use crate::output_error::OutputError;
use crate::pictures;
use crate::print::{note_lines, print, print_json};
use crate::progress::Line;
use crate::table;
use crate::target::{Input, Target};
use crate::values::{length, point};
use clap::Args;
use clap::builder::TypedValueParser;
use if_core::field::SignedDistance;
use if_core::math::Point;
use if_core::mesh::{MeshError, TriMesh};
use if_core::monitor::Progress;
use if_mesh::attributes::{AttributeError, VertexAttributes};
use if_mesh::cleanup::{
    CleanupError, CleanupParams, CleanupReport, Complement, ComponentParams, FillParams,
    MAX_PASSES, Openings, SmoothParams, cleanup,
};
use if_mesh::file::{Content, MeshFile};
use if_mesh::obj::{self, Lost};
use if_mesh::ply::{self, CoordinateType, PlyMesh, WriteParams};
use if_mesh::sdf::{MeshSdf, SdfError};
use if_mesh::validate::faults;
use miette::{Diagnostic, Report};
use serde_json::json;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args, Debug, Clone)]
pub(crate) struct CleanArgs {
    /// The garment (.ply, .obj, .glb, .vrm, .gltf), in metres.
    #[arg(value_name = "MESH")]
    pub(crate) file: PathBuf,
    /// The clean garment (.ply), with all properties of the vertices.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) open: Openness,
    /// The clothed body that the garment was cut from: a loop that bounds a large part of the rest
    /// of it is an opening. Instead of --openings, --longer and --open-at, but for --project.
    #[arg(long, value_name = "MESH")]
    pub(crate) body: Option<PathBuf>,
    /// Put patches and smoothed boundaries onto the surface of --body, which must be closed.
    #[arg(long)]
    pub(crate) project: bool,
    /// Drop parts with less than this share of the largest part's area, in percent.
    #[arg(long, value_name = "PERCENT", default_value_t = 1.0)]
    pub(crate) least_share: f64,
    /// Keep at most so many parts, the largest.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..).map(|n| n as usize))]
    pub(crate) parts: Option<usize>,
    /// Leave holes open.
    #[arg(long, conflicts_with = "Openness")]
    pub(crate) no_fill: bool,
    /// Leave the boundary as it is.
    #[arg(long)]
    pub(crate) no_smooth: bool,
    /// Smooth the whole surface but for its boundary, by so many passes of Laplacian smoothing.
    #[arg(long, value_name = "N", default_value_t = 0,
          value_parser = clap::value_parser!(u64).range(0..=MAX_PASSES as u64).map(|n| n as usize))]
    pub(crate) surface_passes: usize,
    /// Allow the output to replace the input.
    #[arg(long)]
    pub(crate) in_place: bool,
    /// Print the report as JSON on stdout, and no table.
    #[arg(long)]
    pub(crate) json: bool,
    /// Do not draw FILE_before.png and FILE_after.png.
    #[arg(long)]
    pub(crate) no_pictures: bool,
}

/// How openings are told from holes; by their shape where nothing is said.
#[derive(Args, Debug, Clone, Default)]
#[group(multiple = false)]
pub(crate) struct Openness {
    /// The garment has so many openings: 4 for a top or a dress, 3 for trousers, 2 for a skirt.
    #[arg(long, value_name = "N")]
    pub(crate) openings: Option<usize>,
    /// Loops from this length are openings, such as 20cm.
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    pub(crate) longer: Option<f64>,
    /// The loop nearest to this point, by its edge or its middle, is an opening; once for each.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub(crate) open_at: Vec<Point>,
}

/// Why a mesh was not cleaned.
#[derive(Debug, thiserror::Error, Diagnostic)]
enum CleanError {
    #[error("cannot read `{}`", path.display())]
    #[diagnostic(code(ifg::input::mesh), help("{advice}"))]
    Read { path: PathBuf, advice: &'static str, source: ErrorChain },
    #[error("the properties of `{}` do not fit its vertices", path.display())]
    #[diagnostic(code(ifg::input::attributes), help("export it again"))]
    Attributes { path: PathBuf, source: AttributeError },
    #[error("`{}` cannot be projected onto", path.display())]
    #[diagnostic(code(ifg::input::body), help("--project needs a closed --body, wound outwards"))]
    Body { path: PathBuf, source: SdfError },
    #[error("--project needs --body")]
    #[diagnostic(
        code(ifg::arguments),
        help("add --body CLOTHED.ply: its surface is what is projected onto")
    )]
    NoBody,
    #[error("--body has no use beside {option}")]
    #[diagnostic(
        code(ifg::arguments),
        help(
            "--body tells openings from holes where nothing else does: leave it out, or {option}, or add --project"
        )
    )]
    IdleBody { option: &'static str },
    #[error("nothing was cleaned")]
    #[diagnostic(code(ifg::input::params), help("look at the options"))]
    Params { source: CleanupError },
    #[error("nothing is left of `{}`", path.display())]
    #[diagnostic(
        code(ifg::input::empty),
        help("it has no triangle with an area; look at the file")
    )]
    Empty { path: PathBuf },
    #[error("the result cannot be written with coordinates of 4 bytes")]
    #[diagnostic(code(ifg::output::range), help("scale the mesh to metres"))]
    Precision { source: MeshError },
}

/// Runs the command.
pub(crate) fn run(args: &CleanArgs) -> Result<End, Report> {
    let start = Instant::now();
    if let (Some(_), false, Some(option)) = (&args.body, args.project, instead_of_body(args)) {
        return Err(CleanError::IdleBody { option }.into());
    }
    let target = target(args)?;
    let line = Line::new(&args.file.display().to_string(), 0, 1);
    line.message("reading");
    let file = read(&args.file)?;
    let body = args.body.as_deref().map(read).transpose()?;
    let field = match (&body, args.project) {
        (Some(body), true) => Some(MeshSdf::closed(body.mesh()).map_err(|source| {
            CleanError::Body { path: args.body.clone().unwrap_or_default(), source }
        })?),
        (None, true) => return Err(CleanError::NoBody.into()),
        _ => None,
    };
    let mesh = file.mesh();
    let (mut ply, mut notes) = content(&file).map_err(|source| CleanError::Read {
        path: args.file.clone(),
        advice: "export it again",
        source: ErrorChain::new(&source),
    })?;
    let attributes =
        VertexAttributes::new(mesh.vertices().len(), std::mem::take(&mut ply.vertex_properties))
            .map_err(|source| CleanError::Attributes { path: args.file.clone(), source })?;
    let params =
        params(args, body.as_ref().map(MeshFile::mesh), ply.coordinates == CoordinateType::Float);
    let monitor = &mut |progress: &Progress<'_>| {
        line.message(match progress.stage {
            "manifold" => "making it manifold",
            "components" => "removing isolated elements",
            "holes" => "filling holes",
            _ => "smoothing",
        });
        if cancel::is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let field = field.as_ref().map(|f| f as &dyn SignedDistance);
    let clean = match cleanup(mesh, &attributes, field, &params, monitor) {
        Err(CleanupError::Cancelled(_)) => {
            drop(line);
            return Ok(cancelled(args));
        }
        other => other.map_err(|source| CleanError::Params { source })?,
    };
    if clean.mesh.triangles().is_empty() {
        return Err(CleanError::Empty { path: args.file.clone() }.into());
    }
    line.message("writing");
    let positions = ply::quantise(clean.mesh.vertices(), ply.coordinates);
    (ply.mesh, ply.polygons, ply.collapsed) = (clean.mesh, None, Vec::new());
    ply.face_properties.clear();
    ply.other_elements.clear();
    ply.vertex_properties = clean.attributes.into_properties();
    let how = WriteParams { coordinates: ply.coordinates, ..WriteParams::default() };
    ply::write_path(&ply, &positions, &how, &target.staged(0))
        .map_err(|e| OutputError::of_mesh(args.out.clone(), e))?;
    if !args.no_pictures {
        let written =
            ply.mesh.with_vertices(positions).map_err(|source| CleanError::Precision { source })?;
        for (mesh, k) in [(mesh, 1), (&written, 2)] {
            let fault = |source| OutputError::File { path: target.path(k), source };
            pictures::draw_one(mesh, &target.staged(k)).map_err(fault)?;
        }
    }
    if cancel::is_requested() {
        drop(line);
        return Ok(cancelled(args));
    }
    let files = target.commit()?;
    drop(line);
    notes.extend(parted_seams(&clean.report));
    let found = clean.report.holes.openings.len();
    if let Some(count) = args.open.openings.filter(|count| found < *count && !args.no_fill) {
        notes.push(format!("{count} openings were asked for, and there are {found}"));
    }
    say_it(args, &clean.report, &notes, &files, start.elapsed().as_secs_f64())
}

fn cancelled(args: &CleanArgs) -> End {
    cancel::end(args.out.display())
}

/// What tells openings in place of --body.
fn instead_of_body(args: &CleanArgs) -> Option<&'static str> {
    let Openness { openings, longer, open_at } = &args.open;
    let given = [
        (openings.is_some(), "--openings"),
        (longer.is_some(), "--longer"),
        (!open_at.is_empty(), "--open-at"),
        (args.no_fill, "--no-fill"),
    ];
    given.into_iter().find(|(is_given, _)| *is_given).map(|(_, option)| option)
}

fn read(path: &Path) -> Result<MeshFile, CleanError> {
    MeshFile::read(path).map_err(|e| {
        let (advice, source) = (reading_advice(&e), ErrorChain::new(&e));
        CleanError::Read { path: path.into(), advice, source }
    })
}

/// The mesh, and the pictures.
fn target(args: &CleanArgs) -> Result<Target, OutputError> {
    let before = format!("_{}", pictures::BEFORE);
    let after = format!("_{}", pictures::AFTER);
    let beside = if args.no_pictures { vec![] } else { vec![&before[..], &after[..]] };
    let mesh = Input { path: &args.file, in_place: Some(args.in_place) };
    let body = args.body.as_deref().map(|path| Input { path, in_place: None });
    let inputs: Vec<Input> = [mesh].into_iter().chain(body).collect();
    Target::open(&args.out, "ply", &beside, &inputs)
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

/// The mesh with the properties of its vertices, and what a person should know about the file.
fn content(file: &MeshFile) -> Result<(PlyMesh, Vec<String>), obj::ReadError> {
    let mut notes: Vec<String> =
        faults(file.mesh()).iter().map(|f| format!("the input: {f}")).collect();
    let triangles =
        PlyMesh { coordinates: CoordinateType::Double, ..PlyMesh::new(file.mesh().clone()) };
    let ply = match file.content() {
        Content::Ply(ply) => ply.clone(),
        Content::Obj(obj) => {
            let (of_file, lost) = obj::to_ply(obj)?;
            notes.push(
                "texture coordinates, materials and groups of the OBJ file are not kept".into(),
            );
            let at_vertices = |l: &&Lost| {
                matches!(l, Lost::Normals { .. } | Lost::Colours { .. } | Lost::Weights { .. })
            };
            notes.extend(lost.iter().filter(at_vertices).map(ToString::to_string));
            PlyMesh { vertex_properties: of_file.vertex_properties, ..triangles }
        }
        Content::Gltf(_) => {
            notes.push("of the glTF file only the triangles are kept".into());
            triangles
        }
        _ => triangles,
    };
    notes.extend(not_kept(&ply));
    Ok((ply, notes))
}

/// A note on parted seams.
fn parted_seams(report: &CleanupReport) -> Option<String> {
    let parted = &report.holes.parted;
    let at = parted.first()?.center.map(|x| format!("{x:.2}")).join(", ");
    Some(format!(
        "{} loops lie within 0.2 mm of others, the first around {at} m: sides of a parted seam, neither openings nor holes, and left as they are; merge their vertices by distance first, and where only one side has a vertex, split the edge of the other side there",
        parted.len()
    ))
}

fn say_it(
    args: &CleanArgs,
    report: &CleanupReport,
    notes: &[String],
    files: &[PathBuf],
    seconds: f64,
) -> Result<End, Report> {
    let names: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
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
    text += &note_lines(notes);
    text += &format!("Wrote {}, {seconds:.2} s\n", names.join(", "));
    print(&text)?;
    Ok(End::Clean)
}
