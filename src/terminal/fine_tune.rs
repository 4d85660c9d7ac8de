use std::{io::Write, path::PathBuf};

use clap::Args;
use serde::Serialize;

use super::{
    failure::Failure,
    frames::FrameArguments,
    output::{print, print_object, progress_bar},
};
use decoupler_core::{
    dataset::{Dataset, Division, SplitBy, Stream},
    evaluation::{Errors, TestErrors, fine_tune, press_limits},
    network::Networks,
    training::StoppingRules,
};
use decoupler_files::export::{NetworkFile, check_writable, format_number, is_same};

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
    #[arg(long, value_name = "N", value_parser = super::parsers::count(1..=StoppingRules::MAX_EPOCHS))]
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
