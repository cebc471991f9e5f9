use super::*;
use crate::baked::blend::SIDE;
use crate::baked::join::join;

fn quadratic(p: &Point) -> (Real, Vector) {
    let value = 0.3 + p.x - 2.0 * p.y + 0.5 * p.z + p.x * p.x - p.x * p.y + 2.0 * p.y * p.z
        - 0.7 * p.z * p.z;
    (value, Vector::new(1.0 + 2.0 * p.x - p.y, -2.0 - p.x + 2.0 * p.z, 0.5 + 2.0 * p.y - 1.4 * p.z))
}

fn filled(bricks: &mut Bricks, f: impl Fn(&Point) -> (Real, Vector)) {
    for brick in 0..bricks.places.len() {
        let level = bricks.places[brick].level;
        for i in 0..BRICK {
            let (l, at) = (local(i), bricks.node(brick, i));
            let (v, g) = f(&bricks.at(level, at));
            let bump = |k: usize| {
                let mut next = at;
                next[k] += 1;
                let end = f(&bricks.at(level, next)).1[k];
                if l[k] < SIDE { (0.5 * bricks.cell_of(level) * (g[k] - end)) as f32 } else { 0.0 }
            };
            bricks.nodes[brick * BRICK + i] = [v as f32, bump(0), bump(1), bump(2)];
        }
    }
}

/// Two bricks that share a side, the second split, and one half of that again.
fn split() -> Bricks {
    let place = |level, x, y, z| Place { level, at: [x, y, z] };
    let halves = |level, at: [u32; 3]| {
        (0..8u32)
            .map(move |k| place(level, at[0] + (k & 1), at[1] + (k >> 1 & 1), at[2] + (k >> 2 & 1)))
    };
    let mut places = vec![place(0, 0, 0, 0)];
    places.extend(halves(1, [2, 0, 0]).skip(1));
    places.extend(halves(2, [4, 0, 0]));
    let roots = vec![0, SPLIT, INSIDE];
    let splits = vec![[SPLIT + 1, 1, 2, 3, 4, 5, 6, 7], [8, 9, 10, 11, 12, 13, 14, 15]];
    let nodes = vec![[0.0; 4]; places.len() * BRICK];
    Bricks::from_parts(Point::new(-0.5, 0.0, 0.25), 0.25, [3, 1, 1], roots, splits, places, nodes)
        .indexed(index::MOST)
        .unwrap()
}

#[test]
fn quadratic_fields_are_exact_at_every_level() {
    let mut bricks = split();
    filled(&mut bricks, quadratic);
    for k in 0..500 {
        let s = |m: Real| (Real::from(k) * m).fract();
        let p = Point::new(-0.5 + 2.0 * s(0.618), s(0.414), 0.25 + s(0.732));
        let (value, gradient) = quadratic(&p);
        let Reading::Blend(v, g) = bricks.read(&p) else { panic!("{p} is in a brick") };
        // Single precision of values of about 5.
        approx::assert_relative_eq!(v, value, epsilon = 2e-6);
        approx::assert_relative_eq!(g, gradient, epsilon = 1e-4);
    }
    assert_eq!(bricks.read(&Point::new(1.6, 0.5, 0.5)), Reading::Inside);
    assert_eq!(bricks.read(&Point::new(-0.6, 0.5, 0.5)), Reading::Outside);
    assert_eq!(bricks.read(&Point::new(2.6, 0.5, 0.5)), Reading::Outside);
}

#[test]
fn joined_cells_of_three_sizes_leave_no_gap() {
    let mut bricks = split();
    // Far from quadratic: each level has another field.
    filled(&mut bricks, |p| {
        let (a, b, c) = (9.0 * p.x, 7.0 * p.y, 8.0 * p.z);
        (
            a.sin() * b.cos() + c.sin(),
            Vector::new(9.0 * a.cos() * b.cos(), -7.0 * a.sin() * b.sin(), 8.0 * c.cos()),
        )
    });
    let gap = |bricks: &Bricks| {
        let mut gap: Real = 0.0;
        for k in 0..4000 {
            let s = |m: Real| (Real::from(k) * m).fract();
            // On the border of levels 0 and 1 and 2, on those of 1 and 2, and on edges of them.
            for (on, axis) in [
                (Point::new(0.5, s(0.618), 0.25 + s(0.414)), 0),
                (Point::new(1.0, 0.5 * s(0.618), 0.25 + 0.5 * s(0.414)), 0),
                (Point::new(0.5 + 0.5 * s(0.618), 0.5, 0.25 + 0.5 * s(0.414)), 1),
                (Point::new(0.5 + 0.5 * s(0.618), 0.5 * s(0.414), 0.75), 2),
                (Point::new(1.0, 0.5, 0.25 + 0.5 * s(0.414)), 0),
            ] {
                let off = Vector::ith(axis, 1e-12);
                let [Reading::Blend(a, _), Reading::Blend(b, _)] =
                    [bricks.read(&(on - off)), bricks.read(&(on + off))]
                else {
                    panic!("{on} is in a brick")
                };
                gap = gap.max((a - b).abs());
            }
        }
        gap
    };
    let before = gap(&bricks);
    join(&mut bricks);
    // Values of 2 in single precision.
    assert!(before > 1e-2 && gap(&bricks) < 1e-6, "{before} {}", gap(&bricks));
}

#[test]
fn five_halvings_are_found_through_two_tables() {
    // One corner of the root is halved five times.
    let (mut places, mut splits) = (Vec::new(), Vec::new());
    for level in 1..=5u32 {
        let first = places.len() as u32;
        let halves: [u32; 8] =
            std::array::from_fn(
                |k| {
                    if k == 7 && level < 5 { SPLIT + level } else { first + k as u32 }
                },
            );
        for k in (0..8u32).take(if level < 5 { 7 } else { 8 }) {
            let at = [0, 1, 2].map(|a| (1 << level) - 2 + (k >> a & 1));
            places.push(Place { level, at });
        }
        splits.push(halves);
    }
    let nodes = vec![[0.0; 4]; places.len() * BRICK];
    let bricks =
        Bricks::from_parts(Point::origin(), 0.5, [1, 1, 1], vec![SPLIT], splits, places, nodes);
    let bricks = bricks.indexed(index::MOST).unwrap();
    for (brick, place) in bricks.places.iter().enumerate() {
        assert_eq!(bricks.entry(place), (brick as u32, place.level));
        for i in 0..BRICK {
            if local(i).iter().all(|l| *l < SIDE) {
                let p = bricks.at(place.level, bricks.node(brick, i)) + Vector::repeat(1e-9);
                let Spot::Cell { slot, u, .. } = bricks.spot(&p) else {
                    panic!("{p} is in a brick")
                };
                assert!(slot == brick * BRICK + i && u.iter().all(|u| *u < 1e-6), "{place:?} {i}");
            }
        }
    }
}

#[test]
fn the_directory_finds_every_brick() {
    let bricks = split();
    let mut leaves = bricks.leaves();
    leaves.sort_unstable();
    assert_eq!(leaves, (0..16).collect::<Vec<u32>>());
    for (brick, place) in bricks.places.iter().enumerate() {
        assert_eq!(bricks.entry(place), (brick as u32, place.level));
        let middle = bricks.at(place.level, bricks.node(brick, BRICK / 2)) + Vector::repeat(1e-9);
        let Spot::Cell { slot, inverse, .. } = bricks.spot(&middle) else {
            panic!("{middle} is in a brick")
        };
        assert_eq!((slot, inverse), (brick * BRICK + BRICK / 2, 1.0 / bricks.cell_of(place.level)));
    }
}
