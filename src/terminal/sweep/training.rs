use std::{
    path::Path,
    time::{Duration, Instant},
};

use serde_json::Value;

use super::{claim::Claim, trials::PlannedTrial};
use crate::terminal::{
    checkpointing::Checkpointing, failure::Failure, samples::sets, train::measure_decoders, train_report::Trained,
};
use decoupler_core::evaluation::{Run, Workload};
use decoupler_files::{
    export::{CheckpointFile, NetworkFile, Trial},
    import::SetupSets,
};

/// Time between two checkpoints of a trial: what a killed program loses at most.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(10);

/// Trains the trial of `claim` and measures it as `train` does, next to this many others. Returns none if it was stopped,
/// with a checkpoint from which it is resumed with the same bits.
pub(super) fn train(
    trial: &PlannedTrial,
    claim: &Claim,
    beside: usize,
    is_stopped: impl Fn() -> bool,
) -> Result<Option<Trial>, Failure> {
    let begun = Instant::now();
    if let Some(settings) = trial.setup.simulated() {
        let mut workload = Workload::of(&settings)?;
        workload.bytes = workload.bytes.saturating_mul(beside as u64);
        workload.check_memory()?;
    }
    let (mut run, sets, before) = match resumed(trial, claim) {
        Some(resumed) => resumed,
        None => {
            let sets = sets(&trial.setup, true)?;
            let run = sets.run(&trial.setup, &|| false)?.expect("nothing cancels it");
            (run, sets, Duration::ZERO)
        }
    };
    let files = sets.recorded().map_or(&[][..], |recorded| &recorded.files);
    let mut read = files.iter().zip(&trial.crc32);
    if let Some((changed, _)) = read.find(|(read, planned)| read.crc32 != **planned) {
        let message = format!(
            "'{}' has changed since the sweep began; begin it again",
            changed.path.display()
        );
        return Err(Failure::Arguments(message));
    }
    let mut checkpointing = Checkpointing::every(CHECKPOINT_INTERVAL, claim.checkpoint(), sets.recorded());
    while run.stop_reason().is_none() {
        if is_stopped() {
            checkpointing.save(&run)?;
            return Ok(None);
        }
        checkpointing.save_if_due(&run);
        run.step();
    }
    let file = NetworkFile::from_run(&run, sets.recorded())?;
    let mut decoders = Vec::new();
    measure_decoders(&trial.decoders, &file, &sets, &mut decoders)?;
    let trained = Trained {
        run: &run,
        file: &file,
        sets: &sets,
        decoders: &decoders,
        optimism: &[],
    };
    let mut report = serde_json::to_value(trained.report()?).expect("a report has only text keys");
    if sets.recorded().is_some() {
        make_comparable(&mut report);
    }
    let seconds = (before + begun.elapsed()).as_secs_f64();
    Ok(Some(Trial::new(trial.options.clone(), report, seconds)))
}

/// Makes reports on a recording the same on all machines: times are named apart, and files have names but no folders.
fn make_comparable(report: &mut Value) {
    let Value::Object(fields) = report else { return };
    if let Some(seconds) = fields.remove("seconds") {
        fields.insert("training_seconds".to_owned(), seconds);
    }
    let files = fields.get_mut("files").and_then(Value::as_array_mut);
    for path in files.into_iter().flatten().filter_map(|file| file.get_mut("path")) {
        let name = path.as_str().and_then(|path| Path::new(path).file_name());
        if let Some(name) = name.map(|name| Value::from(name.to_string_lossy())) {
            *path = name;
        }
    }
}

/// The run saved in the checkpoint of `claim`, with the time that it had taken. A checkpoint that is damaged or does not
/// belong to the trial is no worse than none.
fn resumed(trial: &PlannedTrial, claim: &Claim) -> Option<(Run, SetupSets, Duration)> {
    let file = CheckpointFile::load(&claim.checkpoint()).ok()?;
    if file.settings != *trial.setup.settings() {
        return None;
    }
    let before = file.wall_time.unwrap_or_default();
    let (run, sets) = file.resume_unless(&|| false, &mut |_| ()).ok()??;
    Some((run, sets, before))
}
