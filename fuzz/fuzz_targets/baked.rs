//! Any bytes as a baked field: no panic, no hang, no memory for what is not there; and what is read is written as the same bytes, and can be asked anywhere.
#![no_main]

use if_core::field::SignedDistance;
use if_core::math::Point;
use if_mesh::baked::Baked;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(field) = Baked::from_bytes(bytes) else { return };
    assert_eq!(field.to_bytes(), bytes);
    for p in [[0.0, 0.0, 0.0], [0.1, -0.2, 0.3], [1e6, 0.0, 0.0], [-0.05, 0.01, -1e-9]] {
        assert!(!field.sample(&Point::from(p)).distance.is_nan());
    }
});
