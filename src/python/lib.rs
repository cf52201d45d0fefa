//! The Python module `armcal._armcal`: the front door of the library and the program's command line.
//!
//! `robot`, `views`, `calibration`, `follower` and `simulation` are its classes; `arrays` takes numpy arrays in,
//! `errors` turns errors into exceptions with code and remedy, `interruptible` lets Ctrl-C through. Nothing is computed
//! here.

mod arrays;
mod calibration;
mod errors;
mod follower;
mod interruptible;
mod planning;
mod robot;
mod simulation;
mod views;

use std::ffi::OsString;
use std::path::PathBuf;

use pyo3::prelude::*;

/// Runs a command line, the first word of which is the program's name; returns the exit code.
#[pyfunction]
fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| armcal::cli::main(words).code())
}

/// Sets the folder with `robots` and `routines` that names are looked up in.
#[pyfunction]
fn set_shared_folder(folder: PathBuf) {
    armcal::front::set_shared_folder(folder);
}

#[pymodule]
fn _armcal(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(main, module)?)?;
    module.add_function(wrap_pyfunction!(set_shared_folder, module)?)?;
    module.add_function(wrap_pyfunction!(calibration::calibrate, module)?)?;
    module.add_function(wrap_pyfunction!(planning::plan, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::simulate, module)?)?;
    module.add_class::<robot::Robot>()?;
    module.add_class::<robot::TagMap>()?;
    module.add_class::<robot::Task>()?;
    module.add_class::<views::Recording>()?;
    module.add_class::<views::Views>()?;
    module.add_class::<calibration::Calibration>()?;
    module.add_class::<calibration::Verdict>()?;
    module.add_class::<follower::Follower>()?;
    module.add_class::<simulation::Run>()?;
    Ok(())
}
