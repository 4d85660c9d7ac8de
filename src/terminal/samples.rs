//! Samples of a run: drawn after an estimate of the work is printed, or read with a progress bar.

use std::{
    io::{BufWriter, Write, stdout},
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use clap::Args;
use decoupler_core::{
    dataset::{Dataset, DatasetError, LARGEST_SAMPLES, Simulation, Stream},
    decoupling::{Decoder, Precision, decode_set},
    evaluation::{DecoderSet, Run, RunError, RunSets, RunSettings, TrainingSize, Workload, error_remarks},
    job::Job,
};
use decoupler_files::{
    export::{
        AtomicFile, WriteError, describe_recorded_workload, describe_workload, write_samples, write_samples_header,
    },
    import::{Progress, Setup, SetupError, SetupSets},
    live::{Fault, FaultySensor},
    machine::memory_budget,
};

use serde_json::json;

use super::{
    count,
    failure::Failure,
    output::{check_output, note, output, print, progress_bar, warn},
    settings_arguments::{OfSimulate, SettingsArguments},
};

/// Draws or reads the samples of `setup`.
pub(super) fn sets(setup: &Setup) -> Result<SetupSets, Failure> {
    announce(setup.settings())?;
    let sets = following(setup, |on_progress| {
        setup.sets(working_folder(), &Job::UNINTERRUPTED, on_progress)
    });
    Ok(sets?)
}

/// Calls `read`, which reads or draws the samples of `setup` without cancellation, with a progress bar if it reads files.
pub(super) fn following<T>(
    setup: &Setup,
    read: impl FnOnce(&mut dyn FnMut(Progress)) -> Result<T, SetupError>,
) -> Result<T, SetupError> {
    if setup.plan().is_none() {
        return read(&mut |_| ());
    }
    with_bar(|watch| {
        read(&mut |progress| {
            let _ = watch(progress);
        })
    })
}

/// Calls `import` with a progress bar of the bytes read.
pub(super) fn with_bar<T>(import: impl FnOnce(&mut dyn FnMut(Progress) -> ControlFlow<()>) -> T) -> T {
    let bar = progress_bar(1, "reading {bytes} of {total_bytes}");
    let result = import(&mut |progress| {
        bar.set_length(progress.of.unwrap_or(progress.bytes));
        bar.set_position(progress.bytes);
        ControlFlow::Continue(())
    });
    bar.finish_and_clear();
    result
}

/// Folder to which the paths of a plan from the arguments are relative.
pub(super) fn working_folder() -> &'static Path {
    Path::new("")
}

/// Reports on standard error how much memory and time a large simulated run will take.
///
/// # Errors
/// If the array lacks a row of the scene, or the machine has too little memory.
pub(super) fn announce(settings: &RunSettings) -> Result<(), RunError> {
    if settings.simulation().is_none() {
        return Ok(());
    }
    announce_workload(&Workload::of(settings, TrainingSize::drawn(settings)?))
}

/// Reports on standard error how long a training on a recording will take, if it is long.
pub(super) fn announce_recording(setup: &Setup, sets: &SetupSets) {
    let settings = setup.settings();
    let size = TrainingSize::of(settings, &sets.sets.split.training);
    if setup.plan().is_some()
        && let Some(text) = describe_recorded_workload(settings, size)
    {
        note(text);
    }
}

/// Reports on standard error how much memory and time a large workload will take.
///
/// # Errors
/// If the machine has too little memory.
pub(super) fn announce_workload(workload: &Workload) -> Result<(), RunError> {
    workload.check_memory(memory_budget())?;
    if workload.is_large() {
        note(describe_workload(workload));
    }
    Ok(())
}

/// Maximum number of snapshots drawn and written together, which limits memory for many samples.
const BLOCK: usize = 64;
/// Memory limit for these snapshots, for large arrays.
const BLOCK_BYTES: usize = 64 << 20;

/// Draw samples of an array and write them as CSV
///
/// A line is one row-wire at one moment: snapshot and row counted from 1, resistances r_1, r_2, … in ohm, and
/// coordinates x_1, y_1, z_1, x_2, … of its nodes in mm. Samples are whole snapshots of all rows. With the seed and array
/// of a training they are its test samples. With --decoder, the coordinates decoded by this decoder follow as
/// decoded_x_1, …; networks are first trained with the settings of the preset.
#[derive(Args)]
#[command(allow_negative_numbers = true)]
pub(super) struct Simulate {
    /// Samples, rounded up to whole snapshots
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = count(1..=LARGEST_SAMPLES))]
    samples: usize,
    /// Fault of a wire or of the electronics to simulate: open-row:ROW or open-column:COLUMN (broken at the connector, or
    /// with @NODE before that node), short-columns:COLUMN-COLUMN, gain:COLUMN=REL (gain error of an
    /// amplifier), stuck:COLUMN=low|high (a converter at an end of its range)
    #[arg(long, value_name = "FAULT")]
    fault: Option<Fault>,
    #[command(flatten)]
    scene: SettingsArguments<OfSimulate>,
    /// File to write instead of standard output
    #[arg(short, long, value_name = "FILE", value_parser = output)]
    out: Option<PathBuf>,
}

impl Simulate {
    pub(super) fn run(self) -> Result<(), Failure> {
        let Some(path) = &self.out else {
            let mut written = BufWriter::new(stdout().lock());
            self.write(&mut written, Failure::Output)?;
            return written.flush().map_err(Failure::Output);
        };
        check_output("--out", path)?;
        let mut file = AtomicFile::create(path)?;
        let samples = self.write(&mut file, |source| WriteError::io(path, source).into())?;
        file.commit()?;
        print(|| json!({"samples": samples}), |_| Ok(()))
    }

    /// Writes the samples and returns their number.
    fn write(&self, writer: &mut dyn Write, refused: impl Fn(std::io::Error) -> Failure) -> Result<usize, Failure> {
        let settings = self.scene.settings(None)?;
        let (Simulation { sensor, scene, .. }, seed) = (settings.drawn()?, settings.seed);
        let array = sensor.scale;
        let rows = scene.rows.read(array.rows()).map_err(DatasetError::from)?;
        let faulty = match self.fault {
            Some(fault) => {
                fault
                    .check(array, &rows)
                    .map_err(|error| Failure::Arguments(format!("--fault: {error}")))?;
                Some(FaultySensor::new(sensor, scene.noise.in_test(), fault).map_err(Failure::Sensor)?)
            }
            None => None,
        };
        let mut decoder = self.decoder(&settings)?;
        let (mut rng, mut noise_rng) = (seed.rng(Stream::Test), seed.rng(Stream::TestNoise));
        let snapshots = self.samples.div_ceil(rows.len());
        write_samples_header(array, decoder.is_some(), writer).map_err(&refused)?;
        let numbers = rows.len() * (array.columns() + array.coordinates_per_row());
        let block = (BLOCK_BYTES / (size_of::<f64>() * numbers)).clamp(1, BLOCK);
        for first in (0..snapshots).step_by(block) {
            let samples = block.min(snapshots - first) * rows.len();
            let mut set = Dataset::simulate(sensor, scene, samples, &mut rng)?;
            let noise = scene.noise.in_test();
            let disturbed = match &faulty {
                Some(faulty) => faulty.disturb(&mut set, &noise, &mut noise_rng),
                None => set.disturb(sensor, &noise, &mut noise_rng),
            };
            disturbed.map_err(RunError::from)?;
            let decoded_mm = match &mut decoder {
                Some(decoder) => Some(decode_set(&mut **decoder, &set).map_err(RunError::from)?),
                None => None,
            };
            write_samples(&set, decoded_mm.as_ref(), first + 1, writer).map_err(&refused)?;
        }
        Ok(snapshots * rows.len())
    }

    /// The given decoder with trained networks; none if none is given.
    fn decoder(&self, settings: &RunSettings) -> Result<Option<Box<dyn Decoder>>, Failure> {
        let kind = match self.scene.decoder[..] {
            [] => return Ok(None),
            [kind] => kind,
            _ => return Err(Failure::Arguments("--decoder: give only one here".to_owned())),
        };
        let networks = if kind.needs_network() {
            announce(settings)?;
            let mut run = Run::prepare(*settings)?;
            run.finish(&Job::UNINTERRUPTED).map_err(RunError::from)?;
            let scores = run.scores();
            let remarks = scores.map(|scores| error_remarks(settings, &scores, run.stop_reason()));
            let remarks = remarks.into_iter().flatten();
            let of_network = remarks
                .filter(|(row, _)| *row == "network")
                .map(|(_, remark)| remark.to_string());
            run.defect().into_iter().chain(of_network).for_each(warn);
            Some(run.network())
        } else {
            None
        };
        let sets = RunSets::draw(settings, memory_budget(), &Job::UNINTERRUPTED)?;
        let set = DecoderSet::new(*settings, sets.split.training, networks);
        Ok(set.decoder(kind, Precision::Double)?)
    }
}
