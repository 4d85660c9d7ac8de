use super::format_duration;
use decoupler_core::{
    evaluation::{Workload, WorkloadTime},
    text::counted,
    training::{MachineMemory, MemorySource},
};

/// Describes the memory and time that a run will take on this machine. The first call measures its speed, which takes
/// some 20 ms.
pub fn describe_workload(workload: &Workload) -> String {
    let gigabytes = |bytes: u64| format!("{:.1} GB", bytes as f64 * 1e-9);
    let memory = MachineMemory::of_this_machine();
    let machine = match memory.source {
        MemorySource::System | MemorySource::User => format!(" of {}", gigabytes(memory.bytes)),
        MemorySource::Assumed => String::new(),
    };
    let WorkloadTime {
        drawing,
        epoch,
        all_epochs,
    } = workload.time();
    let drawn_again = match workload.drawn_again {
        0 => String::new(),
        samples => format!(
            "; the last {} of the training are drawn again in every epoch instead of held, and fit the network only",
            counted(samples, "sample")
        ),
    };
    format!(
        "about {}{machine} of memory; on one thread about {} to draw the samples and {} per epoch, {} for {}; the \
         figures of the decoders take further time{drawn_again}",
        gigabytes(workload.bytes),
        format_duration(drawing),
        format_duration(epoch),
        format_duration(all_epochs),
        counted(workload.epochs, "epoch")
    )
}
