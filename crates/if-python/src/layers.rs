//! Arrays as layers of outfits, and positions as arrays.

use crate::errors::exception;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_outfit::{Layer, ResolveParams, Split, Storage};
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A layer as the Python part passes it.
#[derive(FromPyObject)]
pub(crate) struct LayerArrays<'py> {
    /// What errors about its arrays begin with: `layers[2]`.
    #[pyo3(item)]
    argument: String,
    /// What reports call it.
    #[pyo3(item)]
    name: String,
    /// Positions in metres, one row for each vertex.
    #[pyo3(item)]
    vertices: PyReadonlyArray2<'py, f64>,
    /// Indices of vertices, one row for each triangle.
    #[pyo3(item)]
    faces: PyReadonlyArray2<'py, i64>,
    /// Whether positions are stored in single precision.
    #[pyo3(item)]
    single: bool,
    /// Whether it has attributes, which have no values at new vertices.
    #[pyo3(item)]
    has_attributes: bool,
}

impl LayerArrays<'_> {
    /// The layer.
    ///
    /// # Errors
    ///
    /// `ValueError` that names argument, row and value.
    pub(crate) fn layer(&self) -> PyResult<Layer> {
        let mesh = TriMesh::new(self.points()?, self.triangles()?).map_err(|e| self.invalid(&e))?;
        let storage = if self.single { Storage::F32 } else { Storage::F64 };
        Ok(Layer { storage, ..Layer::new(&*self.name, mesh) })
    }

    /// Checks that the triangles may be split as `params` say.
    ///
    /// # Errors
    ///
    /// `ParameterError` that names the argument.
    pub(crate) fn check_split(&self, py: Python<'_>, params: &ResolveParams) -> PyResult<()> {
        if params.goal.split == Split::Never || !self.has_attributes {
            return Ok(());
        }
        let message = format!(
            "parameter `goal.split`: {} is not a pair of arrays, and its attributes have no values \
             at new vertices; give (vertices, faces)",
            self.argument
        );
        Err(exception(py, "ParameterError", message))
    }

    /// What errors about its arrays begin with.
    pub(crate) fn argument(&self) -> &str {
        &self.argument
    }

    /// What reports call it.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    fn points(&self) -> PyResult<Vec<Point>> {
        let rows = rows(&self.vertices, &self.argument, "vertices")?;
        Ok(rows.into_iter().map(Point::from).collect())
    }

    fn triangles(&self) -> PyResult<Vec<[u32; 3]>> {
        let rows = rows(&self.faces, &self.argument, "faces")?;
        let mut triangles = vec![[0; 3]; rows.len()];
        for (t, (row, triangle)) in rows.iter().zip(&mut triangles).enumerate() {
            for (corner, (index, found)) in row.iter().zip(triangle).enumerate() {
                *found = u32::try_from(*index).map_err(|_| {
                    self.invalid(&format_args!(
                        "triangle {t}: corner {corner} names vertex {index}; indices must be from \
                         0 to {}",
                        u32::MAX
                    ))
                })?;
            }
        }
        Ok(triangles)
    }

    fn invalid(&self, message: &dyn std::fmt::Display) -> PyErr {
        PyValueError::new_err(format!("{}: {message}", self.argument))
    }
}

/// The rows of an array of three columns.
fn rows<T: numpy::Element + Copy>(
    array: &PyReadonlyArray2<'_, T>,
    argument: &str,
    what: &str,
) -> PyResult<Vec<[T; 3]>> {
    let array = array.as_array();
    let [n, columns] = [array.nrows(), array.ncols()];
    if columns != 3 {
        let message = format!("{argument}: {what} have the shape ({n}, {columns}), not ({n}, 3)");
        return Err(PyValueError::new_err(message));
    }
    Ok(array.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
}

/// Positions as an array with one row for each vertex.
pub(crate) fn vertices<'py>(
    py: Python<'py>,
    points: &[Point],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat = points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    PyArray1::from_vec(py, flat).reshape([points.len(), 3])
}

/// Triangles as an array with one row for each.
pub(crate) fn faces<'py>(
    py: Python<'py>,
    triangles: &[[u32; 3]],
) -> PyResult<Bound<'py, PyArray2<i64>>> {
    let flat = triangles.as_flattened().iter().map(|v| i64::from(*v)).collect();
    PyArray1::from_vec(py, flat).reshape([triangles.len(), 3])
}

/// Name, positions and triangles.
pub(crate) type NamedArrays<'py> = (String, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<i64>>);

/// A mesh as arrays.
pub(crate) fn named_arrays<'py>(
    py: Python<'py>,
    name: String,
    mesh: &TriMesh,
) -> PyResult<NamedArrays<'py>> {
    Ok((name, vertices(py, mesh.vertices())?, faces(py, mesh.triangles())?))
}
