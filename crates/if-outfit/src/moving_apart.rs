//! Layers of a clean outfit that nearly touch are moved apart, if a least distance is a goal.
//!
//! Settling keeps the clearance at vertices and middles of long edges; triangles between them come as
//! near as a thousandth of it. Here all primitives are kept apart that are nearer than the goal, in
//! one problem of all garments over a body that is held ([`moved_apart`]). The result is verified as
//! any other; if it is not as clean, half of the distance is tried.
//!
//! ```text
//! move apart to the distance, or else half of it, up to three times
//! while layers are nearer than the distance, and the last solve brought them apart
//!     move apart to the distance from there
//! ```
//!
//! A solve is linear about the state from which it starts. Where several thin gaps lie one over
//! another, layers that move far come near others again.

use crate::attempt::Attempt;
use crate::distances;
use crate::dressing::Dressed;
use crate::findings::{Findings, LayerFindings};
use crate::motion::moved_apart;
use crate::outfit::{Layer, Outfit};
use crate::report::MovedApart;
use crate::verify::verify_changed;
use if_core::math::Real;
use if_core::monitor::{Cancelled, Monitor};
use if_mesh::measure::{displacement, strain};
use if_mesh::solid::ClosedLayer;
use std::sync::Arc;
use tracing::trace_span;

/// Times that half of the distance is tried.
const HALVINGS: i32 = 3;
/// Maximum number of solves after the first. Three tubes 0.1 mm over one another come to 4.98 mm of 5.
const MORE: usize = 4;
/// Share of the distance that counts as all of it.
pub(crate) const ENOUGH: Real = 0.999;
/// Share of the distance by which a solve must bring two layers apart for another one to be made.
const GAIN: Real = 0.002;

/// An outfit with its layers apart.
struct Apart {
    outfit: Outfit,
    findings: Vec<Findings>,
    closed: Vec<Arc<ClosedLayer>>,
    /// The largest motion of a vertex.
    moved: Real,
}

impl Attempt {
    /// Moves the layers of what was reached apart to `distance` metres, where there is room, if it is
    /// clean and they are nearer; `None` if they are not. What was reached is measured later.
    ///
    /// # Errors
    ///
    /// The monitor cancelled.
    pub(crate) fn move_apart(
        &mut self,
        distance: Real,
        monitor: &mut dyn Monitor,
    ) -> Result<Option<MovedApart>, Cancelled> {
        let _phase = trace_span!("moving apart").entered();
        if self.remaining() > 0 {
            return Ok(None);
        }
        let given = self.reached();
        let mut lacking = distances::lacking(&given, &self.closed, distance);
        if lacking.iter().all(|lacks| *lacks == 0.0) {
            return Ok(None);
        }
        let tried = (0..=HALVINGS).map(|halvings| distance * 0.5_f64.powi(halvings));
        let mut tried = tried.map(|distance| self.apart(&given, distance, monitor));
        let mut found = tried.find_map(Result::transpose).transpose()?;
        for done in 0..=MORE {
            let Some(apart) = found.filter(|apart| apart.moved > 0.0) else { break };
            let lack = distances::lacking(&apart.outfit, &apart.closed, distance);
            let gains = lacking.iter().zip(&lack).map(|(before, now)| before - now);
            let gain = gains.clone().fold(0.0, Real::max);
            // What brings some layers apart and others together goes round in circles.
            if done > 0 && (gain <= GAIN * distance || gains.sum::<Real>() <= 0.0) {
                break;
            }
            self.adopt(apart);
            lacking = lack;
            let is_enough = lacking.iter().all(|lacks| *lacks <= (1.0 - ENOUGH) * distance);
            if is_enough || done == MORE {
                break;
            }
            found = self.apart(&self.reached(), distance, monitor)?;
        }
        let layers = self.dressed.iter().zip(&given.garments);
        let moved = layers.map(|(a, b)| displacement(b.mesh.vertices(), a.mesh.vertices()).max);
        let moved = moved.fold(0.0, Real::max);
        Ok(Some(MovedApart { goal: distance, moved, reached: 0.0 }))
    }

    /// Takes over a state with layers apart.
    fn adopt(&mut self, Apart { outfit, findings, closed, .. }: Apart) {
        for (k, (garment, findings)) in outfit.garments.into_iter().zip(findings).enumerate() {
            let input = &self.outfit.garments[k].mesh;
            let dressed = &mut self.dressed[k];
            dressed.findings = findings;
            dressed.moved = displacement(input.vertices(), garment.mesh.vertices());
            dressed.strain = strain(input, garment.mesh.vertices());
            dressed.mesh = garment.mesh;
        }
        self.closed = closed;
    }

    /// `reached` with its layers `distance` metres apart; `None` if that is not as clean.
    fn apart(
        &self,
        reached: &Outfit,
        distance: Real,
        monitor: &mut dyn Monitor,
    ) -> Result<Option<Apart>, Cancelled> {
        let Some(garments) = moved_apart(reached, distance, monitor)? else { return Ok(None) };
        let mut outfit = reached.clone();
        for (garment, positions) in outfit.garments.iter_mut().zip(garments) {
            let mesh = garment.mesh.with_vertices(positions);
            garment.mesh = mesh.expect("states that were proven are finite");
        }
        let layers = outfit.garments.iter().zip(&reached.garments);
        let moved: Vec<Real> =
            layers.map(|(a, b)| displacement(b.mesh.vertices(), a.mesh.vertices()).max).collect();
        let changed: Vec<bool> = moved.iter().map(|moved| *moved > 0.0).collect();
        let given: Vec<Findings> = self.dressed.iter().map(|d| d.findings.clone()).collect();
        let (findings, closed) = verify_changed(&outfit, &changed, given, self.closed.clone());
        let pairs = findings.iter().flat_map(|f| &f.below).map(|layer| layer.pairs.len());
        let inside = findings.iter().flat_map(|f| &f.below).map(|layer| layer.inside);
        tracing::debug!(
            distance,
            pairs = pairs.sum::<usize>(),
            inside = inside.sum::<usize>(),
            "layers were moved apart"
        );
        let is_as_clean = |(now, dressed): (&Findings, &Dressed)| {
            now.below.iter().all(LayerFindings::is_clean)
                && now.new_own(&dressed.findings).is_empty()
        };
        let moved = moved.into_iter().fold(0.0, Real::max);
        let is_clean = findings.iter().zip(&self.dressed).all(is_as_clean);
        Ok(is_clean.then_some(Apart { outfit, findings, closed, moved }))
    }

    /// The outfit that was reached.
    pub(crate) fn reached(&self) -> Outfit {
        let garment = |(given, dressed): (&Layer, &Dressed)| Layer {
            name: given.name.clone(),
            mesh: dressed.mesh.clone(),
            storage: given.storage,
        };
        let garments = self.outfit.garments.iter().zip(&self.dressed).map(garment);
        Outfit { body: self.outfit.body.clone(), garments: garments.collect() }
    }
}

#[cfg(test)]
mod tests {
    use crate::outfit::{Layer, Outfit};
    use crate::resolve::{ResolveParams, Resolved, resolve};
    use crate::storage::Storage;
    use if_core::mesh::TriMesh;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::icosphere;
    use nalgebra::{Rotation3, Vector3};

    /// A ball in two shells of other facets, of which the inner one cuts through the outer.
    fn outfit(storage: Storage) -> Outfit {
        let turn = Rotation3::from_scaled_axis(Vector3::new(0.3, 0.2, 0.1));
        let shirt = icosphere(0.331, 3);
        let turned = storage.round(&shirt.vertices().iter().map(|p| turn * p).collect::<Vec<_>>());
        let layer = |name: &str, mesh| Layer { storage, ..Layer::new(name, mesh) };
        let rounded = |radius, levels| {
            let mesh = icosphere(radius, levels);
            let vertices = storage.round(mesh.vertices());
            mesh.with_vertices(vertices).unwrap()
        };
        Outfit {
            body: layer("body", rounded(0.3, 3)),
            garments: vec![
                layer("vest", rounded(0.33, 3)),
                layer("shirt", shirt.with_vertices(turned).unwrap()),
            ],
        }
    }

    fn with_distance(outfit: &Outfit, least_distance: f64) -> Resolved {
        let params = ResolveParams::default().with("least_distance", &least_distance).unwrap();
        resolve(outfit, &params, &mut Silent).unwrap()
    }

    #[test]
    fn layers_end_as_far_apart_as_was_asked_for_over_the_body_as_it_is() {
        const GOAL: f64 = 1e-3;
        for storage in [Storage::F32, Storage::F64, Storage::Text { decimals: 6 }] {
            let outfit = outfit(storage);
            let near = with_distance(&outfit, 0.0);
            assert!(near.report.moved_apart.is_none());
            let before = near.report.after.least_distance().unwrap();
            assert!(before < 0.5 * GOAL, "{before}");
            let apart = with_distance(&outfit, GOAL);
            let reached = apart.report.after.least_distance().unwrap();
            assert!(reached > 0.97 * GOAL, "{storage:?}: {reached}");
            let report = apart.report.moved_apart.unwrap();
            assert!(report.goal == GOAL && report.moved > 0.0 && report.moved < 3.0 * GOAL);
            assert_eq!(apart.outfit.body, outfit.body);
            // What is reported is what was written.
            let found = crate::verify(&apart.outfit).unwrap();
            assert!(found.is_clean() && found.least_distance() == Some(reached));
            for garment in &apart.outfit.garments {
                let x = garment.mesh.vertices();
                assert_eq!(storage.round(x), x, "{storage:?}");
            }
        }
    }

    #[test]
    fn thin_gaps_one_over_another_open_to_all_of_the_goal() {
        const GOAL: f64 = 5e-3;
        let mut outfit = outfit(Storage::F32);
        let shirt = outfit.garments[1].mesh.clone();
        for k in 1..4 {
            let turn = Rotation3::from_scaled_axis(Vector3::new(0.3, -0.2, 0.1) * f64::from(k));
            let x = shirt.vertices().iter().map(|p| turn * p * (1.0 + 1e-3 * f64::from(k)));
            let mesh = shirt.with_vertices(Storage::F32.round(&x.collect::<Vec<_>>())).unwrap();
            let layer = Layer { storage: Storage::F32, ..Layer::new(format!("shirt {k}"), mesh) };
            outfit.garments.push(layer);
        }
        let apart = with_distance(&outfit, GOAL);
        let reached = apart.report.after.least_distance().unwrap();
        assert!(reached > 0.99 * GOAL, "{reached}");
        assert_eq!(apart.report.moved_apart.unwrap().reached, reached);
    }

    #[test]
    fn sheets_of_one_garment_open_to_a_tenth_of_a_millimetre() {
        let [inner, outer] = [0.33, 0.330_02].map(|radius| icosphere(radius, 3));
        let n = inner.vertices().len() as u32;
        let second = outer.triangles().iter().map(|t| t.map(|v| v + n));
        let triangles = inner.triangles().iter().copied().chain(second).collect();
        let both = [inner.vertices(), outer.vertices()].concat();
        let lined = TriMesh::new(both, triangles).unwrap();
        let shirt = outfit(Storage::F64).garments[1].clone();
        let outfit = Outfit {
            body: Layer::new("body", icosphere(0.3, 3)),
            garments: vec![Layer::new("lined vest", lined), shirt],
        };
        let own = |resolved: &Resolved| resolved.report.after.own_least_distances[0].unwrap();
        let (near, apart) = (with_distance(&outfit, 0.0), with_distance(&outfit, 1e-3));
        let [before, after] = [&near, &apart].map(|resolved| own(resolved).distance);
        assert!(before < 0.03e-3 && after > 0.09e-3 && after < 0.2e-3, "{before} {after}");
        assert!(apart.report.after.least_distance().unwrap() > 0.95e-3);
    }

    #[test]
    fn layers_that_are_apart_stay_to_the_bit() {
        let outfit = outfit(Storage::F32);
        let near = with_distance(&outfit, 0.0);
        let kept = with_distance(&outfit, 0.5 * near.report.after.least_distance().unwrap());
        assert_eq!(kept.outfit, near.outfit);
        assert!(kept.report.moved_apart.is_none());
    }
}
