//! Fields with parameters, as fits use them.

/// Value and input gradient of a field at one point, in the network's own precision.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample32 {
    /// φ, negative inside, in the unit of the points.
    pub value: f32,
    /// ∇φ.
    pub gradient: [f32; 3],
}

/// The loss of one point and its derivatives by the field's value and gradient there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointLoss {
    /// The point's share of the loss, already weighted.
    pub loss: f64,
    /// ∂L/∂φ.
    pub d_value: f32,
    /// ∂L/∂(∇φ).
    pub d_gradient: [f32; 3],
}

/// A scalar field φ(x; θ) with f32 parameters, for which a loss on φ and ∇φ can be differentiated
/// by θ: what an eikonal or a normal term needs.
///
/// The same bits come out for any number of threads.
pub trait TrainableField: Sync {
    /// θ, flat; the order is the implementor's and stays the same.
    fn parameters(&self) -> &[f32];

    /// θ, to be stepped by an optimiser; call [`TrainableField::refresh`] afterwards.
    fn parameters_mut(&mut self) -> &mut [f32];

    /// Brings what is derived from θ (folded weight norms, packed panels) up to date.
    fn refresh(&mut self);

    /// φ and ∇φ at `points`.
    ///
    /// # Panics
    ///
    /// If `out` is not as long as `points`.
    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]);

    /// The sum of `loss(i, sample at points[i])` over all points; its derivative by θ overwrites
    /// `gradient`. `loss` must depend on nothing but its arguments: it is called from many threads.
    ///
    /// # Panics
    ///
    /// If `gradient` is not as long as the parameters.
    fn loss_gradient(
        &self,
        points: &[[f32; 3]],
        loss: &(dyn Fn(usize, Sample32) -> PointLoss + Sync),
        gradient: &mut [f32],
    ) -> f64;
}
