//! How far masks reach beyond label images: of two programs that cut out a person one is often too generous.

use super::projection::pixels_per_metre;
use if_core::math::{Point, Real};
use if_mesh::camera::Camera;

/// Offsets that are told apart, in pixels. Farther is something else, as hair that labels call background.
const MOST: usize = 32;

/// The offsets between the rims of label images and of masks, along rows of pixels.
#[derive(Default)]
pub(super) struct MaskRims {
    /// Rims by their offset, from −[`MOST`] to [`MOST`] pixels.
    counts: Vec<usize>,
    /// The sum over frames of the size of a pixel at the person, in metres.
    pixels: Real,
    frames: usize,
}

impl MaskRims {
    /// Adds the mask and the label image of a frame; the person's vertices lie at `positions`.
    pub(super) fn add(
        &mut self,
        camera: &Camera,
        positions: &[Point],
        (mask, labels): (&[bool], &[u8]),
    ) {
        self.counts.resize(2 * MOST + 1, 0);
        for (mask, labels) in mask.chunks(camera.width()).zip(labels.chunks(camera.width())) {
            for k in 1..labels.len() {
                let [left, right] = [labels[k - 1] != 0, labels[k] != 0];
                let beyond = |outside: &mut dyn Iterator<Item = usize>| {
                    outside.take(MOST).take_while(|i| mask[*i] && labels[*i] == 0).count()
                };
                let short = |inside: &mut dyn Iterator<Item = usize>| {
                    inside.take(MOST).take_while(|i| !mask[*i] && labels[*i] != 0).count()
                };
                let offset = match (left, right) {
                    (true, false) => [beyond(&mut (k..labels.len())), short(&mut (0..k).rev())],
                    (false, true) => [beyond(&mut (0..k).rev()), short(&mut (k..labels.len()))],
                    _ => continue,
                };
                self.counts[MOST + offset[0] - offset[1]] += 1;
            }
        }
        let depth = positions.iter().map(|p| camera.to_camera(p).z).sum::<Real>();
        self.pixels += depth / positions.len().max(1) as Real / pixels_per_metre(camera);
        self.frames += 1;
    }

    /// The median offset, in metres at the person: positive where masks reach farther. Zero without a rim.
    pub(super) fn median(&self) -> Real {
        let all: usize = self.counts.iter().sum();
        let mut below = 0;
        let median = self.counts.iter().position(|count| {
            below += count;
            2 * below > all
        });
        let pixel = self.pixels / self.frames.max(1) as Real;
        median.map_or(0.0, |at| (at as Real - MOST as Real) * pixel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;

    #[test]
    fn masks_that_are_larger_or_smaller_than_labels_have_their_offset() {
        // A person of 10 pixels in 40, a hand's breadth of hair that labels call background, and noise.
        let eye = Point::new(0.0, 0.0, 4.0);
        let camera =
            Camera::looking_at((40, 8), &eye, &Point::origin(), &Vector::y(), 0.5).unwrap();
        let person = |wider: i32| -> Vec<bool> {
            let row = |y: i32| {
                (0..40).map(move |x| {
                    let hair = if y < 2 { 9 } else { 0 };
                    let noise = i32::from(y == 3) - i32::from(y == 5);
                    (15 - wider - noise..25 + wider + hair).contains(&x)
                })
            };
            (0..8).flat_map(row).collect()
        };
        let labels: Vec<u8> = (0..320).map(|i| u8::from((15..25).contains(&(i % 40)))).collect();
        let pixel = 4.0 / pixels_per_metre(&camera);
        for (wider, expected) in [(0, 0.0), (1, pixel), (3, 3.0 * pixel), (-2, -2.0 * pixel)] {
            let mut rims = MaskRims::default();
            rims.add(&camera, &[Point::origin()], (&person(wider), &labels));
            rims.add(&camera, &[Point::origin()], (&person(wider), &labels));
            approx::assert_relative_eq!(rims.median(), expected, epsilon = 1e-12);
        }
        assert_eq!(MaskRims::default().median(), 0.0);
    }
}
