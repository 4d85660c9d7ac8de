use std::time::{Duration, Instant};

use super::{claim::Claim, trials::PlannedTrial};
use crate::{
    cli::{
        checkpointing::Checkpointing, failure::Failure, samples::sets, train::measure_decoders, train_report::Trained,
    },
    evaluation::{Run, Workload},
    export::{CheckpointFile, NetworkFile, Trial},
    import::{Setup, SetupSets},
};

/// Time between two checkpoints of a trial: what a killed program loses at most.
const CHECKPOINT_INTERVAL: Duration = Duration::from_secs(10);

/// Trains the trial of `claim` and measures it as `train` does, beside so many others. Returns none if it was stopped,
/// with a checkpoint from which it is resumed with the same bits.
pub(super) fn train(
    trial: &PlannedTrial,
    claim: &Claim,
    beside: usize,
    is_stopped: impl Fn() -> bool,
) -> Result<Option<Trial>, Failure> {
    let begun = Instant::now();
    let mut workload = Workload::of(&trial.settings)?;
    workload.bytes = workload.bytes.saturating_mul(beside as u64);
    workload.check_memory()?;
    let (mut run, sets, before) = match resumed(trial, claim) {
        Some(resumed) => resumed,
        None => {
            let setup = Setup::from(trial.settings);
            let sets = sets(&setup, true)?;
            let run = sets.run(&setup, &|| false)?.expect("nothing cancels it");
            (run, sets, Duration::ZERO)
        }
    };
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
    let report = serde_json::to_value(trained.report()?).expect("a report has only text keys");
    let seconds = (before + begun.elapsed()).as_secs_f64();
    Ok(Some(Trial::new(trial.options.clone(), report, seconds)))
}

/// The run saved in the checkpoint of `claim`, with the time that it had taken. A checkpoint that is damaged or does not
/// belong to the trial is no worse than none.
fn resumed(trial: &PlannedTrial, claim: &Claim) -> Option<(Run, SetupSets, Duration)> {
    let file = CheckpointFile::load(&claim.checkpoint()).ok()?;
    if file.settings != trial.settings.into() {
        return None;
    }
    let before = file.wall_time.unwrap_or_default();
    let (run, sets) = file.resume_unless(&|| false, &mut |_| ()).ok()??;
    Some((run, sets, before))
}
