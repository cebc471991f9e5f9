//! The GLB reader.

use super::accessor::{Elements, Wanted};
use super::container::{Chunks, chunks};
use super::document::{Document, Node, Primitive, entry};
use super::error::ReadError;
use super::glb_mesh::{GlbMesh, Part, Placings};
use super::placing::{Affine, Placing};
use super::scene::Placed;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use std::collections::BTreeMap;

const POSITION: Wanted =
    Wanted { what: "POSITION", kind: "VEC3", is_whole: false, expected: "VEC3 of floats" };
const NORMAL: Wanted = Wanted { what: "NORMAL", ..POSITION };
const INDICES: Wanted = Wanted {
    what: "indices",
    kind: "SCALAR",
    is_whole: true,
    expected: "SCALAR of unsigned whole numbers",
};
const JOINTS: Wanted =
    Wanted { what: "JOINTS", kind: "VEC4", is_whole: true, expected: "VEC4 of whole numbers" };
const WEIGHTS: Wanted = Wanted {
    what: "WEIGHTS",
    kind: "VEC4",
    is_whole: false,
    expected: "VEC4 of floats or normalised whole numbers",
};
const BIND: Wanted = Wanted {
    what: "inverseBindMatrices",
    kind: "MAT4",
    is_whole: false,
    expected: "MAT4 of floats",
};

/// Lists of triangles may be used by several primitives, but their sum is bounded by this many times
/// the bytes of the file.
const REUSE: usize = 4;

/// Reads the triangles of the default scene.
///
/// # Errors
///
/// [`ReadError`]: the invalid accessor, node or number, or what has to be exported otherwise.
pub fn read(bytes: Vec<u8>) -> Result<GlbMesh, ReadError> {
    read_layer(bytes, None)
}

/// Reads the triangles of the node `node` of the default scene: those of its mesh, or if it has
/// none, of all nodes below it. Without a name, all triangles of the scene.
///
/// # Errors
///
/// As [`read`], and a name that no node or several nodes have.
pub fn read_layer(bytes: Vec<u8>, node: Option<&str>) -> Result<GlbMesh, ReadError> {
    let chunks = chunks(&bytes)?;
    let document = Document::parse(&bytes[chunks.json.clone()])?;
    let placed = Placed::new(&document)?;
    let mut reader =
        Reader { bytes: &bytes, chunks: &chunks, document, parts: Vec::new(), of: BTreeMap::new() };
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    let (mut collapsed, mut faces) = (Vec::new(), 0u32);
    let mut indices_used = 0usize;
    let chosen = match node {
        Some(name) => &placed.layer(&reader.document, name)?,
        None => &placed.shown,
    };
    for &node in chosen {
        let about = &reader.document.nodes[node];
        let Some(mesh) = about.mesh else { continue };
        let count = entry(&reader.document.meshes, "mesh", mesh)?.primitives.len();
        for primitive in 0..count {
            let mode = reader.document.meshes[mesh].primitives[primitive].mode.unwrap_or(4);
            if !(4..=6).contains(&mode) {
                continue; // points and lines
            }
            let part = reader.part(node, [mesh, primitive], &placed, &mut vertices)?;
            let corners = reader.corners([mesh, primitive], part)?;
            indices_used += corners.len();
            if indices_used > REUSE * bytes.len() {
                return Err(ReadError::TooMuch { what: "of triangles" });
            }
            for corners in triangles_of(mode, &corners) {
                if corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]
                {
                    collapsed.push(faces);
                } else {
                    triangles.push(corners);
                }
                faces += 1;
            }
        }
    }
    if triangles.is_empty() {
        return Err(ReadError::NoTriangles);
    }
    for &second in placed.shown.iter().filter(|node| !chosen.contains(node)) {
        if let Some(first) = reader.shown_by_chosen(second) {
            return Err(ReadError::Shared { first, second });
        }
    }
    let parts = reader.parts;
    let mesh = TriMesh::new(vertices, triangles)?;
    Ok(GlbMesh { bytes, node: node.map(str::to_owned), chunks, mesh, parts, collapsed })
}

/// The triangles of a list, strip or fan.
fn triangles_of(mode: u32, corners: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        4 => corners.as_chunks().0.to_vec(),
        5 => (corners.windows(3).enumerate())
            .map(|(k, c)| if k % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] })
            .collect(),
        _ => (1..corners.len().saturating_sub(1))
            .map(|k| [corners[k], corners[k + 1], corners[0]])
            .collect(),
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
    chunks: &'a Chunks,
    document: Document,
    parts: Vec<Part>,
    /// For each accessor of positions its node and part.
    of: BTreeMap<usize, (usize, usize)>,
}

impl Reader<'_> {
    fn elements(&self, accessor: usize, wanted: &Wanted) -> Result<Elements, ReadError> {
        Elements::find(&self.document, &self.chunks.bin, accessor, wanted)
    }

    fn primitive(&self, [mesh, primitive]: [usize; 2]) -> &Primitive {
        &self.document.meshes[mesh].primitives[primitive]
    }

    /// The chosen node that shows vertices of `node`, too.
    fn shown_by_chosen(&self, node: usize) -> Option<usize> {
        let mesh =
            self.document.nodes[node].mesh.and_then(|mesh| self.document.meshes.get(mesh))?;
        let positions = mesh.primitives.iter().filter_map(|p| p.attributes.get("POSITION"));
        positions.filter_map(|accessor| self.of.get(accessor)).map(|(first, _)| *first).next()
    }

    /// The part of a primitive's vertices; its vertices are added if it is new.
    fn part(
        &mut self,
        node: usize,
        at: [usize; 2],
        placed: &Placed,
        vertices: &mut Vec<Point>,
    ) -> Result<usize, ReadError> {
        let primitive = self.primitive(at);
        let Some(&accessor) = primitive.attributes.get("POSITION") else {
            return Err(ReadError::NoTriangles);
        };
        if let Some(&(first, part)) = self.of.get(&accessor) {
            let shared = ReadError::Shared { first, second: node };
            return if first == node { Ok(part) } else { Err(shared) };
        }
        let positions = self.elements(accessor, &POSITION)?;
        if !positions.is_float() {
            let extension = "KHR_mesh_quantization".into();
            return Err(ReadError::Extension { extension });
        }
        // Vertices that could be written do not overlap.
        if (vertices.len() + positions.count).saturating_mul(12) > self.chunks.bin.len() {
            return Err(ReadError::TooMuch { what: "of positions" });
        }
        let normals = match primitive.attributes.get("NORMAL") {
            Some(&normals) => Some(self.elements(normals, &NORMAL)?),
            None => None,
        };
        let normals = normals.filter(|n| n.is_float() && n.count == positions.count);
        let placings = self.placings(node, at, placed, positions.count)?;
        let first = vertices.len();
        for element in 0..positions.count {
            let p: [Real; 3] = positions.values(self.bytes, element);
            let p = placings.of(element).forward(p.map(|x| x as f32));
            if !p.iter().all(|x| x.is_finite()) {
                let (found, expected) = (format!("{p}"), "every coordinate must be finite");
                return Err(ReadError::Value { accessor, element, expected, found });
            }
            vertices.push(p);
        }
        let part = self.parts.len();
        self.parts.push(Part { first, positions, normals, placings });
        self.of.insert(accessor, (node, part));
        Ok(part)
    }

    /// The corners of a primitive, as vertices of the mesh.
    fn corners(&self, at: [usize; 2], part: usize) -> Result<Vec<u32>, ReadError> {
        let Part { first, positions, .. } = &self.parts[part];
        let count = positions.count;
        let Some(accessor) = self.primitive(at).indices else {
            return Ok((*first as u32..(*first + count) as u32).collect());
        };
        let indices = self.elements(accessor, &INDICES)?;
        let corner = |element| {
            let index = indices.index(self.bytes, element);
            if index as usize >= count {
                return Err(ReadError::Index { what: "vertex", index: index as usize, count });
            }
            Ok(*first as u32 + index)
        };
        (0..indices.count).map(corner).collect()
    }

    fn placings(
        &self,
        node: usize,
        at: [usize; 2],
        placed: &Placed,
        count: usize,
    ) -> Result<Placings, ReadError> {
        let about = &self.document.nodes[node];
        let morph = self.morph(about, at, count)?;
        let maps = match about.skin {
            Some(skin) => self.joint_maps(at, skin, placed, count)?,
            None => None,
        };
        if maps.is_none() && !placed.world[node].is_invertible() {
            return Err(ReadError::Transform { node });
        }
        let map = |k: usize| maps.as_ref().map_or(placed.world[node], |maps| maps[k]);
        let offset = |k: usize| morph.as_ref().map_or(Vector::zeros(), |morph| morph[k]);
        if maps.is_none() && morph.is_none() {
            return Ok(Placings::All(Placing { morph: Vector::zeros(), map: placed.world[node] }));
        }
        let each = (0..count).map(|k| Placing { morph: offset(k), map: map(k) });
        Ok(Placings::Each(each.collect()))
    }

    /// The sum of the morph targets that have a weight; `None` if none has.
    fn morph(
        &self,
        node: &Node,
        at: [usize; 2],
        count: usize,
    ) -> Result<Option<Vec<Vector>>, ReadError> {
        let primitive = self.primitive(at);
        let weights = node.weights.as_ref().unwrap_or(&self.document.meshes[at[0]].weights);
        let mut sum: Option<Vec<Vector>> = None;
        for (target, &weight) in primitive.targets.iter().zip(weights) {
            let Some(&accessor) = target.get("POSITION").filter(|_| weight != 0.0) else {
                continue;
            };
            let offsets = self.elements(accessor, &POSITION)?;
            if offsets.count != count {
                let (found, expected) =
                    (format!("{} elements", offsets.count), "as many as POSITION");
                let what = "POSITION of a morph target";
                return Err(ReadError::Accessor { accessor, what, expected, found });
            }
            let sum = sum.get_or_insert_with(|| vec![Vector::zeros(); count]);
            for (element, sum) in sum.iter_mut().enumerate() {
                *sum += Vector::from(offsets.values::<3>(self.bytes, element)) * weight;
            }
        }
        Ok(sum)
    }

    /// For each vertex the blend of its joints' maps; `None` if the primitive has no joints.
    fn joint_maps(
        &self,
        at: [usize; 2],
        skin: usize,
        placed: &Placed,
        count: usize,
    ) -> Result<Option<Vec<Affine>>, ReadError> {
        let skin = entry(&self.document.skins, "skin", skin)?;
        let bind = match skin.inverse_bind_matrices {
            Some(accessor) => Some(self.elements(accessor, &BIND)?),
            None => None,
        };
        let mut joints = Vec::with_capacity(skin.joints.len());
        for (k, &joint) in skin.joints.iter().enumerate() {
            let world = entry(&placed.world, "joint node", joint)?;
            joints.push(match &bind {
                Some(bind) if k >= bind.count => {
                    let (what, index, count) = ("inverse bind matrix", k, bind.count);
                    return Err(ReadError::Index { what, index, count });
                }
                Some(bind) => world.after(&Affine::of_columns(&bind.values(self.bytes, k))),
                None => *world,
            });
        }
        let attributes = &self.primitive(at).attributes;
        let nothing = Affine { linear: Default::default(), shift: Vector::zeros() };
        let mut blends = vec![(0.0, nothing); count];
        let mut last = None;
        for set in 0.. {
            let names = [format!("JOINTS_{set}"), format!("WEIGHTS_{set}")];
            let [Some(&of_joints), Some(&of_weights)] = names.map(|name| attributes.get(&name))
            else {
                break;
            };
            let indices = self.elements(of_joints, &JOINTS)?;
            let weights = self.elements(of_weights, &WEIGHTS)?;
            for (accessor, found) in [(of_joints, indices.count), (of_weights, weights.count)] {
                if found != count {
                    let (found, expected) = (format!("{found} elements"), "as many as POSITION");
                    let what = "JOINTS or WEIGHTS";
                    return Err(ReadError::Accessor { accessor, what, expected, found });
                }
            }
            for (element, (sum, blend)) in blends.iter_mut().enumerate() {
                let of: [Real; 4] = indices.values(self.bytes, element);
                let weights: [Real; 4] = weights.values(self.bytes, element);
                for (joint, weight) in of.into_iter().zip(weights) {
                    if weight == 0.0 {
                        continue;
                    }
                    let map = entry(&joints, "joint", joint as usize)?;
                    blend.linear += map.linear * weight;
                    blend.shift += map.shift * weight;
                    *sum += weight;
                }
            }
            last = Some(of_weights);
        }
        let Some(accessor) = last else { return Ok(None) };
        let finished = |(element, (sum, blend)): (usize, &(Real, Affine))| {
            let map = Affine { linear: blend.linear / *sum, shift: blend.shift / *sum };
            let expected = "weights must not cancel, nor joints flatten space";
            let found = format!("a sum of weights of {sum}");
            let fault = ReadError::Value { accessor, element, expected, found };
            if *sum > 0.0 && map.is_invertible() { Ok(map) } else { Err(fault) }
        };
        blends.iter().enumerate().map(finished).collect::<Result<_, _>>().map(Some)
    }
}
