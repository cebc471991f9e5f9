//! Voxels that several threads mark.

use if_core::aabb::Aabb;
use if_core::math::{Point, Real};
use if_core::shapes::meshes::icosphere;
use if_mesh::voxels::{Voxel, Voxels};
use rayon::prelude::*;

/// The states of all voxels of a block, by points in them.
fn states(voxels: &Voxels, region: &Aabb) -> Vec<Voxel> {
    let cells = (region.size().max() / voxels.cell()).ceil() as usize + 5;
    let at = |k: usize| region.min.x + (k as Real - 1.5) * voxels.cell();
    let places = (0..cells).flat_map(|z| (0..cells).map(move |y| (y, z)));
    let rows = places.flat_map(|(y, z)| (0..cells).map(move |x| [x, y, z]));
    rows.map(|[x, y, z]| voxels.at(&Point::new(at(x), at(y), at(z)))).collect()
}

#[test]
fn walls_and_shadows_at_once_are_those_one_after_the_other() {
    let ball = icosphere(1.0, 3);
    let region = ball.aabb().inflated(0.2);
    let rays: Vec<[Point; 2]> =
        ball.vertices().iter().map(|p| [*p, Point::from(p.coords * 0.6)]).collect();
    let block = || Voxels::new(&region, 0.05);
    let mut one_by_one = block();
    (0..ball.triangles().len()).for_each(|t| one_by_one.add_wall(ball.corners(t)));
    rays.iter().for_each(|ray| one_by_one.fill([*ray].into_par_iter()));
    one_by_one.flood(|_| true);
    let expected = states(&one_by_one, &region);
    let count = |state| expected.iter().filter(|s| **s == state).count();
    for state in [Voxel::Outside, Voxel::Inside, Voxel::Wall, Voxel::Filled] {
        assert!(count(state) > 500, "{state:?}: {}", count(state));
    }
    for threads in [1, 2, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found = pool.install(|| {
            let mut voxels = block();
            voxels.add_walls(&ball);
            voxels.fill(rays.par_iter().copied());
            voxels.flood(|_| true);
            voxels
        });
        assert_eq!(states(&found, &region), expected, "{threads} threads");
        assert_eq!(found.counts(), one_by_one.counts());
    }
}
