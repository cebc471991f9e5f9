//! Any bytes as a glTF file, binary or JSON: no panic, no hang, and what is read is written and read
//! again.
#![no_main]

use if_core::math::Vector;
use if_mesh::gltf::{self, Normals};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(file) = gltf::read(bytes.to_vec()) else { return };
    assert!(file.mesh().vertices().iter().all(|p| p.iter().all(|x| x.is_finite())));
    let _ = file.influences();
    let moved: Vec<_> = file.mesh().vertices().iter().map(|p| p + Vector::repeat(0.01)).collect();
    if let Ok(written) = gltf::write(&file, &moved, Normals::Follow) {
        assert!(written.beside.is_empty());
        let again = gltf::read(written.bytes).expect("what was written is a glTF file");
        assert_eq!(again.mesh().vertices(), file.positions_as_written(&moved));
    }
});
