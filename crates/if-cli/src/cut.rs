//! `ifg cut`: a labelled mesh, cut into one mesh for each label along smooth lines.

use crate::cancel;
use crate::end::End;
use crate::errors::ErrorChain;
use crate::not_kept::not_kept;
use crate::output_error::OutputError;
use crate::pictures;
use crate::print::{note_lines, print, print_json};
use crate::progress::Line;
use crate::staging::Staging;
use crate::table::count;
use crate::target::is_same;
use crate::values::{label_name, length};
use clap::Args;
use if_core::edges::{Edges, NONE, part_count};
use if_core::mesh::TriMesh;
use if_core::monitor::Progress;
use if_mesh::attributes::{AttributeError, Source, VertexAttributes};
use if_mesh::labels::{
    CutParams, LabelError, LabelScores, LabelVotes, Piece, SmoothLabelParams, UNDECIDED, cut,
    smooth_labels,
};
use if_mesh::ply::{self, Column, PlyMesh, Property, WriteParams};
use if_mesh::seams::{Welded, weld};
use if_mesh::validate::suspicious_units;
use if_render::{PALETTE, RenderLayer, View, side_by_side};
use miette::{Diagnostic, Report};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Args, Debug, Clone)]
pub(crate) struct CutArgs {
    /// The mesh (.ply), in metres, with a label at each vertex.
    #[arg(value_name = "MESH")]
    pub(crate) mesh: PathBuf,
    /// Output folder: NAME.ply for each label, and pictures.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// The vertex property that holds the labels: 0 unknown, 1 skin, garments from 2 on.
    #[arg(long, value_name = "PROPERTY", default_value = "label")]
    pub(crate) labels: String,
    /// What a label is called, such as 2=trousers; once for each.
    #[arg(long = "name", value_name = "LABEL=NAME", value_parser = label_name)]
    pub(crate) names: Vec<(u8, String)>,
    /// How far labels are smoothed, with a unit; 0 cuts between the vertices as they are labelled.
    #[arg(long, value_name = "LENGTH", value_parser = length, default_value = "30mm")]
    pub(crate) smooth: f64,
    /// Print the report as JSON on stdout, and no table.
    #[arg(long)]
    pub(crate) json: bool,
    /// Do not draw labels_before.png and labels_after.png.
    #[arg(long)]
    pub(crate) no_pictures: bool,
}

/// The labelled mesh, and the pieces.
const PICTURES: [&str; 2] = ["labels_before.png", "labels_after.png"];

/// Why a mesh was not cut.
#[derive(Debug, thiserror::Error, Diagnostic)]
enum CutFault {
    #[error("cannot read `{}`", path.display())]
    #[diagnostic(
        code(ifg::input::mesh),
        help(
            "labels stand in PLY files; look at the path, repair the file at the place named, or export it again"
        )
    )]
    Read { path: PathBuf, source: ErrorChain },
    #[error("`{}` has no vertex property `{name}` of one number each", path.display())]
    #[diagnostic(
        code(ifg::input::labels),
        help("name the property with --labels; the file has: {have}")
    )]
    NoLabels { path: PathBuf, name: String, have: String },
    #[error("vertex {vertex} has the label {value}")]
    #[diagnostic(
        code(ifg::input::labels),
        help("labels are whole numbers from 0 (unknown) to 254")
    )]
    Label { vertex: usize, value: f64 },
    #[error("all vertices have the label 0, which is unknown")]
    #[diagnostic(code(ifg::input::labels), help("name the right property with --labels"))]
    NothingKnown,
    #[error("the labels cannot be made smooth")]
    #[diagnostic(code(ifg::input::labels), help("try another --smooth"))]
    Smooth { source: LabelError },
    #[error("the mesh cannot be cut")]
    #[diagnostic(code(ifg::input::labels), help("look at the mesh and its labels"))]
    Cut { source: LabelError },
    #[error("the properties of `{}` do not fit its vertices", path.display())]
    #[diagnostic(code(ifg::input::attributes), help("export it again"))]
    Attributes { path: PathBuf, source: AttributeError },
    #[error("label {label} is to be called `{name}`")]
    #[diagnostic(
        code(ifg::input::names),
        help(
            "names become names of files: use letters, digits, `_`, `-` and `.`, and each name once"
        )
    )]
    Name { label: u8, name: String },
    #[error("label {label} is to be called `{name}`, but no vertex of `{}` has it", path.display())]
    #[diagnostic(
        code(ifg::input::names),
        help("leave that --name out; the labels of the file are {have}")
    )]
    NoSuchLabel { path: PathBuf, label: u8, name: String, have: String },
    #[error("label {label} is to be called `{first}` and `{second}`")]
    #[diagnostic(code(ifg::input::names), help("give --name once for each label"))]
    TwoNames { label: u8, first: String, second: String },
    #[error("no triangle of `{}` has a label", path.display())]
    #[diagnostic(
        code(ifg::input::labels),
        help("labels stand only at vertices that no triangle uses; look at the mesh")
    )]
    NothingCut { path: PathBuf },
}

/// What the table says of a piece.
#[derive(Serialize)]
struct Row {
    label: u8,
    name: String,
    file: String,
    vertices: usize,
    triangles: usize,
    area_m2: f64,
    components: usize,
    borders: usize,
}

/// What is in no piece.
#[derive(Serialize)]
struct Undecided {
    vertices: usize,
    triangles: usize,
    area_m2: f64,
    components: usize,
}

/// A label that has no piece.
#[derive(Serialize)]
struct Lost {
    label: u8,
    name: String,
    /// Vertices that had it.
    vertices: usize,
}

/// What became of the labels.
#[derive(Serialize)]
struct Fates {
    #[serde(rename = "labels_changed")]
    changed: usize,
    #[serde(rename = "labels_filled_in")]
    decided: usize,
    #[serde(rename = "labels_lost")]
    lost: Vec<Lost>,
    undecided: Undecided,
}

/// What --json prints.
#[derive(Serialize)]
struct Cutting {
    mesh: String,
    out: String,
    pieces: Vec<Row>,
    vertices: usize,
    #[serde(flatten)]
    fates: Fates,
    notes: Vec<String>,
    seconds: f64,
}

/// Runs the command.
pub(crate) fn run(args: &CutArgs) -> Result<End, Report> {
    let start = Instant::now();
    let staging = Staging::open(&args.out)?;
    let line = Line::new(&args.mesh.display().to_string(), 0, 1);
    line.message("reading");
    let mut ply = ply::read_path(&args.mesh)
        .map_err(|e| CutFault::Read { path: args.mesh.clone(), source: ErrorChain::new(&e) })?;
    let given = labels(args, &ply)?;
    let names = Names::new(args, &given)?;
    for name in names.of.values() {
        let path = args.out.join(format!("{name}.ply"));
        if path.canonicalize().is_ok_and(|file| is_same(&args.mesh, &file)) {
            return Err(OutputError::OverInput {
                path,
                written: args.mesh.display().to_string(),
                option: false,
            }
            .into());
        }
    }
    line.message("smoothing");
    let Dense { present, places } = Dense::new(&given);
    // Seams of exporters are no boundary of labels: both sides have the same scores.
    let welded = weld(&ply.mesh);
    let votes = LabelVotes::from_labels(&places, present.len());
    let joined = welded.as_ref().map(|welded| (&welded.mesh, joined(&votes, welded)));
    let (mesh, joined) = joined.as_ref().map_or((&ply.mesh, &votes), |(mesh, votes)| (mesh, votes));
    let params = SmoothLabelParams { length: args.smooth, ..SmoothLabelParams::default() };
    let monitor = &mut |_: &Progress<'_>| {
        if cancel::is_requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let scores = match smooth_labels(mesh, joined, &params, monitor) {
        Err(LabelError::Cancelled(_)) => return Ok(cancelled(args, line)),
        other => other.map_err(|source| CutFault::Smooth { source: of_label(source, &present) })?,
    };
    let scores = match &welded {
        Some(welded) => spread(&scores, &votes, welded),
        None => scores,
    };
    line.message("cutting");
    let mut pieces = cut(&ply.mesh, &scores, &CutParams::default())
        .map_err(|source| CutFault::Cut { source })?;
    pieces.iter_mut().for_each(|p| p.label = present[usize::from(p.label)]);
    let winners: Vec<u8> =
        scores.winners().iter().map(|place| present[usize::from(*place)]).collect();
    let fates = Fates::new(&given, &winners, &pieces, &names);
    pieces.retain(|p| p.label != UNDECIDED);
    if pieces.is_empty() {
        return Err(CutFault::NothingCut { path: args.mesh.clone() }.into());
    }
    let units = suspicious_units(&ply.mesh).map(|fault| format!("the input: {fault}"));
    let notes: Vec<String> = not_kept(&ply).into_iter().chain(units).collect();
    let attributes = VertexAttributes::new(
        ply.mesh.vertices().len(),
        std::mem::take(&mut ply.vertex_properties),
    )
    .map_err(|source| CutFault::Attributes { path: args.mesh.clone(), source })?;

    line.message("writing");
    let rows: Vec<Row> =
        pieces.iter().map(|piece| row(piece, names.of[&piece.label].clone())).collect();
    let mut files: Vec<&str> = Vec::new();
    for (piece, row) in pieces.iter().zip(&rows) {
        if cancel::is_requested() {
            return Ok(cancelled(args, line));
        }
        write(piece, &attributes, &ply, args, &staging.path(&row.file))
            .map_err(|e| OutputError::of_mesh(args.out.join(&row.file), e))?;
        files.push(&row.file);
    }
    if !args.no_pictures {
        let before = coloured(&ply.mesh, &given);
        let after: Vec<(u8, &TriMesh)> = pieces.iter().map(|p| (p.label, &p.mesh)).collect();
        let before: Vec<(u8, &TriMesh)> = before.iter().map(|(l, m)| (*l, m)).collect();
        for (name, layers) in PICTURES.into_iter().zip([before, after]) {
            draw(&layers, &staging.path(name))
                .map_err(|source| OutputError::File { path: args.out.join(name), source })?;
            files.push(name);
        }
    }
    if cancel::is_requested() {
        return Ok(cancelled(args, line));
    }
    staging.commit(&files)?;
    drop(line);
    let seconds = start.elapsed().as_secs_f64();
    let notes = [fates.notes(), notes].concat();
    if args.json {
        let (mesh, out) = (args.mesh.display().to_string(), args.out.display().to_string());
        print_json(&Cutting {
            mesh,
            out,
            pieces: rows,
            vertices: given.len(),
            fates,
            notes,
            seconds,
        })?;
    } else {
        let mut text = table(&rows);
        let n = given.len().max(1) as f64;
        let (changed, decided) = (fates.changed, fates.decided);
        text += &format!(
            "\n{} of {} labels changed ({:.2} %), {} unknown ones filled in; {seconds:.2} s\n",
            count(changed),
            count(given.len()),
            100.0 * changed as f64 / n,
            count(decided),
        );
        text += &note_lines(&notes);
        text += &format!("Wrote {}: {}\n", args.out.display(), files.join(", "));
        print(&text)?;
    }
    Ok(End::Clean)
}

/// The votes for the vertices of the welded mesh: means of those at each.
fn joined(votes: &LabelVotes, welded: &Welded) -> LabelVotes {
    let labels = votes.labels;
    let joined = welded.vertex_map.iter().filter(|at| **at != NONE);
    let mut copies = vec![0_u32; welded.mesh.vertices().len()];
    joined.for_each(|at| copies[*at as usize] += 1);
    let mut weights = vec![0.0; copies.len() * labels];
    for (v, at) in welded.vertex_map.iter().enumerate().filter(|(_, at)| **at != NONE) {
        let share = f64::from(copies[*at as usize]);
        let means = weights[*at as usize * labels..].iter_mut();
        means.zip(votes.of(v)).for_each(|(mean, vote)| *mean += vote / share);
    }
    LabelVotes { labels, weights }
}

/// The scores of all vertices, from those of the welded mesh; of vertices without triangles the votes.
fn spread(scores: &LabelScores, votes: &LabelVotes, welded: &Welded) -> LabelScores {
    let of = |(v, at): (usize, &u32)| match *at {
        NONE => votes.of(v),
        at => scores.of(at as usize),
    };
    let all = welded.vertex_map.iter().enumerate().flat_map(of).copied().collect();
    LabelScores { labels: scores.labels, scores: all }
}

fn cancelled(args: &CutArgs, line: Line) -> End {
    drop(line);
    cancel::end(args.out.display())
}

/// Labels without gaps between them: a field for each takes memory by their number, not by the
/// largest. They keep their order, by which ties are broken.
struct Dense {
    /// The labels, ascending from [`UNDECIDED`], which may have no vertex.
    present: Vec<u8>,
    /// Of each vertex, the place of its label in `present`.
    places: Vec<u8>,
}

impl Dense {
    fn new(given: &[u8]) -> Self {
        let mut is_there = [false; 256];
        is_there[usize::from(UNDECIDED)] = true;
        given.iter().for_each(|label| is_there[usize::from(*label)] = true);
        let present: Vec<u8> =
            (0..=u8::MAX).filter(|label| is_there[usize::from(*label)]).collect();
        let mut place_of = [0; 256];
        for (place, label) in present.iter().enumerate() {
            place_of[usize::from(*label)] = place as u8;
        }
        let places = given.iter().map(|label| place_of[usize::from(*label)]).collect();
        Self { present, places }
    }
}

/// The fault, with the label of the file in place of its place.
fn of_label(fault: LabelError, present: &[u8]) -> LabelError {
    match fault {
        LabelError::NotConverged { label, steps, residual } => {
            LabelError::NotConverged { label: usize::from(present[label]), steps, residual }
        }
        other => other,
    }
}

/// What the labels of the file are called.
struct Names {
    of: BTreeMap<u8, String>,
}

impl Names {
    /// Faults of names are found here, before there is work.
    fn new(args: &CutArgs, given: &[u8]) -> Result<Self, CutFault> {
        let name = |label: u8| if label == 1 { "skin".into() } else { format!("label_{label}") };
        let mut of: BTreeMap<u8, String> =
            given.iter().filter(|l| **l != UNDECIDED).map(|l| (*l, name(*l))).collect();
        for (k, (label, name)) in args.names.iter().enumerate() {
            if let Some((_, first)) = args.names[..k].iter().find(|(l, _)| l == label) {
                return Err(CutFault::TwoNames {
                    label: *label,
                    first: first.clone(),
                    second: name.clone(),
                });
            }
            let Some(slot) = of.get_mut(label) else {
                let have: Vec<String> = of.keys().map(u8::to_string).collect();
                let (path, have) = (args.mesh.clone(), have.join(", "));
                return Err(CutFault::NoSuchLabel {
                    path,
                    label: *label,
                    name: name.clone(),
                    have,
                });
            };
            slot.clone_from(name);
        }
        let all: Vec<(&u8, &String)> = of.iter().collect();
        for (k, (label, name)) in all.iter().enumerate() {
            if !sound(name) || all[..k].iter().any(|(_, other)| other.eq_ignore_ascii_case(name)) {
                return Err(CutFault::Name { label: **label, name: (*name).clone() });
            }
        }
        Ok(Self { of })
    }
}

impl Fates {
    /// `pieces` with that of what is undecided.
    fn new(given: &[u8], winners: &[u8], pieces: &[Piece], names: &Names) -> Self {
        let rest = pieces.iter().find(|p| p.label == UNDECIDED).map(|p| &p.mesh);
        let lost = names.of.iter().filter(|(label, _)| !pieces.iter().any(|p| p.label == **label));
        let lost = lost.map(|(label, name)| Lost {
            label: *label,
            name: name.clone(),
            vertices: given.iter().filter(|l| *l == label).count(),
        });
        Self {
            changed: given.iter().zip(winners).filter(|(a, b)| **a != UNDECIDED && a != b).count(),
            decided: given
                .iter()
                .zip(winners)
                .filter(|(a, b)| **a == UNDECIDED && **b != UNDECIDED)
                .count(),
            lost: lost.collect(),
            undecided: Undecided {
                vertices: winners.iter().filter(|l| **l == UNDECIDED).count(),
                triangles: rest.map_or(0, |mesh| mesh.triangles().len()),
                area_m2: rest.map_or(0.0, TriMesh::area),
                components: rest.map_or(0, part_count),
            },
        }
    }

    /// What is not in the files.
    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let Undecided { vertices, triangles, area_m2, components } = &self.undecided;
        if *vertices > 0 {
            notes.push(format!(
                "{} vertices stay unknown and are in no file: {} triangles, {area_m2:.4} m2, in {components} parts",
                count(*vertices),
                count(*triangles),
            ));
        }
        for Lost { label, name, vertices } in &self.lost {
            let n = count(*vertices);
            notes.push(format!(
                "label {label} ({name}) has no file: none of its {n} vertices kept it"
            ));
        }
        notes
    }
}

fn table(rows: &[Row]) -> String {
    let mut text = format!(
        "{:<20} {:>5} {:>10} {:>10} {:>9} {:>6} {:>8}\n",
        "piece", "label", "vertices", "triangles", "area m2", "parts", "borders"
    );
    for r in rows {
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:<20} {:>5} {:>10} {:>10} {:>9.4} {:>6} {:>8}",
            r.name,
            r.label,
            count(r.vertices),
            count(r.triangles),
            r.area_m2,
            r.components,
            r.borders
        );
    }
    text
}

/// The labels of the vertices, from the property that holds them.
fn labels(args: &CutArgs, ply: &PlyMesh) -> Result<Vec<u8>, CutFault> {
    let found =
        ply.vertex_property(&args.labels).filter(|p| p.lists.is_none()).ok_or_else(|| {
            let single = ply.vertex_properties.iter().filter(|p| p.lists.is_none());
            let have: Vec<&str> = single.map(|p| p.name.as_str()).collect();
            CutFault::NoLabels {
                path: args.mesh.clone(),
                name: args.labels.clone(),
                have: have.join(", "),
            }
        })?;
    let label = |(vertex, value): (usize, f64)| {
        let whole = (0.0..255.0).contains(&value) && value.fract() == 0.0;
        if whole { Ok(value as u8) } else { Err(CutFault::Label { vertex, value }) }
    };
    let labels: Vec<u8> =
        found.values.to_f64().into_iter().enumerate().map(label).collect::<Result<_, _>>()?;
    if labels.iter().all(|l| *l == UNDECIDED) { Err(CutFault::NothingKnown) } else { Ok(labels) }
}

/// Whether a name can be one of a file.
fn sound(name: &str) -> bool {
    let fits = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.');
    !name.is_empty() && !name.starts_with('.') && name.chars().all(fits)
}

fn row(piece: &Piece, name: String) -> Row {
    // Seams of exporters are no borders.
    let welded = weld(&piece.mesh);
    let surface = welded.as_ref().map_or(&piece.mesh, |welded| &welded.mesh);
    Row {
        label: piece.label,
        file: format!("{name}.ply"),
        name,
        vertices: piece.mesh.vertices().len(),
        triangles: piece.mesh.triangles().len(),
        area_m2: piece.mesh.area(),
        components: part_count(surface),
        borders: Edges::new(surface).boundary_loops(surface).len(),
    }
}

/// A piece with all that its vertices carried; its own label stands where the labels came from.
fn write(
    piece: &Piece,
    all: &VertexAttributes,
    from: &PlyMesh,
    args: &CutArgs,
    path: &Path,
) -> Result<(), ply::WriteError> {
    let source = |o: &if_mesh::labels::Origin| {
        o.source().map_or_else(|| Source::Blend(o.parts()), Source::Vertex)
    };
    let sources: Vec<Source> = piece.origins.iter().map(source).collect();
    let mut vertex_properties = all.derive(&sources).into_properties();
    for property in vertex_properties.iter_mut().filter(|p| p.name == args.labels) {
        *property =
            Property::new(args.labels.clone(), Column::U8(vec![piece.label; piece.origins.len()]));
    }
    let ply = PlyMesh {
        vertex_properties,
        coordinates: from.coordinates,
        comments: from.comments.clone(),
        ..PlyMesh::new(piece.mesh.clone())
    };
    ply::write_path(
        &ply,
        piece.mesh.vertices(),
        &WriteParams { coordinates: from.coordinates, ..Default::default() },
        path,
    )
}

/// The triangles of each label: that of two corners, else of the first.
fn coloured(mesh: &TriMesh, labels: &[u8]) -> Vec<(u8, TriMesh)> {
    let of = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| labels[v as usize]);
        if b == c { b } else { a }
    };
    let mut present: Vec<u8> = mesh.triangles().iter().map(of).collect();
    present.sort_unstable();
    present.dedup();
    let part = |label: u8| {
        let triangles = mesh.triangles().iter().filter(|t| of(t) == label).copied().collect();
        TriMesh::new(mesh.vertices().to_vec(), triangles).ok().map(|m| (label, m))
    };
    present.into_iter().filter_map(part).collect()
}

/// Front, three quarters and back, each label in its colour, what is unknown in grey.
fn draw(layers: &[(u8, &TriMesh)], path: &Path) -> io::Result<()> {
    let color = |label: u8| {
        let [skin, cloths @ ..] = PALETTE;
        match label {
            UNDECIDED => [128; 3],
            1 => skin,
            _ => cloths[(usize::from(label) - 2) % cloths.len()],
        }
    };
    let scene: Vec<RenderLayer> = layers
        .iter()
        .map(|(label, mesh)| RenderLayer { mesh, color: color(*label), highlight: &[] })
        .collect();
    let image = side_by_side(&scene, &[View::FRONT, View::THREE_QUARTER, View::BACK], 400, 640);
    pictures::write(&image, path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertex_that_a_file_has_more_than_once_votes_once() {
        let p = |x: f64, y: f64| if_core::math::Point::new(x, y, 0.0);
        let apart = [p(0.0, 0.0), p(1.0, 0.0), p(0.0, 1.0), p(1.0, 0.0), p(1.0, 1.0), p(0.0, 1.0)];
        let soup = TriMesh::new(apart.to_vec(), vec![[0, 1, 2], [3, 4, 5]]).unwrap();
        let welded = weld(&soup).unwrap();
        let votes = joined(&LabelVotes::from_labels(&[1, 2, 2, 2, 1, 1], 3), &welded);
        let of = |v: usize| votes.of(welded.vertex_map[v] as usize).to_vec();
        assert_eq!((of(0), of(1)), (vec![0.0, 1.0, 0.0], vec![0.0, 0.0, 1.0]));
        assert_eq!(of(2), [0.0, 0.5, 0.5], "its copies do not agree");
    }

    #[test]
    fn labels_stand_without_gaps_in_their_order() {
        let Dense { present, places } = Dense::new(&[254, 7, 0, 7, 200]);
        assert_eq!((present, places), (vec![0, 7, 200, 254], vec![3, 1, 0, 1, 2]));
        let Dense { present, places } = Dense::new(&[2, 2]);
        assert_eq!((present, places), (vec![0, 2], vec![1, 1]));
        let all: Vec<u8> = (0..=u8::MAX).collect();
        assert_eq!(Dense::new(&all).places, all);
        let fault = LabelError::NotConverged { label: 2, steps: 9, residual: 0.5 };
        let LabelError::NotConverged { label, .. } = of_label(fault, &[0, 7, 200]) else {
            panic!("another fault")
        };
        assert_eq!(label, 200);
    }
}
