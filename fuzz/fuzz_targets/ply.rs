//! Any bytes as a PLY file: no panic, no hang, no memory beyond a few times the file; and what is
//! read is written and read again.
#![no_main]

use if_mesh::ply::{self, WriteParams};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let sized = ply::read_bytes(bytes);
    let streamed = ply::read(bytes);
    assert_eq!(sized.is_ok(), streamed.is_ok());
    let Ok(file) = sized else { return };
    assert!(file.mesh.vertices().iter().all(|p| p.iter().all(|x| x.is_finite())));
    let params = WriteParams { coordinates: file.coordinates, ..WriteParams::default() };
    let mut written = Vec::new();
    // Names that a header cannot hold again are refused; nothing else.
    if ply::write(&file, file.mesh.vertices(), &params, &mut written).is_ok() {
        let again = ply::read_bytes(&written).expect("what was written is a PLY file");
        assert_eq!(again.mesh.triangles(), file.mesh.triangles());
        assert_eq!(again.mesh.vertices(), file.mesh.vertices());
    }
});
