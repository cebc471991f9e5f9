//! Votes on the labels of vertices.

use super::error::LabelError;
use if_core::math::Real;

/// The label of unknown surface. In label images it is the background, which does not vote.
pub const UNDECIDED: u8 = 0;

/// Votes for each vertex and label.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelVotes {
    /// Number of labels, [`UNDECIDED`] among them: from 1 to 256.
    pub labels: usize,
    /// `weights[v · labels + label]`: the number of frames that vote for the label, weighted by how
    /// well they see the vertex. Zero for [`UNDECIDED`].
    pub weights: Vec<Real>,
}

impl LabelVotes {
    /// One full vote for the label of each vertex, and none for [`UNDECIDED`].
    ///
    /// # Panics
    ///
    /// If a label is not below `labels`.
    pub fn from_labels(of: &[u8], labels: usize) -> Self {
        let mut weights = vec![0.0; of.len() * labels];
        for (v, &label) in of.iter().enumerate() {
            assert!(usize::from(label) < labels, "vertex {v} has the label {label} of {labels}");
            if label != UNDECIDED {
                weights[v * labels + usize::from(label)] = 1.0;
            }
        }
        Self { labels, weights }
    }

    /// The votes of a vertex, one number per label.
    ///
    /// # Panics
    ///
    /// If `vertex` is out of range.
    pub fn of(&self, vertex: usize) -> &[Real] {
        &self.weights[vertex * self.labels..(vertex + 1) * self.labels]
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.weights.len() / self.labels.max(1)
    }

    /// The label with most votes, the smaller one of equals; [`UNDECIDED`] without votes.
    ///
    /// # Panics
    ///
    /// If `vertex` is out of range, or the label with most votes is above 255.
    pub fn winner(&self, vertex: usize) -> u8 {
        winner(self.of(vertex))
    }

    /// Checks that these are votes for so many vertices, finite and not negative.
    pub(super) fn check(&self, vertices: usize) -> Result<(), LabelError> {
        check_count("votes", self.labels, self.weights.len(), vertices)?;
        match self.weights.iter().position(|w| !(w.is_finite() && *w >= 0.0)) {
            None => Ok(()),
            Some(at) => Err(LabelError::Value {
                values: "votes",
                vertex: at / self.labels,
                label: at % self.labels,
                value: self.weights[at],
                range: "votes must be finite and not negative",
            }),
        }
    }
}

/// Checks that `got` numbers are one for each of so many `vertices` and `labels`.
pub(super) fn check_count(
    values: &'static str,
    labels: usize,
    got: usize,
    vertices: usize,
) -> Result<(), LabelError> {
    if !(1..=usize::from(u8::MAX) + 1).contains(&labels) {
        return Err(LabelError::Labels { values, labels });
    }
    if got / labels != vertices {
        return Err(LabelError::Vertices { values, got: got / labels, expected: vertices });
    }
    if !got.is_multiple_of(labels) {
        return Err(LabelError::Count { values, got, vertices, labels });
    }
    Ok(())
}

/// Index of the largest positive number, the first of equals; [`UNDECIDED`] if none is positive.
pub(super) fn winner(weights: &[Real]) -> u8 {
    let mut best = usize::from(UNDECIDED);
    for (label, w) in weights.iter().enumerate().skip(1) {
        if *w > 0.0 && (best == 0 || *w > weights[best]) {
            best = label;
        }
    }
    u8::try_from(best).expect("at most 256 labels")
}
