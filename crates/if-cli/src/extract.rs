//! `ifg extract`: the surface of a field as a mesh.

use crate::cancel;
use crate::end::End;
use crate::errors::ErrorChain;
use crate::not_kept;
use crate::output_error::OutputError;
use crate::pictures;
use crate::print::{print, print_json};
use crate::progress::Line;
use crate::table;
use crate::target::{Input, Target};
use crate::values::{above_zero, positive};
use clap::Args;
use clap::builder::TypedValueParser;
use if_core::edges::part_count;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Vector, barycentric_point};
use if_core::mesh::{MeshError, TriMesh};
use if_core::monitor::Progress;
use if_mesh::extract::{
    ErrorEstimate, ExtractError, ExtractParams, Extraction, Resolution, Slope, Warning, extract,
    layer_phase,
};
use if_mesh::file::MeshFile;
use if_mesh::index::Bvh;
use if_mesh::measure::{SurfaceDistance, smallest_angles, surface_distance};
use if_mesh::ply::{CoordinateType, PlyMesh, WriteParams, quantise, write_path};
use if_mesh::regular_file;
use if_mesh::sdf::{MeshSdf, SdfError};
use if_mesh::seams::weld;
use if_mesh::validate::faults;
use if_neural::field::NeuralField;
use if_neural::files::read_network;
use if_neural::network::Network;
use if_render::{Image, PALETTE, RenderLayer, View, side_by_side};
use miette::{Diagnostic, Report};
use serde::Serialize;
use serde_json::json;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

#[derive(Args, Debug, Clone)]
pub(crate) struct ExtractArgs {
    /// The field: a closed mesh (.ply, .obj, .glb, .vrm, .gltf), whose signed distance it is, or a network that `ifg
    /// fit` wrote (.safetensors).
    #[arg(value_name = "FIELD")]
    pub(crate) field: PathBuf,
    /// The mesh to write (.ply). Pictures come beside it, as .before.png (of a mesh) and
    /// .after.png, slivers in red.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Side of the cells, with a unit: about the mean edge length that comes out.
    #[arg(long, value_name = "LENGTH", value_parser = above_zero, conflicts_with_all = ["cells", "accuracy"])]
    pub(crate) cell: Option<f64>,
    /// Cells along the longest side.
    #[arg(long, value_name = "N", default_value_t = 128, value_parser = clap::value_parser!(u32).range(1..=16384),
          conflicts_with = "accuracy")]
    pub(crate) cells: u32,
    /// Choose the cells so that triangles are this near to the surface, with a unit.
    #[arg(long, value_name = "LENGTH", value_parser = above_zero)]
    pub(crate) accuracy: Option<f64>,
    /// The smallest cells that --accuracy may choose, with a unit.
    #[arg(long, value_name = "LENGTH", value_parser = above_zero, default_value = "1mm", requires = "accuracy")]
    pub(crate) finest: f64,
    /// Rounds of relaxation, which make slivers into triangles; 0 is plain marching cubes.
    #[arg(long, value_name = "ROUNDS", default_value_t = 3, value_parser = clap::value_parser!(u64).range(0..=100).map(|n| n as usize))]
    pub(crate) relax: usize,
    /// Number of the layer: each has a lattice of its own, so that layers do not touch in
    /// degenerate ways.
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub(crate) layer: usize,
    /// Factor from the units of a mesh to metres; the output keeps its units. Networks are in
    /// metres.
    #[arg(long, value_name = "FACTOR", value_parser = positive, allow_hyphen_values = true)]
    pub(crate) scale: Option<f64>,
    /// Print the report as JSON on stdout, and no tables.
    #[arg(long)]
    pub(crate) json: bool,
    /// Do not draw pictures.
    #[arg(long)]
    pub(crate) no_pictures: bool,
}

/// Why there is no mesh.
#[derive(Debug, thiserror::Error, Diagnostic)]
enum ExtractFault {
    #[error("cannot read field `{}`", path.display())]
    #[diagnostic(
        code(ifg::extract::read),
        help(
            "give a .ply, .obj, .glb, .gltf or .vrm file of a closed mesh, or a .safetensors file that `ifg fit` wrote"
        )
    )]
    Read { path: PathBuf, source: ErrorChain },
    #[error("`{}` cannot be scaled by {scale}", path.display())]
    #[diagnostic(code(ifg::extract::scale), help("look at --scale"))]
    Scale { path: PathBuf, scale: f64, source: MeshError },
    #[error("`{}` has no signed distance", path.display())]
    #[diagnostic(
        code(ifg::extract::field),
        help("the mesh must be closed and wind outwards; an open garment has no inside")
    )]
    Field { path: PathBuf, source: SdfError },
    #[error("`{}` is a network, and cannot be scaled", path.display())]
    #[diagnostic(
        code(ifg::extract::units),
        help("networks are in metres: leave --scale out, or give it to `ifg fit`")
    )]
    Units { path: PathBuf },
    #[error("cannot extract the surface of `{}`", path.display())]
    #[diagnostic(
        code(ifg::extract::surface),
        help("look at --cell, --cells, --accuracy and --finest")
    )]
    Surface { path: PathBuf, source: ExtractError },
    #[error("nothing is left of the surface of `{}` between cells of {:.2} mm", path.display(), 1e3 * cell)]
    #[diagnostic(
        code(ifg::extract::empty),
        help(
            "take smaller cells: look at --cell, --cells and --accuracy; or the field has no surface at all"
        )
    )]
    Empty {
        path: PathBuf,
        /// In metres.
        cell: f64,
    },
    #[error("the surface of `{}` cannot be written in the units of the file", path.display())]
    #[diagnostic(
        code(ifg::extract::range),
        help("look at --scale, or move the mesh to the origin")
    )]
    Range { path: PathBuf, source: MeshError },
}

/// A triangle with a smaller angle is a sliver; in degrees.
const SLIVER: f64 = 10.0;
/// Points on each of the two surfaces, where they are compared.
const SAMPLES: usize = 20_000;

/// What a mesh looks like.
#[derive(Clone, Debug, Serialize)]
struct Looks {
    vertices: usize,
    triangles: usize,
    parts: usize,
    least_angle: f64,
    slivers: usize,
    faults: Vec<String>,
}

impl Looks {
    fn of(mesh: &TriMesh) -> Self {
        let angles = smallest_angles(mesh);
        Self {
            vertices: mesh.vertices().len(),
            triangles: angles.len(),
            parts: weld(mesh).map_or_else(|| part_count(mesh), |w| part_count(&w.mesh)),
            least_angle: angles.iter().copied().fold(180.0, f64::min),
            slivers: angles.iter().filter(|a| **a < SLIVER).count(),
            faults: faults(mesh).iter().map(ToString::to_string).collect(),
        }
    }
}

/// What to say if the surface has more parts than the mesh that the field is of.
fn broken_off(before: Option<&Looks>, after: &Looks) -> Option<String> {
    let before = before?.parts;
    (after.parts > before).then(|| {
        format!(
            "the mesh has {}, the surface {}: thin places came apart; take smaller cells, or remove small parts with `ifg clean`",
            table::counted(before, "part"),
            after.parts
        )
    })
}

/// Runs the command.
pub(crate) fn run(args: &ExtractArgs) -> Result<End, Report> {
    let name =
        args.field.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let target = target(args)?;
    let line = Line::new(&name, 0, 1);
    line.message("reading");
    let source = Source::read(args)?;
    let (field, slope, noise): (&dyn SignedDistance, Slope, f64) = match &source {
        Source::Mesh { field, .. } => (&**field, Slope::Field, 0.0),
        Source::Network(field) => (&**field, SLOPE, ROUNDING * field.frame().aabb().diagonal()),
    };
    let params = ExtractParams { slope, noise, ..params(args) };
    let mut monitor = |p: &Progress| {
        let millimetres = |name| 1e3 * p.measure(name).unwrap_or(0.0);
        let stage = match p.stage {
            "refine" => format!("boxes of {:.2} mm", millimetres("box")),
            "polish" => "vertices".into(),
            "relax" => "relaxing".into(),
            _ => "measuring".into(),
        };
        line.message(&format!(
            "cells of {:.2} mm: {stage}, {} evaluations",
            millimetres("cell"),
            table::count(p.done)
        ));
        if cancel::is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let mut found = match extract(field, &params, &mut monitor) {
        Err(ExtractError::Cancelled(_)) => return Ok(cancelled(args, line)),
        other => {
            other.map_err(|source| ExtractFault::Surface { path: args.field.clone(), source })?
        }
    };
    if found.mesh.triangles().is_empty() {
        return Err(
            ExtractFault::Empty { path: args.field.clone(), cell: found.report.cell }.into()
        );
    }
    line.message("comparing");
    let positions = as_written(args, &mut found, field, &source)?;
    let before = source.mesh();
    let apart = before.map(|before| {
        let (old, new) = (Bvh::new(before), Bvh::new(&found.mesh));
        surface_distance((before, &old), (&found.mesh, &new), SAMPLES, 0)
    });
    let looks = (before.map(Looks::of), Looks::of(&found.mesh));
    line.message("writing");
    write(args, &target, &source, &found, &positions)?;
    if cancel::is_requested() {
        return Ok(cancelled(args, line));
    }
    let files = target.commit()?;
    drop(line);
    let warnings = found.report.warnings.iter().map(ToString::to_string);
    let broken_off = broken_off(looks.0.as_ref(), &looks.1);
    let notes: Vec<String> = source.notes().into_iter().chain(warnings).chain(broken_off).collect();
    if args.json {
        let (before, after) = looks;
        // Paths need not be UTF-8, as JSON must.
        let files: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
        print_json(&json!({
            "field": args.field.display().to_string(), "files": files, "before": before, "after": after, "distance": apart,
            "report": found.report, "notes": notes,
        }))?;
    } else {
        print(&told(&files, &looks, apart.as_ref(), &found, &notes))?;
    }
    let is_inaccurate =
        found.report.warnings.iter().any(|w| matches!(w, Warning::Inaccurate { .. }));
    Ok(if is_inaccurate { End::NotClean } else { End::Clean })
}

fn cancelled(args: &ExtractArgs, line: Line) -> End {
    drop(line);
    cancel::end(args.out.display())
}

/// Values of a network, in single precision, are off by this share of its cube's diagonal: some
/// roundings of 6e-8 in each layer.
const ROUNDING: f64 = 1e-6;

/// Of networks. Their own bound is for the steepest place of the whole cube: for a fitted body the
/// same mesh takes 13 % fewer evaluations with this, and an eighth of the cells that cannot be told
/// empty. Where it is too low, values show it, and a larger one is taken.
const SLOPE: Slope = Slope::Sampled { points: 1024, factor: 1.5, seed: 0 };

/// What has a surface.
enum Source {
    Mesh { mesh: TriMesh, field: Box<MeshSdf>, coordinates: CoordinateType },
    Network(Box<NeuralField<Network>>),
}

/// Whether the field is a network, by its name.
fn is_network(field: &Path) -> bool {
    field.extension().is_some_and(|e| e.eq_ignore_ascii_case("safetensors"))
}

impl Source {
    fn read(args: &ExtractArgs) -> Result<Self, ExtractFault> {
        let path = || args.field.clone();
        let read = |e: &dyn std::error::Error| ExtractFault::Read {
            path: path(),
            source: ErrorChain::new(e),
        };
        if is_network(&args.field) {
            if args.scale.is_some() {
                return Err(ExtractFault::Units { path: path() });
            }
            let file = regular_file::open(&args.field).map_err(|e| read(&e))?;
            let (network, frame) = read_network(file).map_err(|e| read(&e))?;
            return Ok(Self::Network(Box::new(
                NeuralField::new(network, frame).map_err(|e| read(&e))?,
            )));
        }
        let file = MeshFile::read(&args.field).map_err(|e| read(&e))?;
        let scale = args.scale.unwrap_or(1.0);
        let mesh = file.mesh().scaled(scale).map_err(|source| ExtractFault::Scale {
            path: path(),
            scale,
            source,
        })?;
        let field =
            MeshSdf::sewn(&mesh).map_err(|source| ExtractFault::Field { path: path(), source })?;
        let coordinates =
            if file.is_single_precision() { CoordinateType::Float } else { CoordinateType::Double };
        Ok(Self::Mesh { mesh, field: Box::new(field), coordinates })
    }

    /// What a person should know about it.
    fn notes(&self) -> Vec<String> {
        match self {
            Self::Mesh { field, .. } => not_kept::assumed(field),
            Self::Network(_) => Vec::new(),
        }
    }

    fn mesh(&self) -> Option<&TriMesh> {
        match self {
            Self::Mesh { mesh, .. } => Some(mesh),
            Self::Network(_) => None,
        }
    }

    /// How positions are written: as those of the mesh; a network's values are in single precision.
    fn coordinates(&self) -> CoordinateType {
        match self {
            Self::Mesh { coordinates, .. } => *coordinates,
            Self::Network(_) => CoordinateType::Float,
        }
    }
}

fn params(args: &ExtractArgs) -> ExtractParams {
    let resolution = match (args.cell, args.accuracy) {
        (Some(cell), _) => Resolution::Cell(cell),
        (None, Some(error)) => Resolution::Accuracy { error, finest: args.finest },
        (None, None) => Resolution::Cells(args.cells),
    };
    ExtractParams {
        resolution,
        relax: args.relax,
        phase: layer_phase(args.layer),
        ..ExtractParams::default()
    }
}

/// The files to write: the mesh, then pictures of what there was and of what came out.
fn target(args: &ExtractArgs) -> Result<Target, OutputError> {
    let is_network = is_network(&args.field);
    let beside: &[&str] = match (args.no_pictures, is_network) {
        (true, _) => &[],
        (false, true) => &[".after.png"],
        (false, false) => &[".before.png", ".after.png"],
    };
    Target::open(&args.out, "ply", beside, &[Input { path: &args.field, in_place: None }])
}

/// Puts the vertices where a reader of the file will find them, and measures the error there.
/// Returns the positions in the units of the file.
fn as_written(
    args: &ExtractArgs,
    found: &mut Extraction,
    field: &dyn SignedDistance,
    source: &Source,
) -> Result<Vec<Point>, ExtractFault> {
    let scale = args.scale.unwrap_or(1.0);
    let positions: Vec<Point> = found.mesh.vertices().iter().map(|p| p / scale).collect();
    let positions = quantise(&positions, source.coordinates());
    let written = found.mesh.with_vertices(positions.iter().map(|p| p * scale).collect());
    let written =
        written.map_err(|source| ExtractFault::Range { path: args.field.clone(), source })?;
    if written != found.mesh {
        found.mesh = written;
        let report = &mut found.report;
        let checked = args.accuracy.map_or(report.error.checked, |_| usize::MAX);
        report.error = error_of(field, &found.mesh, checked);
        let is_told = report.warnings.iter().any(|w| matches!(w, Warning::Inaccurate { .. }));
        if let Some(requested) = args.accuracy.filter(|a| !is_told && report.error.worst() > *a) {
            report.warnings.push(Warning::Inaccurate {
                requested,
                reached: report.error.worst(),
                cell: report.cell,
            });
        }
    }
    Ok(positions)
}

/// The error at so many vertices and centres of triangles, or at all where there are fewer, spread
/// evenly over them.
fn error_of(field: &dyn SignedDistance, mesh: &TriMesh, checked: usize) -> ErrorEstimate {
    /// A field that is flatter is no distance here: its value stands as it is.
    const FLAT: f64 = 0.1;
    let chosen = |n: usize| (0..checked.min(n)).map(move |k| k * n / checked.min(n));
    let measure = |points: Vec<Point>| {
        let mut samples =
            vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; points.len()];
        field.samples(&points, &mut samples);
        let errors = samples.iter().map(|s| s.distance.abs() / s.gradient.norm().max(FLAT));
        let (most, squares) =
            errors.fold((0.0, 0.0), |(m, q): (f64, f64), e| (m.max(e), q + e * e));
        (most, (squares / points.len().max(1) as f64).sqrt())
    };
    let vertices: Vec<Point> = chosen(mesh.vertices().len()).map(|v| mesh.vertices()[v]).collect();
    let centers =
        chosen(mesh.triangles().len()).map(|t| barycentric_point(mesh.corners(t), [1.0 / 3.0; 3]));
    let checked = vertices.len();
    let ((vertex_max, vertex_rms), (center_max, center_rms)) =
        (measure(vertices), measure(centers.collect()));
    ErrorEstimate { vertex_max, vertex_rms, center_max, center_rms, checked }
}

/// Writes the mesh, in the units of the field, and the pictures.
fn write(
    args: &ExtractArgs,
    target: &Target,
    source: &Source,
    found: &Extraction,
    positions: &[Point],
) -> Result<(), OutputError> {
    let fault = |k, source| OutputError::File { path: target.path(k), source };
    let params = WriteParams { coordinates: source.coordinates(), ..WriteParams::default() };
    write_path(&PlyMesh::new(found.mesh.clone()), positions, &params, &target.staged(0))
        .map_err(|e| OutputError::of_mesh(args.out.clone(), e))?;
    if !args.no_pictures {
        for (k, mesh) in source.mesh().into_iter().chain([&found.mesh]).enumerate() {
            let fault = |source| fault(k + 1, source);
            pictures::write(&picture(mesh), &target.staged(k + 1)).map_err(fault)?;
        }
    }
    Ok(())
}

/// Three views of a mesh, slivers in red.
fn picture(mesh: &TriMesh) -> Image {
    const SIZE: [u32; 2] = [480, 640];
    let slivers: Vec<u32> = smallest_angles(mesh)
        .iter()
        .enumerate()
        .filter(|a| *a.1 < SLIVER)
        .map(|a| a.0 as u32)
        .collect();
    let layer = RenderLayer { mesh, color: PALETTE[1], highlight: &slivers };
    side_by_side(&[layer], &[View::FRONT, View::THREE_QUARTER, View::BACK], SIZE[0], SIZE[1])
}

/// What was done, for people.
fn told(
    files: &[PathBuf],
    (before, after): &(Option<Looks>, Looks),
    apart: Option<&SurfaceDistance>,
    found: &Extraction,
    notes: &[String],
) -> String {
    let report = &found.report;
    let count = table::count;
    let mm = |metres: f64| format!("{:.4}", 1e3 * metres);
    // A network has no mesh before.
    let row = |name, of: &dyn Fn(&Looks) -> String| {
        (name, before.as_ref().map_or_else(|| "-".into(), of), of(after))
    };
    let rows = [
        row("vertices", &|l| count(l.vertices)),
        row("triangles", &|l| count(l.triangles)),
        row("parts", &|l| count(l.parts)),
        row("least angle, degrees", &|l| format!("{:.1}", l.least_angle)),
        row("triangles below 10 degrees", &|l| count(l.slivers)),
        row("faults", &|l| count(l.faults.len())),
    ];
    let mut text = table::columns("Before -> after", ["", "before", "after"], &rows);
    let e = &report.evaluations;
    let cells: usize = report.cells.iter().map(|c| *c as usize).product();
    let mut done = vec![
        (
            "cells",
            format!(
                "{} of {} mm, {:.2} % skipped",
                count(cells),
                mm(report.cell),
                100.0 * report.skipped
            ),
            String::new(),
        ),
        ("field evaluated", count(e.refine), "at nodes".into()),
        ("", count(e.polish), "for vertices".into()),
        ("", count(e.relax + e.check), "to relax and measure".into()),
        (
            "error at vertices, mm",
            mm(report.error.vertex_max),
            format!("largest of {}", report.error.checked),
        ),
        (
            "error of triangles, mm",
            mm(report.error.center_max),
            format!("rms {}", mm(report.error.center_rms)),
        ),
    ];
    if report.moved_back > 0 {
        let why = "so that no triangles meet".to_owned();
        done.push(("vertices moved back", count(report.moved_back), why));
    }
    if let Some(apart) = apart {
        let largest = format!("mean; largest {:.3}", apart.hausdorff_mm);
        done.push(("distance of the meshes, mm", format!("{:.4}", apart.chamfer_mm), largest));
    }
    done.push(("seconds", format!("{:.2}", report.seconds.total()), String::new()));
    text += &table::columns("What was done", ["", "", ""], &done);
    for attempt in &report.attempts {
        text +=
            &format!("tried cells of {} mm: error {} mm\n", mm(attempt.cell), mm(attempt.error));
    }
    for fault in &after.faults {
        text += &format!("note: {fault}\n");
    }
    for note in notes {
        text += &format!("note: {note}\n");
    }
    let names: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
    text + &format!("wrote {}\n", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes::icosphere;

    #[test]
    fn parts_that_came_apart_are_noted() {
        let ball = icosphere(0.1, 1);
        let n = ball.vertices().len() as u32;
        let beside = ball.vertices().iter().map(|p| p + Vector::x());
        let vertices = ball.vertices().iter().copied().chain(beside).collect();
        let others = ball.triangles().iter().map(|t| t.map(|v| v + n));
        let two = TriMesh::new(vertices, ball.triangles().iter().copied().chain(others).collect());
        let [one, two] = [Looks::of(&ball), Looks::of(&two.unwrap())];
        assert_eq!((one.parts, two.parts), (1, 2));
        let note = broken_off(Some(&one), &two).unwrap();
        assert!(note.contains("1 part, the surface 2"), "{note}");
        assert_eq!([broken_off(Some(&two), &one), broken_off(None, &two)], [None, None]);
    }
}
