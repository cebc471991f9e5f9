//! Conversion of OBJ files to PLY.

use super::error::ReadError;
use super::listing::{Listing, listing};
use super::materials::without_comment;
use super::obj_mesh::ObjMesh;
use crate::attributes::{Column, Property};
use crate::ply::{CoordinateType, PlyMesh};
use std::collections::{BTreeSet, HashMap};

/// What a PLY file cannot hold of an OBJ file, as messages for users.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages explain the fields
pub enum Lost {
    /// Normals that belong to corners.
    #[error("normals are not kept: {vertices} vertices have several, or none at a corner")]
    Normals { vertices: usize },
    /// Colours of some vertices only.
    #[error("colours of vertices are not kept: only {coloured} of {vertices} have one")]
    Colours { coloured: usize, vertices: usize },
    /// Weights of rational surfaces.
    #[error(
        "numbers after the coordinates of {vertices} vertices that are not colours are not kept"
    )]
    Weights { vertices: usize },
    /// The third of three numbers.
    #[error("the third texture coordinate is not kept")]
    Depth,
    /// Faces with texture coordinates at some of their corners.
    #[error("texture coordinates of {faces} faces are not kept: not all of their corners have one")]
    Texture { faces: usize },
    /// Files that a PLY file does not name.
    #[error(
        "material libraries are not copied ({names}); each face keeps the number of its material, and comments name them"
    )]
    Libraries { names: String },
    /// More than one group or object.
    #[error("groups and objects are not kept: {names}")]
    Groups { names: String },
    /// More than one smoothing group.
    #[error("smoothing groups are not kept")]
    Smoothing,
    /// Lines, points, curves and surfaces.
    #[error("{count} lines, points, curves or surfaces are not kept")]
    Elements { count: usize },
}

/// Converts an OBJ file to the content of a PLY file; also returns what is lost.
///
/// | OBJ | PLY |
/// |---|---|
/// | `vt` at the corners | `texcoord` of each face: two numbers per corner, zeros if it has none |
/// | colours after `v` | `red`, `green`, `blue`: bytes where they are numbers from 0 to 1, or whole ones to 255, else floats |
/// | `vn`, the same at all corners of a vertex | `nx`, `ny`, `nz` |
/// | `usemtl` | `material` of each face: a number, −1 before the first; comments `material 0 NAME` |
/// | `mtllib` | comments `mtllib NAME` |
/// | polygons | polygons |
///
/// # Errors
///
/// None for a text that [`read`](super::read) has accepted.
///
/// # Examples
///
/// ```
/// let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl red\nf 1/1 2/2 3/3\nl 1 2\n";
/// let (ply, lost) = if_mesh::obj::to_ply(&if_mesh::obj::read(text.as_bytes())?)?;
/// assert_eq!(ply.face_properties[0].values, if_mesh::ply::Column::F32(vec![0.0, 0.0, 1.0, 0.0, 0.0, 1.0]));
/// assert_eq!(ply.comments, ["material 0 red"]);
/// assert_eq!(lost[0].to_string(), "1 lines, points, curves or surfaces are not kept");
/// # Ok::<(), if_mesh::obj::ReadError>(())
/// ```
pub fn to_ply(obj: &ObjMesh) -> Result<(PlyMesh, Vec<Lost>), ReadError> {
    let all = listing(&obj.text)?;
    let mut lost = Vec::new();
    let mut ply = PlyMesh {
        mesh: obj.mesh.clone(),
        coordinates: CoordinateType::Double,
        polygons: obj.polygons.clone(),
        collapsed: obj.collapsed.clone(),
        ..PlyMesh::default()
    };
    ply.vertex_properties.extend(colours(&all, &mut lost));
    ply.vertex_properties.extend(normals(&all, &mut lost));
    ply.face_properties.extend(texcoord(&all, &mut lost));
    let statements = Statements::of(&obj.text);
    if !statements.materials.is_empty() {
        let mut names: Vec<&str> = Vec::new();
        let mut numbers = HashMap::new();
        let mut changes = Vec::new();
        for (at, name) in &statements.materials {
            let number = *numbers.entry(name.as_str()).or_insert_with(|| {
                names.push(name);
                names.len() as i32 - 1
            });
            changes.push((*at, number));
        }
        let of = |face: usize| match changes.partition_point(|c| c.0 < face) {
            0 => -1,
            k => changes[k - 1].1,
        };
        ply.face_properties.push(Property::new(
            "material",
            Column::I32(all.faces.iter().map(|f| of(f.start)).collect()),
        ));
        ply.comments
            .extend(names.iter().enumerate().map(|(k, name)| format!("material {k} {name}")));
    }
    let libraries = obj.material_libraries();
    if !libraries.is_empty() {
        ply.comments.extend(libraries.iter().map(|name| format!("mtllib {name}")));
        lost.push(Lost::Libraries { names: libraries.join(", ") });
    }
    if statements.objects.len() > 1 || statements.groups.len() > 1 {
        let names: Vec<&str> =
            statements.objects.iter().chain(&statements.groups).map(String::as_str).collect();
        lost.push(Lost::Groups { names: names.join(", ") });
    }
    if statements.smoothing.len() > 1 {
        lost.push(Lost::Smoothing);
    }
    if statements.elements > 0 {
        lost.push(Lost::Elements { count: statements.elements });
    }
    Ok((ply, lost))
}

/// Colours: three numbers after the coordinates, or four with opacity.
fn colours(all: &Listing, lost: &mut Vec<Lost>) -> Vec<Property> {
    let rows = &all.vertices;
    let coloured = rows.iter().filter(|r| r.len() >= 6).count();
    let weighted = rows.iter().filter(|r| r.len() == 4).count();
    if weighted > 0 {
        lost.push(Lost::Weights { vertices: weighted });
    }
    if coloured == 0 {
        return Vec::new();
    }
    if coloured < rows.len() {
        lost.push(Lost::Colours { coloured, vertices: rows.len() });
        return Vec::new();
    }
    let channels = rows.iter().map(|r| r.len() - 3).min().unwrap_or(0);
    let values = || rows.iter().flat_map(|r| r[3..3 + channels].iter().copied());
    let scale = if values().all(|x| (0.0..=1.0).contains(&x)) {
        Some(255.0)
    } else {
        values().all(|x| (0.0..=255.0).contains(&x) && x.fract() == 0.0).then_some(1.0)
    };
    let column = |k: usize| match scale {
        Some(scale) => Column::U8(rows.iter().map(|r| (scale * r[3 + k]).round() as u8).collect()),
        None => Column::F32(rows.iter().map(|r| r[3 + k] as f32).collect()),
    };
    ["red", "green", "blue", "alpha"]
        .iter()
        .take(channels)
        .enumerate()
        .map(|(k, name)| Property::new(*name, column(k)))
        .collect()
}

/// Normals: one per vertex. Unused vertices have zeros.
fn normals(all: &Listing, lost: &mut Vec<Lost>) -> Vec<Property> {
    if all.normals.is_empty() {
        return Vec::new();
    }
    let mut found: Vec<Option<Option<u32>>> = vec![None; all.vertices.len()];
    let mut faulty = BTreeSet::new();
    for [v, _, n] in all.faces.iter().flat_map(|f| &f.corners) {
        let Some(v) = v else { continue };
        let slot = &mut found[*v as usize];
        let of = |n: &Option<u32>| n.map(|n| &all.normals[n as usize]);
        match slot {
            None => *slot = Some(*n),
            Some(before) if of(before) == of(n) => {}
            Some(_) => drop(faulty.insert(*v)),
        }
        if n.is_none() {
            faulty.insert(*v);
        }
    }
    if !faulty.is_empty() {
        lost.push(Lost::Normals { vertices: faulty.len() });
        return Vec::new();
    }
    let axis = |k: usize| {
        let of = |n: &Option<Option<u32>>| {
            n.flatten().map_or(0.0, |n| all.normals[n as usize][k] as f32)
        };
        Column::F32(found.iter().map(of).collect())
    };
    ["nx", "ny", "nz"].iter().enumerate().map(|(k, name)| Property::new(*name, axis(k))).collect()
}

/// Texture coordinates: two numbers per corner of each face. Programs that read them expect them on
/// all faces.
fn texcoord(all: &Listing, lost: &mut Vec<Lost>) -> Option<Property> {
    let (mut values, mut lists) = (Vec::new(), vec![0u32]);
    let (mut partly, mut mapped, mut deep) = (0, false, false);
    for face in &all.faces {
        let n = face.corners.iter().filter(|c| c[1].is_some()).count();
        let is_whole = n == face.corners.len();
        mapped |= is_whole;
        partly += usize::from(n > 0 && !is_whole);
        for corner in &face.corners {
            let row =
                corner[1].filter(|_| is_whole).map_or(&[][..], |t| &all.textures[t as usize][..]);
            values.extend([0, 1].map(|k| row.get(k).copied().unwrap_or(0.0) as f32));
            deep |= row.get(2).is_some_and(|w| *w != 0.0);
        }
        lists.push(values.len() as u32);
    }
    if deep {
        lost.push(Lost::Depth);
    }
    if partly > 0 {
        lost.push(Lost::Texture { faces: partly });
    }
    mapped.then(|| Property {
        name: "texcoord".into(),
        values: Column::F32(values),
        lists: Some(lists),
    })
}

/// Statements that apply to the faces after them.
#[derive(Default)]
struct Statements {
    /// Position in the text from which a material applies, and its name.
    materials: Vec<(usize, String)>,
    groups: BTreeSet<String>,
    objects: BTreeSet<String>,
    smoothing: BTreeSet<String>,
    /// Lines, points, curves and surfaces.
    elements: usize,
}

impl Statements {
    fn of(text: &[u8]) -> Self {
        let mut statements = Self::default();
        let mut at = 0;
        for line in text.split_inclusive(|b| *b == b'\n') {
            let statement = String::from_utf8_lossy(without_comment(line));
            let (key, rest) =
                statement.trim().split_once(char::is_whitespace).unwrap_or((statement.trim(), ""));
            let name = || rest.trim().to_owned();
            match key {
                "usemtl" => statements.materials.push((at, name())),
                "g" => drop(statements.groups.insert(name())),
                "o" => drop(statements.objects.insert(name())),
                "s" => drop(statements.smoothing.insert(name())),
                "l" | "p" | "curv" | "curv2" | "surf" => statements.elements += 1,
                _ => {}
            }
            at += line.len();
        }
        statements
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::obj::read;
    use crate::split::split as split_mesh;

    const TEXT: &str = "mtllib a b.mtl\no shirt\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 0.2 0.4 0.6\nv 2 0 0 0 0 0\n\
        vt 0 0\nvt 1 0\nvt 1 1 0\nvt 0 1\nvn 0 0 1\nvn 0 0 1.0\ng front\nf 2//1 3//1 5//1\nusemtl red cloth\nf 1/1/1 2/2/1 3/3/2 4/4/1\n\
        g back\nusemtl blue\ns 1\nf 5/1/1 3/2/1 2/4/1\nusemtl red cloth # again\nf 1/1/1 2/1/1 2/1/1 4/1/1\n";

    #[test]
    fn what_ply_files_support_is_kept() {
        let obj = read(TEXT.as_bytes()).unwrap();
        let (ply, lost) = to_ply(&obj).unwrap();
        assert_eq!(
            (&ply.mesh, ply.polygons.as_ref(), &ply.collapsed[..]),
            (obj.mesh(), obj.polygons(), obj.collapsed())
        );
        let column = |name: &str| ply.vertex_property(name).unwrap().values.clone();
        assert_eq!(column("red"), Column::U8(vec![255, 0, 0, 51, 0]));
        assert_eq!(column("blue"), Column::U8(vec![0, 0, 255, 153, 0]));
        assert_eq!(column("nz"), Column::F32(vec![1.0; 5]), "equal normals of two lines are one");
        let [texcoord, material] = &ply.face_properties[..] else { panic!("two properties") };
        assert_eq!(texcoord.lists.as_ref().unwrap(), &[0, 6, 14, 20, 28]);
        assert_eq!(
            texcoord.values.to_f64()[4..14],
            [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]
        );
        assert_eq!(material.values, Column::I32(vec![-1, 0, 1, 0]));
        assert_eq!(ply.comments, ["material 0 red cloth", "material 1 blue", "mtllib a b.mtl"]);
        let expected = [
            Lost::Libraries { names: "a b.mtl".into() },
            Lost::Groups { names: "shirt, back, front".into() },
        ];
        assert_eq!(lost, expected);
        // The result can be written, read, and split.
        let mut bytes = Vec::new();
        crate::ply::write(&ply, ply.mesh.vertices(), &Default::default(), &mut bytes).unwrap();
        let again = crate::ply::read_bytes(&bytes).unwrap();
        assert_eq!(again.face_properties, ply.face_properties);
        let fine = split_mesh(&again.mesh, &[false, true, false, false, false]).unwrap();
        let after = crate::ply::split(&again, &fine, fine.mesh.clone()).unwrap();
        assert_eq!(after.face_properties[1].values.len(), after.face_properties[0].records());
        let texcoord = &after.face_properties[0];
        assert!(
            (0..texcoord.records()).all(|f| [6, 8].contains(&texcoord.range(f).len())),
            "two numbers for each corner"
        );
    }

    #[test]
    fn what_is_lost_is_reported() {
        let lost = |from: &str, to: &str| {
            assert!(TEXT.contains(from));
            let (ply, lost) =
                to_ply(&read(TEXT.replacen(from, to, 1).as_bytes()).unwrap()).unwrap();
            (
                ply,
                lost.into_iter()
                    .filter(|l| !matches!(l, Lost::Libraries { .. } | Lost::Groups { .. }))
                    .collect::<Vec<_>>(),
            )
        };
        assert_eq!(lost("vn 0 0 1.0", "vn 0 1 0").1, [Lost::Normals { vertices: 1 }]);
        assert_eq!(lost("f 2//1 3//1", "f 2 3//1").1, [Lost::Normals { vertices: 1 }]);
        assert_eq!(
            lost("v 2 0 0 0 0 0", "v 2 0 0").1,
            [Lost::Colours { coloured: 4, vertices: 5 }]
        );
        let (_, weighted) = lost("v 2 0 0 0 0 0", "v 2 0 0 1");
        assert_eq!(
            weighted,
            [Lost::Weights { vertices: 1 }, Lost::Colours { coloured: 4, vertices: 5 }]
        );
        assert_eq!(lost("vt 1 1 0", "vt 1 1 0.5").1, [Lost::Depth]);
        assert_eq!(lost("f 5/1/1 3/2/1", "f 5/1/1 3//1").1, [Lost::Texture { faces: 1 }]);
        assert_eq!(
            lost("s 1", "s 1\ns 2\nl 1 2\np 1").1,
            [Lost::Smoothing, Lost::Elements { count: 2 }]
        );
        let (ply, _) = lost("0.2 0.4 0.6", "200 0 1");
        assert_eq!(
            ply.vertex_property("red").unwrap().values,
            Column::U8(vec![1, 0, 0, 200, 0]),
            "whole numbers to 255"
        );
        let (ply, _) = lost("0.2 0.4 0.6", "1.5 0 1");
        assert_eq!(
            ply.vertex_property("red").unwrap().values,
            Column::F32(vec![1.0, 0.0, 0.0, 1.5, 0.0])
        );
    }
}
