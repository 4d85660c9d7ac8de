use ndarray::Array2;
use serde::{Deserialize, Serialize};

use super::{Coverage, RunError, RunSets, RunSettings, TestErrors, cross_validation::scatter, run_sets::check_sets};
use crate::{
    dataset::{Dataset, PerRow, Simulation},
    decoupling::{NewtonDecoder, Program, ProgramDecoder, decode_set},
    job::Job,
    network::Quantity,
    problem::Problem,
    scene::{NoiseSource, RowModel, Rows},
    sensor::ArrayScale,
};

/// Errors of the baselines, listed next to those of the network in every error table.
// Unknown fields are ignored: those of version 0.1.0 had another row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Baselines {
    /// Errors of always answering the mean of the training set.
    pub mean: TestErrors,
    /// Errors of the best affine map on the readings, one for each row-wire where rows are known; ridge regression for
    /// recordings.
    pub linear: TestErrors,
    /// Errors of [`DecoderKind::Newton`](crate::decoupling::DecoderKind::Newton), which knows the equations, the noise, and
    /// mean and covariance of the loading. Recordings have no sensor model, and files of version 0.1.0 not this row; for
    /// test sets of many large rows it would take too long.
    pub model_based: Option<TestErrors>,
}

/// Errors of the network and of the baselines on the same test set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scores {
    /// Errors of the network, or of the combination that a choice of settings found.
    pub network: TestErrors,
    /// Errors of the network alone, if [`Self::network`] are those of a combination.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub network_alone: Option<TestErrors>,
    /// Errors of the baselines.
    pub baselines: Baselines,
    /// Coverage of the network's intervals for each target on the test set; empty if it has no intervals.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub coverage: Vec<Option<Coverage>>,
}

impl Baselines {
    /// Fits the baselines to the training set and measures them on the test set.
    ///
    /// # Errors
    /// If the settings are invalid, the sets do not belong together, samples cannot be scaled, or the job is cancelled.
    pub fn measure(settings: &RunSettings, sets: &RunSets, job: &Job<'_>) -> Result<Self, RunError> {
        let fitted = Self::fitted(settings, sets)?;
        job.check()?;
        let model_based = model_based(&sets.problem, &sets.test, job)?;
        job.check()?;
        Ok(Self { model_based, ..fitted })
    }

    /// Measures the baselines that are fitted to the training set.
    ///
    /// # Errors
    /// If the settings are invalid, the sets do not belong together, or samples cannot be scaled.
    pub(super) fn fitted(settings: &RunSettings, sets: &RunSets) -> Result<Self, RunError> {
        check_sets(settings, sets)?;
        let (mut mean, mut linear) = fit_baselines(&sets.split.training, settings)?;
        let errors = |answers| TestErrors::measure(&sets.problem, &sets.test, &answers);
        Ok(Self {
            mean: errors(decode_set(&mut mean, &sets.test)?),
            linear: errors(decode_set(&mut linear, &sets.test)?),
            model_based: None,
        })
    }

    /// Returns the reason why the error table of a simulated array has no model-based row.
    pub fn model_based_note(&self) -> Option<&'static str> {
        let is_missing = self.mean.nodes().is_some() && self.model_based.is_none();
        is_missing.then_some(
            "There is no model-based row: solving the equations for this many test samples of an array of this size takes \
             too long, or an earlier version wrote the file. Lower the number of test samples or the size of the array, and \
             train again.",
        )
    }

    /// Name of the linear baseline in tables.
    pub fn linear_name(&self) -> &'static str {
        match self.linear {
            TestErrors::Nodes(_) => "linear map",
            TestErrors::Targets(_) => "ridge",
        }
    }
}

/// Returns the errors on `test` of Newton's method with the noise of the scene and mean and covariance of its loading;
/// `None` without a sensor model, and if it would take more than some seconds.
///
/// # Errors
/// If the sensor is invalid, a reading cannot be decoded, or the job is cancelled.
fn model_based(problem: &Problem, test: &Dataset, job: &Job<'_>) -> Result<Option<TestErrors>, RunError> {
    /// Multiplications of some seconds on one core.
    const MAX_MULTIPLICATIONS: f64 = 1e10;
    /// Multiplications between two checks whether the job is cancelled.
    const BLOCK: f64 = 5e8;
    /// Usual number of decompositions per row-wire tried.
    const STEPS: f64 = 8.0;
    /// As [`STEPS`], if exact readings leave the deformation open: nothing but the bounds and a weak prior ends the search.
    const OPEN_STEPS: f64 = 500.0;
    let Some(simulation) = &problem.sensor else {
        return Ok(None);
    };
    let Simulation { sensor, scene, .. } = simulation;
    let rows = test.row_wires_read().expect("samples of a scene know their row-wire");
    let (readings, unknowns) = (sensor.scale.columns(), scene.unknowns_per_row(sensor.scale));
    let (is_exact, is_determined) = (scene.noise.in_test().is_none(), simulation.is_determined());
    // Only exact readings that determine the deformation distinguish row-wires before each was tried.
    let is_each_tried = scene.rows.model() == RowModel::Shared && !(is_exact && is_determined);
    let tried = if is_each_tried { rows.len() } else { 1 };
    let steps = if is_exact && !is_determined { OPEN_STEPS } else { STEPS };
    // QR decomposition of the equations of readings and prior.
    let of_step = 2.0 * (unknowns * unknowns * (readings + unknowns)) as f64;
    let of_sample = steps * of_step * tried as f64;
    if of_sample * test.samples() as f64 > MAX_MULTIPLICATIONS {
        return Ok(None);
    }
    let mut decoder = NewtonDecoder::new(sensor, scene, rows)?;
    let mut answers = Array2::zeros(test.targets().dim());
    let samples = Vec::from_iter(0..test.samples());
    for block in samples.chunks((BLOCK / of_sample).max(1.0) as usize) {
        job.check()?;
        scatter(&mut answers, block, &decode_set(&mut decoder, &test.select(block))?);
    }
    Ok(Some(TestErrors::measure(problem, test, &answers)))
}

/// Fits the baselines: the training mean and an affine map on the readings, one for each row-wire if networks know the
/// row. The map is the least-squares solution for simulated samples of unknown row-wires or of a single one. Otherwise
/// it is ridge regression, since a row-wire can have fewer samples than readings, and measured samples can be too few
/// or too similar.
pub(super) fn fit_baselines(
    training: &Dataset,
    settings: &RunSettings,
) -> Result<(ProgramDecoder, ProgramDecoder), RunError> {
    let mean = |set: &Dataset| Ok::<_, RunError>(Program::mean(set));
    let mean = PerRow::fit(training, settings.source.row_model(), mean)?;
    let ridge = |quantity| {
        let of_set = move |set: &Dataset| Program::ridge(set, quantity, NoiseSource::default());
        PerRow::fit(training, settings.source.row_model(), of_set)
    };
    let linear = match settings.simulation() {
        Some(simulation) if simulation.scene.rows == Rows::Known => ridge(Quantity::Resistance)?,
        Some(_) => PerRow::shared(Program::least_squares(training, Quantity::Resistance)?),
        None => ridge(settings.inputs.quantity)?,
    };
    let [mean, linear] = [mean, linear].map(|programs| ProgramDecoder::new(Program::each(&programs)));
    Ok((mean, linear))
}

/// A row of the paper's Tables 1 to 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedErrors {
    /// Number of the table.
    pub table: u8,
    /// Array scale.
    pub array: ArrayScale,
    /// Number of hidden nodes.
    pub hidden: usize,
    /// Number of training samples; in Table 2, of all samples, each tested once.
    pub training_samples: usize,
    /// AveZerr, in percent.
    pub z_percent: f64,
    /// AveXerr, in percent.
    pub x_percent: f64,
    /// AveYerr, in percent.
    pub y_percent: f64,
}

/// Returns all rows of the paper's Tables 1 to 3.
pub fn published_errors() -> Vec<PublishedErrors> {
    let text = include_str!("../../../../assets/published_errors.csv");
    let row = |line: &str| {
        let mut cells = line.split(',');
        Some(PublishedErrors {
            table: cells.next()?.parse().ok()?,
            array: cells.next()?.parse().ok()?,
            hidden: cells.next()?.parse().ok()?,
            training_samples: cells.next()?.parse().ok()?,
            z_percent: cells.next()?.parse().ok()?,
            x_percent: cells.next()?.parse().ok()?,
            y_percent: cells.next()?.parse().ok()?,
        })
    };
    let rows: Option<_> = text.lines().skip(1).map(row).collect();
    rows.expect("the embedded file is valid, which a test checks")
}

impl PublishedErrors {
    /// Number of the table obtained by cross-validation.
    const CROSS_VALIDATION: u8 = 2;

    /// Returns the errors reported for this configuration, if there are any: on a test set, or by `cross_validation` of all
    /// samples.
    pub(super) fn of(array: ArrayScale, hidden: usize, samples: usize, cross_validation: bool) -> Option<Self> {
        let wanted = (array, hidden, samples, cross_validation);
        let of_row = |row: &Self| {
            let in_table = row.table == Self::CROSS_VALIDATION;
            (row.array, row.hidden, row.training_samples, in_table)
        };
        published_errors().into_iter().find(|row| of_row(row) == wanted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Simulation, Stream},
        decoupling::decode_set,
        evaluation::{Errors, RunSettings},
        machine::MemoryBudget,
        scene::{Movement, Noise, Scene},
        sensor::SensorModel,
    };

    #[test]
    fn the_linear_map_knows_the_row_if_the_network_does() {
        let errors = |rows, samples| {
            let mut settings = RunSettings::default();
            *settings.simulation_mut().unwrap() = Simulation {
                sensor: SensorModel::new("10x6_3x18".parse().unwrap()),
                scene: Scene {
                    rows,
                    ..Scene::default()
                },
                ..*settings.simulation().unwrap()
            };
            let draw = |samples, stream| {
                let Simulation { sensor, scene, .. } = settings.simulation().unwrap();
                Dataset::simulate(sensor, scene, samples, &mut settings.seed.rng(stream)).unwrap()
            };
            let test = draw(200, Stream::Test);
            let training = draw(samples, Stream::Training);
            let (mut mean, mut linear) = fit_baselines(&training, &settings).unwrap();
            let measured = |answers| Errors::measure(&test, &answers, settings.simulation().unwrap().stroke_mm());
            (
                measured(decode_set(&mut mean, &test).unwrap()),
                measured(decode_set(&mut linear, &test).unwrap()),
            )
        };
        let (_, shared) = errors(Rows::All, 1000);
        assert!(shared.x_percent.unwrap() > 0.1);
        let (_, known) = errors(Rows::Known, 1000);
        assert!(known.x_percent.unwrap() < 1e-9, "the row determines x: {known:?}");
        assert!(known.z_mm < 0.3 * shared.z_mm, "{known:?} {shared:?}");
        // Each row has fewer samples than readings.
        let (mean, few) = errors(Rows::Known, 100);
        assert!(few.z_mm < 0.9 * mean.z_mm, "{few:?} {mean:?}");
    }

    /// More unknowns than readings: one sample would take seconds, since every row-wire is tried.
    #[test]
    fn no_model_based_row_where_exact_readings_leave_the_deformation_open() {
        let is_measured = |array: &str, rows| {
            let simulation = Simulation {
                sensor: SensorModel::new(array.parse().unwrap()),
                scene: Scene {
                    rows,
                    movement: Movement::Xyz { largest_shift_mm: 1.0 },
                    noise: Noise::default(),
                    ..Scene::default()
                },
                samples: 40,
                validation_samples: 0,
                test_samples: 20,
            };
            let settings = RunSettings::from(simulation);
            let sets = RunSets::draw(&settings, MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED).unwrap();
            let measured = Baselines::measure(&settings, &sets, &Job::UNINTERRUPTED).unwrap();
            measured.model_based.is_some()
        };
        assert!(!is_measured("20x20_5x60", Rows::All));
        assert!(is_measured("4x4_3x18", Rows::All), "18 readings of 12 unknowns");
    }

    #[test]
    fn published_errors_are_found_by_configuration() {
        assert_eq!(published_errors().len(), 11);
        let array = ArrayScale::default();
        let tested = |array, hidden, samples| PublishedErrors::of(array, hidden, samples, false);
        assert_eq!(tested(array, 12, 1000).unwrap().z_percent, 2.28);
        assert_eq!(
            tested("10x8_4x24".parse().unwrap(), 12, 1000).unwrap().y_percent,
            2.36e-12
        );
        assert_eq!(tested(array, 12, 100), None, "Table 2 is cross-validation");
        assert_eq!(tested(array, 13, 1000), None);
        let cross_validated = |samples| PublishedErrors::of(array, 12, samples, true);
        assert_eq!(cross_validated(1000).unwrap().z_percent, 2.01);
        assert_eq!(cross_validated(100).unwrap().x_percent, 0.30);
        assert_eq!(cross_validated(500), None);
    }
}
