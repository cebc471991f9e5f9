//! Seams whose sides nearly coincide: closed where rounding has parted them, and watched where more has.

use crate::outfit::Outfit;
use crate::report::SeamReport;
use if_core::edges::Edges;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::seams::{NearSeams, near_seams};
use rayon::prelude::*;

/// Distance up to which the sides of a seam are one, in metres: what five decimals in a file leave. No cloth
/// is as thin.
const ROUNDING: Real = 1e-5;
/// Distance up to which boundaries that run beside one another may be a seam, in metres.
const SUSPECT: Real = 2e-4;
/// Distance by which a seam has to open for a note, in metres.
const OPENED: Real = 2e-4;

/// The seams of an outfit's garments.
pub(crate) struct Sewn {
    /// The outfit with seams closed that rounding parted; `None` if there is none.
    pub(crate) outfit: Option<Outfit>,
    closed: Vec<SeamReport>,
    /// Of each garment, with the largest distance of its sides.
    suspects: Vec<Option<(NearSeams, Real)>>,
}

impl Sewn {
    /// Looks for seams of garments.
    pub(crate) fn new(outfit: &Outfit) -> Self {
        let garments = outfit.garments.par_iter().map(|layer| sides(&layer.mesh));
        let garments: Vec<_> = garments.collect();
        let mut sewn = Self { outfit: None, closed: Vec::new(), suspects: Vec::new() };
        for (k, (closed, suspect)) in garments.into_iter().enumerate() {
            if let Some((mesh, seams)) = closed {
                let given = &outfit.garments[k];
                sewn.closed.push(SeamReport {
                    name: given.name.clone(),
                    edges: seams.edges,
                    given: seams.widest(given.mesh.vertices()),
                    now: 0.0,
                });
                sewn.outfit.get_or_insert_with(|| outfit.clone()).garments[k].mesh = mesh;
            }
            sewn.suspects.push(suspect);
        }
        sewn
    }

    /// What was closed, and what has opened in the outfit `found`.
    pub(crate) fn report(self, found: &Outfit) -> Vec<SeamReport> {
        let mut report = self.closed;
        for (layer, suspect) in found.garments.iter().zip(self.suspects) {
            let Some((seams, given)) = suspect else { continue };
            let now = seams.widest(layer.mesh.vertices());
            if now > given + OPENED {
                let (name, edges) = (layer.name.clone(), seams.edges);
                report.push(SeamReport { name, edges, given, now });
            }
        }
        report
    }
}

type Closed = Option<(TriMesh, NearSeams)>;
type Suspect = Option<(NearSeams, Real)>;

/// A mesh with its seams closed that rounding parted, and those whose sides are farther apart.
fn sides(mesh: &TriMesh) -> (Closed, Suspect) {
    let edges = Edges::new(mesh);
    let closed = near_seams(mesh, &edges, ROUNDING).map(|seams| {
        let positions = seams.closed(mesh.vertices());
        (mesh.with_vertices(positions).expect("positions of the mesh"), seams)
    });
    let mesh = closed.as_ref().map_or(mesh, |(mesh, _)| mesh);
    let suspect = near_seams(mesh, &edges, SUSPECT);
    let suspect = suspect.map(|seams| {
        let given = seams.widest(mesh.vertices());
        (seams, given)
    });
    (closed, suspect)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outfit::Layer;
    use crate::resolve::{ResolveParams, Resolved, resolve};
    use if_core::math::{Point, Vector};
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::{icosphere, tube};

    /// A band about a ball, which it cuts.
    fn band() -> TriMesh {
        let band = tube(0.148, 0.08, 60, 8, false);
        let moved = band.vertices().iter().map(|p| p - Vector::y() * 0.04).collect();
        band.with_vertices(moved).unwrap()
    }

    fn resolved(mesh: TriMesh) -> Resolved {
        let body = Layer::new("ball", icosphere(0.15, 4));
        let outfit = Outfit::new(body, vec![Layer::new("band", mesh)]).unwrap();
        resolve(&outfit, &ResolveParams::default(), &mut Silent).unwrap()
    }

    /// The band with the triangles of one side on vertices of their own, `shifted`.
    fn with_own(is_part: impl Fn(&Point) -> bool, shifted: impl Fn(&Point) -> Point) -> TriMesh {
        let band = band();
        let n = band.vertices().len() as u32;
        let triangles = band.triangles().iter().map(|t| {
            let is_part = t.iter().all(|v| is_part(&band.vertices()[*v as usize]));
            if is_part { t.map(|v| v + n) } else { *t }
        });
        let own = band.vertices().iter().map(shifted);
        TriMesh::new(band.vertices().iter().copied().chain(own).collect(), triangles.collect())
            .unwrap()
    }

    #[test]
    fn a_pocket_with_vertices_of_its_own_stays_sewn_on() {
        let band = band();
        let n = band.vertices().len() as u32;
        // A patch over the front, lifted by 2 mm where it is not sewn to the middle of the band.
        let is_patch = |t: &&[u32; 3]| {
            t.iter().map(|v| band.vertices()[*v as usize]).all(|p| p.z > 0.1 && p.y.abs() < 0.025)
        };
        let patch: Vec<[u32; 3]> = band.triangles().iter().filter(is_patch).copied().collect();
        let rim = Edges::new(&TriMesh::new(band.vertices().to_vec(), patch.clone()).unwrap())
            .boundary_vertices(n as usize);
        let lifted = |(v, p): (usize, &Point)| if rim[v] { *p } else { p * (1.0 + 0.002 / 0.148) };
        let own = band.vertices().iter().enumerate().map(lifted);
        let vertices = band.vertices().iter().copied().chain(own).collect();
        let own = patch.iter().map(|t| t.map(|v| v + n));
        let triangles = band.triangles().iter().copied().chain(own).collect();
        let found = resolved(TriMesh::new(vertices, triangles).unwrap());
        assert_eq!(found.report.after.total_pairs(), 0);
        let x = found.outfit.garments[0].mesh.vertices();
        let sewn: Vec<usize> = (0..n as usize).filter(|v| rim[*v]).collect();
        assert!(sewn.len() > 20 && sewn.iter().all(|v| x[*v] == x[*v + n as usize]));
        assert!(found.report.seams.is_empty());
    }

    #[test]
    fn seams_that_rounding_parted_are_closed_and_told() {
        let nudged = |p: &Point| p + Vector::new(3e-7, -2e-7, 1e-7);
        let mesh = with_own(|p| p.x > -1e-6, nudged);
        let (seams, n) =
            (near_seams(&mesh, &Edges::new(&mesh), 1e-5).unwrap(), mesh.vertices().len());
        let found = resolved(mesh);
        assert!(seams.pairs.len() >= 18, "{seams:?}");
        let x = found.outfit.garments[0].mesh.vertices();
        assert!(x.len() == n && seams.pairs.iter().all(|[a, b]| x[*a as usize] == x[*b as usize]));
        let [report] = &found.report.seams[..] else { panic!("{:?}", found.report.seams) };
        assert_eq!((report.name.as_str(), report.edges, report.now), ("band", seams.edges, 0.0));
        assert!(report.given > 2e-7 && report.given < 5e-7, "{report:?}");
        let notes = found.report.notes("ball");
        assert!(notes.iter().any(|n| n.contains("`band`: the sides of seams were")), "{notes:?}");
    }

    #[test]
    fn seams_that_open_are_told() {
        // Each side moves by itself: the ball pushes the one, and the other hangs 0.1 mm off.
        let mesh = with_own(|p| p.y > -1e-6, |p| p + Vector::y() * 1e-4);
        let report = resolved(mesh).report;
        let [seam] = &report.seams[..] else { panic!("{:?}", report.seams) };
        assert!(seam.now > seam.given + OPENED && (seam.given - 1e-4).abs() < 1e-6, "{seam:?}");
        let notes = report.notes("ball");
        assert!(notes.iter().any(|n| n.contains("merge its vertices by distance")), "{notes:?}");
        assert!(resolved(band()).report.seams.is_empty());
    }
}
