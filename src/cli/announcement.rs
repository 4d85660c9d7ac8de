use std::io::{Write, stderr};

use crate::{
    evaluation::{RunError, SimulatedSettings, Workload, WorkloadTime},
    export::format_duration,
};

/// Tells on standard error how much memory and time a large run will take.
///
/// # Errors
/// If the array lacks a row of the scene.
pub(super) fn announce(settings: &SimulatedSettings) -> Result<(), RunError> {
    let workload = Workload::of(settings)?;
    if workload.is_large() {
        // Nobody is left to tell if this fails.
        let _ = writeln!(stderr(), "{}", text(&workload, settings));
    }
    Ok(())
}

fn text(workload: &Workload, settings: &SimulatedSettings) -> String {
    let gigabytes = |bytes: u64| format!("{:.1} GB", bytes as f64 * 1e-9);
    let machine = Workload::machine_bytes().map_or_else(String::new, |bytes| format!(" of {}", gigabytes(bytes)));
    let WorkloadTime {
        drawing,
        epoch,
        all_epochs,
    } = workload.time();
    format!(
        "about {}{machine} of memory; on one thread about {} to draw the samples and {} an epoch, {} for {} epochs; the \
         figures of the decoders take further time",
        gigabytes(workload.bytes),
        format_duration(drawing),
        format_duration(epoch),
        format_duration(all_epochs),
        settings.training.stopping.epochs
    )
}
