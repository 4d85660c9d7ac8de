use super::{ErrorMeasure, RunSettings, Scores, TestErrors, TrainingSize};
use crate::{
    decoupling::{DecoderKind, Precision},
    scene::{Noise, NoisySets},
    text::counted,
    training::{Method, StopReason},
};

/// Returns the remarks on the rows of an error table, with the names of the rows: on the network, whose training ended
/// for `reason`, and on the linear map.
pub fn error_remarks(
    settings: &RunSettings,
    Scores { network, baselines, .. }: &Scores,
    reason: Option<StopReason>,
) -> Vec<(&'static str, String)> {
    let Ok(size) = TrainingSize::drawn(settings) else {
        return Vec::new();
    };
    let end = reason.map(|reason| (reason, settings.training.method));
    let rows = [
        ("linear map", DecoderKind::Ridge, &baselines.linear, None),
        ("network", DecoderKind::Network, network, end),
    ];
    let of_row = |(name, kind, errors, end)| {
        let mut remarks = worse_than_mean(errors, &baselines.mean, &cause(kind, settings, size, end));
        remarks.extend(missing_figures(Precision::Double, errors, None).map(str::to_owned));
        remarks.into_iter().map(move |remark| (name, remark))
    };
    rows.into_iter().flat_map(of_row).collect()
}

/// Returns a circumstance that may be the cause of errors worse than those of the mean, with what may help: for a decoder
/// fitted with `settings` to training samples of this `size`, whose training ended as in `end`. The circumstance is known;
/// that it is the cause is not.
pub(super) fn cause(
    kind: DecoderKind,
    settings: &RunSettings,
    size: TrainingSize,
    end: Option<(StopReason, Method)>,
) -> String {
    /// Samples per reading below which more samples would help most.
    const FEW: usize = 4;
    let simulation = settings.simulation();
    let noise = simulation.map_or(Noise::default(), |simulation| simulation.scene.noise);
    let is_noisy = !noise.in_test().is_none();
    let is_fitted = kind != DecoderKind::Newton;
    if is_fitted && is_noisy && noise.sets == NoisySets::Test {
        return "the training set lacks the noise of these readings; add the noise to both, or reduce it".to_owned();
    }
    if let Some((reason, method)) = end {
        return reason.remedy(&method).to_string();
    }
    let (samples, readings) = (size.samples / size.networks.max(1), size.inputs);
    if is_fitted && samples < FEW * readings {
        let (samples, readings) = (counted(samples, "training sample"), counted(readings, "reading"));
        return format!("it was fitted to {samples} of {readings}; more samples may help");
    }
    let text = if kind.needs_network() {
        "more or fewer epochs, another number of hidden nodes, or more samples may help"
    } else if is_noisy {
        "the readings have noise: use another decoder; less noise or more samples may help"
    } else {
        "use another decoder; more samples may help"
    };
    text.to_owned()
}

/// Returns a remark on each coordinate or target whose error exceeds that of always answering the mean by enough to show
/// in three decimals of their ratio. NaN is reported by [`missing_figures`] instead.
pub(super) fn worse_than_mean(errors: &TestErrors, mean: &TestErrors, cause: &str) -> Vec<String> {
    /// Largest error in percent that counts as rounding of coordinates.
    const ROUNDING: f64 = 1e-9;
    let (pairs, rounding): (Vec<(String, f64, f64)>, f64) = if errors.nodes().is_some() {
        let axes = [
            ("z", ErrorMeasure::ZStrokePercent),
            ("x", ErrorMeasure::XPercent),
            ("y", ErrorMeasure::YPercent),
        ];
        let pair = |(name, measure): (&str, _)| Some((name.to_owned(), errors.figure(measure)?, mean.figure(measure)?));
        (axes.into_iter().filter_map(pair).collect(), ROUNDING)
    } else {
        let pairs = errors.targets().iter().zip(mean.targets()).enumerate();
        // A target that is constant in the test samples cannot be judged.
        let judged = pairs.filter(|(_, (errors, _))| errors.r2.is_some());
        let named = judged.map(|(index, (errors, mean))| (format!("target {}", index + 1), errors.mae, mean.mae));
        (named.collect(), 0.0)
    };
    let worse = pairs
        .into_iter()
        .filter(|(_, error, of_mean)| *error > 1.0005 * of_mean + rounding);
    let remark = |(target, error, of_mean): (String, f64, f64)| {
        let times = (of_mean > rounding).then(|| error / of_mean);
        let compared = match times.filter(|times| times.is_finite()) {
            None => format!("it has an error in {target}, although always answering the mean is exact"),
            Some(times @ ..1e4) => {
                format!("its error in {target} is {times:.3} times that of always answering the mean")
            }
            Some(times) => format!("its error in {target} is {times:.1e} times that of always answering the mean"),
        };
        format!("{compared}: {cause}")
    };
    worse.map(remark).collect()
}

/// Returns the reason why figures are missing, given the errors of a decoder and the residual of its answers, if there is
/// a model of the sensor; `None` if none are missing.
pub(super) fn missing_figures(
    precision: Precision,
    errors: &TestErrors,
    residual: Option<f64>,
) -> Option<&'static str> {
    let is_complete = match errors {
        TestErrors::Nodes(errors) => errors.z_mm.is_finite() && errors.worst_mm.is_finite(),
        TestErrors::Targets(targets) => targets.iter().all(|target| target.mae.is_finite()),
    };
    match precision {
        _ if is_complete => residual
            .is_some_and(|residual| !residual.is_finite())
            .then_some("no residual, since the sensor has no resistances at some answers: they are too far off"),
        Precision::Single => Some(
            "no figures, since readings or answers exceed single precision (3.4e38): decode in double precision, or lower \
             the noise",
        ),
        Precision::Double => Some("no figures, since its answers overflow: lower the noise"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::{Errors, TargetErrors};

    fn remarks_on(
        kind: DecoderKind,
        (errors, mean): (&TestErrors, &TestErrors),
        settings: &RunSettings,
        (samples, inputs): (usize, usize),
    ) -> Vec<String> {
        let size = TrainingSize {
            samples,
            inputs,
            targets: 30,
            networks: 1,
        };
        worse_than_mean(errors, mean, &cause(kind, settings, size, None))
    }

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
        remarks_on(kind, (&ours, &mean), &settings, (samples, 30))
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
        let of_exact_mean = remarks_on(DecoderKind::Ridge, (&ours, &exact), &RunSettings::default(), (500, 30));
        assert_eq!(of_exact_mean.len(), 1, "{of_exact_mean:?}");
        let text = &of_exact_mean[0];
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
        let settings = RunSettings::measured(crate::scene::RowModel::Shared);
        // Metres, ohm, and a constant.
        let errors = [target(3e-12, Some(-1.0)), target(5.0, Some(0.5)), target(1e-17, None)];
        let mean = [target(2e-12, Some(0.0)), target(7.0, Some(0.0)), target(0.0, None)];
        let [errors, mean] = [errors, mean].map(|targets| TestErrors::Targets(targets.into()));
        let remarks = remarks_on(DecoderKind::Ridge, (&errors, &mean), &settings, (500, 30));
        assert_eq!(remarks.len(), 1, "{remarks:?}");
        assert!(remarks[0].contains("in target 1 is 1.500 times"), "{remarks:?}");
    }
}
