use std::{
    io::{Write, stderr},
    path::PathBuf,
};

use clap::Args;
use decoupler_core::{
    dataset::{Dataset, Division, SplitBy, Stream},
    evaluation::{Channel, Errors, Problem, TestErrors, fine_tune, press_limits},
    network::{DecouplingNetwork, Networks},
    training::StoppingRules,
};
use decoupler_files::export::{NetworkFile, check_writable, format_number, is_same};
use serde::Serialize;

use super::{
    decode::FrameArguments,
    failure::Failure,
    output::{print, print_object, progress_bar},
};

/// Lines that are listed one by one; a damaged file may have thousands.
const MAX_LISTED: usize = 10;

/// Lines with readings or targets outside the range seen in training, where a network extrapolates.
pub(super) struct OutsideTraining<'a> {
    problem: &'a Problem,
    lines: usize,
    outside: usize,
    listed: Vec<String>,
}

/// Readings and targets of one line that are outside.
pub(super) struct LineOutside {
    /// Number of readings; `None` if their range in training is not known.
    pub(super) readings: Option<usize>,
    /// Number of targets.
    pub(super) targets: usize,
}

impl<'a> OutsideTraining<'a> {
    pub(super) fn new(problem: &'a Problem) -> Self {
        Self {
            problem,
            lines: 0,
            outside: 0,
            listed: Vec::new(),
        }
    }

    /// Counts what of a line is outside.
    pub(super) fn count(
        &mut self,
        network: &DecouplingNetwork,
        line: u64,
        readings: &[f64],
        answer: &[f64],
    ) -> LineOutside {
        let (inputs, outputs) = (network.inputs(), network.outputs());
        let range = inputs.range();
        let outside = || {
            range
                .into_iter()
                .flat_map(|range| range.outside(inputs.quantity(), readings))
        };
        let far_outside = || outputs.far_outside(answer);
        let of_line = LineOutside {
            readings: range.map(|_| outside().count()),
            targets: far_outside().count(),
        };
        self.lines += 1;
        if of_line.readings.unwrap_or(0) + of_line.targets == 0 {
            return of_line;
        }
        self.outside += 1;
        if self.listed.len() < MAX_LISTED {
            let first_reading = outside().next().zip(range).map(|(channel, range)| {
                let (name, extremes) = (&self.problem.inputs[channel], range.extremes(channel));
                described(name, readings[channel], extremes)
            });
            let first_target = || {
                let target = far_outside().next()?;
                let (name, extremes) = (&self.problem.targets[target], outputs.extremes(target));
                Some(described(name, answer[target], extremes))
            };
            if let Some(first) = first_reading.or_else(first_target) {
                self.listed.push(format!("line {line}: {first}"));
            }
        }
        of_line
    }

    /// Warns of the lines on standard error.
    pub(super) fn warn(&self) {
        let Self {
            lines, outside, listed, ..
        } = self;
        if *outside == 0 {
            return;
        }
        let mut stderr = stderr().lock();
        for line in listed {
            // There is no one to report to if this fails.
            let _ = writeln!(stderr, "warning: {line}");
        }
        let _ = writeln!(
            stderr,
            "warning: {outside} of {lines} lines are outside the range seen in training, where the network \
             extrapolates; the last two columns count such readings and targets: check these readings, or train with samples \
             that cover them"
        );
    }
}

fn described(channel: &Channel, value: f64, (low, high): (f64, f64)) -> String {
    let unit = channel.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
    format!(
        "{} is {value:.4e}{unit}; in training it was from {low:.4e} to {high:.4e}",
        channel.name
    )
}

/// Continue the training of a network on frames of known presses of the real sensor
///
/// The frames are given as for calibrate. A fifth of them, whole frames at random, is not trained on and measures the error
/// before and after; a fifth of the others selects the weights with the lowest error, which may be those of the network given.
#[derive(Args)]
pub(super) struct FineTune {
    /// Network saved by train --sensor
    #[arg(long, value_name = "FILE")]
    network: PathBuf,
    #[command(flatten)]
    frames: FrameArguments,
    /// Maximum number of epochs [default: those of the network's training]
    #[arg(long, value_name = "N", value_parser = super::arguments::count(1..=StoppingRules::MAX_EPOCHS))]
    epochs: Option<usize>,
    /// File for the fine-tuned network
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// The object printed by `fine-tune --json`.
#[derive(Serialize)]
struct Report {
    training_samples: usize,
    validation_samples: usize,
    test_samples: usize,
    /// Mean error of z on the test frames, in mm.
    z_mm_before: f64,
    z_mm_after: f64,
    /// The same on the simulated test set of the network, in mm.
    simulated_z_mm_before: f64,
    simulated_z_mm_after: f64,
}

impl FineTune {
    pub(super) fn run(self) -> Result<(), Failure> {
        check_writable(&self.out)?;
        if is_same(&self.network, &self.out) {
            let message = "--network and --out name the same file: give --out another name";
            return Err(Failure::Arguments(message.to_owned()));
        }
        let mut file = NetworkFile::load(&self.network)?;
        let no_array = || Failure::NoArray {
            path: self.network.clone(),
            reason: "frames of known presses need a model of the sensor; give a network of train --sensor",
        };
        let settings = file.settings.simulated().ok_or_else(no_array)?;
        let limits = press_limits(&settings.source);
        let frames = self.frames.read(&settings.source.sensor, limits, self.json)?;
        let read = settings.source.scene.rows.read(settings.source.sensor.scale.rows());
        let read = read.map_err(decoupler_core::dataset::SimulationError::from)?;
        let frames = frames
            .among_rows(&read)
            .map_err(|error| Failure::Arguments(error.to_string()))?;
        let division = Division {
            by: SplitBy::Group,
            test_fraction: 0.2,
            validation_fraction: 0.2,
        };
        let parts = division.divide(&frames, &mut settings.seed.rng(Stream::Split));
        let parts = parts.map_err(decoupler_core::evaluation::RunError::from)?;
        let (split, test) = (parts.split(&frames), parts.test_set(&frames));
        let mut training = settings.training;
        training.stopping.epochs = self.epochs.unwrap_or(training.stopping.epochs);
        let bar = progress_bar(self.json, 1, "fine-tuning {spinner}");
        let tuned = fine_tune(&file.network, &split, training, &|| false);
        bar.finish_and_clear();
        let tuned = tuned?.expect("nothing cancels it");
        let stroke_mm = settings.source.stroke_mm();
        let errors = |set: &Dataset, networks: &Networks| Errors::measure(set, &networks.decouple(set), stroke_mm);
        let simulated = settings.draw_test()?;
        let report = Report {
            training_samples: split.training.samples(),
            validation_samples: split.validation.as_ref().map_or(0, Dataset::samples),
            test_samples: test.samples(),
            z_mm_before: errors(&test, &file.network).z_mm,
            z_mm_after: errors(&test, &tuned).z_mm,
            simulated_z_mm_before: file.scores.network.nodes().map_or(f64::NAN, |errors| errors.z_mm),
            simulated_z_mm_after: errors(&simulated, &tuned).z_mm,
        };
        // Its errors stay those on the simulated test set, next to which the baselines stand.
        file.scores.network = TestErrors::Nodes(errors(&simulated, &tuned));
        file.network = tuned;
        file.save(&self.out)?;
        if self.json {
            return print_object(&report);
        }
        print(|out| {
            writeln!(
                out,
                "{} row-wires trained, {} for validation, {} for the test",
                report.training_samples, report.validation_samples, report.test_samples
            )?;
            let mm = format_number;
            writeln!(
                out,
                "Mean error of z on the test frames: {} mm before, {} mm after",
                mm(report.z_mm_before),
                mm(report.z_mm_after)
            )?;
            writeln!(
                out,
                "Mean error of z on the simulated test set: {} mm before, {} mm after",
                mm(report.simulated_z_mm_before),
                mm(report.simulated_z_mm_after)
            )?;
            if report.z_mm_after >= report.z_mm_before {
                writeln!(
                    out,
                    "Warning: the frames did not lower the error on the test frames: keep the network as it was, or give more \
                     frames"
                )?;
            }
            Ok(())
        })
    }
}
