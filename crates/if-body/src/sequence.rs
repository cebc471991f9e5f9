//! Bodies that are given in every frame: meshes of one connectivity in a folder, or positions.

use crate::motion::is_rate;
use crate::pose::FARTHEST;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::file::{MeshFile, ReadError};
use std::f64::consts::PI;
use std::fmt;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The frames of a body: files of one mesh each, or positions.
///
/// Files are read when they are needed: memory does not grow with them.
#[derive(Clone, Debug)]
pub struct BodySequence {
    frames: Vec<Frame>,
    vertices: usize,
    /// Frames per second.
    pub frames_per_second: Real,
}

#[derive(Clone, Debug)]
enum Frame {
    File(PathBuf),
    Positions(Arc<[Point]>),
}

/// What a frame was read from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FrameSource {
    /// A mesh.
    File(PathBuf),
    /// Positions: the number of the frame.
    Positions(usize),
}

impl fmt::Display for FrameSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => path.display().fmt(f),
            Self::Positions(frame) => write!(f, "frame {frame}"),
        }
    }
}

/// Posed bodies cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum SequenceError {
    /// The folder cannot be read.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    /// No positions are given.
    #[error("there are no frames; give the positions of the body in one at least")]
    NoFrames,
    /// There is no mesh.
    #[error("{}: the folder has no .ply, .obj or .glb file; give one mesh for each frame", path.display())]
    Empty { path: PathBuf },
    /// Names do not sort as their numbers.
    #[error(
        "{}: `{second}` follows `{first}` by name, but its number is smaller; write numbers with leading zeros, as in body_0007.ply",
        path.display()
    )]
    Order { path: PathBuf, first: String, second: String },
    /// Two files are of one frame.
    #[error(
        "{}: `{first}` and `{second}` are of one frame by their names; leave one of them there",
        path.display()
    )]
    Twice { path: PathBuf, first: String, second: String },
    /// A mesh cannot be read.
    #[error(transparent)]
    Mesh(#[from] ReadError),
    /// A mesh has another number of vertices or triangles than the body.
    #[error(
        "{frame}: {got} {what}, and the body at rest has {expected}; all frames must have its connectivity"
    )]
    Count { frame: FrameSource, what: &'static str, got: usize, expected: usize },
    /// A triangle has other corners than that of the body.
    #[error(
        "{}: triangle {triangle} has the corners {got:?}, and that of the body at rest {expected:?}; all frames must have its connectivity, in its order",
        path.display()
    )]
    Triangle { path: PathBuf, triangle: usize, got: [u32; 3], expected: [u32; 3] },
    /// A vertex lies beyond what frames can store.
    #[error(
        "{frame}: vertex {vertex} is at {at:?}; coordinates must be numbers of at most {FARTHEST:e} m; export the frame again"
    )]
    Far { frame: FrameSource, vertex: usize, at: Point },
    /// The body of a frame has another size than at rest.
    #[error(
        "{frame}: the body is {found:.3} m from corner to corner of its box, and {expected:.3} m at rest; export frames and body in metres"
    )]
    Size { frame: FrameSource, found: Real, expected: Real },
    /// The body of a frame is turned inside out.
    #[error(
        "{frame}: frames are mirrored: the volume of the body is {found:.4} m³, and {expected:.4} m³ at rest; export frames and body with the same handedness of axes"
    )]
    Mirrored { frame: FrameSource, found: Real, expected: Real },
    /// The frames per second are none.
    #[error("{0} frames per second; give a number from 0.001 to 100,000")]
    Rate(Real),
}

/// How many times larger or smaller than at rest a body may be: a crouched one is half as long, and in
/// centimetres it is a hundred times as large.
const SIZES: Real = 8.0;

/// Share of its volume at rest that a body has with the other sign if it is mirrored. A mirror keeps the volume
/// but for the pose, and no pose turns half of a body inside out.
const MIRRORED: Real = 0.5;
/// Least volume, as a share of that of a ball with the same area, of a body that has an inside: a person has
/// 0.3, and a sheet next to nothing, of any sign.
const SOLID: Real = 0.01;

const EXTENSIONS: [&str; 3] = ["ply", "obj", "glb"];

impl BodySequence {
    /// The meshes in `folder`, sorted by name, each of which is read and compared with the
    /// connectivity of `rest`.
    ///
    /// # Errors
    ///
    /// [`SequenceError`], with the path of the file.
    pub fn open(
        folder: &Path,
        rest: &TriMesh,
        frames_per_second: Real,
    ) -> Result<Self, SequenceError> {
        if !is_rate(frames_per_second) {
            return Err(SequenceError::Rate(frames_per_second));
        }
        let fault = |source| SequenceError::Io { path: folder.into(), source };
        let mut files = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(fault)? {
            let path = entry.map_err(fault)?.path();
            let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
            if EXTENSIONS.contains(&extension.to_ascii_lowercase().as_str()) {
                files.push(path);
            }
        }
        files.sort();
        if files.is_empty() {
            return Err(SequenceError::Empty { path: folder.into() });
        }
        check_order(folder, &files)?;
        let at_rest = Volume::of(rest);
        for path in &files {
            let file = MeshFile::read(path)?;
            let frame = || FrameSource::File(path.clone());
            check_positions(frame, file.mesh().vertices(), rest.vertices().len())?;
            check_triangles(path, &file, rest)?;
            check_size(frame, file.mesh(), rest)?;
            check_handedness(frame, file.mesh(), &at_rest)?;
        }
        let frames = files.into_iter().map(Frame::File).collect();
        Ok(Self { frames, vertices: rest.vertices().len(), frames_per_second })
    }

    /// The body in frames whose positions are given, in metres, in the order of the vertices of `rest`.
    ///
    /// # Errors
    ///
    /// [`SequenceError`], with the number of the frame.
    pub fn from_positions(
        frames: impl IntoIterator<Item = Vec<Point>>,
        rest: &TriMesh,
        frames_per_second: Real,
    ) -> Result<Self, SequenceError> {
        if !is_rate(frames_per_second) {
            return Err(SequenceError::Rate(frames_per_second));
        }
        let vertices = rest.vertices().len();
        let (mut checked, at_rest) = (Vec::new(), Volume::of(rest));
        for (number, positions) in frames.into_iter().enumerate() {
            let frame = || FrameSource::Positions(number);
            check_positions(frame, &positions, vertices)?;
            let mesh = rest.with_vertices(positions.clone()).expect("as many vertices, all finite");
            check_size(frame, &mesh, rest)?;
            check_handedness(frame, &mesh, &at_rest)?;
            checked.push(Frame::Positions(positions.into()));
        }
        if checked.is_empty() {
            return Err(SequenceError::NoFrames);
        }
        Ok(Self { frames: checked, vertices, frames_per_second })
    }

    /// Number of frames; at least one.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Always `false`.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Neighbouring files between which others of a series seem to be missing: one number of their names
    /// ascends by the same step elsewhere, and by more here.
    pub fn gaps(&self) -> Vec<[&Path; 2]> {
        let path = self.frames.iter().filter_map(|frame| match frame {
            Frame::File(path) => Some(path.as_path()),
            Frame::Positions(_) => None,
        });
        let files: Vec<&Path> = path.collect();
        let steps: Vec<Option<u64>> = files.windows(2).map(|two| step(two[0], two[1])).collect();
        let usual = steps.iter().flatten().min().copied();
        let is_usual = |step: &&Option<u64>| **step == usual;
        if 2 * steps.iter().filter(is_usual).count() <= steps.len() {
            return Vec::new();
        }
        let gaps =
            files.windows(2).zip(&steps).filter(|(_, step)| step.is_some_and(|s| Some(s) > usual));
        gaps.map(|(two, _)| [two[0], two[1]]).collect()
    }

    /// The positions of the body in a frame.
    ///
    /// # Errors
    ///
    /// A file that was changed since the folder was opened.
    ///
    /// # Panics
    ///
    /// If there is no such frame.
    pub fn positions(&self, frame: usize) -> Result<Vec<Point>, SequenceError> {
        match &self.frames[frame] {
            Frame::Positions(positions) => Ok(positions.to_vec()),
            Frame::File(path) => {
                let file = MeshFile::read(path)?;
                let positions = file.mesh().vertices();
                check_positions(|| FrameSource::File(path.clone()), positions, self.vertices)?;
                Ok(positions.to_vec())
            }
        }
    }

    /// The frames of a range, at the same rate.
    ///
    /// # Panics
    ///
    /// If there are no such frames.
    pub fn part(&self, frames: Range<usize>) -> Self {
        assert!(!frames.is_empty(), "a sequence has frames");
        Self { frames: self.frames[frames].to_vec(), ..*self }
    }

    /// Every `step`-th frame, the first one included.
    ///
    /// # Panics
    ///
    /// If `step` is 0.
    pub fn every(&self, step: usize) -> Self {
        let frames = self.frames.iter().step_by(step).cloned().collect();
        Self { frames, frames_per_second: self.frames_per_second / step as Real, ..*self }
    }
}

/// By how much the number in which two names differ ascends; `None` if they differ otherwise.
fn step(first: &Path, second: &Path) -> Option<u64> {
    let [a, b] = [first, second].map(stem);
    let [a, b] = [parts(&a), parts(&b)];
    let mut unlike = a.1.iter().zip(&b.1).filter(|(a, b)| a != b);
    let (Some((a, b)), None, true) = (unlike.next(), unlike.next(), a.0 == b.0) else {
        return None;
    };
    let number = |digits: &str| if digits.is_empty() { Ok(0) } else { digits.parse::<u64>() };
    number(b.1).ok()?.checked_sub(number(a.1).ok()?)
}

/// The name of a file without its extension.
fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Refuses names whose numbers do not ascend though all else is equal: `body_10` sorts before `body_9`.
fn check_order(folder: &Path, files: &[PathBuf]) -> Result<(), SequenceError> {
    for two in files.windows(2) {
        let stems = [&two[0], &two[1]].map(|path| stem(path));
        let [a, b] = [&stems[0], &stems[1]].map(|stem| parts(stem));
        if a.0 == b.0 && a.1 >= b.1 {
            let name = |path: &PathBuf| {
                path.file_name().unwrap_or_default().to_string_lossy().into_owned()
            };
            let (path, first, second) = (folder.into(), name(&two[0]), name(&two[1]));
            return Err(if a.1 == b.1 {
                SequenceError::Twice { path, first, second }
            } else {
                SequenceError::Order { path, first, second }
            });
        }
    }
    Ok(())
}

/// A name with `0` for each of its numbers, and these.
///
/// A number is its digits without leading zeros, the longer the larger: it may have any number of them.
fn parts(name: &str) -> (String, Vec<(usize, &str)>) {
    let numbers = name.split(|c: char| !c.is_ascii_digit()).filter(|n| !n.is_empty());
    let numbers = numbers.map(|n| n.trim_start_matches('0')).map(|n| (n.len(), n));
    let mut text = String::new();
    for c in name.chars().map(|c| if c.is_ascii_digit() { '0' } else { c }) {
        if c != '0' || !text.ends_with('0') {
            text.push(c);
        }
    }
    (text, numbers.collect())
}

fn check_positions(
    frame: impl Fn() -> FrameSource,
    positions: &[Point],
    expected: usize,
) -> Result<(), SequenceError> {
    let got = positions.len();
    if got != expected {
        return Err(SequenceError::Count { frame: frame(), what: "vertices", got, expected });
    }
    let is_near = |p: &Point| p.iter().all(|x| x.abs() <= FARTHEST);
    match positions.iter().position(|p| !is_near(p)) {
        None => Ok(()),
        Some(vertex) => Err(SequenceError::Far { frame: frame(), vertex, at: positions[vertex] }),
    }
}

fn check_size(
    frame: impl Fn() -> FrameSource,
    mesh: &TriMesh,
    rest: &TriMesh,
) -> Result<(), SequenceError> {
    let [found, expected] = [mesh, rest].map(|mesh| mesh.surface_aabb().size().norm());
    if found <= SIZES * expected && expected <= SIZES * found {
        Ok(())
    } else {
        Err(SequenceError::Size { frame: frame(), found, expected })
    }
}

/// The volume of a body.
struct Volume {
    signed: Real,
    /// Whether it has an inside.
    is_solid: bool,
}

impl Volume {
    fn of(mesh: &TriMesh) -> Self {
        let (signed, area) = (mesh.signed_volume(), mesh.area());
        let ball = area.powf(1.5) / (6.0 * PI.sqrt());
        Self { signed, is_solid: signed.abs() > SOLID * ball }
    }
}

/// Triangles are those of the rest body, so that a mirror turns its surface inside out.
fn check_handedness(
    frame: impl Fn() -> FrameSource,
    mesh: &TriMesh,
    rest: &Volume,
) -> Result<(), SequenceError> {
    let found = mesh.signed_volume();
    if rest.is_solid && found * rest.signed.signum() < -MIRRORED * rest.signed.abs() {
        return Err(SequenceError::Mirrored { frame: frame(), found, expected: rest.signed });
    }
    Ok(())
}

fn check_triangles(path: &Path, file: &MeshFile, rest: &TriMesh) -> Result<(), SequenceError> {
    let (got, expected) = (file.mesh().triangles(), rest.triangles());
    if got.len() != expected.len() {
        let (frame, what) = (FrameSource::File(path.into()), "triangles");
        let (got, expected) = (got.len(), expected.len());
        return Err(SequenceError::Count { frame, what, got, expected });
    }
    match (0..got.len()).find(|t| got[*t] != expected[*t]) {
        None => Ok(()),
        Some(triangle) => {
            let (got, expected) = (got[triangle], expected[triangle]);
            Err(SequenceError::Triangle { path: path.into(), triangle, got, expected })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;
    use if_core::shapes::meshes::icosphere;
    use if_mesh::ply::{PlyMesh, WriteParams, write_path};

    #[test]
    fn frames_are_read_in_order_and_foreign_ones_are_typed_errors() {
        let folder = tempfile::tempdir().unwrap();
        let rest = icosphere(1.0, 1);
        let write = |name: &str, mesh: &TriMesh| {
            let ply = PlyMesh::new(mesh.clone());
            let path = folder.path().join(name);
            write_path(&ply, ply.mesh.vertices(), &WriteParams::default(), &path).unwrap();
        };
        let open = || BodySequence::open(folder.path(), &rest, 30.0);
        assert!(matches!(open(), Err(SequenceError::Empty { .. })));
        let scaled = |by: Real| {
            rest.with_vertices(rest.vertices().iter().map(|p| p * by).collect()).unwrap()
        };
        for k in 0..3 {
            write(&format!("body_{k}.ply"), &scaled(1.0 + Real::from(k)));
        }
        std::fs::write(folder.path().join("notes.txt"), "no mesh").unwrap();
        let sequence = open().unwrap();
        assert_eq!((sequence.len(), sequence.part(2..3).len(), sequence.every(2).len()), (3, 1, 2));
        let y = |s: &BodySequence, k: usize| s.positions(k).unwrap()[0].coords.norm();
        assert!(
            (y(&sequence, 2) - 3.0).abs() < 1e-6 && (y(&sequence.every(2), 1) - 3.0).abs() < 1e-6
        );
        assert_eq!(sequence.every(2).frames_per_second, 15.0);
        assert!(sequence.gaps().is_empty());
        // The tenth sorts before the ninth.
        write("body_10.ply", &rest);
        let error = open().unwrap_err().to_string();
        assert!(error.contains("`body_2.ply` follows `body_10.ply`"), "{error}");
        std::fs::remove_file(folder.path().join("body_10.ply")).unwrap();
        let twin = folder.path().join("body_2.obj");
        std::fs::write(&twin, "").unwrap();
        assert!(matches!(open(), Err(SequenceError::Twice { .. })));
        std::fs::remove_file(&twin).unwrap();
        // More digits than any integer has.
        let [long, longer] = ["8", "9"].map(|last| format!("{}{last}", "7".repeat(50)));
        for (first, second, is_right) in [
            ("a10_body", "a9_body", false),
            ("1a", "a1", true),
            ("b1_2", "b1_10", false),
            (&long, &longer, true),
        ] {
            let files = [first, second].map(|n| PathBuf::from(format!("{n}.ply")));
            let mut files = files.to_vec();
            files.sort();
            assert_eq!(check_order(folder.path(), &files).is_ok(), is_right, "{first}");
        }
        write("body_3.ply", &icosphere(1.0, 2));
        assert!(matches!(open(), Err(SequenceError::Count { what: "vertices", .. })));
        let mut triangles = rest.triangles().to_vec();
        triangles[4].rotate_left(1);
        write("body_3.ply", &TriMesh::new(rest.vertices().to_vec(), triangles.clone()).unwrap());
        assert!(matches!(open(), Err(SequenceError::Triangle { triangle: 4, .. })));
        triangles.pop();
        write("body_3.ply", &TriMesh::new(rest.vertices().to_vec(), triangles).unwrap());
        assert!(matches!(open(), Err(SequenceError::Count { what: "triangles", .. })));
        // In millimetres, and a vertex that lies nowhere.
        write("body_3.ply", &scaled(1e3));
        assert!(matches!(open(), Err(SequenceError::Size { .. })));
        let mut vertices = rest.vertices().to_vec();
        vertices[7].y = 1e20;
        write("body_3.ply", &rest.with_vertices(vertices).unwrap());
        assert!(matches!(open(), Err(SequenceError::Far { vertex: 7, .. })));
        // With the other handedness, wherever it is.
        let mirror = |p: &Point| Point::new(3.0 - p.x, p.y, p.z);
        write(
            "body_3.ply",
            &rest.with_vertices(rest.vertices().iter().map(mirror).collect()).unwrap(),
        );
        let error = open().unwrap_err().to_string();
        assert!(error.contains("body_3.ply: frames are mirrored"), "{error}");
        std::fs::write(folder.path().join("body_3.ply"), "ply").unwrap();
        assert!(matches!(open(), Err(SequenceError::Mesh(_))));
        for rate in [0.0, -1.0, Real::NAN, 1e-300, 1e300] {
            let error = BodySequence::open(folder.path(), &rest, rate);
            assert!(matches!(error, Err(SequenceError::Rate(_))));
        }
    }

    #[test]
    fn gaps_of_a_regular_series_are_told() {
        let rest = icosphere(1.0, 1);
        let gaps = |names: &[&str]| {
            let frames = names.iter().map(|name| Frame::File(PathBuf::from(name))).collect();
            let (vertices, frames_per_second) = (rest.vertices().len(), 30.0);
            let sequence = BodySequence { frames, vertices, frames_per_second };
            let pairs = sequence.gaps();
            pairs
                .iter()
                .map(|two| two.map(|path| path.to_str().unwrap().to_owned()))
                .collect::<Vec<_>>()
        };
        let missing = [["b_0001.ply".to_owned(), "b_0003.ply".to_owned()]];
        assert_eq!(gaps(&["b_0000.ply", "b_0001.ply", "b_0003.ply", "b_0004.ply"]), missing);
        let tens = gaps(&["w2_t00.ply", "w2_t10.ply", "w2_t20.ply", "w2_t40.ply"]);
        assert_eq!(tens, [["w2_t20.ply".to_owned(), "w2_t40.ply".to_owned()]]);
        // No series: names without numbers, of other words, with other steps each, and too few.
        for names in [
            &["a.ply", "b.ply", "d.ply"][..],
            &["a1.ply", "b2.ply", "c4.ply"],
            &["a1.ply", "a2.ply", "a5.ply", "a9.ply"],
            &["a1.ply", "a7.ply"],
            &["a1.ply"],
        ] {
            assert_eq!(gaps(names), [[""; 2]; 0], "{names:?}");
        }
    }

    #[test]
    fn positions_are_frames_and_bad_ones_are_named() {
        let rest = icosphere(1.0, 1);
        let moved = |by: Real| -> Vec<Point> {
            rest.vertices().iter().map(|p| p + Vector::new(0.0, by, 0.0)).collect()
        };
        let sequence = |frames: Vec<Vec<Point>>| BodySequence::from_positions(frames, &rest, 30.0);
        let found = sequence(vec![moved(0.0), moved(0.5), moved(1.0)]).unwrap();
        assert_eq!((found.len(), found.positions(1).unwrap()), (3, moved(0.5)));
        let part = found.part(1..3).every(2);
        assert_eq!((part.len(), part.positions(0).unwrap()), (1, moved(0.5)));
        assert!(matches!(sequence(vec![]), Err(SequenceError::NoFrames)));
        let message =
            |second: Vec<Point>| sequence(vec![moved(0.0), second]).unwrap_err().to_string();
        let short = message(moved(0.0)[1..].to_vec());
        assert!(short.starts_with("frame 1: 41 vertices, and the body at rest has 42"), "{short}");
        for bad in [Real::NAN, 1e20] {
            let mut positions = moved(0.0);
            positions[7].y = bad;
            let far = message(positions);
            assert!(far.starts_with("frame 1: vertex 7 is at"), "{far}");
        }
        let large = message(moved(0.0).iter().map(|p| p * 1e3).collect());
        assert!(large.contains("export frames and body in metres"), "{large}");
        let mirrored = message(moved(0.0).iter().map(|p| Point::new(p.x, p.y, -p.z)).collect());
        assert!(mirrored.starts_with("frame 1: frames are mirrored"), "{mirrored}");
        // Half a turn is no mirror, and a sheet has no inside.
        let turned = moved(0.0).iter().map(|p| Point::new(-p.x, p.y, -p.z)).collect();
        assert!(sequence(vec![turned]).is_ok());
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|[x, y]| Point::new(x, y, 0.0));
        let sheet = TriMesh::new(corners.to_vec(), vec![[0, 1, 2]]).unwrap();
        let mirrored = corners.map(|p| Point::new(-p.x, p.y, p.z)).to_vec();
        assert!(BodySequence::from_positions([mirrored], &sheet, 30.0).is_ok());
        let rate = BodySequence::from_positions(vec![moved(0.0)], &rest, 0.0);
        assert!(matches!(rate, Err(SequenceError::Rate(_))));
    }
}
