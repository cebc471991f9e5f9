//! What is behind the scene: a gradient, and a soft shadow on the floor.

/// The background of one view.
pub(crate) struct Backdrop {
    /// Rows of samples.
    pub(crate) rows: f32,
    /// The shadow on the floor, if anything stands there.
    pub(crate) shadow: Option<Shadow>,
}

/// An ellipse in the picture, in samples.
pub(crate) struct Shadow {
    pub(crate) center: [f32; 2],
    pub(crate) radii: [f32; 2],
}

impl Shadow {
    /// Distance from the middle at which it is less than a ten-thousandth of the smallest step of a
    /// colour.
    const END: f32 = 14.0;

    /// Squared distance from the middle, in a measure of its own.
    fn away(&self, [x, y]: [f32; 2]) -> f32 {
        let (u, v) = ((x - self.center[0]) / self.radii[0], (y - self.center[1]) / self.radii[1]);
        (u * u + v * v) * 1.6
    }
}

impl Backdrop {
    /// Linear light of row `y` beside the shadow.
    pub(crate) fn plain(&self, y: f32) -> [f32; 3] {
        let s = y / self.rows;
        [0.90 - 0.10 * s, 0.91 - 0.10 * s, 0.92 - 0.09 * s]
    }

    /// Whether the light at a place is that of its row.
    pub(crate) fn is_plain(&self, place: [f32; 2]) -> bool {
        self.shadow.as_ref().is_none_or(|shadow| shadow.away(place) > Shadow::END)
    }

    /// Linear light at a place, given in samples to the right and down.
    pub(crate) fn light(&self, place: [f32; 2]) -> [f32; 3] {
        let plain = self.plain(place[1]);
        let Some(shadow) = &self.shadow else { return plain };
        let dark = 0.38 * (-shadow.away(place)).exp();
        plain.map(|c| c * (1.0 - dark))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color::encode;

    #[test]
    fn far_from_the_shadow_colors_are_those_of_the_row() {
        let shadow = Shadow { center: [50.0, 180.0], radii: [20.0, 4.0] };
        let backdrop = Backdrop { rows: 200.0, shadow: Some(shadow) };
        let mut plain = 0;
        for place in (0..100).flat_map(|x| (0..200).map(move |y| [x as f32, y as f32])) {
            if backdrop.is_plain(place) {
                plain += 1;
                let [exact, row] = [backdrop.light(place), backdrop.plain(place[1])];
                assert_eq!(exact.map(encode), row.map(encode), "{place:?}");
            }
        }
        assert!((10_000..19_000).contains(&plain), "{plain}");
        let dark = backdrop.light([50.0, 180.0])[0] / backdrop.plain(180.0)[0];
        assert!((dark - 0.62).abs() < 1e-3, "{dark}");
    }
}
