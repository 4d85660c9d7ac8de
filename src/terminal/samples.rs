//! Samples of a run: drawn after an announcement of the work, or read with a progress bar.

use std::{
    io::{Write, stderr},
    ops::ControlFlow,
    path::Path,
};

use super::{failure::Failure, output::progress_bar};
use decoupler_core::evaluation::{RunError, RunSettings, Workload};
use decoupler_files::{
    export::describe_workload,
    import::{Progress, Setup, SetupError, SetupSets},
};

/// Draws or reads the samples of `setup`.
pub(super) fn sets(setup: &Setup, is_json: bool) -> Result<SetupSets, Failure> {
    announce(setup.settings())?;
    let sets = following(setup, is_json, |on_progress| {
        setup.sets(working_folder(), &|| false, on_progress)
    });
    Ok(sets?)
}

/// Calls `read`, which reads or draws the samples of `setup` and which nothing cancels, with a progress bar if it reads files.
pub(super) fn following<T>(
    setup: &Setup,
    is_json: bool,
    read: impl FnOnce(&mut dyn FnMut(Progress)) -> Result<Option<T>, SetupError>,
) -> Result<T, SetupError> {
    let read = with_bar(is_json || setup.plan().is_none(), |watch| {
        read(&mut |progress| {
            let _ = watch(progress);
        })
    });
    Ok(read?.expect("nothing cancels it"))
}

/// Calls `import` with a progress bar of the bytes read.
pub(super) fn with_bar<T>(is_hidden: bool, import: impl FnOnce(&mut dyn FnMut(Progress) -> ControlFlow<()>) -> T) -> T {
    let bar = progress_bar(is_hidden, 1, "reading {bytes} of {total_bytes}");
    let result = import(&mut |progress| {
        bar.set_length(progress.of.unwrap_or(progress.bytes));
        bar.set_position(progress.bytes);
        ControlFlow::Continue(())
    });
    bar.finish_and_clear();
    result
}

/// Folder to which the paths of a plan from arguments are relative.
pub(super) fn working_folder() -> &'static Path {
    Path::new("")
}

/// Reports on standard error how much memory and time a large simulated run will take.
///
/// # Errors
/// If the array lacks a row of the scene, or the machine the memory.
pub(super) fn announce(settings: &RunSettings) -> Result<(), RunError> {
    match settings.simulated() {
        Some(settings) => announce_workload(&Workload::of(&settings)?),
        None => Ok(()),
    }
}

/// Reports on standard error how much memory and time a large workload will take.
///
/// # Errors
/// If the machine lacks the memory.
pub(super) fn announce_workload(workload: &Workload) -> Result<(), RunError> {
    workload.check_memory()?;
    if workload.is_large() {
        // There is no one to report to if this fails.
        let _ = writeln!(stderr(), "{}", describe_workload(workload));
    }
    Ok(())
}
