//! Splitting triangles of a PLY file with all its properties.

use super::ply_mesh::PlyMesh;
use crate::attributes::{AttributeError, Column, Property, Source, VertexAttributes};
use crate::polygons::FaceList;
use crate::split::SplitMesh;
use if_core::math::Real;
use if_core::mesh::TriMesh;

/// The same file with its mesh split by `split`, which belongs to a mesh with the same triangles.
///
/// Vertex properties follow the rules of [`VertexAttributes`]. A part of a face has the face's
/// properties; texture coordinates of corners (`texcoord`) are interpolated. A polygon becomes
/// triangles if one of its triangles is split.
///
/// # Errors
///
/// A property that does not have one record per vertex, or per face.
///
/// # Panics
///
/// If `split` belongs to a mesh with other triangles.
pub fn split(ply: &PlyMesh, split: &SplitMesh, mesh: TriMesh) -> Result<PlyMesh, AttributeError> {
    let vertices = VertexAttributes::new(ply.mesh.vertices().len(), ply.vertex_properties.clone())?;
    let records = records(ply, split);
    let mut faces = FaceList::default();
    let mut origins = Vec::new();
    for record in &records {
        faces.push(&record.corners);
        origins.push(Source::Vertex(record.face));
    }
    assert_eq!(*faces.triangles, *split.mesh.triangles(), "a split of these triangles");
    let count = ply.polygons.as_ref().map_or(ply.mesh.triangles().len(), |p| p.len());
    let mut face_properties = VertexAttributes::new(count, ply.face_properties.clone())?
        .derive(&origins)
        .into_properties();
    for (after, before) in
        face_properties.iter_mut().zip(&ply.face_properties).filter(|(_, p)| p.name == "texcoord")
    {
        if let Some(texcoord) = at_corners(before, &records) {
            *after = texcoord;
        }
    }
    Ok(PlyMesh {
        mesh,
        vertex_properties: vertices.derive(&split.sources).into_properties(),
        polygons: faces.polygons,
        collapsed: faces.collapsed,
        face_properties,
        ..ply.clone()
    })
}

/// A face of the new file.
struct Record {
    /// The face that it comes from.
    face: u32,
    corners: Vec<u32>,
    /// For a part of a face: three of the face's corners, and the weights of each own corner.
    part: Option<([usize; 3], [[Real; 3]; 3])>,
}

/// The faces of the new file, in the order of their parents.
fn records(ply: &PlyMesh, split: &SplitMesh) -> Vec<Record> {
    let mut records = Vec::with_capacity(split.parts.len());
    // The next triangle, and the next part.
    let (mut triangle, mut next) = (0u32, 0);
    let mut add = |face: u32, corners: &[u32]| {
        let fan = (1..corners.len() - 1).map(|k| [0, k, k + 1]);
        let fan: Vec<[usize; 3]> =
            fan.filter(|[a, b, c]| distinct(corners[*a], corners[*b], corners[*c])).collect();
        let end = triangle + fan.len() as u32;
        let parts = &split.parts[next..]
            [..split.parts[next..].iter().take_while(|p| p.parent < end).count()];
        if parts.iter().all(|p| p.is_whole()) {
            records.push(Record { face, corners: corners.to_vec(), part: None });
        } else {
            records.extend(parts.iter().enumerate().map(|(k, part)| Record {
                face,
                corners: split.mesh.triangles()[next + k].to_vec(),
                part: Some((fan[(part.parent - triangle) as usize], part.corners)),
            }));
        }
        triangle = end;
        next += parts.len();
    };
    match &ply.polygons {
        Some(polygons) => {
            polygons.iter().enumerate().for_each(|(f, corners)| add(f as u32, corners))
        }
        None => {
            ply.mesh.triangles().iter().enumerate().for_each(|(f, corners)| add(f as u32, corners))
        }
    }
    records
}

fn distinct(a: u32, b: u32, c: u32) -> bool {
    a != b && b != c && c != a
}

/// Interpolates a property of two numbers per corner of a face; `None` if the property is of another
/// kind.
fn at_corners(property: &Property, records: &[Record]) -> Option<Property> {
    let values = property.values.to_f64();
    let mut lists = vec![0u32];
    let mut out: Vec<Real> = Vec::new();
    for record in records {
        let of = &values[property.range(record.face as usize)];
        match &record.part {
            None => out.extend(of),
            Some((fan, weights)) => {
                let corner = |k: usize, axis: usize| of.get(2 * k + axis);
                let last = of.len() / 2;
                if of.len() % 2 == 1 || fan.iter().any(|k| *k >= last) {
                    return None;
                }
                for w in weights {
                    out.extend([0, 1].map(|axis| {
                        (0..3).filter_map(|j| Some(w[j] * corner(fan[j], axis)?)).sum::<Real>()
                    }));
                }
            }
        }
        lists.push(out.len() as u32);
    }
    property.lists.as_ref()?;
    let values = match &property.values {
        Column::F32(_) => Column::F32(out.iter().map(|v| *v as f32).collect()),
        Column::F64(_) => Column::F64(out),
        _ => return None,
    };
    Some(Property { name: property.name.clone(), values, lists: Some(lists) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split::split as split_mesh;

    const SQUARES: &str = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n\
        property uchar red\nproperty float s\nelement face 3\nproperty list uchar int vertex_indices\nproperty uchar part\n\
        property list uchar float texcoord\nend_header\n0 0 0 0 0\n1 0 0 255 1\n1 1 0 255 1\n0 1 0 0 0\n2 0 0 100 2\n2 1 0 100 2\n\
        4 0 1 2 3 7 8 0 0 1 0 1 1 0 1\n3 1 4 5 8 6 0 0 .5 0 .5 .5\n3 1 5 2 9 6 0 0 .5 .5 0 .5\n";

    #[test]
    fn properties_of_vertices_faces_and_corners_are_kept() {
        let ply = crate::ply::read_bytes(SQUARES.as_bytes()).unwrap();
        // The triangle 1 5 2 is split; 0 1 2 and 1 4 5 are its neighbours.
        let fine = split_mesh(&ply.mesh, &[false, false, false, true]).unwrap();
        let after = split(&ply, &fine, fine.mesh.clone()).unwrap();
        assert_eq!(after.mesh.vertices().len(), 9);
        let Column::U8(parts) = &after.face_properties[0].values else { panic!("another type") };
        assert_eq!(parts, &[7, 7, 7, 8, 8, 9, 9, 9, 9]);
        let Column::U8(red) = &after.vertex_property("red").unwrap().values else {
            panic!("another type")
        };
        assert_eq!(red[..6], [0, 255, 255, 0, 100, 100]);
        // s is linear in x in this file, and so is texcoord of the last two faces, x − 1 over 2 and
        // y over 2.
        let s = after.vertex_property("s").unwrap().values.to_f64();
        assert!(s.iter().zip(after.mesh.vertices()).all(|(s, p)| (s - p.x).abs() < 1e-7));
        let texcoord = &after.face_properties[1];
        for (t, tri) in after.mesh.triangles().iter().enumerate() {
            let uv = &texcoord.values.to_f64()[texcoord.range(t)];
            let [scale, shift] = if parts[t] == 7 { [1.0, 0.0] } else { [0.5, 1.0] };
            for (k, v) in tri.iter().enumerate() {
                let p = after.mesh.vertices()[*v as usize];
                assert_eq!(
                    [uv[2 * k], uv[2 * k + 1]],
                    [scale * (p.x - shift), scale * p.y],
                    "face {t}, corner {k}"
                );
            }
        }
        let mut file = Vec::new();
        crate::ply::write(&after, after.mesh.vertices(), &Default::default(), &mut file).unwrap();
        assert_eq!(crate::ply::read_bytes(&file).unwrap().mesh, after.mesh);
    }

    #[test]
    fn faces_without_a_split_triangle_stay_polygons() {
        let ply = crate::ply::read_bytes(
            SQUARES.replace("9 6", "9 4").replace("0 0 .5 .5 0 .5", "0 0 .5 .5").as_bytes(),
        )
        .unwrap();
        let apart = split_mesh(&ply.mesh, &[false; 4]).unwrap();
        assert_eq!(split(&ply, &apart, apart.mesh.clone()).unwrap(), ply);
        // The triangle 0 2 3 of the square has no neighbour but the other half of it.
        let fine = split_mesh(&ply.mesh, &[false, true, false, false]).unwrap();
        let after = split(&ply, &fine, fine.mesh.clone()).unwrap();
        assert_eq!(after.polygons, None, "triangles alone");
        assert_eq!(
            after.face_properties[1].values.len(),
            6 * 6 + 6 + 4,
            "a list that is not one of corners is left as it is"
        );
    }
}
