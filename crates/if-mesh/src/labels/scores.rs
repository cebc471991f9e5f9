//! Scores of the labels of vertices.

use super::votes::winner;
use if_core::math::Real;

/// Scores of the labels of each vertex: one field over the surface per label.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelScores {
    /// Number of labels, [`UNDECIDED`](super::UNDECIDED) among them: from 1 to 256.
    pub labels: usize,
    /// `scores[v · labels + label]`, from 0 to 1; zero for [`UNDECIDED`](super::UNDECIDED).
    pub scores: Vec<Real>,
}

impl LabelScores {
    /// The scores of a vertex, one per label.
    ///
    /// # Panics
    ///
    /// If `vertex` is out of range.
    pub fn of(&self, vertex: usize) -> &[Real] {
        &self.scores[vertex * self.labels..(vertex + 1) * self.labels]
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.scores.len() / self.labels.max(1)
    }

    /// The label of each vertex: that of the highest score, the smaller one of equals;
    /// [`UNDECIDED`](super::UNDECIDED) if no score is positive.
    ///
    /// # Panics
    ///
    /// If the label of a highest score is above 255.
    pub fn winners(&self) -> Vec<u8> {
        (0..self.vertices()).map(|v| winner(self.of(v))).collect()
    }
}
