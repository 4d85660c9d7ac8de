use serde::{Deserialize, Serialize};

use super::{Errors, NoReference, RunError, RunSettings, Source, TestErrors};
use crate::{
    dataset::{Dataset, PerRow},
    decoupling::{AffineMap, TrainingMean},
    network::{InputChoice, Quantity},
    scene::{NoiseSource, Rows},
};

/// Errors of the baselines, listed next to those of the network in every error table. `E` is [`Errors`] where the targets
/// are known to be nodes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Baselines<E = TestErrors> {
    /// Errors of always answering the mean of the training set.
    pub mean: E,
    /// Errors of the best affine map on the readings, one for each row-wire where rows are known; ridge regression for
    /// recordings.
    pub linear: E,
    /// Errors of the Bayesian reference, the limit set by the noise and by the distribution of the loading:
    /// [`reference_errors`](super::reference_errors). Recordings have none.
    pub reference: Option<E>,
    /// Reason for which there is no reference, if one was sought.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub no_reference: Option<NoReference>,
}

/// Errors of the network and of the baselines on the same test set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scores<E = TestErrors> {
    /// Errors of the network.
    pub network: E,
    /// Errors of the baselines.
    pub baselines: Baselines<E>,
}

impl Baselines {
    /// Returns the errors on the nodes, if the targets are nodes of an array.
    pub fn nodes(&self) -> Option<Baselines<Errors>> {
        Some(Baselines {
            mean: *self.mean.nodes()?,
            linear: *self.linear.nodes()?,
            reference: self.reference.as_ref().and_then(TestErrors::nodes).copied(),
            no_reference: self.no_reference,
        })
    }

    /// Name of the linear baseline in tables.
    pub fn linear_name(&self) -> &'static str {
        match self.linear {
            TestErrors::Nodes(_) => "linear map",
            TestErrors::Targets(_) => "ridge",
        }
    }
}

impl Scores {
    /// Returns the errors on the nodes, if the targets are nodes of an array.
    pub fn nodes(&self) -> Option<Scores<Errors>> {
        Some(Scores {
            network: *self.network.nodes()?,
            baselines: self.baselines.nodes()?,
        })
    }
}

/// Fits the baselines: the training mean and an affine map on the readings, of each row-wire where networks know theirs.
/// For simulated samples of row-wires that are not told, or of one, the map is that of least squares; samples of each of
/// several row-wires can be fewer than its readings, and measured ones too few or too alike, so theirs is ridge regression.
pub(super) fn fit_baselines(
    training: &Dataset,
    settings: &RunSettings,
) -> Result<(PerRow<TrainingMean>, PerRow<AffineMap>), RunError> {
    let mean = |set: &Dataset| Ok::<_, RunError>(TrainingMean::fit(set));
    let mean = PerRow::fit(training, settings.source.row_model(), mean)?;
    let ridge = |inputs| {
        let of_set = move |set: &Dataset| AffineMap::ridge(set, inputs, NoiseSource::default());
        PerRow::fit(training, settings.source.row_model(), of_set)
    };
    let linear = match settings.source {
        Source::Simulated(simulation) if simulation.scene.rows == Rows::Known => ridge(InputChoice::PAPER)?,
        Source::Simulated(_) => PerRow::shared(AffineMap::least_squares(training, Quantity::Resistance)?),
        Source::Measured(_) => ridge(settings.inputs)?,
    };
    Ok((mean, linear))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::Stream,
        decoupling::decode_set,
        evaluation::{SimulatedSettings, Simulation},
        scene::Scene,
        sensor::SensorModel,
    };

    #[test]
    fn the_linear_map_is_told_the_row_where_the_network_is() {
        let errors = |rows, samples| {
            let mut settings = SimulatedSettings::default();
            settings.source = Simulation {
                sensor: SensorModel::new("10x6_3x18".parse().unwrap()),
                scene: Scene {
                    rows,
                    ..Scene::default()
                },
                ..settings.source
            };
            let draw = |samples, stream| {
                let Simulation { sensor, scene, .. } = &settings.source;
                Dataset::simulate(sensor, scene, samples, &mut settings.seed.rng(stream)).unwrap()
            };
            let test = draw(200, Stream::Test);
            let training = draw(samples, Stream::Training);
            let (mut mean, mut linear) = fit_baselines(&training, &settings.into()).unwrap();
            let measured = |answers| Errors::measure(&test, &answers, settings.source.stroke_mm());
            (
                measured(decode_set(&mut mean, &test).unwrap()),
                measured(decode_set(&mut linear, &test).unwrap()),
            )
        };
        let (_, shared) = errors(Rows::All, 1000);
        assert!(shared.x_percent.unwrap() > 0.1);
        let (_, known) = errors(Rows::Known, 1000);
        assert!(known.x_percent.unwrap() < 1e-9, "the row says x: {known:?}");
        assert!(known.z_mm < 0.3 * shared.z_mm, "{known:?} {shared:?}");
        // Fewer samples of a row than it has readings.
        let (mean, few) = errors(Rows::Known, 100);
        assert!(few.z_mm < 0.9 * mean.z_mm, "{few:?} {mean:?}");
    }
}
