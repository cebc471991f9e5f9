//! The body with the garments put on so far, inner to outer: each settled, verified and frozen.

use crate::findings::{Findings, LayerFindings};
use crate::outfit::{Layer, Outfit};
use crate::phases::beside;
use crate::progress::{DONE, GarmentProgress, VERIFY};
use crate::settle::{Settings, Settled, settle};
use crate::upper_layers::{TightGarments, UpperLayers};
use crate::verify::verify_garment;
use crate::workpiece::SettleError;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::measure::{Displacement, Strain, displacement, strain};
use if_mesh::solid::ClosedLayer;
use std::sync::Arc;
use std::time::Instant;
use tracing::field::Empty;
use tracing::trace_span;

/// A garment that was put on.
pub(crate) struct Dressed {
    /// Where it settled.
    pub(crate) mesh: TriMesh,
    /// What was found of it there.
    pub(crate) findings: Findings,
    pub(crate) settled: Settled,
    /// Against the input.
    pub(crate) moved: Displacement,
    pub(crate) strain: Strain,
    /// Whether it did not move from where it was before it settled.
    pub(crate) is_unmoved: bool,
    /// Layers below whose boxes it does not meet.
    pub(crate) layers_apart: usize,
    pub(crate) verify_seconds: Real,
    pub(crate) seconds: Real,
}

impl Dressed {
    /// Pairs and vertices on a wrong side that remain, and own pairs that are not in `given`, what was
    /// found of it in the input.
    pub(crate) fn remaining(&self, given: &Findings) -> usize {
        let layers = self.findings.below.iter().map(|layer| layer.pairs.len() + layer.inside);
        layers.sum::<usize>() + self.findings.new_own(given).len()
    }
}

/// The garments put on so far.
pub(crate) struct Dressing<'a> {
    /// As given, and with its garments untangled: these settle.
    input: &'a Outfit,
    pub(crate) outfit: &'a Outfit,
    /// What was found in the untangled outfit, for each garment.
    pub(crate) given: &'a [Findings],
    pub(crate) settings: Settings<'a>,
    /// The closed layers put on, the body first.
    pub(crate) below: Vec<Arc<ClosedLayer>>,
    pub(crate) dressed: Vec<Dressed>,
}

impl<'a> Dressing<'a> {
    /// Starts with the bare body. `outfit` is `input` after untangling; `given` is what was found in
    /// `outfit`.
    pub(crate) fn new(
        [input, outfit]: [&'a Outfit; 2],
        given: &'a [Findings],
        body: &Arc<ClosedLayer>,
        settings: Settings<'a>,
    ) -> Self {
        let below = vec![Arc::clone(body)];
        Self { input, outfit, given, settings, below, dressed: Vec::new() }
    }

    /// Takes off the garments from `index` on.
    pub(crate) fn take_off(&mut self, index: usize) {
        self.below.truncate(index + 1);
        self.dressed.truncate(index);
    }

    /// Puts on the garment `index`; those before it are on. `given` is its closed layer as in the
    /// input, if it was computed.
    ///
    /// # Errors
    ///
    /// [`SettleError::Cancelled`] if the monitor cancels; [`SettleError::Stuck`] if the garment
    /// makes no progress over others that it met, and `tucking_helps`; [`SettleError::Step`] if a
    /// step of the solver fails.
    pub(crate) fn put_on(
        &mut self,
        index: usize,
        given: Option<&Arc<ClosedLayer>>,
        tight: &TightGarments<'_>,
        tucking_helps: bool,
        progress: &mut GarmentProgress<'_>,
    ) -> Result<(), SettleError> {
        let garment = &self.outfit.garments[index];
        let start = Instant::now();
        progress.report(VERIFY, 0, None)?;
        let below: Vec<&ClosedLayer> = self.below.iter().map(Arc::as_ref).collect();
        let above = tight.over(index, garment.mesh.vertices(), below[0]);
        // If no layer below has moved, what was found in the input still holds.
        let found = &self.given[index];
        let needs_nothing = self.dressed.iter().all(|dressed| dressed.is_unmoved)
            && above.is_empty()
            && found.is_clean();
        let settled = if needs_nothing {
            Settled::unchanged(garment)
        } else {
            let above = UpperLayers { layers: &above, tuck_distance: tight.tuck_distance() };
            let meets_garments = found.below[1..].iter().any(|l: &LayerFindings| !l.is_clean());
            let may_yield = !(tucking_helps && meets_garments);
            settle(garment, None, &below, above, may_yield, self.settings, progress)?
        };
        let rounds = settled.rounds;
        self.freeze(index, given, settled, needs_nothing.then(|| found.clone()), start);
        Ok(progress.report(DONE, rounds, None)?)
    }

    /// Puts on the garment `index` as it came.
    pub(crate) fn leave(&mut self, index: usize, given: Option<&Arc<ClosedLayer>>) {
        let settled = Settled::unchanged(&self.outfit.garments[index]);
        self.freeze(index, given, settled, None, Instant::now());
    }

    /// Keeps the garment `index` where it `settled`; what is found of it there may be `known`.
    pub(crate) fn freeze(
        &mut self,
        index: usize,
        given: Option<&Arc<ClosedLayer>>,
        settled: Settled,
        known: Option<Findings>,
        start: Instant,
    ) {
        let garment = &self.outfit.garments[index];
        let mesh = garment.mesh.with_vertices(settled.positions.clone());
        let mesh = mesh.expect("settled positions are finite");
        let is_unmoved = mesh.vertices() == garment.mesh.vertices();
        let is_covered = index + 1 < self.outfit.garments.len();
        let below: Vec<&ClosedLayer> = self.below.iter().map(Arc::as_ref).collect();
        let prove = || {
            let start = Instant::now();
            match known {
                Some(known) => (known, 0.0),
                None => (verify_garment(&mesh, &below), start.elapsed().as_secs_f64()),
            }
        };
        let close = || match given {
            Some(layer) if is_unmoved => Arc::clone(layer),
            _ => Arc::new(ClosedLayer::garment(&mesh, below[0], &self.outfit.body.mesh)),
        };
        let input = &self.input.garments[index].mesh;
        let close_and_measure = || {
            let closed = is_covered.then(close);
            let x = mesh.vertices();
            (closed, displacement(input.vertices(), x), strain(input, x))
        };
        let names = ["verification", "closed layer"];
        let span = trace_span!(
            "verification and closed layer",
            "verification" = Empty,
            "closed layer" = Empty
        );
        let ((findings, verify_seconds), (closed, moved, strain)) =
            beside(&span, names, prove, close_and_measure);
        let dressed = Dressed {
            moved,
            strain,
            is_unmoved,
            mesh,
            findings,
            settled,
            layers_apart: self.layers_apart(garment),
            verify_seconds,
            seconds: start.elapsed().as_secs_f64(),
        };
        self.below.extend(closed);
        self.dressed.push(dressed);
    }

    /// How many layers below have boxes that the garment does not meet.
    fn layers_apart(&self, garment: &Layer) -> usize {
        let params = self.settings.params;
        let range = params.goal.clearance + params.effort.contact_margin;
        let region = garment.mesh.aabb().inflated(range);
        self.below.iter().filter(|l| !l.bvh().aabb().overlaps(&region)).count()
    }
}
