use super::*;

fn points(n: usize, seed: u64) -> Vec<[f32; 3]> {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    (0..n).map(|_| [0; 3].map(|_| random.random_range(-1.05..1.05))).collect()
}

fn small(features: u32, hidden: u32, table: u32) -> GridField {
    let config = GridConfig {
        coarsest: 4,
        finest: 9,
        levels: 3,
        features,
        table,
        hidden,
        softness: 0.3,
        seed: 7,
    };
    let mut grid = GridField::new(config).unwrap();
    let mut random = Pcg64Mcg::seed_from_u64(3);
    for p in grid.parameters_mut() {
        *p += random.random_range(-0.3..0.3);
    }
    grid
}

/// The field in f64, written down anew from the formula.
fn slow(grid: &GridField, params: &[f64], p: [f64; 3]) -> f64 {
    let f = grid.config.features as usize;
    let spline = |x: f64| match x.abs() {
        a if a < 0.5 => 0.75 - a * a,
        a if a < 1.5 => 0.5 * (1.5 - a).powi(2),
        _ => 0.0,
    };
    let mut features = Vec::new();
    for level in &grid.levels {
        let mut sum = vec![0.0; f];
        for k in 0..level.side {
            for j in 0..level.side {
                for i in 0..level.side {
                    let w: f64 = [i, j, k]
                        .iter()
                        .zip(p)
                        .map(|(n, x)| {
                            spline((x + 1.0) * level.cells as f64 / 2.0 + 1.0 - *n as f64)
                        })
                        .product();
                    let at = level.offset + (level.row(j, k) + i) * f;
                    (0..f).for_each(|c| sum[c] += w * params[at + c]);
                }
            }
        }
        features.extend(sum);
    }
    let head = &params[grid.tables()..];
    let (d, h) = (features.len(), grid.head.hidden);
    let mut value = head[h * (d + 2)];
    for (x, w) in features.iter().zip(&grid.head.linear) {
        value += x * f64::from(*w);
    }
    for j in 0..h {
        let z: f64 = head[h * d + j] + (0..d).map(|i| head[j * d + i] * features[i]).sum::<f64>();
        value += head[h * (d + 1) + j] * 0.5 * (z + (z * z + f64::from(grid.head.softness)).sqrt());
    }
    value
}

fn slow_gradient(grid: &GridField, params: &[f64], p: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| {
        let at = |d: f64| {
            let mut q = p;
            q[k] += d;
            slow(grid, params, q)
        };
        (at(1e-5) - at(-1e-5)) / 2e-5
    })
}

fn double(x: &[f32]) -> Vec<f64> {
    x.iter().map(|v| f64::from(*v)).collect()
}

#[test]
fn value_and_gradient_are_those_of_the_formula_dense_and_hashed() {
    for (features, hidden, table) in [(1, 0, 1 << 20), (2, 5, 1 << 20), (4, 3, 300), (1, 4, 300)] {
        let grid = small(features, hidden, table);
        let points: Vec<[f32; 3]> = points(37, 5)
            .into_iter()
            .map(|p| p.map(|x| x.clamp(-0.999, 0.999)))
            .chain([[0.0; 3], [1.0, -1.0, 1.0]])
            .collect();
        let mut out = vec![Sample32::default(); points.len()];
        grid.samples32(&points, &mut out);
        let params = double(grid.parameters());
        for (p, s) in points.iter().zip(&out) {
            let p = p.map(f64::from);
            // Features of order 1 in f32: 1e-7 each, some hundred of them.
            approx::assert_abs_diff_eq!(
                f64::from(s.value),
                slow(&grid, &params, p),
                epsilon = 1e-5
            );
            for (got, expected) in s.gradient.iter().zip(slow_gradient(&grid, &params, p)) {
                approx::assert_abs_diff_eq!(f64::from(*got), expected, epsilon = 3e-4);
            }
        }
    }
}

/// A loss on value and gradient with all cross terms, and its derivatives.
fn loss(i: usize, s: Sample32) -> PointLoss {
    let (v, g) = (f64::from(s.value), s.gradient.map(f64::from));
    let a = 0.3 + 0.1 * (i % 5) as f64;
    let along = a * g[0] - g[1] + 0.5 * g[2];
    let square: f64 = g.iter().map(|x| x * x).sum();
    PointLoss {
        loss: v * v * a + v * along + 0.25 * (square - 1.0).powi(2),
        d_value: (2.0 * a * v + along) as f32,
        d_gradient: [0, 1, 2].map(|k| (v * [a, -1.0, 0.5][k] + (square - 1.0) * g[k]) as f32),
    }
}

#[test]
fn parameter_derivatives_are_central_differences_of_the_formula() {
    for (features, hidden, table) in [(1, 0, 1 << 20), (2, 3, 300)] {
        let grid = small(features, hidden, table);
        let points: Vec<[f32; 3]> =
            points(19, 11).into_iter().map(|p| p.map(|x| 0.95 * x)).collect();
        let mut gradient = vec![f32::NAN; grid.parameters().len()];
        grid.loss_gradient(&points, &loss, &mut gradient);
        let params = double(grid.parameters());
        let total = |params: &[f64]| -> f64 {
            points
                .iter()
                .enumerate()
                .map(|(i, p)| {
                    let p = p.map(f64::from);
                    let (v, g) = (slow(&grid, params, p), slow_gradient(&grid, params, p));
                    let a = 0.3 + 0.1 * (i % 5) as f64;
                    let square: f64 = g.iter().map(|x| x * x).sum();
                    v * v * a + v * (a * g[0] - g[1] + 0.5 * g[2]) + 0.25 * (square - 1.0).powi(2)
                })
                .sum()
        };
        let scale = gradient.iter().fold(0.0f32, |m, g| m.max(g.abs()));
        let tables = grid.tables();
        let stride = (tables / 12).max(1);
        let chosen =
            (0..tables).step_by(stride).chain(tables..params.len()).chain([tables / 2 + 1]);
        let mut seen = 0;
        for k in chosen {
            let at = |d: f64| {
                let mut moved = params.clone();
                moved[k] += d;
                total(&moved)
            };
            let expected = (at(1e-4) - at(-1e-4)) / 2e-4;
            seen += usize::from(expected != 0.0);
            approx::assert_abs_diff_eq!(
                f64::from(gradient[k]),
                expected,
                epsilon = 2e-4 * f64::from(scale)
            );
        }
        assert!(seen > 3, "hardly a derivative was other than zero");
    }
}

#[test]
fn the_same_bits_come_out_on_any_number_of_threads_and_for_any_batch() {
    let grid = small(2, 5, 300);
    let points = points(1000, 2);
    let run = |threads| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let mut gradient = vec![0.0; grid.parameters().len()];
            let total = grid.loss_gradient(&points, &loss, &mut gradient);
            let mut out = vec![Sample32::default(); points.len()];
            grid.samples32(&points, &mut out);
            (total.to_bits(), gradient.iter().map(|g| g.to_bits()).collect::<Vec<_>>(), out)
        })
    };
    let first = run(1);
    assert!(first == run(2) && first == run(7));
    for k in [0, 15, 16, 255, 256, 999] {
        let mut one = [Sample32::default()];
        grid.samples32(&points[k..=k], &mut one);
        assert_eq!(one[0], first.2[k]);
    }
}

#[test]
fn a_seeded_grid_holds_its_target() {
    let config = GridConfig { coarsest: 8, finest: 32, levels: 3, ..GridConfig::default() };
    let mut grid = GridField::new(config).unwrap();
    let torus = |p: &[f32; 3]| ((p[0].hypot(p[2]) - 0.6).powi(2) + p[1] * p[1]).sqrt() - 0.2;
    grid.seed(3, |points, out| points.iter().zip(out).for_each(|(p, o)| *o = torus(p)));
    let on: Vec<[f32; 3]> = (0..500)
        .map(|i| {
            let (a, b) = (i as f32 * 0.7, i as f32 * 1.3);
            [(0.6 + 0.2 * b.cos()) * a.cos(), 0.2 * b.sin(), (0.6 + 0.2 * b.cos()) * a.sin()]
        })
        .collect();
    let mut out = vec![Sample32::default(); on.len()];
    grid.samples32(&on, &mut out);
    for s in &out {
        // A twentieth of a cell: the middle of the tube, a crease, is three cells off.
        assert!(s.value.abs() < 3e-3, "{s:?}");
        let length = s.gradient.iter().map(|x| x * x).sum::<f32>().sqrt();
        assert!((length - 1.0).abs() < 0.1, "{s:?}");
    }
}

#[test]
fn sizes_out_of_range_are_rejected_before_memory_is_allocated() {
    let base = GridConfig::default();
    for (config, name) in [
        (GridConfig { table: u32::MAX, ..base }, "table"),
        (GridConfig { features: 3, ..base }, "features"),
        (GridConfig { finest: 100_000, ..base }, "finest"),
        (GridConfig { coarsest: 0, ..base }, "coarsest"),
        (GridConfig { levels: 0, ..base }, "levels"),
        (GridConfig { levels: 1, ..base }, "levels"),
        (GridConfig { hidden: 1 << 20, ..base }, "hidden"),
        (GridConfig { softness: f32::NAN, ..base }, "softness"),
    ] {
        assert!(
            matches!(GridField::new(config), Err(NetworkError::Parameter(e)) if e.name == name),
            "{config:?}"
        );
    }
    assert_eq!(
        GridField::with_parameters(
            GridConfig { hidden: 0, levels: 2, finest: 17, features: 2, ..base },
            vec![0.0; 3]
        )
        .unwrap_err(),
        NetworkError::Length { got: 3, expected: 2 * (19usize.pow(3) + 20usize.pow(3)) + 1 }
    );
}
