//! `ifg demo`: the built-in scene, written as files and resolved like any other outfit.

use crate::animate::{self, SourceArgs};
use crate::end::End;
use crate::inputs::ParamArgs;
use crate::outfit_file;
use crate::output_error::OutputError;
use crate::progress::Line;
use crate::report_output::{self, Style};
use crate::resolve_outfit::{self, Options};
use crate::shared_body::SharedBody;
use crate::staging::Staging;
use clap::{Args, ValueEnum};
use if_body::Motion;
use if_body::mannequin::{self, MannequinParams, rig};
use if_core::mesh::TriMesh;
use if_mesh::ply::{PlyMesh, WriteParams, write_path};
use if_pipeline::animate::AnimateParams;
use miette::{IntoDiagnostic, Report};
use std::fmt::Write;
use std::num::NonZeroUsize;
use std::path::PathBuf;

#[derive(Args, Debug, Clone)]
pub(crate) struct DemoArgs {
    /// Output folder.
    #[arg(short, long, value_name = "DIR", default_value = "out/demo")]
    pub(crate) out: PathBuf,
    /// T-shirt, skirt, jacket and coat; or trousers, T-shirt, jacket and coat.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) variant: Variant,
    /// How fine the meshes are: coarse has half, fine four times the triangles of normal.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) size: Size,
    #[command(flatten)]
    pub(crate) params: ParamArgs,
    /// Let the person take two steps as well, in a few frames: written to the folder `motion` in the
    /// output folder.
    #[arg(long, conflicts_with = "json")]
    pub(crate) motion: bool,
    /// With --motion: write its motion.glb as well, one file with all layers and frames.
    #[arg(long, requires = "motion")]
    pub(crate) gltf: bool,
    /// Print the report as JSON on stdout, and no tables.
    #[arg(long)]
    pub(crate) json: bool,
    /// Do not draw before.png and after.png, nor write report.html.
    #[arg(long)]
    pub(crate) no_pictures: bool,
}

/// Scenes of the demo.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Variant {
    #[default]
    Skirt,
    Trousers,
}

/// Sizes of the demo.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Size {
    Coarse,
    #[default]
    Normal,
    Fine,
}

/// The folder below the output folder that holds the scene as it was before.
const INPUT: &str = "input";
/// The scene's outfit file.
const OUTFIT: &str = "demo.toml";
/// The skeleton and the motion of `--motion`.
const SKELETON: &str = "skeleton.json";
const MOTION: &str = "motion.json";
/// Frames of two steps, which take a second.
const FRAMES: usize = 8;

/// Runs the command.
pub(crate) fn run(args: &DemoArgs) -> Result<End, Report> {
    let line = Line::new("demo", 0, 1);
    line.message("making the scene");
    // Nothing is replaced while another process writes there.
    let held = Staging::open(&args.out)?;
    let outfit = write_scene(args)?;
    drop(held);
    let spec = outfit_file::with_args(outfit_file::read(&outfit)?, None, &args.params)?;
    let options =
        Options { pictures: !args.no_pictures, write_unproven: true, ..Default::default() };
    let outcome =
        resolve_outfit::run(&spec, &args.out, options, (&mut SharedBody::default(), &line))?;
    drop(line);
    let style = if args.json { Style::Json } else { Style::Tables };
    let end = report_output::outcome(&spec, &args.out, outcome, (style, false))?;
    if !args.motion || !matches!(end, End::Clean) {
        return Ok(end);
    }
    let folder = args.out.join(INPUT);
    let source = SourceArgs {
        motion: folder.join(MOTION),
        skeleton: None,
        every: NonZeroUsize::MIN,
        frames: None,
        fps: None,
    };
    let options = animate::Options {
        source,
        params: AnimateParams::default(),
        out: args.out.join("motion"),
        shard: None,
        continuous: false,
        meshes: false,
        gltf: args.gltf,
        pictures: !args.no_pictures,
        json: false,
        strict: false,
    };
    animate::animated(&spec, &options)
}

/// Writes the scene's meshes and its outfit file, and returns the path of the latter.
fn write_scene(args: &DemoArgs) -> Result<PathBuf, Report> {
    let folder = args.out.join(INPUT);
    let staging = Staging::open(&folder)?;
    let mut names = Vec::new();
    let mut toml = String::from(
        "# The built-in scene of ifg, before. `ifg fix` on this file, with the same parameters, gives what `ifg demo` gives.\n",
    );
    for (k, (name, mesh)) in scene(args).into_iter().enumerate() {
        let file = format!("{name}.ply");
        let mut ply = PlyMesh::new(mesh);
        if k == 0 && args.motion {
            ply.vertex_properties = rig::skin_weights(ply.mesh.vertices()).to_properties();
        }
        write_path(&ply, ply.mesh.vertices(), &WriteParams::default(), &staging.path(&file))
            .map_err(|e| OutputError::of_mesh(folder.join(&file), e))?;
        // Writing to a string cannot fail.
        let _ = if k == 0 {
            writeln!(toml, "body = \"{file}\"")
        } else {
            writeln!(toml, "\n[[garment]]\nfile = \"{file}\"")
        };
        names.push(file);
    }
    if args.motion {
        let skeleton = rig::skeleton();
        let poses = (0..FRAMES).map(|k| rig::walking_pose(k, FRAMES)).collect();
        let motion = Motion::new(FRAMES as f64, poses).into_diagnostic()?;
        let (mut joints, mut poses) = (Vec::new(), Vec::new());
        skeleton.write(&mut joints).into_diagnostic()?;
        motion.write(&mut poses, &skeleton).into_diagnostic()?;
        for (name, bytes) in [(SKELETON, joints), (MOTION, poses)] {
            let path = folder.join(name);
            std::fs::write(staging.path(name), bytes)
                .map_err(|source| OutputError::File { path, source })?;
            names.push(name.into());
        }
    }
    let path = folder.join(OUTFIT);
    std::fs::write(staging.path(OUTFIT), toml)
        .map_err(|source| OutputError::File { path, source })?;
    names.push(OUTFIT.into());
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    staging.commit(&names)?;
    Ok(folder.join(OUTFIT))
}

/// The scene's meshes with their names: the body, then garments, inner to outer.
fn scene(args: &DemoArgs) -> Vec<(String, TriMesh)> {
    let params = params(args.size);
    match args.variant {
        Variant::Skirt => mannequin::layered(&params),
        Variant::Trousers => mannequin::layered_with_trousers(&params),
    }
}

fn params(size: Size) -> MannequinParams {
    let resolution = match size {
        Size::Coarse => 0.7,
        Size::Normal => 1.0,
        Size::Fine => 2.0,
    };
    MannequinParams { resolution, ..Default::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mannequin_takes_every_size() {
        for size in Size::value_variants() {
            assert_eq!(params(*size).validate(), Ok(()), "{size:?}");
        }
    }
}
