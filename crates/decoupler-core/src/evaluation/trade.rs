use super::{Baselines, DecoderReport, DecoderSet, Errors, Preset, Run, RunError, RunSets, RunSettings, TestErrors};
use crate::{
    dataset::Simulation, decoupling::DecoderKind, identifiability::Identifiability, job::Job, scene::Rows,
    sensor::RelativeNoise, training::Method,
};

/// One decoder in the trade-off between speed and accuracy.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOffPoint {
    /// Preset from which the settings were derived, if any.
    pub preset: Option<Preset>,
    /// Settings of the run; hidden nodes and method matter only if the decoder has a network.
    pub settings: RunSettings,
    /// Decoder, its errors, and its time per frame.
    pub report: DecoderReport,
    /// Training or fitting time in seconds: [`Run::training_time`] of networks.
    pub training_seconds: f64,
    /// Model-based errors in this scene: [`Baselines::model_based`](super::Baselines::model_based).
    pub model_based: Option<Errors>,
}

impl TradeOffPoint {
    /// Returns the [error in percent](super::TestErrors::percent); infinite if undefined.
    pub fn percent(&self) -> f64 {
        self.report.errors.percent().unwrap_or(f64::INFINITY)
    }

    /// Number of hidden nodes, if the decoder has a network.
    pub fn hidden(&self) -> Option<usize> {
        self.report.kind.needs_network().then_some(self.settings.hidden)
    }

    /// Training method, if the decoder has a network.
    pub fn method(&self) -> Option<Method> {
        let is_trained = self.report.kind.needs_network();
        is_trained.then_some(self.settings.training.method)
    }

    /// Returns the ratio of the error to the model-based one: [`Errors::times`]; `None` without that.
    pub fn to_model_based(&self) -> Option<f64> {
        self.report.errors.nodes()?.times(self.model_based.as_ref()?)
    }
}

/// Measures every decoder of `decoders` on the test samples of `sets`, with each number of `hidden` nodes for networks.
///
/// Each point is passed to `on_point` as soon as it is measured, or the reason why a decoder cannot be used with these
/// samples, together with the run that trained the networks of the decoder, if it needs any. Decoders that solve the
/// equations of a sensor are left out if there is no model of it. Training uses all threads; decoding is timed on one
/// thread.
///
/// # Errors
/// If the settings are invalid, a network cannot be trained with them on these samples, or the job is cancelled.
pub fn measure_trade_off(
    settings: &RunSettings,
    sets: &RunSets,
    hidden: &[usize],
    decoders: &[DecoderKind],
    job: &Job<'_>,
    mut on_point: impl FnMut(DecoderKind, Result<TradeOffPoint, RunError>, Option<&Run>),
) -> Result<(), RunError> {
    let mut set = DecoderSet::new(*settings, sets.split.training.clone(), None);
    let baselines = Baselines::measure(settings, sets, job)?;
    let model_based = baselines.model_based.as_ref().and_then(TestErrors::nodes).copied();
    for hidden in std::iter::once(None).chain(hidden.iter().map(Some)) {
        let is_offered = |kind: &&DecoderKind| {
            kind.needs_network() == hidden.is_some() && (sets.problem.sensor.is_some() || !kind.needs_sensor())
        };
        let offered = Vec::from_iter(decoders.iter().filter(is_offered));
        if offered.is_empty() {
            continue;
        }
        let hidden = *hidden.unwrap_or(&settings.hidden);
        let settings = RunSettings { hidden, ..*settings };
        let mut run = None;
        if offered[0].needs_network() {
            let run = run.insert(Run::new(settings, sets.clone(), None, job)?);
            run.baselines = Some(baselines.clone());
            run.finish(job)?;
            set.networks = Some(run.network());
        }
        let of_run = run.as_ref().map(|run: &Run| run.training_time().as_secs_f64());
        for &kind in offered {
            for &precision in kind.precisions() {
                job.check()?;
                if let Some(measured) = set.measure(kind, precision, &sets.test).transpose() {
                    let point = measured.map(|report| TradeOffPoint {
                        preset: None,
                        settings,
                        training_seconds: of_run.unwrap_or(report.fit_seconds),
                        report,
                        model_based,
                    });
                    on_point(kind, point, run.as_ref());
                }
            }
        }
    }
    Ok(())
}

/// Marks the points (cost, error) on the Pareto front: those for which no other point is better in one coordinate and
/// at least as good in the other.
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<bool> {
    let is_beaten = |&(cost, error): &(f64, f64)| {
        let beats = |other: &(f64, f64)| other.0 <= cost && other.1 <= error && (other.0 < cost || other.1 < error);
        points.iter().any(beats)
    };
    points.iter().map(|point| !is_beaten(point)).collect()
}

/// Returns the index of the point with the shortest decoding time among those with an error of at most `percent`.
pub fn fastest_under(points: &[TradeOffPoint], percent: f64) -> Option<usize> {
    let is_good = |place: &usize| points[*place].percent() <= percent;
    let time = |place: usize| points[place].report.frame_us;
    let places = (0..points.len()).filter(is_good);
    places.min_by(|&a, &b| time(a).total_cmp(&time(b)))
}

/// Returns the index of the point with the smallest error among those that decode a frame within `microseconds`.
pub fn most_accurate_under(points: &[TradeOffPoint], microseconds: f64) -> Option<usize> {
    let is_quick = |place: &usize| points[*place].report.frame_us <= microseconds;
    let error = |place: usize| points[place].percent();
    let places = (0..points.len()).filter(is_quick);
    places.min_by(|&a, &b| error(a).total_cmp(&error(b)))
}

/// Conditioning of a scene and the resulting warnings, known before anything is trained.
#[derive(Clone, Debug, PartialEq)]
pub struct Outlook {
    /// Analysis of the worst-conditioned row-wire of those read, with its nodes at half the stroke.
    pub worst_row: Identifiability,
    /// Relative noise of a reading of that row, from all sources of the scene.
    pub noise: RelativeNoise,
    /// Standard deviation in mm of the least determined pattern for readings with this noise; 0 without noise.
    pub worst_spread_mm: f64,
    /// Warnings about obstacles to decoupling, with remedies.
    pub warnings: Vec<String>,
}

impl Outlook {
    /// Analyses every row-wire that the simulated scene reads.
    ///
    /// # Errors
    /// If the sensor or scene is invalid, or singular values do not converge.
    pub fn of(simulation: &Simulation) -> Result<Self, RunError> {
        let Simulation { sensor, scene, .. } = simulation;
        sensor.check()?;
        scene.check()?;
        let stroke_mm = simulation.stroke_mm();
        let half_way = vec![glam::DVec3::new(0.0, 0.0, 0.5 * stroke_mm); sensor.scale.nodes_per_row()];
        let mut worst: Option<Identifiability> = None;
        for row in scene.rows.read(sensor.scale.rows())? {
            let seen =
                Identifiability::of_row(sensor, row, &half_way, scene.movement.axes(), RelativeNoise::default())?;
            if worst.as_ref().is_none_or(|worst| seen.condition() > worst.condition()) {
                worst = Some(seen);
            }
        }
        let worst_row = worst.expect("an array has row-wires");
        let noise = RelativeNoise::of(scene.noise, sensor, &[worst_row.row], 0.5 * stroke_mm)?;
        let alike = if scene.rows == Rows::All {
            Identifiability::most_alike_rows(sensor, noise)?
        } else {
            None
        };
        let seen = Identifiability::of_row(sensor, worst_row.row, &half_way, worst_row.axes, noise)?;
        Ok(Self {
            warnings: seen.warnings(noise.own, stroke_mm / 12.0_f64.sqrt(), alike),
            worst_spread_mm: seen.worst_spread_mm(noise.own),
            worst_row,
            noise,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Simulation;
    use crate::scene::{Noise, Scene};

    #[test]
    fn the_front_consists_of_points_that_no_other_beats() {
        let points = [(1.0, 5.0), (2.0, 2.0), (3.0, 2.0), (4.0, 1.0), (5.0, 3.0), (1.0, 6.0)];
        assert_eq!(pareto_front(&points), [true, true, false, true, false, false]);
        let twins = [(1.0, 1.0), (1.0, 1.0)];
        assert_eq!(pareto_front(&twins), [true, true], "neither beats the other");
        assert!(pareto_front(&[]).is_empty());
    }

    fn is_hopeless(noise: Noise) -> bool {
        let simulation = Simulation {
            scene: Scene {
                noise,
                ..Scene::default()
            },
            ..Simulation::default()
        };
        let warnings = Outlook::of(&simulation).unwrap().warnings;
        warnings
            .iter()
            .any(|warning| warning.contains("hardly constrain the deformation"))
    }

    /// The model-based error of this scene is far below the error of the mean, and rows differ by 20 times the noise.
    #[test]
    fn drift_is_not_treated_as_independent_noise() {
        let simulation = Simulation {
            scene: Scene {
                noise: Noise {
                    drift: 0.1,
                    ..Noise::relative(1e-3)
                },
                ..Scene::default()
            },
            sensor: crate::sensor::SensorModel::new("10x6_3x18".parse().unwrap()),
            ..Simulation::default()
        };
        let outlook = Outlook::of(&simulation).unwrap();
        assert!(outlook.warnings.is_empty(), "{:?}", outlook.warnings);
        assert_eq!((outlook.noise.own, outlook.noise.common), (1e-3, 0.1));
    }

    #[test]
    fn every_kind_of_noise_causes_a_warning() {
        let of = |relative, additive_ohm, converter_bits, drift| Noise {
            relative,
            additive_ohm,
            converter_bits,
            drift,
            ..Noise::default()
        };
        assert!(!is_hopeless(of(1e-4, 0.0, None, 0.0)));
        assert!(is_hopeless(of(1.0, 0.0, None, 0.0)));
        // Resistances are below 100 ohm; 1 bit rounds to steps as large as the largest.
        assert!(is_hopeless(of(0.0, 1e3, None, 0.0)));
        assert!(is_hopeless(of(0.0, 0.0, Some(1), 0.0)));
        // A gain that is common to all readings hides only one pattern.
        assert!(!is_hopeless(of(0.0, 0.0, None, 1.0)));
        assert!(is_hopeless(of(1.0, 0.0, None, 1.0)));
    }
}
