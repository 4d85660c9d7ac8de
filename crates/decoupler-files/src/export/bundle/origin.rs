use super::BundleError;
use crate::{
    export::{NetworkFile, document::PROGRAM},
    import::{Plan, Setup, SetupSets},
};
use decoupler_core::{
    decoupling::decode_set,
    evaluation::{DecoderSet, Problem, RunError, RunSettings, TestErrors},
};

/// Facts about the samples to which an exported decoder was fitted, for the metadata of its bundle.
pub(super) struct Origin {
    /// Program and version that trained or fitted it.
    pub(super) program: String,
    pub(super) settings: RunSettings,
    /// Names, units and positions of readings and targets.
    pub(super) problem: Problem,
    /// Row-wires of the samples in ascending order, from 0, if they are known.
    pub(super) row_wires: Option<Vec<usize>>,
    /// Names of the recordings, without the folders of anyone who trained; empty for a simulated array.
    pub(super) files: Vec<String>,
    /// Errors of the linear baseline on the test samples.
    pub(super) errors_of_linear: TestErrors,
}

impl Origin {
    /// Takes the facts from the file of a trained network.
    pub(super) fn of_file(file: &NetworkFile) -> Self {
        Self {
            program: file.program.clone(),
            settings: file.settings,
            problem: file.problem.clone(),
            row_wires: file.row_wires.clone(),
            files: names(file.recorded.as_ref().map(|recorded| &recorded.plan)),
            errors_of_linear: file.scores.baselines.linear.clone(),
        }
    }

    /// Takes the facts from the samples of `setup`, for a decoder without a network.
    ///
    /// # Errors
    /// The samples cannot be scaled or decoded.
    pub(super) fn of_sets(setup: &Setup, sets: &SetupSets) -> Result<Self, BundleError> {
        let (settings, samples) = (*setup.settings(), &sets.sets);
        let set = DecoderSet::on_set(settings, samples.split.training.clone(), None);
        let mut linear = set.linear().map_err(Box::new)?;
        let answers = decode_set(&mut *linear, &samples.test).map_err(|error| Box::new(RunError::from(error)))?;
        Ok(Self {
            program: PROGRAM.to_owned(),
            problem: Problem::clone(&samples.problem),
            row_wires: samples.test.row_wires_read().map(<[usize]>::to_vec),
            files: names(setup.plan()),
            errors_of_linear: TestErrors::measure(&settings.source, &samples.test, &answers),
            settings,
        })
    }
}

fn names(plan: Option<&Plan>) -> Vec<String> {
    let paths = plan.into_iter().flat_map(Plan::files);
    let names = paths.filter_map(|path| path.file_name());
    names.map(|name| name.to_string_lossy().into_owned()).collect()
}
