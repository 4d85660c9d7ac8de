use clap::Args;

use super::{
    announcement::announce_workload,
    failure::Failure,
    import_arguments::ImportArguments,
    interruption::Graceful,
    output::progress_bar,
    parsers::{count, number, seed},
    scene_arguments::SceneArguments,
    trade_report::{Limits, print_json, print_text},
    training_arguments::method,
};
use crate::{
    dataset::{LARGEST_SAMPLES, Seed},
    evaluation::{Preset, SimulatedSettings, TradeOffLevel, TradeOffPoint, Workload, measure_trade_off},
    network::LARGEST_HIDDEN,
    sensor::{ArrayScale, SensorModel},
    training::{Method, StoppingRules},
};

/// Measure speed against accuracy of every decoder
///
/// Trains networks of both presets with several numbers of hidden nodes, at several levels of noise, and prints for each
/// decoder its error, its time for a frame (median of many, one thread) and its training time, with the choices that no
/// other beats, and the command for each choice asked for. With --data it does so on samples of a real sensor from files, for
/// the decoders that need no model of the sensor.
#[derive(Args)]
#[command(allow_negative_numbers = true)]
pub(super) struct Trade {
    #[command(flatten)]
    pub(super) scene: SceneArguments,
    #[command(flatten)]
    pub(super) import: ImportArguments,
    /// Array scale M1xM2_M3xM4: rows x nodes on each, nodes on each column x columns [default: 10x10_5x30]
    #[arg(long, value_name = "SCALE")]
    pub(super) array: Option<ArrayScale>,
    /// Hidden nodes of the networks
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "6,12", value_parser = count(1..=LARGEST_HIDDEN))]
    pub(super) hidden: Vec<usize>,
    /// Training methods of the networks, of own data [default: br]; a simulated sensor has those of its presets
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = method())]
    pub(super) method: Vec<Method>,
    /// Maximum number of epochs [default: those of the preset; of own data 300]
    #[arg(long, value_name = "N", value_parser = count(1..=StoppingRules::MOST_EPOCHS))]
    pub(super) epochs: Option<usize>,
    /// Training samples [default: those of the preset]
    #[arg(long, value_name = "N", value_parser = count(1..=LARGEST_SAMPLES))]
    pub(super) samples: Option<usize>,
    /// Test samples, on which the errors are measured [default: 100]
    #[arg(long, value_name = "N", value_parser = count(1..=LARGEST_SAMPLES))]
    pub(super) test_samples: Option<usize>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 0, value_parser = seed)]
    pub(super) seed: u64,
    /// Also print the fastest decoder whose error is at most this many percent: of z, or of own data's ranges
    #[arg(long, value_name = "PERCENT", value_parser = number)]
    under_percent: Option<f64>,
    /// Also print the most accurate decoder that takes at most this many microseconds for a frame
    #[arg(long, value_name = "US", value_parser = number)]
    under_us: Option<f64>,
    /// Print one JSON object instead of text and progress
    #[arg(long)]
    pub(super) json: bool,
}

impl Trade {
    pub(super) fn run(self) -> Result<(), Failure> {
        if self.import.is_given() {
            return self.run_measured();
        }
        self.import.check_unused()?;
        if !self.method.is_empty() {
            let message = "--method: the presets name the methods of a simulated sensor; leave it out, or give --data";
            return Err(Failure::Arguments(message.to_owned()));
        }
        let noises = match &self.scene.noise[..] {
            [] => vec![0.0, 1e-4, 1e-3, 1e-2],
            given => given.to_vec(),
        };
        let presets = match self.scene.preset {
            Some(preset) => vec![preset],
            None => Preset::ALL.to_vec(),
        };
        let decoders = self.scene.decoders();
        for &preset in &presets {
            let settings = self.settings(preset, noises[0])?;
            announce_workload(&Workload::of_trade_off(&settings, &self.hidden, &decoders)?)?;
        }
        let bar = progress_bar(
            self.json,
            noises.len() * presets.len(),
            "{bar:30} {pos} of {len}, {msg}, {elapsed}",
        );
        let graceful = Graceful::begin();
        let (levels, end) = measure_levels(&noises, &presets, |noise, preset, points| {
            let settings = self.settings(preset, noise)?;
            let is_cancelled = || graceful.is_end_requested();
            let is_whole = measure_trade_off(preset, &settings, &self.hidden, &decoders, is_cancelled, |point| {
                bar.set_message(format!("{preset}, {}", point.report.name()));
                points.push(point);
            })?;
            bar.inc(1);
            Ok(is_whole)
        });
        bar.finish_and_clear();
        drop(graceful);
        if end.is_ok() || !levels.is_empty() {
            let print = if self.json { print_json } else { print_text };
            print(self.array(), &levels, self.limits())?;
        }
        if end? {
            return Ok(());
        }
        let done = levels.iter().map(|level| level.points.len()).sum();
        Err(Failure::InterruptedTrade { done })
    }

    pub(super) fn limits(&self) -> Limits {
        Limits {
            percent: self.under_percent,
            microseconds: self.under_us,
        }
    }

    fn array(&self) -> ArrayScale {
        self.array.unwrap_or_default()
    }

    fn settings(&self, preset: Preset, noise: f64) -> Result<SimulatedSettings, Failure> {
        let mut settings = self.scene.settings_at(preset, Some(noise))?;
        settings.source.sensor = SensorModel::new(self.array());
        settings.source.samples = self.samples.unwrap_or(settings.source.samples);
        settings.source.test_samples = self.test_samples.unwrap_or(settings.source.test_samples);
        settings.seed = Seed(self.seed);
        let stopping = &mut settings.training.stopping;
        stopping.epochs = self.epochs.unwrap_or(stopping.epochs);
        Ok(settings)
    }
}

/// Measures every preset at every level of noise, up to the first that fails. Returns the levels that have points, and
/// whether all were measured to their end.
fn measure_levels(
    noises: &[f64],
    presets: &[Preset],
    mut measure: impl FnMut(f64, Preset, &mut Vec<TradeOffPoint>) -> Result<bool, Failure>,
) -> (Vec<TradeOffLevel>, Result<bool, Failure>) {
    let mut levels: Vec<TradeOffLevel> = Vec::new();
    let mut is_whole = true;
    for &noise in noises {
        let mut points = Vec::new();
        let measured = presets.iter().try_for_each(|&preset| {
            is_whole &= measure(noise, preset, &mut points).map_err(|cause| (preset, Box::new(cause)))?;
            Ok(())
        });
        if !points.is_empty() {
            levels.push(TradeOffLevel { noise, points });
        }
        match measured {
            Ok(()) => {}
            // Nothing is lost that would need words.
            Err((_, cause)) if levels.is_empty() => return (levels, Err(*cause)),
            Err((preset, cause)) => {
                let place = format!("noise {noise}, preset {preset}");
                return (levels, Err(Failure::TradeOff { place, cause }));
            }
        }
    }
    (levels, Ok(is_whole))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decoupling::DecoderKind;

    #[test]
    fn what_was_measured_before_a_failure_is_kept_and_the_failure_names_its_place() {
        let mut settings = SimulatedSettings::default();
        settings.source.sensor.scale = "1x1_1x3".parse().unwrap();
        (settings.source.samples, settings.source.test_samples) = (8, 4);
        let noises = [0.0, 0.01, 0.1];
        let measure_until = |fails_at: (f64, Preset)| {
            measure_levels(&noises, &Preset::ALL, |noise, preset, points| {
                if (noise, preset) == fails_at {
                    return Err(Failure::Arguments("too wide".to_owned()));
                }
                let keep = |point| points.push(point);
                Ok(measure_trade_off(
                    preset,
                    &settings,
                    &[],
                    &[DecoderKind::Mean],
                    || false,
                    keep,
                )?)
            })
        };
        for (place, preset) in Preset::ALL.into_iter().enumerate() {
            let (levels, end) = measure_until((0.01, preset));
            let points: Vec<_> = levels.iter().map(|level| (level.noise, level.points.len())).collect();
            assert_eq!(points, [(0.0, 2), (0.01, place)][..1 + place]);
            let failure = end.unwrap_err();
            assert_eq!(failure.status(), 1);
            let message = failure.to_string();
            let expected = format!("noise 0.01, preset {preset}: too wide");
            assert!(message.starts_with(&expected), "{message}");
        }
        let (levels, end) = measure_until((0.0, Preset::ALL[0]));
        assert!(levels.is_empty());
        assert_eq!(end.unwrap_err().status(), 2, "an argument is wrong and nothing is lost");
        let (levels, end) = measure_until((1.0, Preset::ALL[0]));
        assert_eq!((levels.len(), end.unwrap()), (3, true));
    }
}
