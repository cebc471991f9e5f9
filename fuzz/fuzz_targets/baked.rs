//! Any bytes as a baked field, and the bytes of a field with some changed: no panic, no hang, no memory for what is not there; what is read is
//! written as the same bytes, and can be asked anywhere.
//!
//! The first byte says whether the rest are the file, or changes to that of a ball: four bytes each, what, where (two) and with what.
#![no_main]

use if_core::field::SignedDistance;
use if_core::math::Point;
use if_core::shapes::Sphere;
use if_mesh::baked::{BakeParams, Baked};
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

static BALL: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let ball = Sphere { center: Point::new(0.01, 0.02, -0.03), radius: 0.2 };
    let params = BakeParams { cell: 0.05, depth: 0.1, ..BakeParams::default() };
    Baked::new(&ball, &params).expect("a ball can be baked").to_bytes()
});

const NUMBERS: [f64; 8] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1.0, 0.0, 5e-324, 1e-9];

fuzz_target!(|input: &[u8]| {
    let [how, rest @ ..] = input else { return };
    let bytes = if how % 2 == 0 {
        rest.to_vec()
    } else {
        let mut bytes = BALL.clone();
        for change in rest.chunks_exact(4) {
            let at = usize::from(u16::from_le_bytes([change[1], change[2]])) % bytes.len().max(1);
            match change[0] % 4 {
                0 => bytes[at..].iter_mut().take(1).for_each(|b| *b = change[3]),
                1 => bytes[at..].iter_mut().take(1).for_each(|b| *b ^= change[3]),
                2 => bytes.iter_mut().skip(at).zip(NUMBERS[usize::from(change[3] % 8)].to_le_bytes()).for_each(|(b, n)| *b = n),
                _ if change[3] == 77 => bytes.truncate(at),
                _ => bytes.insert(at, change[3]),
            }
        }
        bytes
    };
    let Ok(field) = Baked::from_bytes(&bytes) else { return };
    assert_eq!(field.to_bytes(), bytes);
    for p in [[0.0, 0.0, 0.0], [0.1, -0.2, 0.3], [1e6, 0.0, 0.0], [-0.05, 0.01, -1e-9], [0.2, 0.02, -0.03]] {
        assert!(!field.sample(&Point::from(p)).distance.is_nan(), "{p:?}");
    }
});
