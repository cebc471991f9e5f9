//! What repairs have drawn out is eased, and stays clean; what they have not is not touched.

use crate::scenes::{assert_clean, mannequin};
use if_body::mannequin::Garment::{Coat, Jacket, Tshirt};
use if_core::monitor::Silent;
use if_outfit::outfit::Outfit;
use if_outfit::resolve::{ResolveError, ResolveParams, Resolved, resolve};

fn run(outfit: &Outfit, ease_rounds: usize) -> Result<Resolved, ResolveError> {
    let mut params = ResolveParams::default();
    params.effort.ease_rounds = ease_rounds;
    resolve(outfit, &params, &mut Silent)
}

#[test]
fn the_largest_strain_falls_the_others_do_not_grow_and_the_outfit_stays_clean() {
    // A T-shirt over a coat: it is far too tight, and drawn out at the armpits.
    let outfit = mannequin(&[Coat, Tshirt], 1.0);
    let (never, eased) =
        (assert_clean(&outfit, run(&outfit, 0)), assert_clean(&outfit, run(&outfit, 40)));
    assert_eq!(never.outfit.garments[0], eased.outfit.garments[0]);
    let (before, after) = (&never.report.layers[1], &eased.report.layers[1]);
    assert_eq!((before.eased, after.eased), ([0.0; 2], [before.strain.max, after.strain.max]));
    assert!(
        before.strain.max > 0.5 && after.strain.max < 0.95 * before.strain.max,
        "{:?} {:?}",
        before.strain,
        after.strain
    );
    assert!(after.strain.rms <= before.strain.rms && after.moved.max <= 1.02 * before.moved.max);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    assert_eq!(pool.install(|| run(&outfit, 40)).unwrap().outfit, eased.outfit);
}

#[test]
fn where_no_edge_is_drawn_no_bit_changes() {
    let outfit = mannequin(&[Tshirt, Jacket, Coat], 1.0);
    let (never, eased) = (run(&outfit, 0).unwrap(), run(&outfit, 40).unwrap());
    assert!(never.report.layers.iter().any(|l| l.moved.vertices > 0));
    assert_eq!(never.outfit, eased.outfit);
    assert!(eased.report.layers.iter().all(|l| l.eased == [0.0; 2]));
}
