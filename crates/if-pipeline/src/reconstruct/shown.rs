//! What the pictures show of a mesh and of each label, and what lies beyond their edges.

use super::underside::VOTE;
use crate::capture::SKIN;
use if_core::math::Point;
use if_mesh::camera::Camera;
use if_mesh::labels::LabelVotes;
use serde::{Deserialize, Serialize};

/// In how many of the label images that were read a label is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LabelShown {
    /// Label images with a pixel of it.
    pub frames: usize,
    /// Of these, the ones with such a pixel at the edge of the picture, beyond which it may go on.
    pub at_edge: usize,
}

/// What was shown so far.
pub(super) struct Shown<'a> {
    camera: &'a Camera,
    /// Whether each vertex was beyond the edge of all pictures.
    beyond: Vec<bool>,
    /// How each label was shown.
    labels: Vec<LabelShown>,
}

impl<'a> Shown<'a> {
    /// Nothing, of a mesh of so many vertices and of so many labels.
    pub(super) fn nothing(vertices: usize, labels: usize, camera: &'a Camera) -> Self {
        Self { camera, beyond: vec![true; vertices], labels: vec![LabelShown::default(); labels] }
    }

    /// Adds a picture of the mesh with its vertices at `positions`.
    pub(super) fn add(&mut self, positions: &[Point]) {
        let (width, height) = (self.camera.width() as f64, self.camera.height() as f64);
        for (beyond, p) in self.beyond.iter_mut().zip(positions).filter(|(beyond, _)| **beyond) {
            let pixel = self.camera.project(p);
            *beyond =
                !pixel.is_some_and(|q| (0.0..width).contains(&q.x) && (0.0..height).contains(&q.y));
        }
    }

    /// Adds a label image.
    pub(super) fn add_labels(&mut self, image: &[u8]) {
        let width = self.camera.width();
        let (mut shown, mut at_edge) = (vec![false; 256], vec![false; 256]);
        for (i, &label) in image.iter().enumerate() {
            shown[usize::from(label)] = true;
            let (x, y) = (i % width, i / width);
            if x == 0 || y == 0 || x + 1 == width || (y + 1) * width == image.len() {
                at_edge[usize::from(label)] = true;
            }
        }
        for (label, count) in self.labels.iter_mut().enumerate() {
            count.frames += usize::from(shown[label]);
            count.at_edge += usize::from(at_edge[label]);
        }
    }

    /// The votes, with one for skin, which is no garment, at each vertex that lies beyond all pictures:
    /// else it would go to the label beside it, and trousers that a picture cuts have toes.
    pub(super) fn voted(&self, mut votes: LabelVotes) -> LabelVotes {
        for v in (0..self.beyond.len()).filter(|v| self.beyond[*v]) {
            votes.weights[v * votes.labels + usize::from(SKIN)] += VOTE;
        }
        votes
    }

    /// How each label was shown, by its number.
    pub(super) fn labels(self) -> Vec<LabelShown> {
        self.labels
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;

    fn camera() -> Camera {
        let eye = Point::new(0.0, 0.0, 4.0);
        Camera::looking_at((4, 3), &eye, &Point::origin(), &Vector::y(), 0.5).unwrap()
    }

    #[test]
    fn what_no_picture_shows_is_skin() {
        let camera = camera();
        let at = |y| [Point::origin(), Point::new(0.0, y, 0.0), Point::new(0.0, 0.0, 9.0)];
        let mut shown = Shown::nothing(3, 3, &camera);
        shown.add(&at(-3.0));
        let votes = LabelVotes { labels: 3, weights: vec![0.0; 9] };
        let winners = |votes: &LabelVotes| [0, 1, 2].map(|v| votes.winner(v));
        // The last one is behind the camera.
        assert_eq!(winners(&shown.voted(votes.clone())), [0, SKIN, SKIN]);
        shown.add(&at(0.1));
        shown.add(&at(-3.0));
        assert_eq!(winners(&shown.voted(votes)), [0, 0, SKIN], "one picture is enough");
    }

    #[test]
    fn labels_at_the_edge_of_a_picture_are_counted() {
        let camera = camera();
        let mut shown = Shown::nothing(0, 4, &camera);
        shown.add_labels(&[0, 0, 0, 0, 0, 1, 2, 0, 0, 0, 2, 0]);
        shown.add_labels(&[0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0]);
        let counts = shown.labels().iter().map(|l| (l.frames, l.at_edge)).collect::<Vec<_>>();
        assert_eq!(counts, [(2, 2), (2, 0), (1, 1), (0, 0)]);
    }
}
