use super::{DecoderReport, DecoderSet, Errors, Preset, Run, RunError, RunSets, RunSettings, preparation::reference};
use crate::{decoupling::DecoderKind, training::Method};

/// One decoder on the trade-off between speed and accuracy.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOffPoint {
    /// Preset from which the settings were derived, if they were.
    pub preset: Option<Preset>,
    /// Settings of the run; hidden nodes and method matter only if the decoder has a network.
    pub settings: RunSettings,
    /// Decoder, its errors, and its time per frame.
    pub report: DecoderReport,
    /// Training or fitting time in seconds, summed over all rows and starts.
    pub training_seconds: f64,
    /// Errors of the Bayesian reference in this scene; `None` for recordings and where a posterior did not converge.
    pub reference: Option<Errors>,
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

    /// Its error in proportion to the reference: [`Errors::times`]; `None` without a reference.
    pub fn to_reference(&self) -> Option<f64> {
        self.report.errors.nodes()?.times(self.reference.as_ref()?)
    }

    /// Returns decoding time in microseconds and the error in percent.
    pub fn decoding(&self) -> (f64, f64) {
        (self.report.cost.frame_us, self.percent())
    }

    /// Returns training time in seconds and the error in percent.
    pub fn training(&self) -> (f64, f64) {
        (self.training_seconds, self.percent())
    }
}

/// Measures every decoder of `decoders` on the test samples of `sets`, networks with each number of `hidden` nodes, and passes
/// each point to `on_point` as soon as it is measured, or why a decoder cannot be used with these samples, together with the
/// run whose networks the decoder has, if it needs any. Decoders that solve
/// the equations of a sensor are left out where there is no model of one. Training uses all threads; decoding is timed on one.
/// Returns `false` if cancelled before the end.
///
/// # Errors
/// If the settings are invalid, or a network cannot be trained with them on these samples.
pub fn measure_trade_off(
    settings: &RunSettings,
    sets: &RunSets,
    hidden: &[usize],
    decoders: &[DecoderKind],
    is_cancelled: impl Fn() -> bool,
    mut on_point: impl FnMut(DecoderKind, Result<TradeOffPoint, RunError>, Option<&Run>),
) -> Result<bool, RunError> {
    let mut set = DecoderSet::on_set(*settings, sets.split.training.clone(), None);
    let reference = match settings.simulated() {
        Some(simulated) => reference(&simulated, &sets.test)?.ok(),
        None => None,
    };
    let offered = decoders
        .iter()
        .filter(|kind| settings.source.simulation().is_some() || !kind.needs_sensor());
    let (with_network, without): (Vec<DecoderKind>, Vec<DecoderKind>) = offered.partition(|kind| kind.needs_network());
    let point = |settings: RunSettings, report: DecoderReport, training_seconds| TradeOffPoint {
        preset: None,
        settings,
        report,
        training_seconds,
        reference,
    };
    for kind in without {
        for &precision in kind.precisions() {
            if is_cancelled() {
                return Ok(false);
            }
            if let Some(measured) = set.measure(kind, precision, &sets.test).transpose() {
                let of_report = |report: DecoderReport| {
                    let fit_seconds = report.cost.fit_seconds;
                    point(*settings, report, fit_seconds)
                };
                on_point(kind, measured.map(of_report), None);
            }
        }
    }
    for &hidden in hidden.iter().filter(|_| !with_network.is_empty()) {
        let settings = RunSettings { hidden, ..*settings };
        let Some(mut run) = Run::on_unless(settings, sets.clone(), &is_cancelled)? else {
            return Ok(false);
        };
        while run.step().is_none() {
            if is_cancelled() {
                return Ok(false);
            }
        }
        let training_seconds = run.trainers().iter().map(|start| start.elapsed().as_secs_f64()).sum();
        set.set_networks(Some(run.network()));
        for &kind in &with_network {
            for &precision in kind.precisions() {
                if let Some(measured) = set.measure(kind, precision, &sets.test).transpose() {
                    let measured = measured.map(|report| point(settings, report, training_seconds));
                    on_point(kind, measured, Some(&run));
                }
            }
        }
    }
    Ok(true)
}

/// Marks the points (cost, error) on the Pareto front: those that no other beats in one and equals or beats in the
/// other.
pub(crate) fn pareto_front(points: &[(f64, f64)]) -> Vec<bool> {
    let is_beaten = |&(cost, error): &(f64, f64)| {
        let beats = |other: &(f64, f64)| other.0 <= cost && other.1 <= error && (other.0 < cost || other.1 < error);
        points.iter().any(beats)
    };
    points.iter().map(|point| !is_beaten(point)).collect()
}

/// Returns the point with the least decoding time among those with an error of at most `percent`.
pub fn fastest_under(points: &[TradeOffPoint], percent: f64) -> Option<&TradeOffPoint> {
    let good = points.iter().filter(|point| point.percent() <= percent);
    good.min_by(|a, b| a.decoding().0.total_cmp(&b.decoding().0))
}

/// Returns the point with the least error among those that decode a frame within `microseconds`.
pub fn most_accurate_under(points: &[TradeOffPoint], microseconds: f64) -> Option<&TradeOffPoint> {
    let quick = points.iter().filter(|point| point.report.cost.frame_us <= microseconds);
    quick.min_by(|a, b| a.percent().total_cmp(&b.percent()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_is_what_no_other_beats() {
        let points = [(1.0, 5.0), (2.0, 2.0), (3.0, 2.0), (4.0, 1.0), (5.0, 3.0), (1.0, 6.0)];
        assert_eq!(pareto_front(&points), [true, true, false, true, false, false]);
        let twins = [(1.0, 1.0), (1.0, 1.0)];
        assert_eq!(pareto_front(&twins), [true, true], "neither beats the other");
        assert!(pareto_front(&[]).is_empty());
    }
}
