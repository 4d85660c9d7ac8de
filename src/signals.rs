//! Signals by which the system asks the program to end.

/// Calls `react` on a thread of its own for every SIGTERM and SIGHUP, with the exit status that shells give them: 128 plus the
/// number of the signal. If SIGHUP is ignored, as by nohup, it remains ignored.
#[cfg(unix)]
pub(crate) fn on_termination(react: impl Fn(u8) + Send + 'static) {
    use signal_hook::{
        consts::{SIGHUP, SIGTERM},
        iterator::Signals,
    };

    // Without the handlers, signals end the program at once.
    let Ok(mut signals) = Signals::new([SIGTERM]) else {
        return;
    };
    if !is_ignored(SIGHUP) {
        let _ = signals.add_signal(SIGHUP);
    }
    let _ = std::thread::Builder::new().name("signals".to_owned()).spawn(move || {
        for signal in &mut signals {
            react(128 + signal as u8);
        }
    });
}

/// There are no such signals on other systems.
#[cfg(not(unix))]
pub(crate) fn on_termination(_react: impl Fn(u8) + Send + 'static) {}

/// Returns true if the program was started with this signal ignored, or if that is not known.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_none_or(|mask| mask >> (signal - 1) & 1 == 1)
}
