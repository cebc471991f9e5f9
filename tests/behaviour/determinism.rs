//! The same input gives the same bits, on any number of threads.

use crate::scenes::{mannequin, resolved};
use if_body::mannequin::Garment;
use if_outfit::outfit::Outfit;

/// The bits of every coordinate of every garment.
fn bits(outfit: &Outfit) -> Vec<u64> {
    outfit
        .garments
        .iter()
        .flat_map(|g| g.mesh.vertices())
        .flat_map(|p| p.iter().map(|x| x.to_bits()))
        .collect()
}

fn with_threads(threads: usize, outfit: &Outfit) -> Vec<u64> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    bits(&pool.install(|| resolved(outfit)).unwrap().outfit)
}

#[test]
fn one_two_and_seven_threads_and_a_second_run_give_the_same_bits() {
    let outfit = mannequin(&[Garment::Tshirt, Garment::Jacket], 1.0);
    let first = with_threads(1, &outfit);
    assert_ne!(first, bits(&outfit), "nothing moved, so nothing is tested");
    for threads in [1, 2, 7] {
        assert!(first == with_threads(threads, &outfit), "{threads} threads");
    }
}

#[test]
fn the_built_in_scene_is_made_of_the_same_bits_twice() {
    let make = || mannequin(&[Garment::Skirt], 1.0);
    let (a, b) = (make(), make());
    assert!(bits(&a) == bits(&b) && a == b);
}
