//! One extraction, with cells of one size.

use crate::extract::apart::apart;
use crate::extract::budget::Budget;
use crate::extract::error::ExtractError;
use crate::extract::lattice::{Lattice, MAX_CELLS};
use crate::extract::params::{ExtractParams, Sampling};
use crate::extract::polish::polish;
use crate::extract::refine::{dense, refine, unresolved};
use crate::extract::report::{Evaluations, ExtractReport, Extraction, Seconds, Warning};
use crate::extract::slope::Bound;
use crate::extract::surface::Crossings;
use crate::extract::{check, memory};
use crate::marching::{RelaxParams, relax_within};
use if_core::aabb::Aabb;
use if_core::field::SignedDistance;
use if_core::math::{Real, Vector};
use if_core::mesh::TriMesh;
use std::time::Instant;

/// Extracts the surface with cells of side `cell`, in metres.
pub(super) fn attempt(
    field: &dyn SignedDistance,
    region: &Aabb,
    cell: Real,
    bound: &Bound,
    params: &ExtractParams,
    budget: &mut Budget,
) -> Result<Extraction, ExtractError> {
    let lattice = lattice_of((region, params.region.is_none()), cell, params.phase)?;
    budget.cell = cell;
    let mut evaluations = Evaluations::default();
    let mut seconds = Seconds::default();
    let mut clock = Instant::now();
    let mut lap = || std::mem::replace(&mut clock, Instant::now()).elapsed().as_secs_f64();
    let mut before = budget.evaluations;
    let mut count =
        |budget: &Budget| budget.evaluations - std::mem::replace(&mut before, budget.evaluations);

    // Cells that may hold the surface, and the field at their corners.
    let refined = match params.sampling {
        Sampling::Sparse => refine(field, &lattice, bound, budget)?,
        Sampling::Dense => dense(field, &lattice, bound, budget)?,
    };
    (evaluations.refine, seconds.refine) = (count(budget), lap());

    // Crossed edges and the triangles between them. Memory is checked before it is allocated.
    let held = refined.cells.bytes() + refined.nodes.bytes();
    budget.room(held, memory::crossings(&refined.nodes.rows))?;
    let crossings = Crossings::of(&refined.nodes.rows);
    if u32::try_from(crossings.count).is_err() {
        return Err(ExtractError::TooManyNodes { nodes: crossings.count });
    }
    budget.room(
        held,
        memory::crossings(&refined.nodes.rows)
            .saturating_add(memory::mesh(crossings.count, params.relax > 0)),
    )?;
    let edges = crossings.edges(|value| refined.nodes.values[value]);
    let triangles = crossings.triangles();
    seconds.triangles = lap();

    let polished = polish(field, &lattice, &edges, params.secant, params.newton, budget)?;
    (evaluations.polish, seconds.polish) = (count(budget), lap());
    let mesh = TriMesh::new(polished.points, triangles)
        .expect("vertices stay within a cell of their edge, and cases name them");

    let mut warnings = Vec::new();
    if refined.restored > 0 || refined.slope > bound.slope {
        warnings.push(Warning::Slope {
            given: bound.slope,
            used: refined.slope,
            cells: refined.restored,
        });
    }
    let leaving = crossings.on_border();
    if leaving > 0 {
        warnings.push(Warning::LeavesRegion { edges: leaving });
    }
    let crossed = crossings.cells();
    let hidden = unresolved(&lattice, bound.noise, &refined, &crossed);
    if hidden > 0 {
        warnings.push(Warning::Unresolved { cells: hidden });
    }
    let near =
        check::near_sheets(&mesh, &polished.samples, &crossings.neighbours_on_lines(), &lattice);
    warnings.extend(near.warning());
    let skipped = 1.0 - refined.cells.count() as Real / lattice.volume();
    drop(crossed);

    let mut earlier = Vec::new();
    let mesh = if params.relax > 0 {
        let rounds = RelaxParams { rounds: params.relax, ..RelaxParams::default() };
        let region = lattice.aabb().inflated(cell);
        let relaxed =
            relax_within(&mesh, field, &rounds, Some(&region), |n| budget.evaluated("relax", n))?;
        earlier = mesh.vertices().to_vec();
        relaxed
    } else {
        mesh
    };
    let (mesh, moved_back) = apart(mesh, &earlier, (&lattice, &edges), field, budget)?;
    (evaluations.relax, seconds.relax) = (count(budget), lap());

    let error = check::error_estimate(field, &mesh, params, budget)?;
    (evaluations.check, seconds.check) = (count(budget), lap());
    evaluations.total = budget.evaluations;
    let report = ExtractReport {
        region: lattice.aabb(),
        cell,
        cells: lattice.cells,
        slope: refined.slope,
        evaluations,
        skipped,
        error,
        moved_back,
        attempts: Vec::new(),
        warnings,
        seconds,
    };
    Ok(Extraction { mesh, report })
}

/// A part of a cell by which a region may fall short of a whole number of cells, so that rounding
/// (1e-13 of them) adds no layer of cells.
const WHOLE: Real = 1e-6;

/// The lattice over a region. If that is the `tight` box of the surface, its last nodes lie beyond its sides: a
/// flat side through nodes would not be crossed.
fn lattice_of(
    (region, tight): (&Aabb, bool),
    cell: Real,
    phase: [Real; 3],
) -> Result<Lattice, ExtractError> {
    let size = region.size();
    let phase = Vector::from(phase);
    let cells = [0, 1, 2].map(|k| {
        let cells = (size[k] / cell + phase[k] - WHOLE).ceil().max(1.0);
        let last = region.min[k] - phase[k] * cell + cells * cell;
        if tight && last <= region.max[k] { cells + 1.0 } else { cells }
    });
    if !cells.iter().all(|c| *c <= MAX_CELLS) {
        return Err(ExtractError::TooFine { size: size.max(), cell });
    }
    Ok(Lattice { min: region.min - phase * cell, cell, cells: cells.map(|c| c as u32) })
}
