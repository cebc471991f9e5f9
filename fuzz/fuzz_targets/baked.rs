//! Bytes of a baked field, damaged: no panic, no hang, no memory for what is not there; and what is
//! read is written as the same bytes, can be asked anywhere, and keeps what it says of its errors,
//! its slope and its bounds.
//!
//! The first byte chooses one of some small fields, which the code bakes and writes, or the input
//! itself as a file. What follows are changes of the file, four bytes each and a value: of a number
//! in the header, of the tree, of a node, of any byte, of the length. As its first byte has it, the
//! file is mended before it is read: as many codes in the tree as the header says, as many nodes as
//! the tree has bricks. Else nearly all would be refused at once.
#![no_main]

use if_core::monitor::Silent;
use if_core::field::SignedDistance;
use if_core::math::{Point, Vector};
use if_core::shapes::{Capsule, Sphere, Union};
use if_mesh::baked::{BakeParams, Baked};
use libfuzzer_sys::fuzz_target;
use std::sync::OnceLock;

/// Bytes before the number of errors, of which the last 120 are fifteen numbers of eight bytes.
const NUMBERS: std::ops::Range<usize> = 14..134;
/// Bytes of a brick: 125 nodes of four single numbers.
const BRICK: usize = 2000;

/// Files of small fields: one empty, one of a level, one of three, one with all of its inside.
fn files() -> &'static [Vec<u8>; 4] {
    static FILES: OnceLock<[Vec<u8>; 4]> = OnceLock::new();
    FILES.get_or_init(|| {
        let ball = Sphere { center: Point::new(0.01, 0.02, -0.03), radius: 0.1 };
        let limb = Capsule { from: Point::new(-0.05, -0.1, 0.0), to: Point::new(0.07, 0.05, 0.02), radius: 0.03 };
        let coarse = BakeParams { cell: 0.02, band: 0.02, depth: 0.02, accuracy: f64::INFINITY, ..BakeParams::default() };
        let bake = |params: BakeParams| Baked::new(&Union(ball, limb), &params, &mut Silent).expect("a field that can be baked").to_bytes();
        let region = if_core::aabb::Aabb { min: Point::new(1.0, 1.0, 1.0), max: Point::new(1.2, 1.2, 1.2) };
        [
            bake(BakeParams { region: Some(region), ..coarse }),
            bake(coarse),
            bake(BakeParams { accuracy: 1e-3, levels: 2, ..coarse }),
            bake(BakeParams { depth: f64::INFINITY, ..coarse }),
        ]
    })
}

/// A file in its parts.
struct Parts {
    head: Vec<u8>,
    tree: Vec<u8>,
    nodes: Vec<u8>,
}

impl Parts {
    fn of(file: &[u8]) -> Self {
        let number = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().expect("four bytes")) as usize;
        let count = NUMBERS.end + 4 + 8 * number(NUMBERS.end) + 1 + 12;
        let (tree, nodes) = file[count + 4..].split_at(number(count));
        Self { head: file[..count + 4].to_vec(), tree: tree.to_vec(), nodes: nodes.to_vec() }
    }

    fn change(&mut self, kind: u8, place: u16, value: &[u8]) {
        let byte = value[0];
        // What single and double numbers have at their ends.
        let special = match byte % 16 {
            0 => 0.0,
            1 => -0.0,
            2 => f64::NAN,
            3 => f64::INFINITY,
            4 => f64::NEG_INFINITY,
            5 => f64::from_bits(1),
            6 => f64::MIN_POSITIVE,
            7 => f64::MAX,
            8 => -f64::MAX,
            9 => f64::from(f32::MAX),
            10 => -f64::from(f32::MAX),
            11 => 1e-40,
            12 => 1e150,
            13 => -1e-150,
            _ => f64::from(byte as i8) / 32.0,
        };
        let place = usize::from(place);
        match kind % 8 {
            0 => {
                let at = NUMBERS.start + 8 * (place % (NUMBERS.len() / 8));
                self.head[at..at + 8].copy_from_slice(&special.to_le_bytes());
            }
            1 => {
                // The size of the grid, or the number of codes.
                let at = self.head.len() - 16 + 4 * (place % 4);
                self.head[at..at + 4].copy_from_slice(&u32::from(byte).to_le_bytes());
            }
            2 => {
                let at = place % self.head.len();
                self.head[at] = byte;
            }
            3 if !self.tree.is_empty() => {
                let at = place % self.tree.len();
                self.tree[at] = byte % 5;
            }
            4 => {
                let at = place % (self.tree.len() + 1);
                self.tree.splice(at..at, value.iter().map(|b| b % 4));
            }
            5 if !self.tree.is_empty() => {
                let at = place % self.tree.len();
                self.tree.drain(at..(at + usize::from(byte) % 16).min(self.tree.len()));
            }
            6 if self.nodes.len() >= 4 => {
                let at = 4 * (place % (self.nodes.len() / 4));
                self.nodes[at..at + 4].copy_from_slice(&(special as f32).to_le_bytes());
            }
            7 => self.nodes.resize(self.nodes.len().saturating_add_signed(isize::from(byte as i8)), byte),
            _ => {}
        }
    }

    /// As many codes and nodes as are said to be there.
    fn mend(&mut self) {
        let count = self.head.len() - 4;
        self.head[count..].copy_from_slice(&(self.tree.len() as u32).to_le_bytes());
        let bricks = self.tree.iter().filter(|code| **code == 2).count();
        self.nodes.resize(BRICK * bricks, 0);
    }
}

fuzz_target!(|bytes: &[u8]| {
    let Some((choice, changes)) = bytes.split_first() else { return };
    let file = match files().get(usize::from(choice % 8)) {
        None => changes.to_vec(),
        Some(file) => {
            let mut parts = Parts::of(file);
            for change in changes.chunks_exact(6) {
                parts.change(change[0], u16::from_le_bytes([change[1], change[2]]), &change[3..]);
            }
            if choice & 8 == 0 {
                parts.mend();
            }
            [parts.head, parts.tree, parts.nodes].concat()
        }
    };
    let Ok(field) = Baked::from_bytes(&file) else {
        assert!(!changes.is_empty() || choice % 8 >= 4, "a file that was not changed is refused");
        return;
    };
    assert!(field.to_bytes() == file, "another file");
    assert!(field.bytes() <= 16 * file.len(), "{} bytes made of {}", field.bytes(), file.len());
    assert!(field.error_bound() >= 0.0 && field.error_bound_within(0.01) >= 0.0, "an error below zero");
    assert!(field.lipschitz() >= 1.0 && field.lipschitz().is_finite(), "a slope of {}", field.lipschitz());
    let box_ = field.bounds();
    let held = box_.map(|b| b.inflated(1e-6 * field.cell()));
    let inside = |k: u32| {
        let share = |m: f64| (f64::from(k) * m).fract();
        box_.map(|b| b.min + Vector::new(share(0.618), share(0.414), share(0.732)).component_mul(&b.size()))
    };
    let asked = [[0.0, 0.0, 0.0], [0.1, -0.2, 0.3], [1e6, 0.0, 0.0], [-0.05, 0.01, -1e-9], [0.06, 0.02, -0.03], [f64::MAX; 3]];
    let asked = asked.into_iter().map(Point::from).chain((0..20).filter_map(inside));
    for p in asked.filter(|p| p.iter().all(|x| x.is_finite())) {
        let sample = field.sample(&p);
        assert!(!sample.distance.is_nan() && !field.distance(&p).is_nan(), "{p}");
        assert!(sample.gradient.norm() <= field.lipschitz() * (1.0 + 1e-6), "{p}: {}", sample.gradient);
        // Beside values of 1e38 rounding decides the sign of a small one.
        let huge = sample.gradient.norm() > 1e6;
        assert!(huge || sample.distance > 0.0 || held.is_some_and(|b| b.contains(&p)), "{p} is inside, beyond the bounds");
    }
});
