//! STAND-IN until if-mesh's file.rs lands.
use if_core::{math::Point, mesh::TriMesh};
use std::path::Path;
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(crate) struct MeshFileError(String);
pub(crate) struct MeshFile { mesh: TriMesh }
impl MeshFile {
    pub(crate) fn read(path: &Path) -> Result<Self, MeshFileError> {
        let e = |t: String| MeshFileError(t);
        let text = std::fs::read_to_string(path).map_err(|x| e(x.to_string()))?;
        let (mut v, mut f) = (vec![], vec![]);
        for l in text.lines() {
            let w: Vec<&str> = l.split_whitespace().collect();
            match w.first() {
                Some(&"v") => { let n: Vec<f64> = w[1..].iter().map(|x| x.parse().unwrap_or(f64::NAN)).collect(); v.push(Point::new(n[0], n[1], n[2])); }
                Some(&"f") => { let n: Vec<u32> = w[1..].iter().map(|x| x.parse::<u32>().unwrap_or(0).wrapping_sub(1)).collect(); f.push([n[0], n[1], n[2]]); }
                _ => {}
            }
        }
        Ok(Self { mesh: TriMesh::new(v, f).map_err(|x| e(x.to_string()))? })
    }
    pub(crate) fn mesh(&self) -> &TriMesh { &self.mesh }
    pub(crate) fn positions_as_written(&self, positions: &[Point]) -> Vec<Point> { positions.to_vec() }
    pub(crate) fn write(&self, path: &Path, positions: &[Point]) -> Result<(), MeshFileError> {
        let mut s = String::new();
        for p in positions { s += &format!("v {} {} {}\n", p.x, p.y, p.z); }
        for t in self.mesh.triangles() { s += &format!("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1); }
        std::fs::write(path, s).map_err(|x| MeshFileError(x.to_string()))
    }
}
