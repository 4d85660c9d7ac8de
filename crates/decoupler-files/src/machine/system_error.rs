use std::io::{self, ErrorKind};

/// Returns in plain words why the operating system refused a file, and what to do about it.
pub fn system_cause(error: &io::Error) -> String {
    let words = match error.kind() {
        ErrorKind::NotFound => "there is no such file or folder; check the name",
        ErrorKind::PermissionDenied => {
            "permission denied; change the permissions of the file and its folder, or give another place"
        }
        ErrorKind::IsADirectory => "it is a folder; give the name of a file",
        ErrorKind::NotADirectory => "a part of the path is a file, not a folder; correct the path",
        ErrorKind::AlreadyExists => "there is a file of this name already; remove it, or give another name",
        ErrorKind::StorageFull => "the disk is full; free some space, or give a place on another disk",
        ErrorKind::QuotaExceeded => "your disk quota is exhausted; free some space, or give another place",
        // Beyond one of our own limits.
        ErrorKind::FileTooLarge if error.get_ref().is_some() => return error.to_string(),
        ErrorKind::FileTooLarge => "the file is too large for this disk; give a place on another disk",
        ErrorKind::ReadOnlyFilesystem => "the disk is read-only; give a place on another disk",
        ErrorKind::InvalidFilename => {
            "the name is too long, or has characters that the disk does not allow; give another"
        }
        ErrorKind::ResourceBusy | ErrorKind::ExecutableFileBusy => {
            "another program is using it; close that program, or wait, and try again"
        }
        ErrorKind::BrokenPipe => "the program that reads it has ended; start both again",
        ErrorKind::OutOfMemory => "memory is full; close other programs, or use less data",
        ErrorKind::InvalidData => "it is not text that can be read; check that it is the right file",
        _ if error.raw_os_error().is_none() => return system_words(error),
        _ => {
            let words = system_words(error);
            return format!("the system reports: {words}; check the disk or device, or give another place");
        }
    };
    words.to_owned()
}

/// Returns the system's own message without its number.
pub(crate) fn system_words(error: &io::Error) -> String {
    let text = error.to_string();
    text.split(" (os error").next().unwrap_or(&text).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_system_error_has_a_message_with_a_remedy() {
        // Linux numbers: no entry, permission, exists, not a folder, is a folder, too large, full, read-only, input/output,
        // too many open files, name too long, loop of links.
        for number in [2, 13, 17, 20, 21, 27, 28, 30, 5, 24, 36, 40] {
            let text = system_cause(&io::Error::from_raw_os_error(number));
            assert!(!text.contains("os error") && text.contains(';'), "{number}: {text}");
        }
        let own = io::Error::other("the archive is empty; choose another");
        assert_eq!(system_cause(&own), "the archive is empty; choose another");
    }
}
