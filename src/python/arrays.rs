//! Arrays of Python as numbers, with a message that says which shape is needed.

use numpy::{PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::wrong_value;

/// An array whose shape was checked, read where it lies if it holds 64-bit numbers.
pub type Numbers<'py> = PyReadonlyArrayDyn<'py, f64>;

/// `value` as numbers of the shape; `None` in it stands for any size. `meaning` says what the axes are.
pub fn numbers<'py>(
    value: &Bound<'py, PyAny>,
    name: &str,
    shape: &[Option<usize>],
    meaning: &str,
) -> PyResult<Numbers<'py>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let found = numpy
        .call_method1("asarray", (value,))
        .map_err(|error| wrong_value(format!("{name} is no array ({error}); give {meaning}")))?;
    let kind: String = found.getattr("dtype")?.getattr("kind")?.extract()?;
    if !["i", "u", "f"].contains(&kind.as_str()) {
        let dtype = found.getattr("dtype")?.str()?;
        return Err(wrong_value(format!("{name} has the type {dtype}; give real numbers: {meaning}")));
    }
    let options = PyDict::new(py);
    options.set_item("copy", false)?;
    let found = found.call_method("astype", ("float64",), Some(&options))?;
    let array: Bound<'py, numpy::PyArrayDyn<f64>> = found.extract()?;
    let is_so = array.ndim() == shape.len()
        && array.shape().iter().zip(shape).all(|(is, wanted)| wanted.is_none_or(|wanted| *is == wanted));
    if !is_so {
        return Err(wrong_value(format!("{name} has the shape {:?}; give {meaning}", array.shape())));
    }
    Ok(array.readonly())
}

/// A whole number from 0 to `most`.
pub fn whole(value: &Bound<'_, PyAny>, name: &str, most: u64) -> PyResult<u64> {
    value.extract().ok().filter(|found| *found <= most).ok_or_else(|| {
        let given = value.repr().map_or_else(|_| "another value".to_owned(), |given| given.to_string());
        wrong_value(format!("{name} is {given}; give a whole number from 0 to {most}"))
    })
}

/// Whole numbers from 0 on, as many as `n`.
pub fn indices(value: &Bound<'_, PyAny>, name: &str, n: usize, meaning: &str) -> PyResult<Vec<usize>> {
    let found = numbers(value, name, &[Some(n)], meaning)?;
    let whole = |value: &f64| {
        let is_whole = value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(value);
        is_whole.then_some(*value as usize)
    };
    found
        .as_array()
        .iter()
        .map(whole)
        .collect::<Option<_>>()
        .ok_or_else(|| wrong_value(format!("{name} has values that are no whole numbers from 0 on; give {meaning}")))
}
