//! Any bytes as a GLB file: no panic, no hang, and what is read is written and read again.
#![no_main]

use if_core::math::Vector;
use if_mesh::glb::{self, Normals};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(file) = glb::read(bytes.to_vec()) else { return };
    assert!(file.mesh().vertices().iter().all(|p| p.iter().all(|x| x.is_finite())));
    let moved: Vec<_> = file.mesh().vertices().iter().map(|p| p + Vector::repeat(0.01)).collect();
    let mut written = Vec::new();
    if glb::write(&file, &moved, Normals::Follow, &mut written).is_ok() {
        let again = glb::read(written).expect("what was written is a GLB file");
        assert_eq!(again.mesh().vertices(), file.positions_as_written(&moved));
    }
});
