//! Reads a PLY file and writes it again: `ply_roundtrip in.ply out.ply [portable|double]`.
//!
//! `portable` drops what meshio 5.3.5 cannot read; `double` writes coordinates of eight bytes. Used
//! by `tests/files/meshio_interop.py`.

use if_mesh::ply::{self, CoordinateType, Keep, WriteParams};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [input, output, flags @ ..] = &args[..] else {
        return Err("usage: ply_roundtrip IN OUT [portable|double]".into());
    };
    let file = ply::read_path(Path::new(input))?;
    let mut params = WriteParams { coordinates: file.coordinates, ..WriteParams::default() };
    for flag in flags {
        match flag.as_str() {
            "portable" => params.keep = Keep::Portable,
            "double" => params.coordinates = CoordinateType::Double,
            other => return Err(format!("unknown flag {other}").into()),
        }
    }
    ply::write_path(&file, file.mesh.vertices(), &params, Path::new(output))?;
    Ok(())
}
