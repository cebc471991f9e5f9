//! A folder of small meshes, and the binary run in it.

use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::{icosphere, tube};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

/// A temporary folder with a body, two garments that pass through it and one another, one that is
/// clear of both, and an outfit file.
pub(crate) struct Folder(TempDir);

/// With these no outfit of the folder is resolved.
pub(crate) const TOO_FEW: &str = "--set rounds=1 --set settle_rounds=1 --set sweeps=1 --set contact_step=1e-5 --set max_push=1e-5 --set ease_rounds=0";

/// What the binary did.
pub(crate) struct Run {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl From<Output> for Run {
    fn from(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("ifg writes UTF-8");
        Self {
            code: output.status.code(),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }
}

impl Run {
    /// Fails unless the exit code is this one.
    #[track_caller]
    pub(crate) fn expect(self, code: i32) -> Self {
        assert_eq!(self.code, Some(code), "{}\n{}", self.stdout, self.stderr);
        self
    }

    /// Standard output as JSON.
    #[track_caller]
    pub(crate) fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|e| panic!("{e}: {}", self.stdout))
    }
}

/// The body: a ball drawn out to the proportions of a person, 1.8 m high and 0.3 m wide.
pub(crate) fn body() -> TriMesh {
    moved(&icosphere(1.0, 2), drawn_out)
}

/// The hoop with a loose triangle, one corner of which lies 2 mm behind its front.
pub(crate) fn flap() -> TriMesh {
    let hoop = belt(1.3, 0.0, 0.2);
    let n = hoop.vertices().len() as u32;
    let flap = [[-0.01, 0.06, 0.15], [0.01, 0.06, 0.15], [0.0, 0.09, 0.128]];
    let vertices = [hoop.vertices(), &flap.map(Point::from)].concat();
    let triangles = [hoop.triangles(), &[[n, n + 1, n + 2]]].concat();
    TriMesh::new(vertices, triangles).unwrap()
}

/// A tube about the body's middle, from `y = from` to `to`. Of `radius` 1 it touches the body at
/// `y = 0`; a smaller one passes through it.
pub(crate) fn belt(radius: Real, from: Real, to: Real) -> TriMesh {
    moved(&tube(radius, 1.0, 24, 4, false), |p| {
        drawn_out(&Point::new(p.x, (from + p.y * (to - from)) / 0.9, p.z))
    })
}

/// The same of three flat sides.
pub(crate) fn angular_belt(radius: Real, from: Real, to: Real) -> TriMesh {
    moved(&tube(radius, 1.0, 3, 2, false), |p| {
        drawn_out(&Point::new(p.x, (from + p.y * (to - from)) / 0.9, p.z))
    })
}

fn drawn_out(p: &Point) -> Point {
    Point::new(0.15 * p.x, 0.9 * p.y, 0.1 * p.z)
}

pub(crate) fn moved(mesh: &TriMesh, f: impl Fn(&Point) -> Point) -> TriMesh {
    mesh.with_vertices(mesh.vertices().iter().map(f).collect()).expect("finite positions")
}

/// A mesh as OBJ text.
pub(crate) fn obj(mesh: &TriMesh) -> String {
    let v = mesh.vertices().iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let f = mesh.triangles().iter().map(|t| format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1));
    v.chain(f).collect()
}

/// A mesh as PLY text with a label for each vertex.
pub(crate) fn ply(mesh: &TriMesh) -> String {
    let (n, m) = (mesh.vertices().len(), mesh.triangles().len());
    let header = format!(
        "ply\nformat ascii 1.0\nelement vertex {n}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar label\nelement face {m}\nproperty list uchar int vertex_indices\nend_header\n"
    );
    let v =
        mesh.vertices().iter().map(|p| format!("{} {} {} 7\n", p.x as f32, p.y as f32, p.z as f32));
    let f = mesh.triangles().iter().map(|t| format!("3 {} {} {}\n", t[0], t[1], t[2]));
    header + &v.chain(f).collect::<String>()
}

impl Folder {
    pub(crate) fn new() -> Self {
        let folder = Self(tempfile::tempdir().expect("a temporary folder"));
        folder.write("body.ply", ply(&body()));
        folder.write("skirt.ply", ply(&belt(0.97, -0.3, 0.0)));
        folder.write("shirt.obj", obj(&belt(0.98, -0.1, 0.3)));
        folder.write("hoop.ply", ply(&belt(1.3, 0.0, 0.2)));
        folder.write(
            "outfit.toml",
            "body = \"body.ply\"\n[[garment]]\nfile = \"skirt.ply\"\n[[garment]]\nfile = \"shirt.obj\"\nname = \"top\"\n",
        );
        folder
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).expect("the temporary folder can be written");
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// The binary with these arguments, which are split at blanks.
    pub(crate) fn command(&self, args: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_ifg"));
        command.current_dir(self.0.path()).args(args.split_whitespace());
        command
    }

    pub(crate) fn ifg(&self, args: &str) -> Run {
        // Pictures take longer than all the rest.
        let pictures =
            if args.starts_with("fix") || args.starts_with("demo") { " --no-pictures" } else { "" };
        self.ifg_drawing(&format!("{args}{pictures}"))
    }

    /// With pictures.
    pub(crate) fn ifg_drawing(&self, args: &str) -> Run {
        self.command(args).output().expect("ifg starts").into()
    }

    /// Starts the binary, waits until it works on `out`, whose hidden folder is then there,
    /// interrupts it a moment later, and makes sure that it ends soon with the exit code of that,
    /// and that no file but those before are there.
    #[cfg(unix)]
    #[track_caller]
    pub(crate) fn interrupt(&self, args: &str, hidden: &str) -> Run {
        use std::process::Stdio;
        use std::thread::sleep;
        use std::time::{Duration, Instant};
        /// How long a test waits for what takes a moment.
        const PATIENCE: Duration = Duration::from_secs(20);
        let before = self.files();
        let mut child = self
            .command(args)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("ifg starts");
        let start = Instant::now();
        while !self.path(hidden).exists() {
            assert!(start.elapsed() < PATIENCE, "no {hidden}");
            sleep(Duration::from_millis(2));
        }
        sleep(Duration::from_millis(500));
        cancel(child.id());
        let start = Instant::now();
        while child.try_wait().expect("it is our child").is_none() {
            if start.elapsed() > PATIENCE {
                child.kill().expect("it is our child");
                panic!("`{args}` goes on after Ctrl-C");
            }
            sleep(Duration::from_millis(2));
        }
        let run = Run::from(child.wait_with_output().expect("it ended")).expect(130);
        assert!(self.files() == before, "`{args}` left something");
        run
    }

    /// Starts the binary with a full pipe for its stdout, so that it waits where it first prints;
    /// interrupts it a moment after it handles Ctrl-C and `ready` returns, and lets it go on.
    #[cfg(unix)]
    #[track_caller]
    pub(crate) fn interrupt_printing(&self, args: &str, ready: impl FnOnce()) -> Run {
        use std::io::{Read, Write};
        use std::process::Stdio;
        use std::thread::{sleep, spawn};
        use std::time::Duration;
        let (mut reader, mut writer) = std::io::pipe().expect("a pipe");
        let stdout = writer.try_clone().expect("the same pipe");
        // More than any pipe holds.
        let filling = spawn(move || writer.write_all(&vec![b'\n'; 1 << 21]));
        let child =
            self.command(args).stdout(stdout).stderr(Stdio::piped()).spawn().expect("ifg starts");
        while handles_signals(child.id()) == Some(false) {
            sleep(Duration::from_millis(2));
        }
        ready();
        sleep(Duration::from_millis(300));
        cancel(child.id());
        sleep(Duration::from_millis(100));
        let mut printed = String::new();
        reader.read_to_string(&mut printed).expect("a pipe");
        filling.join().expect("it does not panic").expect("a pipe");
        Run { stdout: printed, ..child.wait_with_output().expect("it ended").into() }
    }

    /// All files with their bytes, in order of their names.
    pub(crate) fn files(&self) -> Vec<(PathBuf, Vec<u8>)> {
        let mut files = Vec::new();
        collect(self.0.path(), &mut files);
        files.sort();
        files
    }
}

/// Sends Ctrl-C to a process; SIGTERM, which does the same, where it ignores that as these tests do: what a
/// script starts in the background does so.
#[cfg(unix)]
pub(crate) fn cancel(process: u32) {
    let ignores = signals("self", "SigIgn:").is_some_and(|ignored| ignored & SIGINT != 0);
    let signal = if ignores { "-TERM" } else { "-INT" };
    Command::new("kill").args([signal, &process.to_string()]).status().expect("kill is there");
}

/// Whether a process handles SIGTERM, as it does Ctrl-C; `None` where that cannot be seen.
#[cfg(unix)]
fn handles_signals(process: u32) -> Option<bool> {
    Some(signals(&process.to_string(), "SigCgt:")? & SIGTERM != 0)
}

/// A bit for each signal of a kind, as the system says of a process.
#[cfg(unix)]
fn signals(process: &str, kind: &str) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let bits = status.lines().find_map(|line| line.strip_prefix(kind))?;
    u64::from_str_radix(bits.trim(), 16).ok()
}

#[cfg(unix)]
const SIGINT: u64 = 1 << 1;
#[cfg(unix)]
const SIGTERM: u64 = 1 << 14;

fn collect(folder: &Path, files: &mut Vec<(PathBuf, Vec<u8>)>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files.push((path.clone(), vec![]));
            collect(&path, files);
        } else {
            files.push((path.clone(), fs::read(&path).expect("a file")));
        }
    }
}
