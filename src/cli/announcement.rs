use std::io::{Write, stderr};

use crate::{
    evaluation::{RunError, SimulatedSettings, Workload},
    export::describe_workload,
};

/// Tells on standard error how much memory and time a large run will take.
///
/// # Errors
/// If the array lacks a row of the scene, or the machine the memory.
pub(super) fn announce(settings: &SimulatedSettings) -> Result<(), RunError> {
    announce_workload(&Workload::of(settings)?)
}

/// Tells on standard error how much memory and time a large workload will take.
///
/// # Errors
/// If the machine lacks the memory.
pub(super) fn announce_workload(workload: &Workload) -> Result<(), RunError> {
    workload.check_memory()?;
    if workload.is_large() {
        // Nobody is left to tell if this fails.
        let _ = writeln!(stderr(), "{}", describe_workload(workload));
    }
    Ok(())
}
