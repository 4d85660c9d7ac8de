use std::{io, path::PathBuf};

use thiserror::Error;

use decoupler_core::text::system_cause;

/// Most trials of a sweep. Every program that works on one reads all of them.
pub(super) const MAX_TRIALS: usize = 100_000;

/// Errors of a specification.
#[derive(Debug, Error)]
pub(super) enum SpecificationError {
    #[error("cannot read '{}': {}", .path.display(), system_cause(.source))]
    Read { path: PathBuf, source: io::Error },
    #[error(
        "'{}' is no specification: {message}; write {{\"train\": {{OPTION: VALUE, ...}}, \"axes\": {{OPTION: [VALUE, ...], \
         ...}}}} with the options of decoupler train",
        .path.display()
    )]
    Layout { path: PathBuf, message: String },
    #[error("'{}': {place}: {message}", .path.display())]
    Option {
        path: PathBuf,
        place: String,
        message: String,
    },
    #[error("'{}': its axes have more than {MAX_TRIALS} combinations; give fewer values, or several specifications", .0.display())]
    TooMany(PathBuf),
}
