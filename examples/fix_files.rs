//! Resolves an outfit of mesh files: read, resolved, proven as stored, and written back with all
//! attributes.
//!
//! `cargo run --release --example fix_files -- OUT BODY INNER … OUTER`

use if_garments::core::monitor::Silent;
use if_garments::outfit::files::{FilesError, LayerFile, OutfitFiles};
use if_garments::outfit::resolve::ResolveParams;
use std::error::Error;
use std::path::PathBuf;

#[allow(clippy::print_stdout)] // an example
fn main() -> Result<(), Box<dyn Error>> {
    let mut paths = std::env::args_os().skip(1).map(PathBuf::from);
    let (Some(out), Some(body)) = (paths.next(), paths.next()) else {
        return Err("usage: fix_files OUT BODY INNER … OUTER".into());
    };
    // The factor from the units of the files to metres.
    let scale = 1.0;
    let files =
        OutfitFiles::read(LayerFile::new(body), paths.map(LayerFile::new).collect(), scale)?;

    let resolved = match files.resolve(&ResolveParams::default(), &mut Silent) {
        // Writing it is possible, but it is not proven.
        Err(FilesError::Unresolved { unresolved, .. }) => {
            return Err(format!("{unresolved}; triangles {:?}", unresolved.triangles).into());
        }
        other => other?,
    };
    for path in resolved.write(&out)? {
        println!("wrote {}", path.display());
    }
    let [before, after] = [&resolved.report.before, &resolved.report.after];
    println!("{} -> {} intersecting pairs", before.total_pairs(), after.total_pairs());
    Ok(())
}
