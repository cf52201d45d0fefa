//! Exceptions: `armcal.Error` with the code, the remedy and the page that `armcal explain CODE` prints.

use armcal::codes::{Code, Coded, explanation};
use pyo3::prelude::*;

/// An error of the library as `armcal.Error`.
pub fn raised(error: impl Coded + std::error::Error + Send + Sync + 'static) -> PyErr {
    coded(error.code(), &error.to_string())
}

/// Such an exception of an error whose code is found among its causes.
pub fn of_any(error: &anyhow::Error) -> PyErr {
    coded(armcal::cli::code_of(error), &armcal::cli::message_of(error))
}

/// A value that Python code gave and that cannot be used.
pub fn wrong_value(problem: impl AsRef<str>) -> PyErr {
    coded(Code::ValueInvalid, problem.as_ref())
}

/// `armcal.Error(message, code, remedy, page)`.
fn coded(code: Code, message: &str) -> PyErr {
    let (remedy, page) = explanation(code).map_or(("", ""), |found| (found.remedy.as_str(), found.page.as_str()));
    Python::attach(|py| {
        let made = py
            .import("armcal")
            .and_then(|module| module.getattr("Error")?.call1((message, code.to_string(), remedy, page)));
        made.map_or_else(|error| error, |exception| PyErr::from_value(exception))
    })
}

/// Objects that stay in their process.
pub fn not_pickled<T>(what: &str, remedy: &str) -> PyResult<T> {
    Err(wrong_value(format!("a {what} cannot be pickled or copied to another process: {remedy}")))
}
