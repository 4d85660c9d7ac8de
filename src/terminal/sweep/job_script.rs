use std::{
    env,
    path::{self, Path},
};

use clap::ValueEnum;

use crate::terminal::failure::Failure;
use decoupler_files::export::report::quoted;

/// Programs that distribute jobs over machines.
#[derive(Clone, Copy, ValueEnum)]
pub(super) enum Engine {
    Slurm,
    Parallel,
    #[value(name = "hyperqueue")]
    HyperQueue,
}

impl Engine {
    /// Most jobs of a script unless asked for: Slurm's own limit on arrays, in its default configuration.
    pub(super) const MAX_JOBS: usize = 1000;

    /// Script that has this engine train the trials of `specification` in this many jobs, each of one thread.
    pub(super) fn script(
        self,
        specification: &Path,
        folder: &Path,
        trials: usize,
        jobs: usize,
    ) -> Result<String, Failure> {
        let program = env::current_exe().map_err(|_| refused("the program's own path is not known".to_owned()))?;
        let command = format!(
            "{} sweep --spec {} --out {} --threads 1 --shard",
            absolute(&program)?,
            absolute(specification)?,
            absolute(folder)?
        );
        Ok(match self {
            Self::Slurm => slurm(&command, trials, jobs),
            Self::Parallel => parallel(&command, trials, jobs),
            Self::HyperQueue => hyperqueue(&command, trials, jobs),
        })
    }
}

/// The full path in quotes: a job may begin in another folder.
fn absolute(path: &Path) -> Result<String, Failure> {
    let full = path::absolute(path).ok().filter(|full| full.to_str().is_some());
    let full = full.ok_or_else(|| refused(format!("the path '{}' cannot be written in a script", path.display())))?;
    Ok(quoted(&full))
}

fn refused(message: String) -> Failure {
    Failure::Arguments(format!("--engine: {message}; move the files"))
}

fn slurm(command: &str, trials: usize, jobs: usize) -> String {
    format!(
        r#"#!/bin/bash
#SBATCH --job-name=decoupler-sweep
#SBATCH --array=1-{jobs}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --signal=B:USR1@60
# {trials} trials in {jobs} jobs of one thread. Submit with sbatch, with --partition, --time and --mem as your cluster
# needs. All nodes must see the folder. Submitting it again trains only what is missing.

# SIGTERM comes when Slurm itself requeues, preempts or cancels the job, SIGUSR1 a minute before its time is over. In both
# cases the training is saved, and the next run resumes it.
worker=
waiting=yes
requeue=no
stop() {{
    waiting=yes
    [ -z "$worker" ] || kill -TERM "$worker" 2>/dev/null
}}
trap stop TERM
trap 'requeue=yes; stop' USR1
{command} "$SLURM_ARRAY_TASK_ID/{jobs}" &
worker=$!
while [ "$waiting" = yes ]; do
    waiting=no
    wait "$worker"
    status=$?
done
if [ "$requeue" = yes ] && [ "$status" -eq 143 ]; then
    scontrol requeue "${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID"
fi
exit "$status"
"#
    )
}

fn parallel(command: &str, trials: usize, jobs: usize) -> String {
    format!(
        r#"#!/bin/bash
# {trials} trials in {jobs} jobs of one thread, one on each core. Further arguments go to GNU parallel, for example
# --sshloginfile FILE for other machines, which must see the folder. A job that was killed is tried again. Running the
# script again trains only what is missing.

# After SIGTERM each training is saved, and the next run resumes it.
seq {jobs} | exec parallel --quote -I '{{shard}}' --retries 3 --termseq TERM,60000,KILL,25 "$@" \
    {command} '{{shard}}/{jobs}'
"#
    )
}

fn hyperqueue(command: &str, trials: usize, jobs: usize) -> String {
    format!(
        r#"#!/bin/bash
#HQ --name decoupler-sweep
#HQ --array 1-{jobs}
#HQ --cpus 1
# {trials} trials in {jobs} tasks of one thread. Save this as sweep.sh and submit it with: hq submit sweep.sh. All workers must
# see the folder. HyperQueue restarts the tasks of a worker that is lost, and they resume their trainings. Submitting it
# again trains only what is missing.

exec {command} "$HQ_TASK_ID/{jobs}"
"#
    )
}
