//! Layers that a page shows in three dimensions.

mod data;

use crate::intersections::Intersections;
use crate::preview::color;
use data::Writer;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use serde::Serialize;

/// The program of the page, and its style.
pub(crate) const SCRIPT: &str = include_str!("viewer/viewer.js");
pub(crate) const STYLE: &str = include_str!("viewer/viewer.css");

/// Layers to turn, cut and compare in a browser: see [`Page::viewer`](crate::Page::viewer).
///
/// There are one or more states of the same layers, such as before and after, or the frames of a
/// motion. Lines in red show where triangles of two layers, or of one, intersect: exactly the pairs
/// that verification counts.
#[derive(Clone, Debug)]
pub struct Viewer<'a> {
    states: Vec<String>,
    layers: Vec<Layer<'a>>,
    /// Of each state, if they were found already.
    found: Vec<&'a Intersections<'a>>,
    /// Whether the layers are parts of one surface.
    is_one_surface: bool,
}

#[derive(Clone, Debug)]
struct Layer<'a> {
    name: String,
    color: [u8; 3],
    meshes: Vec<&'a TriMesh>,
}

impl<'a> Viewer<'a> {
    /// No layers, in these states.
    ///
    /// # Panics
    ///
    /// If there is no state.
    pub fn new(states: &[&str]) -> Self {
        assert!(!states.is_empty(), "at least one state");
        let states = states.iter().map(ToString::to_string).collect();
        Self { states, layers: Vec::new(), found: Vec::new(), is_one_surface: false }
    }

    /// Takes the intersections of the layers of each state, which would be looked for otherwise.
    ///
    /// # Panics
    ///
    /// If there are not as many as states.
    pub fn intersections(&mut self, found: &[&'a Intersections<'a>]) -> &mut Self {
        assert_eq!(found.len(), self.states.len(), "of each state");
        self.found = found.to_vec();
        self
    }

    /// The layers are parts of one surface, which meet at their borders: intersections are not looked for.
    pub fn one_surface(&mut self) -> &mut Self {
        self.is_one_surface = true;
        self
    }

    /// Adds a layer above the others: its mesh in each state. Where the triangles differ from those
    /// of the state before, nothing is shown between the two.
    ///
    /// # Panics
    ///
    /// If there are not as many meshes as states.
    pub fn layer(&mut self, name: &str, meshes: &[&'a TriMesh]) -> &mut Self {
        let color = color(self.layers.len());
        self.colored(name, color, meshes)
    }

    /// As [`layer`](Self::layer), in a colour of sRGB.
    ///
    /// # Panics
    ///
    /// If there are not as many meshes as states.
    pub fn colored(&mut self, name: &str, color: [u8; 3], meshes: &[&'a TriMesh]) -> &mut Self {
        assert_eq!(meshes.len(), self.states.len(), "one mesh a state");
        self.layers.push(Layer { name: name.to_owned(), color, meshes: meshes.to_vec() });
        self
    }

    /// The elements of a page that `viewer.js` reads: what there is as JSON, and the numbers.
    pub(crate) fn html(&self) -> String {
        let meshes = self.layers.iter().flat_map(|layer| &layer.meshes);
        let mut writer = Writer::new(meshes.flat_map(|mesh| mesh.surface_vertices()));
        let mut layers = Vec::new();
        for layer in &self.layers {
            let mut states = Vec::new();
            let mut before: Option<(&TriMesh, Used, Vec<[i32; 3]>)> = None;
            for &mesh in &layer.meshes {
                let same = before.filter(|(mesh_before, ..)| {
                    mesh_before.triangles() == mesh.triangles()
                        && mesh_before.vertices().len() == mesh.vertices().len()
                });
                let (used, grid, triangles) = match same {
                    Some((_, used, before)) => {
                        let grid = writer.grid(&used.points(mesh));
                        let moved = before.iter().zip(&grid);
                        writer.differences(moved.flat_map(|(a, b)| [0, 1, 2].map(|k| b[k] - a[k])));
                        (used, grid, None)
                    }
                    None => {
                        let used = Used::new(mesh);
                        let grid = writer.grid(&used.points(mesh));
                        let corners = mesh.triangles().as_flattened().iter();
                        writer.chain(corners.map(|v| [used.places[*v as usize]]));
                        writer.chain(grid.iter().copied());
                        (used, grid, Some(mesh.triangles().len()))
                    }
                };
                states.push(StateHead { vertices: grid.len(), triangles });
                before = Some((mesh, used, grid));
            }
            layers.push(LayerHead { name: &layer.name, color: layer.color, states });
        }
        let mut lines = Vec::new();
        for state in self.lines() {
            writer.chain(writer.grid(state.as_flattened()).into_iter());
            lines.push(state.len());
        }
        let (low, step) = (writer.low(), writer.step());
        let head = Head { states: &self.states, low, step, layers, lines };
        let head = serde_json::to_string(&head).expect("text and finite numbers");
        // No text ends the element.
        let head = head.replace('<', "\\u003c");
        format!(
            "<div class=\"viewer\"><p>Needs a browser with JavaScript and WebGL 2.</p>\
             <script type=\"application/json\">{head}</script>\
             <script type=\"text/plain\">{}</script></div>\n",
            writer.finish()
        )
    }
}

impl Viewer<'_> {
    /// The lines in which triangles meet in each state, of different layers and of one; none at all of parts
    /// of one surface.
    fn lines(&self) -> Vec<Vec<[Point; 2]>> {
        if self.is_one_surface {
            return Vec::new();
        }
        let mut own: Vec<Vec<[Point; 2]>> = vec![Vec::new(); self.layers.len()];
        let of_state = |state: usize| {
            let meshes = || self.layers.iter().map(|l| l.meshes[state]).collect::<Vec<_>>();
            let looked_for = self.found.is_empty().then(|| Intersections::between(&meshes()));
            let found = looked_for.as_ref().unwrap_or_else(|| self.found[state]);
            let mut lines = found.lines();
            for (k, (layer, own)) in self.layers.iter().zip(&mut own).enumerate() {
                if state == 0 || layer.meshes[state] != layer.meshes[state - 1] {
                    *own = found.own_lines(k);
                }
                lines.extend_from_slice(own);
            }
            lines
        };
        (0..self.states.len()).map(of_state).collect()
    }
}

/// The vertices of a mesh that a triangle uses.
struct Used {
    list: Vec<usize>,
    /// For each used vertex of the mesh its place in the list.
    places: Vec<i32>,
}

impl Used {
    fn new(mesh: &TriMesh) -> Self {
        let is_used = mesh.used_vertices();
        let list: Vec<usize> = (0..is_used.len()).filter(|v| is_used[*v]).collect();
        let mut places = vec![0; is_used.len()];
        list.iter().enumerate().for_each(|(k, v)| places[*v] = k as i32);
        Self { list, places }
    }

    fn points(&self, mesh: &TriMesh) -> Vec<Point> {
        self.list.iter().map(|v| mesh.vertices()[*v]).collect()
    }
}

#[derive(Serialize)]
struct Head<'a> {
    states: &'a [String],
    /// The place of the grid's point 0 0 0, in metres.
    low: [f64; 3],
    /// The grid's step, in metres.
    step: f64,
    layers: Vec<LayerHead<'a>>,
    /// The number of lines in each state; empty if they were not looked for.
    lines: Vec<usize>,
}

#[derive(Serialize)]
struct LayerHead<'a> {
    name: &'a str,
    color: [u8; 3],
    states: Vec<StateHead>,
}

#[derive(Serialize)]
struct StateHead {
    vertices: usize,
    /// Missing where they are those of the state before.
    #[serde(skip_serializing_if = "Option::is_none")]
    triangles: Option<usize>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;
    use if_core::shapes::meshes::icosphere;
    use serde_json::Value;

    fn head(html: &str) -> Value {
        let json = html.split("json\">").nth(1).unwrap().split("</script>").next().unwrap();
        serde_json::from_str(json).unwrap()
    }

    #[test]
    fn a_state_with_the_triangles_of_the_one_before_stores_only_motion() {
        let ball = icosphere(0.2, 3);
        let moved: Vec<Point> =
            ball.vertices().iter().map(|p| p + Vector::new(0.01, 0.0, 0.0)).collect();
        let moved = ball.with_vertices(moved).unwrap();
        let finer = icosphere(0.2, 4);
        let mut viewer = Viewer::new(&["before", "after", "finer"]);
        viewer.layer("</script><b>", &[&ball, &moved, &finer]);
        let html = viewer.html();
        assert!(!html.contains("</script><b>"));
        let head = head(&html);
        assert_eq!(head["layers"][0]["name"], "</script><b>");
        let states = &head["layers"][0]["states"];
        assert_eq!(states[0]["triangles"], ball.triangles().len());
        assert!(states[1].get("triangles").is_none());
        assert_eq!(states[2]["triangles"], finer.triangles().len());
    }

    #[test]
    fn lines_are_counted_in_each_state() {
        let (ball, inner) = (icosphere(0.2, 3), icosphere(0.15, 3));
        let shifted: Vec<Point> =
            inner.vertices().iter().map(|p| Point::new(p.x + 0.1, p.y, p.z)).collect();
        let crossing = inner.with_vertices(shifted).unwrap();
        let mut viewer = Viewer::new(&["before", "after"]);
        viewer.layer("ball", &[&ball, &ball]).layer("inner", &[&crossing, &inner]);
        let head = self::head(&viewer.html());
        assert!(head["lines"][0].as_u64().unwrap() > 30 && head["lines"][1] == 0, "{head}");
        // Parts of one surface meet at their borders.
        let of_one = self::head(&viewer.one_surface().html());
        assert_eq!(of_one["lines"], serde_json::json!([]));
    }
}
