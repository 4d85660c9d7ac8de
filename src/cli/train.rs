use std::{path::PathBuf, time::Duration};

use clap::{
    Args,
    builder::{PossibleValuesParser, TypedValueParser},
};
use indicatif::{ProgressBar, ProgressStyle};

use super::{
    arguments::{count, seed},
    failure::Failure,
    train_report::{print_json, print_text},
};
use crate::{
    dataset::{LARGEST_SAMPLES, Seed},
    evaluation::{Run, RunSettings},
    export::{NetworkFile, check_writable, format_number},
    network::LARGEST_HIDDEN,
    sensor::{ArrayScale, SensorModel},
    training::{Method, StoppingRules, TrainingSettings},
};

/// Train a network and print what it is worth
///
/// Draws samples of the array, trains, and compares the network on its test samples with the mean of the training
/// set, with the best linear map, and with the published figures where there are any.
#[derive(Args)]
#[command(allow_negative_numbers = true)]
pub(super) struct Train {
    /// Array scale M1xM2_M3xM4: rows x nodes on each, nodes on each column x columns
    #[arg(long, value_name = "SCALE", default_value = "10x10_5x30")]
    array: ArrayScale,
    /// Hidden nodes
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = count(1..=LARGEST_HIDDEN))]
    hidden: usize,
    /// Levenberg-Marquardt (lm) or gradient descent with momentum (gdm)
    #[arg(long, default_value = "lm", value_parser = method())]
    method: Method,
    /// Most epochs
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = count(1..=StoppingRules::MOST_EPOCHS))]
    epochs: usize,
    /// Training samples; this and the next two are rounded up to whole snapshots of all rows
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = count(1..=LARGEST_SAMPLES))]
    samples: usize,
    /// Samples for the errors that are printed
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = count(1..=LARGEST_SAMPLES))]
    test_samples: usize,
    /// Samples that choose the best weights and end the training; 0 for none
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = count(0..=LARGEST_SAMPLES))]
    validation_samples: usize,
    /// From which everything random follows
    #[arg(long, default_value_t = 0, value_parser = seed)]
    seed: u64,
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment, help = settings_help())]
    set: Vec<(String, f64)>,
    /// File for the network, to be opened in the window or given to decode
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object instead of text and progress
    #[arg(long)]
    json: bool,
}

impl Train {
    pub(super) fn run(self) -> Result<(), Failure> {
        let settings = self.settings()?;
        if let Some(path) = &self.out {
            check_writable(path)?;
        }
        let mut run = Run::prepare(settings)?;
        train(&mut run, !self.json);
        let file = NetworkFile::from_run(&run);
        if let Some(path) = &self.out {
            file.save(path)?;
        }
        if self.json {
            print_json(&file)
        } else {
            print_text(&file)
        }
    }

    fn settings(&self) -> Result<RunSettings, Failure> {
        let mut method = self.method;
        for (name, value) in &self.set {
            let mut settings = method.settings();
            let names = settings.iter().map(|setting| dashed(setting.name)).collect::<Vec<_>>();
            match settings.iter_mut().find(|setting| dashed(setting.name) == *name) {
                Some(setting) => *setting.value = *value,
                None => {
                    let (method, names) = (self.method.short_name(), names.join(", "));
                    let message = format!("--set {name}: {method} has no such setting; it has {names}");
                    return Err(Failure::Arguments(message));
                }
            }
        }
        let training = TrainingSettings {
            method,
            stopping: StoppingRules {
                epochs: self.epochs,
                ..StoppingRules::default()
            },
        };
        training.check()?;
        Ok(RunSettings {
            sensor: SensorModel::new(self.array),
            samples: self.samples,
            validation_samples: self.validation_samples,
            test_samples: self.test_samples,
            hidden: self.hidden,
            training,
            seed: Seed(self.seed),
            ..RunSettings::default()
        })
    }
}

/// Steps to the end; the bar shows itself only where standard error is a terminal.
fn train(run: &mut Run, with_progress: bool) {
    let epochs = run.settings().training.stopping.epochs;
    let bar = if with_progress {
        ProgressBar::new(epochs as u64)
    } else {
        ProgressBar::hidden()
    };
    let style = ProgressStyle::with_template("{bar:30} epoch {pos} of {len}, {msg}, at most {eta} left");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(200));
    while run.step().is_none() {
        let latest = run.leader().latest();
        bar.set_position(latest.epoch as u64);
        if !bar.is_hidden() {
            bar.set_message(format!("mse {}", format_number(latest.training_mse)));
        }
    }
    bar.finish_and_clear();
}

fn method() -> impl TypedValueParser<Value = Method> {
    let names = Method::all().map(|method| method.short_name());
    PossibleValuesParser::new(names).map(|name| {
        let mut methods = Method::all().into_iter();
        methods.find(|method| method.short_name() == name).unwrap_or_default()
    })
}

fn assignment(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("write NAME=VALUE, for example mu=0.01")?;
    let value = value.trim().parse().map_err(|_| format!("'{value}' is not a number"))?;
    Ok((name.trim().to_owned(), value))
}

/// How a setting is named in the terminal.
fn dashed(name: &str) -> String {
    name.replace(' ', "-")
}

fn settings_help() -> String {
    let of = |mut method: Method| {
        let settings = method.settings();
        let list = settings
            .iter()
            .map(|setting| format!("{} (default {})", dashed(setting.name), setting.default));
        let list = list.collect::<Vec<_>>().join(", ");
        format!("{} has {list}", method.short_name())
    };
    let methods = Method::all().map(of).join("; ");
    format!("Change a setting of the method, as often as you like: {methods}")
}
