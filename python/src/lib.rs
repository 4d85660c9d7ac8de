//! Extension module `decoupler._native`, on which the Python package `decoupler` is built. Its classes and functions take
//! and return plain values and arrays; names, defaults and documentation for users are in the Python modules.
//!
//! | module | contents |
//! |---|---|
//! | `work` | work without the interpreter lock, exceptions |
//! | `arrays` | samples in NumPy arrays |
//! | `network`, `training`, `saving`, `decoders` | trained networks, their training, their files, the other decoders |
//! | `settings` | settings by their names |
//! | `sensor`, `simulation`, `recording` | sensor model, simulated samples, recorded samples |

mod arrays;
mod decoders;
mod network;
mod recording;
mod saving;
mod sensor;
mod settings;
mod simulation;
mod training;
mod work;

use pyo3::prelude::*;

/// Runs the program with these arguments, the first being its name, and returns its exit status.
#[pyfunction]
fn run_program(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> u8 {
    py.detach(|| decoupler::terminal::run_for_status(arguments, |files| Ok(decoupler::window::open(files)?)))
}

/// See the documentation of the crate.
#[pymodule(gil_used = true)]
mod _native {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::{
        decoders::{FittedDecoder, fit_decoder},
        network::{Network, load_network},
        recording::{import_recording, read_recording},
        run_program,
        sensor::{Sensor, default_geometry, node_errors},
        settings::default_settings,
        simulation::simulate,
        training::{Training, train},
    };

    #[pymodule_init]
    fn init(_module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::work::loaded();
        Ok(())
    }
}
