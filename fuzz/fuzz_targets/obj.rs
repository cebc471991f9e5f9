//! Any bytes as an OBJ file: no panic, no hang, and what is read is written and read again.
#![no_main]

use if_mesh::obj::{self, Normals};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(file) = obj::read(bytes) else { return };
    assert!(file.mesh().vertices().iter().all(|p| p.iter().all(|x| x.is_finite())));
    let mut written = Vec::new();
    obj::write(&file, file.mesh().vertices(), Normals::Follow, &mut written).expect("positions have not changed");
    let again = obj::read(&written[..]).expect("what was written is an OBJ file");
    assert_eq!(again.mesh(), file.mesh());
});
