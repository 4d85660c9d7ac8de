use super::{DecoderSet, Run, RunError, RunSettings, TargetReport};
use crate::{
    dataset::{Dataset, Split},
    decoupling::DecoderKind,
    training::Method,
};

/// One decoder of targets of any meaning on the trade-off between speed and accuracy.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetTradeOffPoint {
    /// Settings of the run; hidden nodes and method matter only if the decoder has a network.
    pub settings: RunSettings,
    /// Decoder, its errors target by target, and its decoding time.
    pub report: TargetReport,
    /// Training or fitting time in seconds, summed over all rows and starts.
    pub training_seconds: f64,
}

impl TargetTradeOffPoint {
    /// Mean absolute error in percent of the target's range, averaged over the targets: the error that compares targets
    /// in different units. `None` if an error is not finite or every target is constant.
    pub fn percent_of_range(&self) -> Option<f64> {
        let targets = &self.report.targets;
        if targets.iter().any(|target| !target.mae.is_finite()) {
            return None;
        }
        let percents = Vec::from_iter(targets.iter().filter_map(|target| target.percent_of_range));
        (!percents.is_empty()).then(|| percents.iter().sum::<f64>() / percents.len() as f64)
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

    /// Returns decoding time in microseconds and the error in percent of the range, infinite if undefined.
    pub fn decoding(&self) -> (f64, f64) {
        (self.report.cost.frame_us, self.error())
    }

    /// Returns training time in seconds and the error in percent of the range, infinite if undefined.
    pub fn training(&self) -> (f64, f64) {
        (self.training_seconds, self.error())
    }

    fn error(&self) -> f64 {
        self.percent_of_range().unwrap_or(f64::INFINITY)
    }
}

/// Measures every decoder of `decoders` on the test samples, networks with each number of `hidden` nodes, and passes each
/// point to `on_point` as soon as it is measured, or why a decoder cannot be used with these samples. Decoders that solve
/// the equations of a sensor are left out. Training uses all threads; decoding is timed on one. Returns `false` if
/// cancelled before the end.
///
/// # Errors
/// If a network cannot be trained with these settings and samples.
pub fn measure_target_trade_off(
    settings: &RunSettings,
    (split, test): (&Split, &Dataset),
    hidden: &[usize],
    decoders: &[DecoderKind],
    is_cancelled: impl Fn() -> bool,
    mut on_point: impl FnMut(DecoderKind, Result<TargetTradeOffPoint, RunError>),
) -> Result<bool, RunError> {
    let mut set = DecoderSet::on_set(*settings, split.training.clone(), None);
    let (with_network, without): (Vec<DecoderKind>, Vec<DecoderKind>) = decoders
        .iter()
        .filter(|kind| !kind.needs_sensor())
        .partition(|kind| kind.needs_network());
    for kind in without {
        for &precision in kind.precisions() {
            if is_cancelled() {
                return Ok(false);
            }
            let measured = set.measure_targets(kind, precision, test).transpose();
            let point = measured.map(|report| {
                report.map(|report| TargetTradeOffPoint {
                    settings: *settings,
                    training_seconds: report.cost.fit_seconds,
                    report,
                })
            });
            point.into_iter().for_each(|point| on_point(kind, point));
        }
    }
    for &hidden in hidden.iter().filter(|_| !with_network.is_empty()) {
        let settings = RunSettings { hidden, ..*settings };
        let mut run = Run::on_sets(settings, split.clone(), test.clone())?;
        while run.step().is_none() {
            if is_cancelled() {
                return Ok(false);
            }
        }
        let training_seconds = run.trainers().iter().map(|start| start.elapsed().as_secs_f64()).sum();
        set.set_networks(Some(run.network()));
        for &kind in &with_network {
            for &precision in kind.precisions() {
                let measured = set.measure_targets(kind, precision, test).transpose();
                let point = measured.map(|report| {
                    report.map(|report| TargetTradeOffPoint {
                        settings,
                        report,
                        training_seconds,
                    })
                });
                point.into_iter().for_each(|point| on_point(kind, point));
            }
        }
    }
    Ok(true)
}
