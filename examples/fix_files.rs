//! Mesh files in, resolved mesh files out, with all their attributes: what `ifg fix` does.
//!
//! ```text
//! cargo run --release --example fix_files                              # the built-in scene
//! cargo run --release --example fix_files -- OUT BODY INNER … OUTER
//! ```

#![allow(clippy::print_stdout)] // a program for the terminal

use if_garments::body::mannequin::{MannequinParams, layered};
use if_garments::mesh::ply::{PlyMesh, WriteParams, write_path};
use if_garments::{FilesError, LayerFile, OutfitFiles, ResolveParams, Silent};
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = tempfile::tempdir()?;
    let mut paths: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    if paths.is_empty() {
        paths.push(scene.path().join("out"));
        paths.extend(write_scene(scene.path())?);
    }
    let [out, body, garments @ ..] = paths.as_slice() else {
        return Err("usage: fix_files OUT BODY INNER … OUTER".into());
    };

    // The last argument is the factor from the units of the files to metres.
    let garments = garments.iter().map(LayerFile::new).collect();
    let files = OutfitFiles::read(LayerFile::new(body), garments, 1.0)?;
    let resolved = match files.resolve(&ResolveParams::default(), &mut Silent) {
        // The error holds the result, too. It could be written, but it is not proven.
        Err(FilesError::Unresolved { unresolved, .. }) => {
            return Err(format!("{unresolved}; triangles {:?}", unresolved.triangles).into());
        }
        other => other?,
    };
    for path in resolved.write(out)? {
        println!("wrote {}", path.display());
    }
    assert!(files.outfit().garments.len() == resolved.outfit.garments.len());
    assert!(resolved.report.is_proven()); // of the positions as the files store them
    Ok(())
}

/// Writes the layers of the built-in scene, the body first, and returns their paths.
fn write_scene(folder: &Path) -> Result<Vec<PathBuf>, Box<dyn std::error::Error>> {
    let mut paths = Vec::new();
    for (name, mesh) in layered(&MannequinParams { resolution: 0.7, ..Default::default() }) {
        paths.push(folder.join(format!("{name}.ply")));
        let file = PlyMesh::new(mesh);
        write_path(&file, file.mesh.vertices(), &WriteParams::default(), &paths[paths.len() - 1])?;
    }
    Ok(paths)
}
