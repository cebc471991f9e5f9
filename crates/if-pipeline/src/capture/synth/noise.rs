//! Errors of human parsers (displaced borders, patches of a wrong label, specks on the background,
//! and occasionally two confused garments), and of normal estimators.

use if_core::math::{Real, Vector};
use nalgebra::UnitQuaternion;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

/// An about normally distributed number of deviation one: the sum of three uniform ones.
pub(super) fn normal(rng: &mut Pcg64Mcg) -> Real {
    (0..3).map(|_| rng.random_range(-1.0..1.0)).sum()
}

/// A smooth random field with values of about ±1, interpolated on a lattice of this spacing in
/// pixels.
fn field((width, height): (usize, usize), spacing: Real, rng: &mut Pcg64Mcg) -> Vec<Real> {
    let columns = (width as Real / spacing).ceil() as usize + 2;
    let rows = (height as Real / spacing).ceil() as usize + 2;
    let lattice: Vec<Real> = (0..columns * rows).map(|_| normal(rng)).collect();
    let smooth = |s: Real| s * s * (3.0 - 2.0 * s);
    let value = |at: usize| {
        let (x, y) = ((at % width) as Real / spacing, (at / width) as Real / spacing);
        let (i, j, s, t) = (x as usize, y as usize, smooth(x.fract()), smooth(y.fract()));
        let l = |i: usize, j: usize| lattice[j * columns + i];
        let (top, bottom) = (
            l(i, j) + s * (l(i + 1, j) - l(i, j)),
            l(i, j + 1) + s * (l(i + 1, j + 1) - l(i, j + 1)),
        );
        top + t * (bottom - top)
    };
    (0..width * height).map(value).collect()
}

/// Displaces the pixels of an image smoothly by about `amplitude` pixels.
fn displaced<T: Copy>(
    picture: &[T],
    (width, height): (usize, usize),
    amplitude: Real,
    rng: &mut Pcg64Mcg,
) -> Vec<T> {
    let spacing = (width as Real / 35.0).max(4.0);
    let (dx, dy) = (field((width, height), spacing, rng), field((width, height), spacing, rng));
    let source = |at: usize| {
        let moved = |from: usize, by: Real, n: usize| {
            (from as Real + amplitude * by).round().clamp(0.0, n as Real - 1.0) as usize
        };
        picture[moved(at / width, dy[at], height) * width + moved(at % width, dx[at], width)]
    };
    (0..picture.len()).map(source).collect()
}

/// Calls `set` for every pixel of an ellipse.
fn ellipse(
    (width, height): (usize, usize),
    center: [Real; 2],
    radii: [Real; 2],
    angle: Real,
    mut set: impl FnMut(usize),
) {
    let (s, c) = angle.sin_cos();
    let reach = radii[0].max(radii[1]);
    let span = |x: Real, n: usize| {
        (x - reach).max(0.0) as usize..((x + reach).max(0.0) as usize + 1).min(n)
    };
    for row in span(center[1], height) {
        for column in span(center[0], width) {
            let (x, y) = (column as Real - center[0], row as Real - center[1]);
            let (u, v) = ((x * c + y * s) / radii[0], (y * c - x * s) / radii[1]);
            if u * u + v * v < 1.0 {
                set(row * width + column);
            }
        }
    }
}

/// A Poisson-distributed number, by Knuth's algorithm.
fn poisson(mean: Real, rng: &mut Pcg64Mcg) -> usize {
    let limit = (-mean).exp();
    let (mut product, mut n) = (1.0, 0);
    loop {
        product *= rng.random::<Real>();
        if product <= limit {
            return n;
        }
        n += 1;
    }
}

/// A label image with the errors of a parser, for `noise` from 0 to 1. `names` is the number of
/// labels.
pub(super) fn labels(
    truth: &[u8],
    size: (usize, usize),
    noise: Real,
    names: u8,
    rng: &mut Pcg64Mcg,
) -> Vec<u8> {
    if noise <= 0.0 {
        return truth.to_vec();
    }
    let width = size.0 as Real;
    let mut out = displaced(truth, size, 0.6 * noise * width / 64.0, rng);
    let person: Vec<usize> = (0..truth.len()).filter(|at| truth[*at] > 0).collect();
    if person.is_empty() {
        return out;
    }
    // Patches of a wrong label on the person.
    for _ in 0..poisson(6.0 * noise, rng) {
        let at = person[rng.random_range(0..person.len())];
        let center = [(at % size.0) as Real, (at / size.0) as Real];
        let radii = [(); 2].map(|()| rng.random_range(0.008..0.035) * width * (0.5 + noise));
        let (angle, label) = (rng.random_range(0.0..3.2), rng.random_range(0..names));
        ellipse(size, center, radii, angle, |at| {
            if out[at] > 0 {
                out[at] = label;
            }
        });
    }
    // Specks on the background.
    for _ in 0..poisson(5.0 * noise, rng) {
        let center = [rng.random_range(0.0..width), rng.random_range(0.0..size.1 as Real)];
        let (radius, label) = (rng.random_range(0.003..0.012) * width, rng.random_range(1..names));
        ellipse(size, center, [radius; 2], 0.0, |at| {
            if truth[at] == 0 {
                out[at] = label;
            }
        });
    }
    // Two confused garments.
    if names > 3 && rng.random_bool(0.15 * noise) {
        let a = rng.random_range(2..names);
        let b = if a + 1 < names { a + 1 } else { 2 };
        out.iter_mut().filter(|l| **l == a).for_each(|l| *l = b);
    }
    out
}

/// A mask with a displaced outline, for `noise` from 0 to 1.
pub(super) fn mask(
    truth: &[bool],
    size: (usize, usize),
    noise: Real,
    rng: &mut Pcg64Mcg,
) -> Vec<bool> {
    if noise <= 0.0 {
        truth.to_vec()
    } else {
        displaced(truth, size, 0.6 * noise * size.0 as Real / 100.0, rng)
    }
}

/// Deviation of a [`field`]: the mean of the squared weights of a lattice point is 26/35 along each
/// axis.
const FIELD: Real = 26.0 / 35.0;

/// Normals that are turned smoothly, by `degrees` as the root of the mean square. Zero normals stay.
pub(super) fn normals(
    truth: &[[f32; 3]],
    size: (usize, usize),
    degrees: Real,
    rng: &mut Pcg64Mcg,
) -> Vec<[f32; 3]> {
    if degrees <= 0.0 {
        return truth.to_vec();
    }
    let spacing = (size.0 as Real / 16.0).max(4.0);
    let axes = [(); 3].map(|()| field(size, spacing, rng));
    // Two of the three components of a rotation vector turn a normal.
    let scale = degrees.to_radians() / (FIELD * Real::sqrt(2.0));
    let turned = |(i, n): (usize, &[f32; 3])| {
        let n = Vector::new(n[0].into(), n[1].into(), n[2].into());
        let turn = UnitQuaternion::new(Vector::from_fn(|c, _| axes[c][i] * scale));
        let n = turn * n;
        [n.x as f32, n.y as f32, n.z as f32]
    };
    truth.iter().enumerate().map(turned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn more_noise_makes_more_errors_and_no_noise_none() {
        let size = (64, 48);
        let truth: Vec<u8> = (0..64 * 48)
            .map(|at| if (20..44).contains(&(at % 64)) { 1 + u8::from(at / 64 > 20) } else { 0 })
            .collect();
        let wrong = |noise| {
            let mut rng = Pcg64Mcg::seed_from_u64(5);
            (0..20)
                .map(|_| {
                    labels(&truth, size, noise, 3, &mut rng)
                        .iter()
                        .zip(&truth)
                        .filter(|(a, b)| a != b)
                        .count()
                })
                .sum::<usize>()
        };
        let counts = [0.0, 0.1, 0.3, 1.0].map(wrong);
        assert!(
            counts[0] == 0
                && counts.is_sorted()
                && counts[1] < counts[3]
                && counts[3] < 20 * truth.len() / 4,
            "{counts:?}"
        );
    }

    #[test]
    fn normals_are_turned_smoothly_by_the_stated_angle() {
        let (size, n) = ((128, 96), 128 * 96);
        let truth: Vec<[f32; 3]> = (0..n).map(|i| [[0.0, 0.6, -0.8], [0.0; 3]][i % 2]).collect();
        let noisy = normals(&truth, size, 12.0, &mut Pcg64Mcg::seed_from_u64(3));
        let (mut square, mut step) = (0.0, 0.0);
        for i in (0..n).step_by(2) {
            let n = noisy[i].map(f64::from);
            let cos = n[1] * 0.6 - n[2] * 0.8;
            square += cos.clamp(-1.0, 1.0).acos().to_degrees().powi(2) / 6144.0;
            let next = noisy[(i + 2) % noisy.len()].map(f64::from);
            step += (0..3).map(|c| (n[c] - next[c]).powi(2)).sum::<Real>() / 6144.0;
            assert_eq!(noisy[i + 1], [0.0; 3]);
        }
        // 17 × 13 lattice points.
        assert!((square.sqrt() / 12.0 - 1.0).abs() < 0.15, "{}", square.sqrt());
        // Independent noise would give twice the mean square.
        assert!(step < 0.3 * square * 1f64.to_radians().powi(2), "{step} {square}");
        assert_eq!(normals(&truth, size, 0.0, &mut Pcg64Mcg::seed_from_u64(3)), truth);
    }

    #[test]
    fn a_field_is_smooth_and_of_deviation_about_one() {
        let f = field((100, 80), 8.0, &mut Pcg64Mcg::seed_from_u64(1));
        let square = f.iter().map(|v| v * v).sum::<Real>() / 8000.0;
        assert!((0.2..1.5).contains(&square), "{square}");
        // From one pixel to the next at most 1.5 / 8 of the largest difference, 6.
        assert!(
            f.chunks(100).all(|row| row.windows(2).all(|w| (w[0] - w[1]).abs() < 1.5 / 8.0 * 6.0))
        );
    }
}
