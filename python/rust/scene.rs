//! Views and solids, drawn and as meshes.

use crate::errors::plain;
use crate::values::{Adjoint, numbers, picture};
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pcadlang_library::scene::SceneView;
use pcadlang_scene::geom::{Mesh, Object, glb, obj};
use pcadlang_scene::render;
use pcadlang_workbench::session::over;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use std::sync::Arc;

/// The largest picture that is drawn, in pixels along the longer side.
const LARGEST: u32 = 8192;

/// A solid in front of a camera. `longer` is the longer side of a picture in pixels; by default,
/// that of the camera.
#[pyclass(frozen, module = "pcadlang")]
pub struct View {
    pub view: Arc<render::View>,
}

impl View {
    pub fn new(view: Arc<render::View>) -> View {
        View { view }
    }

    fn longer(&self, longer: Option<u32>) -> PyResult<u32> {
        let camera = self.view.camera();
        match longer.unwrap_or(camera.width.max(camera.height)) {
            0 => Err(PyValueError::new_err("a picture has at least one pixel")),
            n if n > LARGEST => {
                Err(PyValueError::new_err(format!("a picture has at most {LARGEST} pixels a side")))
            }
            n => Ok(n),
        }
    }

    fn shape(&self, longer: u32) -> (usize, usize) {
        let camera = self.view.camera().scaled_to(longer);
        (camera.height as usize, camera.width as usize)
    }
}

#[pymethods]
impl View {
    /// The width and height of the camera's picture, in pixels.
    #[getter]
    fn size(&self) -> (u32, u32) {
        (self.view.camera().width, self.view.camera().height)
    }

    /// The solid.
    #[getter]
    fn solid(&self) -> Solid {
        Solid(self.view.solid().clone())
    }

    /// Whether each pixel shows the solid: height x width truth values.
    #[pyo3(signature = (longer = None))]
    fn mask<'py>(
        &self,
        py: Python<'py>,
        longer: Option<u32>,
    ) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let longer = self.longer(longer)?;
        let frame = py.detach(|| self.view.frame(longer));
        picture(py, frame.mask().collect(), frame.height as usize, frame.width as usize)
    }

    /// The distance along the viewing axis at each pixel, in scene units; infinite off the solid:
    /// height x width float32.
    #[pyo3(signature = (longer = None))]
    fn depth<'py>(
        &self,
        py: Python<'py>,
        longer: Option<u32>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let longer = self.longer(longer)?;
        let frame = py.detach(|| self.view.depth(longer));
        PyArray1::from_slice(py, &frame.depth)
            .reshape([frame.height as usize, frame.width as usize])
    }

    /// The unit normal at each pixel, in the camera's frame (x right, y up, z towards the camera);
    /// zero off the solid: height x width x 3 float32.
    #[pyo3(signature = (longer = None))]
    fn normals<'py>(
        &self,
        py: Python<'py>,
        longer: Option<u32>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let longer = self.longer(longer)?;
        let frame = py.detach(|| self.view.frame(longer));
        let all = PyArray1::from_slice(py, frame.normal.as_flattened());
        all.reshape([frame.height as usize, frame.width as usize, 3])
    }

    /// The pieces of the contours: n x 4 numbers, x, y and length in pixels, and the angle in
    /// radians, measured from right towards down.
    #[pyo3(signature = (longer = None))]
    fn contours<'py>(
        &self,
        py: Python<'py>,
        longer: Option<u32>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let longer = self.longer(longer)?;
        let pieces = py.detach(|| SceneView::from(Arc::clone(&self.view)).contours(longer));
        PyArray1::from_slice(py, pieces.as_flattened()).reshape([pieces.len(), 4])
    }

    /// The solid drawn with its contours, over a photograph if one is given (height x width x 3
    /// bytes): height x width x 3 bytes.
    #[pyo3(signature = (photo = None))]
    fn overlay<'py>(
        &self,
        py: Python<'py>,
        photo: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let photo = photo.map(rgb).transpose()?;
        let (width, height) = match &photo {
            Some(p) => (p.width(), p.height()),
            None => (self.view.camera().width, self.view.camera().height),
        };
        let drawn = py.detach(|| over(&self.view, photo.as_ref(), (width, height)));
        let shape = [drawn.height() as usize, drawn.width() as usize, 3];
        PyArray1::from_vec(py, drawn.into_raw()).reshape(shape)
    }

    /// The adjoint of the view, given the derivative of a number with respect to the coverage of
    /// each pixel (height x width): the outline moves and covers or uncovers pixels.
    fn by_mask(&self, py: Python<'_>, gains: &Bound<'_, PyAny>, longer: u32) -> PyResult<Adjoint> {
        let (longer, gains) = (self.longer(Some(longer))?, numbers(gains)?);
        let (height, width) = self.shape(longer);
        if gains.len() != height * width {
            let n = gains.len();
            return Err(PyValueError::new_err(format!(
                "one derivative a pixel is needed, {height} x {width}, not {n}"
            )));
        }
        Ok(Adjoint(py.detach(|| SceneView::from(Arc::clone(&self.view)).by_mask(longer, &gains))))
    }

    /// The adjoint of the view, given the derivatives of a number with respect to the pieces that
    /// `contours` returns (n x 4).
    fn by_contours(
        &self,
        py: Python<'_>,
        by_piece: &Bound<'_, PyAny>,
        longer: u32,
    ) -> PyResult<Adjoint> {
        let (longer, all) = (self.longer(Some(longer))?, numbers(by_piece)?);
        let view = SceneView::from(Arc::clone(&self.view));
        let (pieces, rest) = all.as_chunks::<4>();
        let wanted = py.detach(|| view.contours(longer).len());
        if pieces.len() != wanted || !rest.is_empty() {
            let n = all.len();
            return Err(PyValueError::new_err(format!(
                "four derivatives a piece are needed, {wanted} x 4, not {n} numbers"
            )));
        }
        Ok(Adjoint(py.detach(|| view.by_contours(longer, pieces))))
    }

    fn __repr__(&self) -> String {
        let (width, height) = self.size();
        format!("<pcadlang.View: {width} x {height} pixels>")
    }
}

/// A picture as height x width x 3 bytes.
fn rgb(photo: &Bound<'_, PyAny>) -> PyResult<image::RgbImage> {
    let numpy = photo.py().import("numpy")?;
    let array = numpy.call_method1("ascontiguousarray", (photo,))?.cast_into::<PyArray3<u8>>();
    let wrong = || PyValueError::new_err("a photograph is an array of height x width x 3 bytes");
    let array = array.map_err(|_| wrong())?;
    let read = array.try_readonly().map_err(|_| wrong())?;
    let (height, width, channels) = read.as_array().dim();
    let pixels = read.as_array().iter().copied().collect();
    let (Ok(width), Ok(height), 3) = (u32::try_from(width), u32::try_from(height), channels) else {
        return Err(wrong());
    };
    image::RgbImage::from_raw(width, height, pixels).ok_or_else(wrong)
}

type VerticesAndTriangles<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<u32>>);

/// A solid, in scene units.
#[pyclass(frozen, module = "pcadlang")]
pub struct Solid(pub pcadlang_scene::geom::Solid);

impl Solid {
    fn meshed(&self, py: Python<'_>) -> PyResult<Mesh> {
        py.detach(|| self.0.to_mesh()).map_err(plain)
    }

    fn objects(&self, py: Python<'_>) -> PyResult<Vec<Object>> {
        py.detach(|| self.0.objects()).map_err(plain)
    }
}

#[pymethods]
impl Solid {
    /// Its mesh: n x 3 float32 positions of vertices, m x 3 uint32 triangles, counter-clockwise
    /// seen from outside.
    fn mesh<'py>(&self, py: Python<'py>) -> PyResult<VerticesAndTriangles<'py>> {
        let mesh = self.meshed(py)?;
        let vertices: Vec<f32> = mesh.positions.iter().flat_map(|p| p.to_array()).collect();
        let triangles = &mesh.topology.triangles;
        Ok((
            PyArray1::from_vec(py, vertices).reshape([mesh.positions.len(), 3])?,
            PyArray1::from_slice(py, triangles.as_flattened()).reshape([triangles.len(), 3])?,
        ))
    }

    /// Its mesh as the text of an OBJ file.
    fn obj(&self, py: Python<'_>) -> PyResult<String> {
        Ok(obj::write(&self.objects(py)?))
    }

    /// Its mesh as the bytes of a binary glTF file.
    fn glb<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyBytes>> {
        Ok(PyBytes::new(py, &glb::write(&self.objects(py)?)))
    }

    /// Its named points: x, y and z, by name.
    #[getter]
    fn landmarks<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for l in self.0.landmarks().iter() {
            all.set_item(&*l.name, l.position.to_array())?;
        }
        Ok(all)
    }

    fn __repr__(&self) -> String {
        "<pcadlang.Solid>".to_owned()
    }
}
