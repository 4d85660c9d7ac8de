//! Settings by their names in the program's table of settings, which are the keywords in Python.

use decoupler_core::evaluation::{RUN_OPTIONS, RunSettings};
use pyo3::{exceptions::PyTypeError, prelude::*};

use crate::work::value_error;

/// Settings given in Python, each a name and the text of its value.
pub type Given = Vec<(String, String)>;

/// Changes the given settings of `run`, in the order of the table.
///
/// # Errors
/// `ValueError` if a value is not possible, and `TypeError` if there is no such setting.
pub fn apply(run: &mut RunSettings, given: &Given) -> PyResult<()> {
    let mut left = Vec::from_iter(given);
    for option in &RUN_OPTIONS {
        let (setting, word) = (&option.setting, option.setting.word("_"));
        let Some(place) = left.iter().position(|(name, _)| *name == word) else {
            continue;
        };
        let (_, text) = left.swap_remove(place);
        let value = setting.parse(text).map_err(value_error)?;
        setting.set(run, &value).map_err(value_error)?;
        setting.check(run).map_err(value_error)?;
    }
    match left.first() {
        Some((name, _)) => Err(PyTypeError::new_err(format!("there is no setting '{name}'"))),
        None => Ok(()),
    }
}

/// Names and defaults of the settings of a run, on a simulated array, as texts.
#[pyfunction]
pub fn default_settings() -> Given {
    let run = RunSettings::default();
    let value =
        |setting: &decoupler_core::settings::Setting<RunSettings>| setting.get(&run).map(|value| value.to_string());
    let settings = RUN_OPTIONS.iter().map(|option| &option.setting);
    settings
        .filter_map(|setting| Some((setting.word("_"), value(setting)?)))
        .collect()
}
