//! The glTF reader.

use super::accessor::Wanted;
use super::data::{Data, POSITION};
use super::document::{Document, entry};
use super::error::ReadError;
use super::gltf_mesh::{GltfMesh, Part, Placings};
use super::placing::Placing;
use super::scene::Placed;
use super::skin::Skinned;
use super::source::{Beside, Source};
use super::uri::{self, Uri};
use crate::regular_file;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

const NORMAL: Wanted = Wanted { what: "NORMAL", ..POSITION };
const TANGENT: Wanted = Wanted { what: "TANGENT", kind: "VEC4", ..POSITION };
const TEXTURE: Wanted = Wanted { what: "TEXCOORD_0", kind: "VEC2", ..POSITION };
const INDICES: Wanted = Wanted {
    what: "indices",
    kind: "SCALAR",
    is_whole: true,
    expected: "SCALAR of unsigned whole numbers",
};

/// Positions, of 12 bytes each, may be as many times the bytes of the file, so that a mesh may be
/// shown by several nodes.
const INSTANCES: usize = 16;
/// Elements that a primitive counts for each time that a node shows it, whatever it holds.
const SHOWN: usize = 16;

/// Reads the triangles of the default scene of a file without files beside it.
///
/// # Errors
///
/// [`ReadError`]: the invalid accessor, node or number, or what has to be exported otherwise.
pub fn read(bytes: Vec<u8>) -> Result<GltfMesh, ReadError> {
    read_layer(bytes, None, None)
}

/// Reads the triangles of the node `node` of the default scene: those of its mesh, or if it has
/// none, of all nodes below it. Without a name, all triangles of the scene. External buffers are
/// read from `folder`, and are refused without one.
///
/// # Errors
///
/// As [`read`], a name that no node or several nodes have, and errors of external buffers.
pub fn read_layer(
    bytes: Vec<u8>,
    node: Option<&str>,
    folder: Option<&Path>,
) -> Result<GltfMesh, ReadError> {
    let beside = |path: &Path| match folder {
        None => Err(io::Error::other("give the file by its path, not by its bytes")),
        Some(folder) => regular_file::read(&folder.join(path)),
    };
    read_with(bytes, node, &beside)
}

/// [`read_layer`] with external buffers from elsewhere.
pub(super) fn read_with(
    bytes: Vec<u8>,
    node: Option<&str>,
    beside: Beside<'_>,
) -> Result<GltfMesh, ReadError> {
    let mut source = Source::new(bytes)?;
    let document = Document::parse(&source.bytes[source.json.clone()])?;
    source.load(&document, beside)?;
    let placed = Placed::new(&document)?;
    let data = Data::new(source, &document);
    let mut reader = Reader { data, parts: Vec::new(), of: BTreeMap::new() };
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    let (mut collapsed, mut faces) = (Vec::new(), 0u32);
    let chosen = match node {
        Some(name) => &placed.layer(&document, name)?,
        None => &placed.shown,
    };
    for &node in chosen {
        let Some(mesh) = document.nodes[node].mesh else { continue };
        let primitives = &entry(&document.meshes, "mesh", mesh)?.primitives;
        for (primitive, about) in primitives.iter().enumerate() {
            let mode = about.mode.unwrap_or(4);
            if !(4..=6).contains(&mode) {
                continue; // points and lines
            }
            let part = reader.part(node, [mesh, primitive], &placed, &mut vertices)?;
            let corners = reader.corners([mesh, primitive], part)?;
            let Part { first, placings, .. } = &reader.parts[part];
            for mut corners in triangles_of(mode, &corners) {
                if placings.of(corners[0] as usize - first).is_mirrored() {
                    corners.swap(1, 2);
                }
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
    let mut is_chosen = vec![false; document.nodes.len()];
    chosen.iter().for_each(|&node| is_chosen[node] = true);
    let shared = reader.shared(placed.shown.iter().copied().filter(|&node| !is_chosen[node]));
    let (joints, nearest) = placed.joints(&document, chosen);
    let Reader { data, mut parts, of } = reader;
    for &(node, part) in
        of.values().flatten().filter(|(node, _)| document.nodes[*node].skin.is_none())
    {
        parts[part].hangs_from = nearest[node];
    }
    let mesh = TriMesh::new(vertices, triangles)?;
    let (source, node) = (data.source, node.map(str::to_owned));
    let images = images(&document);
    Ok(GltfMesh { source, node, mesh, parts, collapsed, shared, images, joints })
}

/// The images that are not in the file.
fn images(document: &Document) -> Vec<Result<PathBuf, String>> {
    let mut found = Vec::new();
    for uri in document.images.iter().filter_map(|image| image.uri.as_ref()) {
        match uri::parse(uri) {
            Ok(Uri::Path(path)) => found.push(Ok(path)),
            Err(_) if !uri.starts_with("data:") => found.push(Err(uri::shortened(uri))),
            _ => {}
        }
    }
    found
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

/// The primitives read so far.
struct Reader<'a> {
    data: Data<'a>,
    parts: Vec<Part>,
    /// For each accessor of positions the nodes that show it, with their parts.
    of: BTreeMap<usize, Vec<(usize, usize)>>,
}

impl Reader<'_> {
    /// Two nodes that show the same vertices, one of them chosen.
    fn shared(&self, mut others: impl Iterator<Item = usize>) -> Option<[usize; 2]> {
        let twice = self.of.values().find(|shows| shows.len() > 1);
        let twice = twice.map(|shows| [shows[0].0, shows[1].0]);
        let by_other = |second: usize| {
            let mesh = self.data.document.nodes[second].mesh;
            let mesh = mesh.and_then(|mesh| self.data.document.meshes.get(mesh))?;
            let positions = mesh.primitives.iter().filter_map(|p| p.attributes.get("POSITION"));
            let mut shown = positions.filter_map(|accessor| self.of.get(accessor));
            shown.next().map(|shows| [shows[0].0, second])
        };
        twice.or_else(|| others.find_map(by_other))
    }

    /// The part of a primitive's vertices; its vertices are added if it is new.
    fn part(
        &mut self,
        node: usize,
        at: [usize; 2],
        placed: &Placed,
        vertices: &mut Vec<Point>,
    ) -> Result<usize, ReadError> {
        let primitive = self.data.primitive(at);
        let Some(&accessor) = primitive.attributes.get("POSITION") else {
            return Err(ReadError::NoTriangles);
        };
        // Nodes come one after the other.
        let last = self.of.get(&accessor).and_then(|shows| shows.last());
        if let Some((_, part)) = last.filter(|(shown_by, _)| *shown_by == node) {
            return Ok(*part);
        }
        self.data.spend(SHOWN, "of primitives")?;
        let positions = self.data.elements(accessor, &POSITION)?;
        let sum = (vertices.len() + positions.count).saturating_mul(12);
        if sum > INSTANCES.saturating_mul(self.data.size) {
            return Err(ReadError::TooMuch { what: "of positions" });
        }
        let normals = match primitive.attributes.get("NORMAL") {
            Some(&normals) => Some(self.data.elements(normals, &NORMAL)?),
            None => None,
        };
        let normals = normals.filter(|n| n.count == positions.count);
        // Nothing depends on them here, so that invalid ones are as if there were none.
        let mut other = |name: &str, wanted| {
            let found = primitive.attributes.get(name);
            let found = found.and_then(|&at| self.data.elements(at, wanted).ok());
            found.filter(|elements| elements.count == positions.count)
        };
        let tangents = other("TANGENT", &TANGENT);
        let texture = other("TEXCOORD_0", &TEXTURE);
        let (placings, skinned) = self.placings(node, at, placed, positions.count)?;
        let first = vertices.len();
        for element in 0..positions.count {
            let p: [Real; 3] = positions.values(&self.data.source, element);
            let p = placings.of(element).forward(p.map(|x| x as f32));
            if !p.iter().all(|x| x.is_finite()) {
                let (found, expected) = (format!("{p}"), "every coordinate must be finite");
                return Err(ReadError::Value { accessor, element, expected, found });
            }
            vertices.push(p);
        }
        let part = self.parts.len();
        let hangs_from = None;
        self.parts.push(Part {
            first,
            positions,
            normals,
            tangents,
            texture,
            placings,
            skinned,
            hangs_from,
        });
        self.of.entry(accessor).or_default().push((node, part));
        Ok(part)
    }

    /// The corners of a primitive, as vertices of the mesh.
    fn corners(&mut self, at: [usize; 2], part: usize) -> Result<Vec<u32>, ReadError> {
        let Part { first, positions, .. } = &self.parts[part];
        let (first, count) = (*first, positions.count);
        let Some(accessor) = self.data.primitive(at).indices else {
            self.data.spend(count, "of triangles")?;
            return Ok((first as u32..(first + count) as u32).collect());
        };
        let indices = self.data.elements(accessor, &INDICES)?;
        self.data.spend(indices.count, "of triangles")?;
        let corner = |element| {
            let index = indices.index(&self.data.source, element);
            if index as usize >= count {
                return Err(ReadError::Index { what: "vertex", index: index as usize, count });
            }
            Ok(first as u32 + index)
        };
        (0..indices.count).map(corner).collect()
    }

    fn placings(
        &mut self,
        node: usize,
        at: [usize; 2],
        placed: &Placed,
        count: usize,
    ) -> Result<(Placings, Option<Skinned>), ReadError> {
        let morph = self.data.morph(node, at, count)?;
        let (mut skinned, mut maps) = (None, None);
        if let Some(skin) = self.data.document.nodes[node].skin {
            skinned = self.data.skinned(at, skin, count)?;
            if let Some(skinned) = &skinned {
                maps = Some(self.data.joint_maps(at, skin, placed, (skinned, count))?);
            }
        }
        if maps.is_none() && !placed.world[node].is_invertible() {
            return Err(ReadError::Transform { node });
        }
        let map = |k: usize| maps.as_ref().map_or(placed.world[node], |maps| maps[k]);
        let offset = |k: usize| morph.as_ref().map_or(Vector::zeros(), |morph| morph[k]);
        if maps.is_none() && morph.is_none() {
            let all = Placing { morph: Vector::zeros(), map: placed.world[node] };
            return Ok((Placings::All(all), None));
        }
        let each = (0..count).map(|k| Placing { morph: offset(k), map: map(k) });
        Ok((Placings::Each(each.collect()), skinned))
    }
}
