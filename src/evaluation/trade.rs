use super::{
    DecoderReport, DecoderSet, Errors, Preset, Run, RunError, SimulatedSettings, Workload, preparation::reference,
};
use crate::decoupling::{DecoderKind, Precision};

/// One decoder on the trade-off between speed and accuracy.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOffPoint {
    /// Preset from which the settings were derived.
    pub preset: Preset,
    /// Settings of the run; the hidden nodes matter only if the decoder has a network.
    pub settings: SimulatedSettings,
    /// Decoder, its errors, and its time per frame.
    pub report: DecoderReport,
    /// Training or fitting time in seconds, summed over all rows and starts.
    pub training_seconds: f64,
    /// Errors of the Bayesian reference in this scene; `None` where a posterior did not converge.
    pub reference: Option<Errors>,
}

impl TradeOffPoint {
    /// Returns AveZerr in percent; infinite if undefined.
    pub fn z_percent(&self) -> f64 {
        self.report.errors.z_percent.unwrap_or(f64::INFINITY)
    }

    /// Number of hidden nodes, if the decoder has a network.
    pub fn hidden(&self) -> Option<usize> {
        self.report.kind.needs_network().then_some(self.settings.hidden)
    }

    /// Its error in proportion to the reference: [`Errors::times`]; `None` without a reference.
    pub fn to_reference(&self) -> Option<f64> {
        self.report.errors.times(self.reference.as_ref()?)
    }

    /// Returns decoding time in microseconds and AveZerr in percent.
    pub fn decoding(&self) -> (f64, f64) {
        (self.report.cost.frame_us, self.z_percent())
    }

    /// Returns training time in seconds and AveZerr in percent.
    pub fn training(&self) -> (f64, f64) {
        (self.training_seconds, self.z_percent())
    }
}

/// Measures every decoder of `decoders` in the scene of `settings`, networks with each number of `hidden` nodes, and
/// passes each point to `on_point` as soon as it is measured. Training uses all threads; decoding is timed on one.
/// Returns `false` if cancelled before the end.
///
/// # Errors
/// If the settings are invalid.
pub fn measure_trade_off(
    preset: Preset,
    settings: &SimulatedSettings,
    hidden: &[usize],
    decoders: &[DecoderKind],
    is_cancelled: impl Fn() -> bool,
    mut on_point: impl FnMut(TradeOffPoint),
) -> Result<bool, RunError> {
    Workload::of_trade_off(settings, hidden, decoders)?.check_memory()?;
    let mut set = DecoderSet::new(settings, None)?;
    let test = settings.draw_test()?;
    let reference = reference(settings, &test)?.ok();
    let (with_network, without): (Vec<DecoderKind>, Vec<DecoderKind>) =
        decoders.iter().partition(|kind| kind.needs_network());
    for kind in without {
        if is_cancelled() {
            return Ok(false);
        }
        let report = set.measure(kind, Precision::Double, &test)?;
        let report = report.expect("it needs no network");
        on_point(TradeOffPoint {
            preset,
            settings: *settings,
            training_seconds: report.cost.fit_seconds,
            report,
            reference,
        });
    }
    if with_network.is_empty() {
        return Ok(true);
    }
    for &hidden in hidden {
        let settings = SimulatedSettings { hidden, ..*settings };
        let Some(mut run) = Run::prepare_unless(settings, &is_cancelled)? else {
            return Ok(false);
        };
        while run.step().is_none() {
            if is_cancelled() {
                return Ok(false);
            }
        }
        set.set_networks(Some(run.network()));
        for &kind in &with_network {
            for &precision in kind.precisions() {
                let report = set.measure(kind, precision, &test)?.expect("it has its network");
                on_point(TradeOffPoint {
                    preset,
                    settings,
                    report,
                    training_seconds: run.trainers().iter().map(|start| start.elapsed().as_secs_f64()).sum(),
                    reference,
                });
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
    let good = points.iter().filter(|point| point.z_percent() <= percent);
    good.min_by(|a, b| a.decoding().0.total_cmp(&b.decoding().0))
}

/// Returns the point with the least error among those that decode a frame within `microseconds`.
pub fn most_accurate_under(points: &[TradeOffPoint], microseconds: f64) -> Option<&TradeOffPoint> {
    let quick = points.iter().filter(|point| point.report.cost.frame_us <= microseconds);
    quick.min_by(|a, b| a.z_percent().total_cmp(&b.z_percent()))
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
