use std::time::Duration;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use super::{
    failure::Failure,
    interruption::Graceful,
    parsers::{count, number, seed},
    scene_arguments::SceneArguments,
    trade_report::{Limits, print_json, print_text},
};
use crate::{
    dataset::{LARGEST_SAMPLES, Seed},
    evaluation::{Preset, SimulatedSettings, TradeLevel, measure_trade},
    network::LARGEST_HIDDEN,
    sensor::{ArrayScale, SensorModel},
    training::StoppingRules,
};

/// Measure speed against accuracy of every decoder
///
/// Trains networks of both presets with several numbers of hidden nodes, at several levels of noise, and prints for each
/// decoder its error, its time for a frame (median of many, one thread) and its training time, with the choices that no
/// other beats, and the command for each choice asked for.
#[derive(Args)]
#[command(allow_negative_numbers = true)]
pub(super) struct Trade {
    #[command(flatten)]
    scene: SceneArguments,
    /// Array scale M1xM2_M3xM4: rows x nodes on each, nodes on each column x columns
    #[arg(long, value_name = "SCALE", default_value = "10x10_5x30")]
    array: ArrayScale,
    /// Hidden nodes of the networks
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "6,12", value_parser = count(1..=LARGEST_HIDDEN))]
    hidden: Vec<usize>,
    /// Maximum number of epochs [default: those of the preset]
    #[arg(long, value_name = "N", value_parser = count(1..=StoppingRules::MOST_EPOCHS))]
    epochs: Option<usize>,
    /// Training samples [default: those of the preset]
    #[arg(long, value_name = "N", value_parser = count(1..=LARGEST_SAMPLES))]
    samples: Option<usize>,
    /// Test samples, on which the errors are measured
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = count(1..=LARGEST_SAMPLES))]
    test_samples: usize,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 0, value_parser = seed)]
    seed: u64,
    /// Also tell the fastest decoder whose Z error is at most this many percent
    #[arg(long, value_name = "PERCENT", value_parser = number)]
    under_percent: Option<f64>,
    /// Also tell the most accurate decoder that takes at most this many microseconds for a frame
    #[arg(long, value_name = "US", value_parser = number)]
    under_us: Option<f64>,
    /// Print one JSON object instead of text and progress
    #[arg(long)]
    json: bool,
}

impl Trade {
    pub(super) fn run(self) -> Result<(), Failure> {
        let noises = match &self.scene.noise[..] {
            [] => vec![0.0, 1e-4, 1e-3, 1e-2],
            given => given.to_vec(),
        };
        let presets = match self.scene.preset {
            Some(preset) => vec![preset],
            None => Preset::ALL.to_vec(),
        };
        let decoders = self.scene.decoders();
        let bar = self.progress_bar(noises.len() * presets.len());
        let graceful = Graceful::begin();
        let mut levels = Vec::new();
        let mut is_whole = true;
        for &noise in &noises {
            let mut points = Vec::new();
            for &preset in &presets {
                let settings = self.settings(preset, noise)?;
                let is_cancelled = || graceful.is_end_requested();
                is_whole &= measure_trade(preset, &settings, &self.hidden, &decoders, is_cancelled, |point| {
                    bar.set_message(format!("{preset}, {}", point.report.name()));
                    points.push(point);
                })?;
                bar.inc(1);
            }
            levels.push(TradeLevel { noise, points });
        }
        bar.finish_and_clear();
        drop(graceful);
        let limits = Limits {
            percent: self.under_percent,
            microseconds: self.under_us,
        };
        if self.json {
            print_json(self.array, &levels, limits)?;
        } else {
            print_text(self.array, &levels, limits)?;
        }
        if is_whole {
            return Ok(());
        }
        let done = levels.iter().map(|level| level.points.len()).sum();
        Err(Failure::InterruptedTrade { done })
    }

    fn settings(&self, preset: Preset, noise: f64) -> Result<SimulatedSettings, Failure> {
        let mut settings = self.scene.settings_at(preset, Some(noise))?;
        settings.source.sensor = SensorModel::new(self.array);
        settings.source.samples = self.samples.unwrap_or(settings.source.samples);
        settings.source.test_samples = self.test_samples;
        settings.seed = Seed(self.seed);
        let stopping = &mut settings.training.stopping;
        stopping.epochs = self.epochs.unwrap_or(stopping.epochs);
        Ok(settings)
    }

    fn progress_bar(&self, parts: usize) -> ProgressBar {
        if self.json {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(parts as u64);
        let style = ProgressStyle::with_template("{bar:30} {pos} of {len}, {msg}, {elapsed}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    }
}
