//! Systems with known solutions.

use if_sparse::{Cholesky, CholeskyError, Entry, Mat, Pattern, Place};

/// A chain of n particles between two walls: 2 on the diagonal, −1 beside it.
fn chain(n: usize) -> Vec<Entry> {
    let diagonal = (0..n).flat_map(|i| [Entry::new(i, i, 1.0), Entry::new(i, i, 1.0)]);
    diagonal.chain((1..n).map(|i| Entry::new(i, i - 1, -1.0))).collect()
}

/// The chain's displacement under a load of 1 everywhere: a parabola.
fn check(cholesky: &Cholesky, n: usize) {
    let mut right = Mat::from_fn(n, 2, |_, k| 1.0 + k as f64);
    cholesky.solve_in_place(&mut right);
    for i in 0..n {
        let x = (i + 1) as f64 * (n - i) as f64 / 2.0;
        approx::assert_relative_eq!(right[(i, 0)], x, max_relative = 1e-12);
        approx::assert_relative_eq!(right[(i, 1)], 2.0 * x, max_relative = 1e-12);
    }
}

#[test]
fn a_loaded_chain_hangs_in_a_parabola() {
    for n in [1, 2, 100] {
        let entries = chain(n);
        check(&Cholesky::new(n, &entries).unwrap(), n);
        // The same by a pattern; then with other values.
        let places: Vec<Place> = entries.iter().map(|e| Place::new(e.row, e.column)).collect();
        let pattern = Pattern::new(n, &places).unwrap();
        let mut values: Vec<f64> = entries.iter().map(|e| e.value).collect();
        check(&pattern.factor(&values).unwrap(), n);
        values.iter_mut().for_each(|v| *v *= 4.0);
        let mut right = Mat::from_fn(n, 1, |_, _| 4.0);
        pattern.factor(&values).unwrap().solve_in_place(&mut right);
        approx::assert_relative_eq!(right[(0, 0)], n as f64 / 2.0, max_relative = 1e-12);
        assert_eq!(
            pattern.factor(&values[1..]).unwrap_err(),
            CholeskyError::Count { values: values.len() - 1, places: values.len() }
        );
    }
    let mut nothing = Mat::zeros(0, 3);
    Cholesky::new(0, &[]).unwrap().solve_in_place(&mut nothing);
}

#[test]
fn matrices_that_cannot_be_factored_are_named() {
    let beyond = Cholesky::new(2, &[Entry::new(5, 1, 1.0)]).unwrap_err();
    assert_eq!(beyond, CholeskyError::Place { row: 5, column: 1, n: 2 });
    assert_eq!(
        Pattern::new(2, &[Place::new(0, 2)]).unwrap_err(),
        CholeskyError::Place { row: 0, column: 2, n: 2 }
    );
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = Cholesky::new(1, &[Entry::new(0, 0, value)]).unwrap_err();
        assert_eq!(error, CholeskyError::NotPositiveDefinite, "{value}");
    }
    let singular = [Entry::new(0, 0, 1.0), Entry::new(1, 0, -1.0), Entry::new(1, 1, 1.0)];
    assert!(matches!(Cholesky::new(2, &singular), Err(CholeskyError::NotPositiveDefinite)));
}

#[test]
#[should_panic(expected = "one row for each")]
fn a_right_side_of_another_size_panics() {
    Cholesky::new(1, &[Entry::new(0, 0, 1.0)]).unwrap().solve_in_place(&mut Mat::zeros(2, 1));
}
