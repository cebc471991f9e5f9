//! An outfit of files, resolved and written again with all attributes: what `ifg fix` does at its
//! core, for programs that do it themselves.
//!
//! `cargo run --release -p if-pipeline --no-default-features --example fix_files -- OUT BODY INNER
//! … OUTER`

use if_mesh::file::MeshFile;
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{ResolveError, ResolveParams, resolve};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

fn name(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

#[allow(clippy::print_stdout)] // an example
fn main() -> Result<(), Box<dyn Error>> {
    let mut paths = std::env::args_os().skip(1).map(PathBuf::from);
    let (Some(out), Some(body)) = (paths.next(), paths.next()) else {
        return Err("usage: fix_files OUT BODY INNER … OUTER".into());
    };
    let body = Layer::of_file("body", &MeshFile::read(&body)?);
    let paths: Vec<PathBuf> = paths.collect();
    let files = paths.iter().map(|path| MeshFile::read(path)).collect::<Result<Vec<_>, _>>()?;
    let garments = paths.iter().zip(&files).map(|(path, file)| Layer::of_file(name(path), file));
    let outfit = Outfit::new(body, garments.collect())?;

    // `watch` is called often; a window would draw a bar, and break when its button is pressed.
    let mut watch = |_: &if_core::monitor::Progress| ControlFlow::Continue(());
    let resolved = match resolve(&outfit, &ResolveParams::default(), &mut watch) {
        Ok(resolved) => resolved,
        Err(ResolveError::Remaining { outer, inner, triangles, .. }) => {
            return Err(format!(
                "{outer} cannot be brought over {inner}; look at their triangles {triangles:?}"
            )
            .into());
        }
        Err(e) => return Err(e.into()),
    };

    std::fs::create_dir_all(&out)?;
    for ((path, file), garment) in paths.iter().zip(&files).zip(&resolved.outfit.garments) {
        file.write(&out.join(path.file_name().unwrap_or_default()), garment.mesh.vertices())?;
    }
    for layer in &resolved.report.layers {
        println!(
            "{}: moved by {:.1} mm at most, strained by {:.1} % rms",
            layer.name,
            1e3 * layer.moved.max,
            100.0 * layer.strain.rms
        );
    }
    println!(
        "{} -> {} pairs",
        resolved.report.before.total_pairs(),
        resolved.report.after.total_pairs()
    );
    Ok(())
}
