//! Parts of a body, their boundaries, and which of them have an inside.

use super::boundary::closing_loops;
use super::merge::{Merged, with_triangles};
use super::report::{BodyReport, Hole, NoInside};
use crate::inverted::NO_VOLUME;
use crate::orient::orient;
use if_core::aabb::Aabb;
use if_core::edges::{Edges, parts};
use if_core::math::{Point, Real, Vector, area_vector};
use if_core::mesh::TriMesh;

/// Size up to which a hole is filled and counts as skin, as a share of the body's longest side:
/// 32 mm for a person. Wrists have 50 mm and more; patches over larger holes leave the skin by more
/// than a millimetre.
const FILLED: Real = 1.0 / 50.0;
/// Share of a part's area up to which openings may be missing, however many they are. A body cut at
/// neck, wrists and ankles lacks 2 %; trousers and shirts lack 7 to 25 %.
const MISSING: Real = 0.05;
/// Share of a part's area up to which one opening, or any number beside a part that has an inside,
/// may be missing. Half a ball lacks 50 %, a card of hair 100 %.
const MOSTLY_OPEN: Real = 0.55;
/// Distance to an opening up to which a part without an inside is a piece of skin, as a share of
/// the longest side: 40 mm for a person. Faces deleted under clothes leave such pieces at hems.
const ISLAND: Real = 1.0 / 40.0;

/// One connected part.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) triangles: usize,
    pub(super) aabb: Aabb,
    area: Real,
    /// With its loops closed.
    volume: Real,
    /// Area of its openings.
    missing: Real,
    openings: usize,
    pub(super) has_inside: bool,
    /// Whether it is a piece of skin without an inside, left over beside an opening.
    pub(super) is_island: bool,
}

/// A loop and the part that it belongs to.
pub(super) struct Loop {
    /// In the direction of the triangles that close it.
    pub(super) vertices: Vec<u32>,
    pub(super) part: usize,
    pub(super) is_hole: bool,
}

/// A body with vertices merged and triangles turned.
pub(super) struct Survey {
    pub(super) mesh: TriMesh,
    /// For each triangle its number in the given mesh.
    pub(super) given: Vec<u32>,
    /// Number of given triangles.
    pub(super) given_count: usize,
    /// For each given vertex that of the mesh.
    pub(super) first: Vec<u32>,
    pub(super) parts: Vec<Part>,
    /// For each triangle its part.
    pub(super) part_of: Vec<u32>,
    pub(super) loops: Vec<Loop>,
    pub(super) report: BodyReport,
}

impl Survey {
    /// # Errors
    ///
    /// No part has an inside.
    pub(super) fn new(mesh: &TriMesh) -> Result<Self, NoInside> {
        let given_count = mesh.triangles().len();
        let Merged { mesh, given, first, merged_vertices, repeated_triangles } = Merged::new(mesh);
        let mut triangles = mesh.triangles().to_vec();
        let mut edges = Edges::new(&mesh);
        let turned_triangles = orient(&mut triangles, &edges);
        let mut mesh = with_triangles(&mesh, triangles);
        if turned_triangles > 0 {
            edges = Edges::new(&mesh);
        }
        let (part_of, mut parts) = connected(&mesh);
        let height = mesh.surface_aabb().size().max();
        let place = |v: u32| mesh.vertices()[v as usize];
        let mut loops: Vec<Loop> = Vec::new();
        let part_of_vertex = of_vertices(&mesh, &part_of);
        for vertices in closing_loops(&mesh, &edges) {
            let part = part_of_vertex[vertices[0] as usize] as usize;
            let size = Aabb::from_points(vertices.iter().map(|v| &mesh.vertices()[*v as usize]))
                .size()
                .max();
            let is_hole = size <= FILLED * height;
            let middle = mean(vertices.iter().map(|v| place(*v)));
            let mut area = Vector::zeros();
            let from = parts[part].aabb.min;
            for (k, v) in vertices.iter().enumerate() {
                let (a, b) = (place(*v), place(vertices[(k + 1) % vertices.len()]));
                area += 0.5 * area_vector(&middle, &a, &b);
                parts[part].volume += cone(&from, [&middle, &a, &b]);
            }
            if !is_hole {
                parts[part].missing += area.norm();
                parts[part].openings += 1;
            }
            loops.push(Loop { vertices, part, is_hole });
        }
        let turned: Vec<bool> = parts.iter_mut().map(Part::turn_outwards).collect();
        decide(&mut parts)?;
        let islands = islands(&mesh, &parts, &loops, ISLAND * height);
        let mut turned: Vec<bool> =
            turned.iter().zip(&parts).map(|(turned, part)| *turned && part.has_inside).collect();
        for (island, beside) in islands {
            parts[island].is_island = true;
            turned[island] = turned[beside];
        }
        let turn = |part: usize| turned[part];
        let triangles = mesh.triangles().iter().zip(&part_of);
        let triangles =
            triangles.map(|(t, part)| if turn(*part as usize) { [t[0], t[2], t[1]] } else { *t });
        mesh = with_triangles(&mesh, triangles.collect());
        loops.retain(|l| parts[l.part].has_inside);
        loops.iter_mut().filter(|l| turn(l.part)).for_each(|l| l.vertices.reverse());
        let hole = |l: &Loop| {
            let points = || l.vertices.iter().map(|v| &mesh.vertices()[*v as usize]);
            Hole {
                edges: l.vertices.len(),
                size: Aabb::from_points(points()).size().max(),
                center: mean(points().copied()).into(),
                filled: l.is_hole,
            }
        };
        let report = BodyReport {
            holes: loops.iter().map(hole).collect(),
            merged_vertices,
            repeated_triangles,
            turned_triangles,
            turned_parts: (0..parts.len()).filter(|part| turn(*part)).count(),
            islands: parts.iter().filter(|part| part.is_island).count(),
            sheets: parts.iter().filter(|part| !part.has_inside && !part.is_island).count(),
            ..BodyReport::default()
        };
        Ok(Self { mesh, given, given_count, first, parts, part_of, loops, report })
    }
}

impl Part {
    /// Whether its volume is not that of a folded sheet.
    fn encloses(&self) -> bool {
        self.volume.abs() > NO_VOLUME * self.area.powf(1.5)
    }

    /// Makes the volume positive, and returns whether it was negative.
    fn turn_outwards(&mut self) -> bool {
        let turned = self.volume < 0.0;
        self.volume = self.volume.abs();
        turned
    }

    fn may_have_inside(&self) -> bool {
        self.encloses() && self.missing <= MOSTLY_OPEN * self.area
    }

    /// Whether it would be a body if it were alone.
    fn is_body(&self) -> bool {
        self.may_have_inside() && (self.openings <= 1 || self.missing <= MISSING * self.area)
    }
}

/// Decides which parts have an inside.
fn decide(parts: &mut [Part]) -> Result<(), NoInside> {
    if !parts.iter().any(Part::is_body) {
        let largest = parts.iter().max_by(|a, b| a.area.total_cmp(&b.area));
        return Err(NoInside {
            area: parts.iter().map(|part| part.area).sum(),
            volume: largest.map_or(0.0, |part| part.volume),
            openings: largest.map_or(0, |part| part.openings),
            share: largest.map_or(0.0, |part| part.missing / part.area.max(Real::MIN_POSITIVE)),
        });
    }
    parts.iter_mut().for_each(|part| part.has_inside = part.may_have_inside());
    Ok(())
}

/// Parts without an inside that lie within `reach` of an opening, each with the part that has it.
fn islands(mesh: &TriMesh, parts: &[Part], loops: &[Loop], reach: Real) -> Vec<(usize, usize)> {
    let openings: Vec<&Loop> =
        loops.iter().filter(|l| !l.is_hole && parts[l.part].has_inside).collect();
    let beside = |part: &Part| {
        let region = part.aabb.inflated(reach);
        let is_near = |v: &u32| region.distance_squared(&mesh.vertices()[*v as usize]) == 0.0;
        openings.iter().find(|l| l.vertices.iter().any(is_near)).map(|l| l.part)
    };
    let sheets = (0..parts.len()).filter(|part| !parts[*part].has_inside);
    sheets.filter_map(|part| Some((part, beside(&parts[part])?))).collect()
}

/// For each triangle its part, and the parts, that of the first triangle first. Volumes are those
/// of the triangles and a corner of the part's box.
fn connected(mesh: &TriMesh) -> (Vec<u32>, Vec<Part>) {
    let root = parts(mesh);
    let mut number = vec![u32::MAX; root.len()];
    let mut found: Vec<Part> = Vec::new();
    let mut part_of = Vec::with_capacity(mesh.triangles().len());
    for (t, corners) in mesh.triangles().iter().enumerate() {
        let slot = &mut number[root[corners[0] as usize] as usize];
        if *slot == u32::MAX {
            *slot = found.len() as u32;
            found.push(Part {
                triangles: 0,
                aabb: Aabb::EMPTY,
                area: 0.0,
                volume: 0.0,
                missing: 0.0,
                openings: 0,
                has_inside: false,
                is_island: false,
            });
        }
        part_of.push(*slot);
        let part = &mut found[*slot as usize];
        part.triangles += 1;
        part.aabb = part.aabb.merged(&Aabb::from_points(mesh.corners(t)));
    }
    for (t, part) in part_of.iter().enumerate() {
        let part = &mut found[*part as usize];
        let [a, b, c] = mesh.corners(t);
        part.area += 0.5 * area_vector(a, b, c).norm();
        part.volume += cone(&part.aabb.min, [a, b, c]);
    }
    (part_of, found)
}

fn of_vertices(mesh: &TriMesh, part_of: &[u32]) -> Vec<u32> {
    let mut of_vertex = vec![0; mesh.vertices().len()];
    for (corners, part) in mesh.triangles().iter().zip(part_of) {
        corners.iter().for_each(|v| of_vertex[*v as usize] = *part);
    }
    of_vertex
}

/// Signed volume between a triangle and a point.
fn cone(from: &Point, [a, b, c]: [&Point; 3]) -> Real {
    (a - from).dot(&(b - from).cross(&(c - from))) / 6.0
}

fn mean(points: impl ExactSizeIterator<Item = Point>) -> Point {
    let n = points.len().max(1) as Real;
    Point::from(points.map(|p| p.coords).sum::<Vector>() / n)
}
