use std::fmt;

use thiserror::Error;

use super::{Errors, RunSettings, Scores, TargetErrors, TestErrors};
use crate::{
    decoupling::{DecoderKind, Precision, SolvedRows},
    scene::{Noise, NoisySets},
    text::counted,
    training::{Method, StopReason},
};

/// Remark on an unreliable result of a decoder, with what may help. Printed next to its errors.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Remark {
    /// Always answering the mean of the training set would be more accurate.
    WorseThanMean {
        /// Name of the coordinate or target.
        target: String,
        /// Ratio of the mean absolute error to that of the mean; `None` if the mean is exact, for instance if a
        /// coordinate is the same in all samples.
        times: Option<f64>,
        /// Circumstance that may be the cause.
        cause: Cause,
    },
    /// Figures are missing.
    Missing(MissingFigures),
    /// Rows were not solved, or the readings do not determine their answers.
    NotAllSolved(SolvedRows),
}

/// Circumstance that may be the cause of a result that is worse than the mean. It is known; that it is the cause is not.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Cause {
    /// The readings have noise that the training set lacks.
    UnseenNoise,
    /// The training set is small.
    FewSamples {
        /// Number of training samples of each fit.
        samples: usize,
        /// Number of readings per sample.
        readings: usize,
    },
    /// The settings of the training.
    Training,
    /// The end of the training of the network.
    End {
        /// Reason why the training ended.
        reason: StopReason,
        /// Method of the training.
        method: Method,
    },
    /// The noise of the readings.
    Noise,
    /// Unknown.
    Unknown,
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WorseThanMean { target, times, cause } => {
                match times {
                    None => write!(
                        f,
                        "it has an error in {target}, although always answering the mean is exact"
                    )?,
                    Some(times @ ..1e4) => write!(
                        f,
                        "its error in {target} is {times:.3} times that of always answering the mean"
                    )?,
                    Some(times) => write!(
                        f,
                        "its error in {target} is {times:.1e} times that of always answering the mean"
                    )?,
                }
                write!(f, ": {cause}")
            }
            Self::Missing(reason) => reason.fmt(f),
            Self::NotAllSolved(rows) => rows.fmt(f),
        }
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnseenNoise => {
                f.write_str("the training set lacks the noise of these readings; add the noise to both, or reduce it")
            }
            Self::FewSamples { samples, readings } => {
                let (samples, readings) = (counted(*samples, "training sample"), counted(*readings, "reading"));
                write!(f, "it was fitted to {samples} of {readings}; more samples may help")
            }
            Self::Training => {
                f.write_str("more or fewer epochs, another number of hidden nodes, or more samples may help")
            }
            Self::End { reason, method } => f.write_str(&reason.remedy(method)),
            Self::Noise => f.write_str("the readings have noise; less noise or more samples may help"),
            Self::Unknown => f.write_str("use another decoder; more samples may help"),
        }
    }
}

impl Cause {
    /// Finds the circumstance to name for a decoder fitted with `settings` to `samples` training samples of `readings`
    /// each.
    fn of(kind: DecoderKind, settings: &RunSettings, samples: usize, readings: usize) -> Self {
        /// Samples per reading below which more samples would help most.
        const FEW: usize = 4;
        let noise = settings
            .simulation()
            .map_or(Noise::default(), |simulation| simulation.scene.noise);
        let is_noisy = !noise.in_test().is_none();
        let is_fitted = kind != DecoderKind::Newton;
        if is_fitted && is_noisy && noise.sets == NoisySets::Test {
            Self::UnseenNoise
        } else if is_fitted && samples < FEW * readings {
            Self::FewSamples { samples, readings }
        } else if kind.needs_network() {
            Self::Training
        } else if is_noisy {
            Self::Noise
        } else {
            Self::Unknown
        }
    }
}

/// Errors of a decoder next to those of the mean, coordinate by coordinate or target by target.
struct Pair {
    target: String,
    error: f64,
    of_mean: f64,
    /// Largest error that counts as rounding.
    rounding: f64,
}

impl Pair {
    fn of_nodes(errors: &Errors, mean: &Errors) -> Vec<Self> {
        /// Largest error in percent that counts as rounding.
        const ROUNDING: f64 = 1e-9;
        let percent = |target: &str, error: Option<f64>, of_mean: Option<f64>| {
            Some(Self {
                target: target.to_owned(),
                error: error?,
                of_mean: of_mean?,
                rounding: ROUNDING,
            })
        };
        let z = (Some(errors.z_full_scale_percent), Some(mean.z_full_scale_percent));
        let pairs = [
            percent("z", z.0, z.1),
            percent("x", errors.x_percent, mean.x_percent),
            percent("y", errors.y_percent, mean.y_percent),
        ];
        pairs.into_iter().flatten().collect()
    }

    fn of_targets(errors: &[TargetErrors], mean: &[TargetErrors]) -> Vec<Self> {
        // A target that is constant in the test samples cannot be judged.
        let pairs = errors.iter().zip(mean).enumerate();
        let judged = pairs.filter(|(_, (errors, _))| errors.r2.is_some());
        let pair = |(index, (errors, mean)): (usize, (&TargetErrors, &TargetErrors))| Self {
            target: format!("target {}", index + 1),
            error: errors.mae,
            of_mean: mean.mae,
            rounding: 0.0,
        };
        judged.map(pair).collect()
    }

    /// Returns `true` if the error exceeds that of the mean by enough to show in three decimals of their ratio. NaN is
    /// reported as [`Remark::Missing`] instead.
    fn is_worse(&self) -> bool {
        self.error > 1.0005 * self.of_mean + self.rounding
    }

    /// Returns the ratio of the error to that of the mean; `None` if the error of the mean is only rounding.
    fn times(&self) -> Option<f64> {
        let times = (self.of_mean > self.rounding).then(|| self.error / self.of_mean);
        times.filter(|times| times.is_finite())
    }
}

impl Remark {
    /// Returns the remarks on the errors of a decoder of this kind, fitted with `settings` to `samples` training
    /// samples of `readings` each, compared with the errors of the mean.
    pub(super) fn on(
        kind: DecoderKind,
        (errors, mean): (&TestErrors, &TestErrors),
        settings: &RunSettings,
        (samples, readings): (usize, usize),
    ) -> Vec<Self> {
        let cause = Cause::of(kind, settings, samples, readings);
        let pairs = match (errors, mean) {
            (TestErrors::Nodes(errors), TestErrors::Nodes(mean)) => Pair::of_nodes(errors, mean),
            _ => Pair::of_targets(errors.targets(), mean.targets()),
        };
        let worse = pairs
            .into_iter()
            .filter(Pair::is_worse)
            .map(|pair| Self::WorseThanMean {
                times: pair.times(),
                target: pair.target,
                cause,
            });
        worse.collect()
    }

    /// Sets the reason for the end of the training as the cause, unless the cause is noise that the training set lacks.
    fn attribute_to_end(&mut self, reason: Option<StopReason>, method: Method) {
        if let (Self::WorseThanMean { cause, .. }, Some(reason)) = (self, reason)
            && *cause != Cause::UnseenNoise
        {
            *cause = Cause::End { reason, method };
        }
    }
}

/// Returns the remarks on the rows of the error table of a simulated array, with the names of the rows: on the network,
/// whose training ended for `reason`, and on the linear map.
pub fn error_remarks(
    settings: &RunSettings,
    Scores { network, baselines, .. }: &Scores,
    reason: Option<StopReason>,
) -> Vec<(&'static str, Remark)> {
    let Some(simulation) = settings.simulation() else {
        return Vec::new();
    };
    let readings = simulation.sensor.scale.columns();
    let networks = simulation.model_size().map_or(1, |size| size.networks);
    let method = settings.training.method;
    let samples = simulation.samples / networks;
    let rows = [
        ("linear map", DecoderKind::Ridge, &baselines.linear),
        ("network", DecoderKind::Network, network),
    ];
    let of_row = |(name, kind, errors)| {
        let mut remarks = Remark::on(kind, (errors, &baselines.mean), settings, (samples, readings));
        for remark in remarks.iter_mut().filter(|_| kind == DecoderKind::Network) {
            remark.attribute_to_end(reason, method);
        }
        remarks.extend(MissingFigures::of(Precision::Double, errors, None).map(Remark::Missing));
        remarks.into_iter().map(move |remark| (name, remark))
    };
    rows.into_iter().flat_map(of_row).collect()
}

/// Reason why a decoder has no figures, or no residual.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MissingFigures {
    /// Readings or answers exceed the range of single precision.
    #[error(
        "no figures, since readings or answers exceed single precision (3.4e38): decode in double precision, or lower \
         the noise"
    )]
    SinglePrecision,
    /// Answers overflow.
    #[error("no figures, since its answers overflow: lower the noise")]
    Overflow,
    /// The sensor has no resistance at the answers.
    #[error("no residual, since the sensor has no resistances at some answers: they are too far off")]
    NoResistance,
}

impl MissingFigures {
    /// Returns the reason why figures are missing, given the errors of a decoder and the residual of its answers, if
    /// there is a model of the sensor; `None` if none are missing.
    pub(super) fn of(precision: Precision, errors: &TestErrors, residual: Option<f64>) -> Option<Self> {
        let is_complete = match errors {
            TestErrors::Nodes(errors) => errors.z_mm.is_finite() && errors.worst_mm.is_finite(),
            TestErrors::Targets(targets) => targets.iter().all(|target| target.mae.is_finite()),
        };
        match precision {
            _ if is_complete => residual
                .is_some_and(|residual| !residual.is_finite())
                .then_some(Self::NoResistance),
            Precision::Single => Some(Self::SinglePrecision),
            Precision::Double => Some(Self::Overflow),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(z_mm: f64, x_percent: Option<f64>) -> Errors {
        Errors {
            z_percent: Some(z_mm),
            x_percent,
            y_percent: Some(0.0),
            z_mm,
            z_full_scale_percent: z_mm,
            worst_mm: z_mm,
            worst_node: Default::default(),
        }
    }

    fn remarks(kind: DecoderKind, noise: Noise, samples: usize, ours: &Errors) -> Vec<String> {
        let mut settings = RunSettings::default();
        settings.simulation_mut().unwrap().scene.noise = noise;
        let mean = errors(0.2, Some(5.0));
        let [ours, mean] = [*ours, mean].map(TestErrors::Nodes);
        let remarks = Remark::on(kind, (&ours, &mean), &settings, (samples, 30));
        remarks.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn only_errors_worse_than_the_mean_are_reported_with_what_may_help() {
        let none = Noise::default();
        for good in [
            errors(0.2, Some(5.0)),
            errors(0.0, None),
            errors(0.2 * (1.0 + 1e-15), Some(5.0)),
        ] {
            assert!(remarks(DecoderKind::Ridge, none, 500, &good).is_empty());
        }
        let bad = errors(0.3, Some(6.0));
        let unseen = Noise {
            sets: NoisySets::Test,
            ..Noise::relative(1e-2)
        };
        let cases = [
            (DecoderKind::Ridge, unseen, 500, "add the noise to both"),
            (
                DecoderKind::Ridge,
                none,
                62,
                "it was fitted to 62 training samples of 30 readings; more samples may help",
            ),
            (DecoderKind::Network, none, 500, "epochs"),
            (DecoderKind::RadialBasis, Noise::relative(1e-2), 500, "less noise"),
            (DecoderKind::RadialBasis, none, 500, "use another decoder"),
        ];
        for (kind, noise, samples, remedy) in cases {
            let remarks = remarks(kind, noise, samples, &bad);
            assert_eq!(remarks.len(), 2, "z and x");
            assert!(
                remarks[0].contains("in z is 1.500 times") && remarks[0].contains(remedy),
                "{remarks:?}"
            );
            assert!(remarks[1].contains("in x is 1.200 times"), "{remarks:?}");
        }
        let [ours, exact] = [errors(0.1, Some(0.5)), errors(0.2, Some(1e-14))].map(TestErrors::Nodes);
        let of_exact_mean = Remark::on(DecoderKind::Ridge, (&ours, &exact), &RunSettings::default(), (500, 30));
        assert_eq!(of_exact_mean.len(), 1, "{of_exact_mean:?}");
        let text = of_exact_mean[0].to_string();
        assert!(
            text.contains("error in x, although always answering the mean is exact"),
            "{text}"
        );
        assert!(!text.contains("inf") && !text.contains("times"), "{text}");
        let none_at_all = errors(f64::NAN, None);
        assert_eq!(
            remarks(DecoderKind::Ridge, none, 500, &none_at_all).len(),
            0,
            "no figure is compared"
        );
    }

    #[test]
    fn targets_in_any_unit_are_compared_except_constant_ones() {
        let target = |mae: f64, r2: Option<f64>| TargetErrors {
            rmse: mae,
            mae,
            r2,
            worst: mae,
            worst_sample: 0,
            percent_of_range: None,
        };
        let settings = RunSettings::from(crate::evaluation::Measured {
            rows: crate::scene::RowModel::Shared,
        });
        // Metres, ohm, and a constant.
        let errors = [target(3e-12, Some(-1.0)), target(5.0, Some(0.5)), target(1e-17, None)];
        let mean = [target(2e-12, Some(0.0)), target(7.0, Some(0.0)), target(0.0, None)];
        let [errors, mean] = [errors, mean].map(|targets| TestErrors::Targets(targets.into()));
        let remarks = Remark::on(DecoderKind::Ridge, (&errors, &mean), &settings, (500, 30));
        assert_eq!(remarks.len(), 1, "{remarks:?}");
        assert!(
            remarks[0].to_string().contains("in target 1 is 1.500 times"),
            "{remarks:?}"
        );
    }
}
