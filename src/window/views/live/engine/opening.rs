use std::{
    io::Read,
    sync::mpsc::{RecvTimeoutError, channel},
    thread,
    time::Duration,
};

use decoupler_core::live::Source;

/// Time between looks at whether the source is still wanted.
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);

/// Opens a source on a thread of its own: connecting may take minutes, and ending must not. Returns `None` if the source
/// is no longer wanted.
///
/// # Errors
/// If it cannot be opened.
pub(super) fn open(source: &Source, is_wanted: &dyn Fn() -> bool) -> Result<Option<Box<dyn Read + Send>>, String> {
    let (send, opened) = channel();
    let wanted = source.clone();
    let open = move || {
        // No one waits for a source that is no longer wanted.
        let _ = send.send(wanted.open());
    };
    let thread = thread::Builder::new().name("open source".to_owned()).spawn(open);
    thread.map_err(|error| format!("no thread could be started: {error}"))?;
    while is_wanted() {
        match opened.recv_timeout(BETWEEN_LOOKS) {
            Ok(opened) => return opened.map(Some).map_err(|error| error.to_string()),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(format!("opening {source} failed unexpectedly")),
        }
    }
    Ok(None)
}
