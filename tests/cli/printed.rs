//! Output of successful calls.

use std::path::Path;

use serde_json::Value;

use crate::terminal::decoupler;

/// Standard output of a call that must succeed, possibly with warnings.
pub(crate) fn success(arguments: &str, folder: &Path) -> String {
    let output = decoupler(arguments, folder);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// Like `success`, for a call that prints JSON.
pub(crate) fn json(arguments: &str, folder: &Path) -> Value {
    serde_json::from_str(&success(arguments, folder)).unwrap()
}
