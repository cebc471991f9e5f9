//! Own pairs of settled garments: what is left, or came back while a garment settled over others,
//! gets another try in which every accepted state is as clean between layers as before.

use super::untangle;
use crate::dressing::Dressed;
use crate::findings::Findings;
use crate::outfit::Outfit;
use crate::params::ResolveParams;
use crate::progress::{GarmentProgress, UNTANGLE};
use crate::verify::{verify_changed, verify_garment};
use if_core::math::Point;
use if_core::monitor::{Cancelled, Monitor};
use if_mesh::measure::{displacement, strain};
use if_mesh::solid::ClosedLayer;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Maximum vertices that are verified against layers for a garment: some seconds, where thousands of small parts meet
/// themselves.
const VERIFIED: usize = 20_000_000;

/// Untangles the settled garments of `input` that intersect themselves. `closed` are their closed
/// layers, the body first, and follow. `costly` receives for each garment what [`untangle`] finds so.
/// Returns for each garment the rounds made.
///
/// # Errors
///
/// [`Cancelled`] by the monitor.
pub(crate) fn untangle_settled(
    input: &Outfit,
    dressed: &mut [Dressed],
    closed: &mut Vec<Arc<ClosedLayer>>,
    params: &ResolveParams,
    costly: &mut [BTreeSet<[u32; 2]>],
    monitor: &mut dyn Monitor,
) -> Result<Vec<usize>, Cancelled> {
    let mut rounds = vec![0; dressed.len()];
    for index in 0..dressed.len() {
        if dressed[index].findings.own.is_empty() {
            continue;
        }
        let mut outfit = input.clone();
        for (garment, dressed) in outfit.garments.iter_mut().zip(dressed.iter()) {
            garment.mesh = dressed.mesh.clone();
        }
        let findings: Vec<Findings> = dressed.iter().map(|d| d.findings.clone()).collect();
        let mut changed = vec![false; dressed.len()];
        changed[index] = true;
        let faults = |findings: &[Findings]| -> usize {
            findings.iter().flat_map(|f| &f.below).map(|l| l.pairs.len() + l.inside).sum()
        };
        let most = faults(&findings);
        let mut found = None;
        let mut left = VERIFIED;
        let mut is_as_clean = |x: &[Point]| {
            if left == 0 {
                return false;
            }
            left = left.saturating_sub(x.len() * (index + 1));
            let mesh = dressed[index].mesh.with_vertices(x.to_vec());
            let mesh = mesh.expect("the solver keeps positions finite");
            // Most of what fails does so here, without a new closed layer.
            let below: Vec<&ClosedLayer> = closed[..=index].iter().map(Arc::as_ref).collect();
            if faults(&[verify_garment(&mesh, &below)]) > faults(&findings[index..=index]) {
                return false;
            }
            let above = outfit.garments[index..].iter().map(|g| g.mesh.vertices().len());
            left = left.saturating_sub(above.sum::<usize>() * (index + 1));
            outfit.garments[index].mesh = mesh;
            let now = verify_changed(&outfit, &changed, findings.clone(), closed.clone());
            let is_as_clean = faults(&now.0) <= most;
            if is_as_clean {
                found = Some(now);
            }
            is_as_clean
        };
        let start = dressed[index].mesh.vertices().to_vec();
        let (garment, count) = (&input.garments[index], dressed.len());
        let mut progress = GarmentProgress { monitor, name: &garment.name, index, count };
        let mut report = |pairs| progress.report(UNTANGLE, 0, Some(pairs));
        let costly = &mut costly[index];
        let result = untangle(garment, &start, params, costly, &mut is_as_clean, &mut report)?;
        if let (Some(untangled), Some((findings, layers))) = (result, found) {
            *closed = layers;
            for (dressed, findings) in dressed.iter_mut().zip(findings) {
                dressed.findings = findings;
            }
            rounds[index] = untangled.rounds;
            let (rest, of) = (&input.garments[index].mesh, &mut dressed[index]);
            of.mesh = rest.with_vertices(untangled.positions).expect("positions of a mesh");
            of.moved = displacement(rest.vertices(), of.mesh.vertices());
            of.strain = strain(rest, of.mesh.vertices());
        }
    }
    Ok(rounds)
}
