//! Decoding of files, and frames of known presses, in the terminal.

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

use clap::Args;
use decoupler_core::{
    calibration::check_presses,
    dataset::{Dataset, Division, SplitBy},
    evaluation::{Errors, TestErrors, fine_tune},
    job::Job,
    network::{DecouplingNetwork, Networks},
    problem::{Channel, Problem},
    scene::Scene,
    sensor::SensorModel,
    text::{counted, inert},
    training::StoppingRules,
};
use decoupler_files::{
    export::{AtomicFile, NetworkFile, WriteError, format_number, is_same, write_csv_row, write_decoded_header},
    import::KeptCell,
    live::Answer,
    machine::memory_budget,
};
use glam::DVec3;
use ndarray::Array2;
use serde_json::json;

use super::{
    failure::Failure,
    follow::{Answers, Follow, Form},
    import_arguments::ImportArguments,
    intervals::DriftWarnings,
    output::{check_output, input, output, print, progress_bar, read, warn},
    samples::{with_bar, working_folder},
};

/// Decouple the resistances of a CSV file with a saved network
///
/// The input has columns named r_1, r_2, … (one for each column-wire, in ohm), in any order and among others, or exactly
/// as many unnamed columns. Each line is one row-wire. For networks of known rows, a column named row has the row number
/// from 1; without it, lines form whole snapshots from the first row to the last. For each line, the output has x_1, y_1,
/// z_1, x_2, … in mm; readings_outside, the number of readings outside the training range by more than a tenth of the
/// range; and coordinates_outside, the number of coordinates outside by more than the whole range. A warning lists such
/// lines. With --follow, frames are decoded as they arrive, also from standard input, a serial port or a socket. The
/// network of a recording (train --data) reads columns named like its inputs (or as many unnamed columns) from CSV, .npy,
/// .npz or .mat, and writes its targets under their names, after the time, group and row columns of the input. The column
/// TARGET_half_width_90 has the half-width of the 90 % prediction interval of this answer: the true value is within TARGET ±
/// this half-width with a probability of 90 %, as long as the readings are like those of the training. A warning lists the
/// lines in which they are not: in several consecutive blocks of readings, the means, the spread or the relation of the inputs
/// are beyond those of all training blocks; with --follow, a note says when they are back. A block is at least five times as
/// long as neighbouring readings are correlated. In readings like those of the training, a false warning occurs on average at
/// most once in 10 000 blocks. A note gives the reason if readings are not monitored, such as too few independent training
/// readings (50 to 100 are needed).
#[derive(Args)]
pub(super) struct Decode {
    /// Network saved by train --out or by the window
    #[arg(long, value_name = "FILE", value_parser = input)]
    network: PathBuf,
    /// File of readings, for an array a CSV file of resistances in ohm; - is standard input. With --follow also
    /// DEVICE:BAUD or tcp:HOST:PORT, and - is the default
    #[arg(long, value_name = "FILE", required_unless_present = "follow")]
    data: Option<PathBuf>,
    /// CSV file to write, for an array with coordinates in mm; - is standard output
    #[arg(short, long, value_name = "FILE", required_unless_present = "follow", value_parser = output)]
    out: Option<PathBuf>,
    #[command(flatten)]
    follow: Follow,
}

impl Decode {
    pub(super) fn run(self) -> Result<(), Failure> {
        let standard_input = PathBuf::from("-");
        let (Some(data), Some(out), false) = (&self.data, &self.out, self.follow.follow) else {
            let file = NetworkFile::load(&self.network)?;
            return self.follow.run(self.data.as_ref().unwrap_or(&standard_input), file);
        };
        let data = input(&data.to_string_lossy()).unwrap_or_else(|_| data.clone());
        for (name, path) in [("data", &data), ("network", &self.network)] {
            if is_same(path, out) {
                let message = format!("--{name} and --out name the same file: give the output another name");
                return Err(Failure::Arguments(message));
            }
        }
        check_output("--out", out)?;
        let (lines, lines_outside) = decode_file(&NetworkFile::load(&self.network)?, &data, out)?;
        print(|| json!({"lines": lines, "lines_outside": lines_outside}), |_| Ok(()))
    }
}

/// Decodes the file `input` into the file `output`; returns the number of lines, and of those outside the training range.
pub(crate) fn decode_file(file: &NetworkFile, input: &Path, output: &Path) -> Result<(usize, usize), Failure> {
    let refused = |source| WriteError::io(output, source);
    let mut answers = Answers::new(file, Form::Csv, AtomicFile::create(output)?);
    let mut answer = Answer::default();
    let mut drift = DriftWarnings::new(file);
    let mut decoder = file.decoder();
    read(file, input, &mut |block| {
        let decoded = decoder.answers(&block.row_indices, block.values.view());
        for (row, (&line, &first_row)) in block.lines.iter().zip(&block.row_indices).enumerate() {
            let [readings, values] = [block.values.row(row), decoded.row(row)];
            if values.iter().any(|value| !value.is_finite()) {
                return Err(Failure::at(
                    input,
                    format_args!(
                        "line {line}: the resistances are so far outside the training range that the network's output is not a \
                         finite number; check them"
                    ),
                ));
            }
            let [readings, values] =
                [&readings, &values].map(|row| row.to_slice().expect("a row of a standard array is contiguous"));
            drift.take(line, readings);
            (answer.line, answer.first_row) = (line, Some(first_row));
            readings.clone_into(&mut answer.readings);
            values.clone_into(&mut answer.values);
            answer.kept.resize_with(block.kept.len(), KeptCell::default);
            for (cell, (title, texts)) in answer.kept.iter_mut().zip(&block.kept) {
                cell.title.clone_from(title);
                cell.text.clone_from(&texts[row]);
            }
            answers.write(&answer).map_err(refused)?;
        }
        Ok(())
    })?;
    answers.output.commit()?;
    let outside = answers.outside;
    outside.warn();
    drift.end();
    Ok((outside.lines, outside.outside))
}

/// Fills `values` with the answers, each followed by the half-width of its interval if the target has one.
pub(super) fn with_half_widths(file: &NetworkFile, answers: &[f64], values: &mut Vec<f64>) {
    let targets = file.problem.targets.len();
    values.clear();
    for (index, &answer) in answers.iter().enumerate() {
        let intervals = file.intervals.as_ref();
        values.push(answer);
        values.extend(intervals.and_then(|intervals| intervals.half_width(index % targets, answer)));
    }
}

// Readings of a real sensor with known presses.
#[derive(Args)]
pub(super) struct FrameArguments {
    #[command(flatten)]
    import: ImportArguments,
    /// Columns with the resistances of a row-wire in ohm, one per column-wire
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    inputs: Vec<String>,
    /// Columns with the depth of each node of the row-wire in mm, as an alternative to --targets with the coordinates of
    /// its nodes (x, y, z of each) in the frame of the nominal sensor
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',', group = "roles")]
    depths: Vec<String>,
}

impl FrameArguments {
    /// Reads the frames of presses within the limits of `scene`, if there is one: a sample is a row-wire, and its targets are the coordinates of its
    /// nodes in the frame of `sensor`.
    pub(super) fn read(&self, sensor: &SensorModel, scene: Option<&Scene>) -> Result<Dataset, Failure> {
        let has_depths = !self.depths.is_empty();
        self.import.refuse_division(|argument| {
            format!(
                "{argument}: calibrate fits all frames, and fine-tune holds out a fifth of them by itself; leave it out"
            )
        })?;
        let plan = if has_depths {
            self.import.plan_of(&self.inputs, &self.depths)?
        } else {
            self.import.plan(&self.inputs)?
        };
        let Some(column) = &plan.import.row_wire else {
            let message = "--row-wire: name the column with the number of the row-wire of each line, from 1";
            return Err(Failure::Arguments(message.to_owned()));
        };
        let recording = with_bar(|watch| plan.recording(working_folder(), watch))?;
        let (set, lines, scale) = (recording.set.clone(), &recording.lines, sensor.scale);
        let (argument, targets) = if has_depths {
            ("--depths", scale.nodes_per_row())
        } else {
            ("--targets", scale.coordinates_per_row())
        };
        let counts = [
            ("--inputs", set.channels(), scale.columns()),
            (argument, set.outputs(), targets),
        ];
        if let Some((argument, found, expected)) = counts.into_iter().find(|(_, found, expected)| found != expected) {
            return Err(Failure::Arguments(format!(
                "{argument}: {}, where a row-wire of the array {scale} needs {expected}",
                counted(found, "column")
            )));
        }
        let row_wires: Option<Vec<usize>> = (0..set.samples()).map(|sample| set.row_wire(sample)).collect();
        let row_wires = row_wires.unwrap_or_default();
        if let Some(row) = row_wires.iter().find(|row| **row >= scale.rows()) {
            return Err(Failure::Arguments(format!(
                "--row-wire: '{column}' has row {}, and the array {scale} has {}",
                row + 1,
                scale.rows()
            )));
        }
        let frames = if has_depths {
            coordinates_of_depths(set, &row_wires, sensor)
        } else {
            set
        };
        let checked = check_presses(sensor, scene, &frames);
        checked.map_err(|source| match source.sample() {
            Some(sample) => {
                let line = lines[sample];
                Failure::at(
                    recording.file_of(sample),
                    format_args!("line {line}: {source} (--where)"),
                )
            }
            None => source.into(),
        })?;
        Ok(frames)
    }
}

/// Replaces the targets of `set`, the depths of the nodes, by the coordinates of the nodes.
fn coordinates_of_depths(set: Dataset, row_wires: &[usize], sensor: &SensorModel) -> Dataset {
    let outputs = sensor.scale.coordinates_per_row();
    let coordinates = Array2::from_shape_fn((set.samples(), outputs), |(sample, output)| {
        let (node, axis) = (output / 3, output % 3);
        let pressed = DVec3::new(0.0, 0.0, set.targets()[[sample, node]]);
        sensor.displaced_mm(row_wires[sample], node, pressed)[axis]
    });
    let (readings, groups) = (set.readings().to_owned(), set.groups().to_vec());
    Dataset::new(readings, coordinates, Some(row_wires), groups).expect("the parts come from a valid set")
}

/// Writes the header: the columns `kept` from the input, the targets of `rows` row-wires, each followed by the half-width
/// of its interval if it has one, and the counts of values outside the training range.
pub(super) fn write_heading<'a>(
    file: &NetworkFile,
    kept: impl Iterator<Item = &'a str>,
    rows: usize,
    out: &mut dyn Write,
) -> io::Result<()> {
    let problem = &file.problem;
    if problem.has_nodes() {
        return write_decoded_header(rows * problem.targets.len() / 3, out);
    }
    let titles = problem.targets.iter().enumerate().flat_map(|(index, target)| {
        let of_target = file
            .intervals
            .as_ref()
            .and_then(|intervals| intervals.targets.get(index));
        let half_width = of_target
            .is_some_and(Option::is_some)
            .then(|| Channel::new(half_width_name(target), target.unit.as_deref()));
        [Some(target.clone()), half_width].into_iter().flatten()
    });
    let names = kept
        .map(inert)
        .chain(titles.map(|target| inert(&target.title())))
        .chain(["readings_outside".to_owned(), "targets_outside".to_owned()]);
    write_csv_row(names, out)
}

/// Name of the column with the half-width of the 90 % interval of `target`.
fn half_width_name(target: &Channel) -> String {
    format!("{}_half_width_90", target.name)
}

/// Maximum number of lines listed individually; a damaged file may have thousands.
const MAX_LISTED: usize = 10;

/// Lines with readings or targets outside the range seen in training, where a network extrapolates.
pub(super) struct OutsideTraining<'a> {
    problem: &'a Problem,
    /// Names of the inputs of the network.
    features: Vec<Channel>,
    lines: usize,
    outside: usize,
    listed: Vec<String>,
}

/// Readings and targets of one line outside the training range.
pub(super) struct LineOutside {
    /// Number of readings; `None` if their training range is unknown.
    pub(super) readings: Option<usize>,
    /// Number of targets.
    pub(super) targets: usize,
}

impl<'a> OutsideTraining<'a> {
    pub(super) fn new(problem: &'a Problem) -> Self {
        Self {
            problem,
            features: problem.features(),
            lines: 0,
            outside: 0,
            listed: Vec::new(),
        }
    }

    /// Counts the readings and targets of a line outside the training range.
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
                let (name, extremes) = (&self.features[channel], range.extremes(channel));
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
        listed.iter().for_each(warn);
        warn(format_args!(
            "{outside} of {lines} lines are outside the range seen in training, where the network extrapolates; the last two \
             columns count such readings and targets: check these readings, or train with samples that cover them"
        ));
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
/// The frames are given as for calibrate. A random fifth of the frames is held out to measure the error before and after;
/// a fifth of the others selects the weights with the lowest error, which may be those of the given network.
#[derive(Args)]
pub(super) struct FineTune {
    /// Network saved by train --sensor
    #[arg(long, value_name = "FILE", value_parser = input)]
    network: PathBuf,
    #[command(flatten)]
    frames: FrameArguments,
    /// Maximum number of epochs [default: those of the network's training]
    #[arg(long, value_name = "N", value_parser = super::count(1..=StoppingRules::MAX_EPOCHS))]
    epochs: Option<usize>,
    /// File for the fine-tuned network
    #[arg(short, long, value_name = "FILE", value_parser = output)]
    out: PathBuf,
}

impl FineTune {
    pub(super) fn run(self) -> Result<(), Failure> {
        if is_same(&self.network, &self.out) {
            let message = "--network and --out name the same file: give --out another name";
            return Err(Failure::Arguments(message.to_owned()));
        }
        check_output("--out", &self.out)?;
        let mut file = NetworkFile::load(&self.network)?;
        let no_array = || {
            let message = "it is the network of a recording: frames of known presses need a model of the sensor; give a \
                           network of train --sensor";
            Failure::at(&self.network, message)
        };
        let simulation = file.problem.sensor.ok_or_else(no_array)?;
        let settings = file.settings;
        // Samples outside are not presses, or require answers that the network was not trained for.
        let frames = self.frames.read(&simulation.sensor, Some(&simulation.scene))?;
        let read = simulation.scene.rows.read(simulation.sensor.scale.rows());
        let read = read.map_err(decoupler_core::dataset::DatasetError::from)?;
        let frames = frames
            .among_rows(&read)
            .map_err(|error| Failure::Arguments(error.to_string()))?;
        let division = Division {
            by: SplitBy::Group,
            test_fraction: 0.2,
            validation_fraction: Some(0.2),
        };
        let divided = division.sets(&frames, None, settings.seed);
        let (split, test) = divided.map_err(decoupler_core::evaluation::RunError::from)?;
        let mut training = settings.training;
        training.stopping.epochs = self.epochs.unwrap_or(training.stopping.epochs);
        let bar = progress_bar(1, "fine-tuning {spinner}");
        let tuned = fine_tune(&file.network, &split, training, memory_budget(), &Job::UNINTERRUPTED);
        bar.finish_and_clear();
        let tuned = tuned?;
        let stroke_mm = simulation.stroke_mm();
        let errors = |set: &Dataset, networks: &Networks| Errors::measure(set, &networks.decouple(set), stroke_mm);
        let simulated = simulation.draw_test(settings.seed)?;
        let samples = [Some(&split.training), split.validation.as_ref(), Some(&test)];
        let samples = samples.map(|set| set.map_or(0, Dataset::samples));
        let before = errors(&test, &file.network).z_mm;
        let after = errors(&test, &tuned).z_mm;
        let simulated_before = file.scores.network.nodes().map_or(f64::NAN, |errors| errors.z_mm);
        let simulated = errors(&simulated, &tuned);
        // The errors in the file remain those on the simulated test set, to which the baselines refer.
        file.scores.network = TestErrors::Nodes(simulated);
        file.network = tuned;
        file.save(&self.out)?;
        if after >= before {
            warn(
                "the frames did not lower the error on the test frames: keep the original network, or give more frames",
            );
        }
        let object = || {
            json!({
                "training_samples": samples[0],
                "validation_samples": samples[1],
                "test_samples": samples[2],
                "z_mm_before": before,
                "z_mm_after": after,
                "simulated_z_mm_before": simulated_before,
                "simulated_z_mm_after": simulated.z_mm,
            })
        };
        print(object, |out| {
            let [training, validation, test] = samples;
            writeln!(
                out,
                "{training} row-wires trained, {validation} for validation, {test} for testing"
            )?;
            for (frames, before, after) in [
                ("test frames", before, after),
                ("simulated test set", simulated_before, simulated.z_mm),
            ] {
                let [before, after] = [before, after].map(format_number);
                writeln!(
                    out,
                    "Mean error of z on the {frames}: {before} mm before, {after} mm after"
                )?;
            }
            Ok(())
        })
    }
}
