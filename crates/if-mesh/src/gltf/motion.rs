//! Motions as binary glTF: a first shape of each layer, and a morph target for each later frame.

use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use serde_json::{Value, json};
use std::io::{self, Write};

/// A layer of a motion.
#[derive(Clone, Copy, Debug)]
pub struct MotionLayer<'a> {
    /// The name of its node and mesh.
    pub name: &'a str,
    /// Its triangles; where its vertices are does not count.
    pub mesh: &'a TriMesh,
    /// A texture coordinate for each vertex, its second component counted downwards, as glTF counts.
    pub texture: Option<&'a [[f32; 2]]>,
    /// Its colour, in linear light from 0 to 1.
    pub colour: [f32; 3],
}

/// A motion cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum MotionError {
    /// No layer, no frame, or a rate at which the times of frames are no ascending single-precision
    /// numbers.
    #[error(
        "{layers} layers, {frames} frames and {rate} frames a second are no motion; give at least one of each"
    )]
    Empty { layers: usize, frames: usize, rate: Real },
    /// A list does not fit the layers.
    #[error("{what}: {found} were given for {expected} vertices; give one for each")]
    Count { what: String, found: usize, expected: usize },
    /// A position or its difference from the first frame is not a single-precision number.
    #[error(
        "frame {frame}, vertex {vertex} of layer `{layer}`: {at:?} and its difference from frame 0 must be \
         single-precision numbers; round all frames to a common step"
    )]
    Inexact { frame: usize, layer: String, vertex: usize, at: Point },
    /// More than a binary file can be long.
    #[error(
        "the file would have {bytes} bytes, and binary glTF at most {}; take every second frame, or a part of them",
        u32::MAX
    )]
    Size { bytes: u64 },
    /// The writer fails.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// Bytes of a position.
const POSITION: usize = 12;
/// Bytes of the file that are not JSON and not data: the header and two chunks' heads.
const HEADS: u64 = 28;

/// Checks that a motion of so many frames, at this rate, can be written, but for its positions.
///
/// # Errors
///
/// [`MotionError`], but for [`MotionError::Inexact`] and [`MotionError::Io`].
pub fn check_motion(
    layers: &[MotionLayer<'_>],
    (frames, rate): (usize, Real),
) -> Result<(), MotionError> {
    let ascends = |frame: usize| time(frame, rate) > time(frame - 1, rate);
    let has_times = frames < 2 || (ascends(1) && ascends(frames - 1));
    let is_rate = rate > 0.0 && time(frames, rate).is_finite();
    if layers.is_empty() || frames == 0 || !is_rate || !has_times {
        return Err(MotionError::Empty { layers: layers.len(), frames, rate });
    }
    for layer in layers {
        let (expected, found) =
            (vertices(layer), layer.texture.map_or(vertices(layer), <[_]>::len));
        if found != expected {
            let what = format!("texture coordinates of layer `{}`", layer.name);
            return Err(MotionError::Count { what, found, expected });
        }
    }
    // Each frame has its positions, and a weight for each of the others.
    let of_frame = (POSITION * layers.iter().map(vertices).sum::<usize>()) as u64;
    let bytes = (frames as u64).saturating_mul(of_frame.saturating_add(4 * (frames as u64 - 1)));
    if bytes > u32::MAX.into() { Err(MotionError::Size { bytes }) } else { Ok(()) }
}

/// Writes a motion as one binary file, with one animation, `motion`.
///
/// The meshes are shaped as in frame 0. Each later frame is a morph target, whose weight is 1 at its
/// time (frame / `rate` seconds) and falls to 0 until the frames beside it: between frames vertices go
/// in straight lines. At the time of a frame viewers show exactly its positions, for these are the
/// sums of two single-precision numbers. There are no normals, so that surfaces are shaded flat.
/// Vertices of no triangle stay where frame 0 has them.
///
/// `positions` has all vertices of a frame, layer by layer. It is asked for each frame at most twice, and no
/// more than two are in memory at a time.
///
/// # Errors
///
/// [`MotionError`], or what `positions` returns.
///
/// # Examples
///
/// ```
/// use if_core::shapes::meshes::icosphere;
/// use if_mesh::gltf::{MotionError, MotionLayer, read, write_motion};
/// let ball = icosphere(0.5, 1);
/// let layer = MotionLayer { name: "ball", mesh: &ball, texture: None, colour: [0.8, 0.2, 0.2] };
/// // It grows to twice its size; all coordinates are multiples of 2^-20 m.
/// let stored = |x: f64| (x * 1048576.0).round() / 1048576.0;
/// let mut frame = |k: usize| {
///     let size = (k + 1) as f64;
///     Ok::<Vec<_>, MotionError>(ball.vertices().iter().map(|p| p.map(|x| stored(x * size))).collect())
/// };
/// let mut bytes = Vec::new();
/// write_motion(&mut bytes, &[layer], (2, 24.0), &mut frame)?;
/// assert_eq!(read(bytes)?.mesh().vertices(), frame(0)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_motion<E: From<MotionError>>(
    writer: &mut dyn Write,
    layers: &[MotionLayer<'_>],
    (frames, rate): (usize, Real),
    positions: &mut dyn FnMut(usize) -> Result<Vec<Point>, E>,
) -> Result<(), E> {
    check_motion(layers, (frames, rate))?;
    let is_used: Vec<bool> = layers.iter().flat_map(|layer| layer.mesh.used_vertices()).collect();
    let mut checked = |frame: usize, first: Option<&[[f32; 3]]>| {
        Ok::<_, E>(checked(layers, &is_used, (frame, positions(frame)?), first)?)
    };
    let first = checked(0, None)?;
    let mut bounds = vec![bounds(layers, &first)];
    for frame in 1..frames {
        bounds.push(self::bounds(layers, &checked(frame, Some(&first))?));
    }
    let (document, data) = described(layers, (frames, rate), &bounds);
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let bytes = HEADS + text.len() as u64 + data;
    let io = |result: io::Result<()>| result.map_err(|e| E::from(MotionError::Io(e)));
    let length = u32::try_from(bytes).map_err(|_| MotionError::Size { bytes })?;
    // Both are smaller than the length.
    let (text_length, data_length) = (text.len() as u32, data as u32);
    io((|| {
        writer.write_all(b"glTF")?;
        for word in [2, length, text_length] {
            writer.write_all(&word.to_le_bytes())?;
        }
        writer.write_all(b"JSON")?;
        writer.write_all(&text)?;
        writer.write_all(&data_length.to_le_bytes())?;
        writer.write_all(b"BIN\0")?;
        write_still(writer, layers, (frames, rate))?;
        write_numbers(writer, first.as_flattened())
    })())?;
    for frame in 1..frames {
        let next = checked(frame, Some(&first))?;
        io(write_numbers(writer, next.as_flattened()))?;
    }
    io(writer.flush())
}

fn vertices(layer: &MotionLayer<'_>) -> usize {
    layer.mesh.vertices().len()
}

/// The positions of a frame, or their differences from the `first`, where a triangle uses them.
fn checked(
    layers: &[MotionLayer<'_>],
    is_used: &[bool],
    (frame, positions): (usize, Vec<Point>),
    first: Option<&[[f32; 3]]>,
) -> Result<Vec<[f32; 3]>, MotionError> {
    let expected = layers.iter().map(vertices).sum();
    if positions.len() != expected {
        let what = format!("positions of frame {frame}");
        return Err(MotionError::Count { what, found: positions.len(), expected });
    }
    let mut rows = Vec::with_capacity(expected);
    let mut start = 0;
    for layer in layers {
        for (vertex, at) in positions[start..start + vertices(layer)].iter().enumerate() {
            if first.is_some() && !is_used[start + vertex] {
                rows.push([0.0; 3]);
                continue;
            }
            let from = first.map_or([0.0; 3], |first| first[start + vertex]);
            let row = [0, 1, 2].map(|k| (at[k] - Real::from(from[k])) as f32);
            let is_exact = (0..3).all(|k| Real::from(from[k] + row[k]) == at[k]);
            if !is_exact {
                let (layer, at) = (layer.name.to_owned(), *at);
                return Err(MotionError::Inexact { frame, layer, vertex, at });
            }
            rows.push(row);
        }
        start += vertices(layer);
    }
    Ok(rows)
}

/// Of each layer the least and the largest coordinates.
fn bounds(layers: &[MotionLayer<'_>], rows: &[[f32; 3]]) -> Vec<[[f32; 3]; 2]> {
    let mut rest = rows;
    let one = |layer: &MotionLayer<'_>| {
        let (own, others) = rest.split_at(vertices(layer));
        rest = others;
        own.iter().fold([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]], |[low, high], row| {
            [[0, 1, 2].map(|k| low[k].min(row[k])), [0, 1, 2].map(|k| high[k].max(row[k]))]
        })
    };
    layers.iter().map(one).collect()
}

/// Views of the buffer, in order: triangles, texture coordinates, times, weights, positions.
#[derive(Default)]
struct Views {
    views: Vec<Value>,
    accessors: Vec<Value>,
    at: u64,
}

impl Views {
    /// A new view of what comes next, of this length and with these properties.
    fn view(&mut self, bytes: u64, mut about: Value) {
        about["buffer"] = json!(0);
        about["byteOffset"] = json!(self.at);
        about["byteLength"] = json!(bytes);
        self.views.push(about);
        self.at += bytes;
    }

    /// An accessor of the last view, and its index.
    fn accessor(&mut self, mut about: Value) -> usize {
        about["bufferView"] = json!(self.views.len() - 1);
        self.accessors.push(about);
        self.accessors.len() - 1
    }
}

/// The document, and the bytes of its buffer.
fn described(
    layers: &[MotionLayer<'_>],
    (frames, rate): (usize, Real),
    bounds: &[Vec<[[f32; 3]; 2]>],
) -> (Value, u64) {
    const ARRAY: u32 = 34962;
    const ELEMENTS: u32 = 34963;
    let mut of = Views::default();
    let count =
        |lists: &dyn Fn(&MotionLayer<'_>) -> usize| layers.iter().map(lists).sum::<usize>() as u64;
    let mut primitives: Vec<Value> = Vec::new();
    of.view(12 * count(&|l| l.mesh.triangles().len()), json!({"target": ELEMENTS}));
    let mut start = 0;
    for layer in layers {
        let n = 3 * layer.mesh.triangles().len();
        let triangles = of.accessor(
            json!({"byteOffset": 4 * start, "componentType": 5125, "count": n, "type": "SCALAR"}),
        );
        start += n;
        primitives.push(json!({"indices": triangles, "material": primitives.len(), "attributes": {}, "targets": []}));
    }
    if layers.iter().any(|l| l.texture.is_some()) {
        let bytes = 8 * count(&|l| l.texture.map_or(0, <[_]>::len));
        of.view(bytes, json!({"target": ARRAY, "byteStride": 8}));
        let mut start = 0;
        for (layer, primitive) in layers.iter().zip(&mut primitives) {
            let Some(texture) = layer.texture else { continue };
            let n = texture.len();
            let about =
                json!({"byteOffset": 8 * start, "componentType": 5126, "count": n, "type": "VEC2"});
            primitive["attributes"]["TEXCOORD_0"] = json!(of.accessor(about));
            start += n;
        }
    }
    let targets = frames - 1;
    let mut animation = None;
    if targets > 0 {
        of.view(4 * frames as u64, json!({}));
        let times = of.accessor(json!({
            "componentType": 5126, "count": frames, "type": "SCALAR",
            "min": [time(0, rate)], "max": [time(targets, rate)],
        }));
        of.view(4 * (frames * targets) as u64, json!({}));
        let count = frames * targets;
        let weights = of.accessor(json!({"componentType": 5126, "count": count, "type": "SCALAR"}));
        animation = Some((times, weights));
    }
    let all = count(&vertices);
    of.view(
        POSITION as u64 * all * frames as u64,
        json!({"target": ARRAY, "byteStride": POSITION}),
    );
    let mut start = 0;
    for of_layers in bounds {
        for ((layer, primitive), [low, high]) in layers.iter().zip(&mut primitives).zip(of_layers) {
            let n = vertices(layer);
            let accessor = of.accessor(json!({
                "byteOffset": POSITION * start, "componentType": 5126, "count": n, "type": "VEC3",
                "min": low, "max": high,
            }));
            start += n;
            if primitive["attributes"]["POSITION"].is_null() {
                primitive["attributes"]["POSITION"] = json!(accessor);
            } else if let Some(targets) = primitive["targets"].as_array_mut() {
                targets.push(json!({"POSITION": accessor}));
            }
        }
    }
    let names: Vec<String> = (1..frames).map(|frame| format!("frame {frame}")).collect();
    let meshes: Vec<Value> = layers
        .iter()
        .zip(primitives)
        .map(|(layer, mut primitive)| {
            if names.is_empty() {
                primitive.as_object_mut().map(|p| p.remove("targets"));
                return json!({"name": layer.name, "primitives": [primitive]});
            }
            let weights = vec![0; targets];
            json!({
                "name": layer.name, "primitives": [primitive], "weights": weights,
                "extras": {"targetNames": names},
            })
        })
        .collect();
    let material = |layer: &MotionLayer<'_>| {
        let [r, g, b] = layer.colour;
        json!({
            "name": layer.name, "doubleSided": true,
            "pbrMetallicRoughness":
                {"baseColorFactor": [r, g, b, 1], "metallicFactor": 0, "roughnessFactor": 0.9},
        })
    };
    let nodes: Vec<usize> = (0..layers.len()).collect();
    let node = |k: &usize| json!({"name": layers[*k].name, "mesh": k});
    let mut document = json!({
        "asset": {"version": "2.0", "generator": concat!("if-garments ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": nodes}],
        "nodes": nodes.iter().map(node).collect::<Vec<_>>(),
        "meshes": meshes,
        "materials": layers.iter().map(material).collect::<Vec<_>>(),
        "accessors": of.accessors,
        "bufferViews": of.views,
        "buffers": [{"byteLength": of.at}],
    });
    if let Some((times, weights)) = animation {
        let channel = |k: &usize| json!({"sampler": 0, "target": {"node": k, "path": "weights"}});
        document["animations"] = json!([{
            "name": "motion",
            "samplers": [{"input": times, "output": weights, "interpolation": "LINEAR"}],
            "channels": nodes.iter().map(channel).collect::<Vec<_>>(),
        }]);
    }
    (document, of.at)
}

/// The time of a frame in seconds.
fn time(frame: usize, rate: Real) -> f32 {
    (frame as Real / rate) as f32
}

/// Writes all that does not move.
fn write_still(
    writer: &mut dyn Write,
    layers: &[MotionLayer<'_>],
    (frames, rate): (usize, Real),
) -> io::Result<()> {
    for layer in layers {
        let corners = layer.mesh.triangles().as_flattened().iter();
        writer.write_all(&corners.flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())?;
    }
    for texture in layers.iter().filter_map(|layer| layer.texture) {
        write_numbers(writer, texture.as_flattened())?;
    }
    if frames == 1 {
        return Ok(());
    }
    let times: Vec<f32> = (0..frames).map(|frame| time(frame, rate)).collect();
    write_numbers(writer, &times)?;
    for frame in 0..frames {
        let weight = |target: usize| if target == frame { 1.0 } else { 0.0 };
        write_numbers(writer, &(1..frames).map(weight).collect::<Vec<f32>>())?;
    }
    Ok(())
}

fn write_numbers(writer: &mut dyn Write, numbers: &[f32]) -> io::Result<()> {
    writer.write_all(&numbers.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>())
}

#[cfg(test)]
mod tests {
    use super::super::tests::{bin, document};
    use super::super::{read, read_layer};
    use super::*;
    use if_core::shapes::meshes::{icosphere, tube};

    /// Eighths of metres, whose sums and differences are exact.
    fn moved(mesh: &TriMesh, frame: usize) -> Vec<Point> {
        let eighths = |x: Real| (8.0 * x).round() / 8.0;
        let shift = |p: &Point| Point::new(p.x + frame as Real, p.y * (1.0 + frame as Real), p.z);
        mesh.vertices().iter().map(|p| shift(p).map(eighths)).collect()
    }

    fn two() -> [TriMesh; 2] {
        [icosphere(0.5, 1), tube(0.6, 1.0, 12, 3, false)]
    }

    #[test]
    fn a_reader_gets_every_frame_to_the_bit_and_the_weights_single_it_out() {
        let [body, shirt] = two();
        let texture: Vec<[f32; 2]> = shirt.vertices().iter().map(|p| [p.x as f32, 0.25]).collect();
        let layers = [
            MotionLayer { name: "body", mesh: &body, texture: None, colour: [0.5; 3] },
            MotionLayer { name: "shirt", mesh: &shirt, texture: Some(&texture), colour: [1.0; 3] },
        ];
        let mut frame =
            |k: usize| Ok::<_, MotionError>([moved(&body, k), moved(&shirt, k)].concat());
        let mut bytes = Vec::new();
        write_motion(&mut bytes, &layers, (3, 24.0), &mut frame).unwrap();
        for (name, mesh) in [("body", &body), ("shirt", &shirt)] {
            let found = read_layer(bytes.clone(), Some(name), None).unwrap();
            assert_eq!(found.mesh().triangles(), mesh.triangles());
            assert_eq!(found.mesh().vertices(), moved(mesh, 0));
            let is_textured = found.texture_coordinates().is_some_and(|found| found == texture);
            assert_eq!(is_textured, name == "shirt");
        }
        let document = document(&bytes);
        let numbers = |accessor: &Value| -> Vec<f32> {
            let about = &document["accessors"][accessor.as_u64().unwrap() as usize];
            let view = &document["bufferViews"][about["bufferView"].as_u64().unwrap() as usize];
            let at = |v: &Value| v["byteOffset"].as_u64().unwrap_or(0) as usize;
            let each = match about["type"].as_str() {
                Some("VEC3") => 3,
                Some("VEC2") => 2,
                _ => 1,
            };
            let count = each * about["count"].as_u64().unwrap() as usize;
            let of = |b: &[u8]| f32::from_le_bytes(b.try_into().unwrap());
            bin(&bytes)[at(view) + at(about)..].chunks_exact(4).take(count).map(of).collect()
        };
        let shapes = &document["meshes"][1]["primitives"][0];
        assert_eq!(numbers(&shapes["attributes"]["TEXCOORD_0"]), texture.as_flattened());
        let sampler = &document["animations"][0]["samplers"][0];
        assert_eq!(numbers(&sampler["input"]), [0.0, 1.0 / 24.0, 2.0 / 24.0]);
        let weights = numbers(&sampler["output"]);
        let base = numbers(&shapes["attributes"]["POSITION"]);
        for k in 0..3 {
            // As a viewer adds them, in single precision.
            let mut shown = base.clone();
            for (target, weight) in
                shapes["targets"].as_array().unwrap().iter().zip(&weights[2 * k..])
            {
                let by = numbers(&target["POSITION"]);
                shown.iter_mut().zip(by).for_each(|(x, by)| *x += weight * by);
            }
            let expected: Vec<f32> =
                moved(&shirt, k).iter().flat_map(|p| [p.x, p.y, p.z]).map(|x| x as f32).collect();
            assert_eq!(shown, expected, "frame {k}");
        }
    }

    #[test]
    fn a_vertex_of_no_triangle_stays() {
        let [body, _] = two();
        let with_one = |body: &TriMesh| [body.vertices(), &[Point::new(5.0, 0.0, 0.0)]].concat();
        let mesh = TriMesh::new(with_one(&body), body.triangles().to_vec()).unwrap();
        let layers = [MotionLayer { name: "body", mesh: &mesh, texture: None, colour: [0.5; 3] }];
        let mut bytes = Vec::new();
        let mut frame = |k: usize| {
            let mut positions = moved(&mesh, k);
            // No difference from the first frame that single precision holds.
            positions.last_mut().unwrap().x = 5.0 + k as Real * (1.0 + 1e-6f32 as Real);
            Ok::<_, MotionError>(positions)
        };
        write_motion(&mut bytes, &layers, (2, 30.0), &mut frame).unwrap();
        assert_eq!(read(bytes).unwrap().mesh().vertices(), moved(&mesh, 0));
    }

    #[test]
    fn a_single_frame_has_no_animation() {
        let [body, _] = two();
        let layers = [MotionLayer { name: "body", mesh: &body, texture: None, colour: [0.5; 3] }];
        let mut bytes = Vec::new();
        let mut frame = |k| Ok::<_, MotionError>(moved(&body, k));
        write_motion(&mut bytes, &layers, (1, 30.0), &mut frame).unwrap();
        assert!(document(&bytes)["animations"].is_null());
        assert_eq!(read(bytes).unwrap().mesh().vertices(), moved(&body, 0));
    }

    #[test]
    fn what_cannot_be_stored_exactly_is_named() {
        let [body, _] = two();
        let mut layer = MotionLayer { name: "body", mesh: &body, texture: None, colour: [0.5; 3] };
        let fault = |layer: MotionLayer<'_>, motion, change: &dyn Fn(&mut Vec<Point>, usize)| {
            let mut frame = |k: usize| {
                let mut positions = moved(&body, k);
                change(&mut positions, k);
                Ok::<_, MotionError>(positions)
            };
            write_motion(&mut Vec::new(), &[layer], motion, &mut frame).unwrap_err()
        };
        for at in [1.0 + 1e-9, 1e300, Real::NAN] {
            let error = fault(layer, (3, 24.0), &|x, k| {
                if k == 2 {
                    x[5].y = at
                }
            });
            let named = matches!(error, MotionError::Inexact { frame: 2, vertex: 5, .. });
            assert!(named, "{error}");
        }
        // Both are single precision, and their difference is not.
        let error =
            fault(layer, (2, 24.0), &|x, k| x[0].x = [1.0 + 2f64.powi(-23), 1e-9f32.into()][k]);
        assert!(matches!(error, MotionError::Inexact { frame: 1, vertex: 0, .. }), "{error}");
        let error = fault(layer, (2, 24.0), &|x, k| x.truncate(42 - k));
        assert!(
            error.to_string().contains("positions of frame 1: 41 were given for 42"),
            "{error}"
        );
        for motion in [(0, 24.0), (2, 0.0), (2, Real::INFINITY), (2, 1e-300), (2, 1e300)] {
            assert!(matches!(fault(layer, motion, &|_, _| ()), MotionError::Empty { .. }));
        }
        let error = fault(layer, (10_000_000, 24.0), &|_, _| ());
        assert!(matches!(error, MotionError::Size { .. }), "{error}");
        layer.texture = Some(&[[0.0; 2]]);
        let error = fault(layer, (2, 24.0), &|_, _| ());
        assert!(error.to_string().contains("texture coordinates of layer `body`: 1"), "{error}");
    }
}
