//! Compiling the C source and running its self-test.

use std::{
    fs::{self, File},
    io,
    path::Path,
    process::{Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::{
    export::{bundle::report::BundleError, unfinished::UnfinishedFolder},
    machine::system_cause,
};

const COMPILER: &str = "cc";
/// The flags under which the source has no warning.
const FLAGS: &str = "-std=c99 -Wall -Wextra -Werror -pedantic -Wconversion -O2";

/// Compiles the source and the self-test in `folder` and runs the self-test; no files are left there. Returns the largest
/// deviation of the golden answers, relative to the range of the outputs, or the reason why nothing was compiled.
///
/// # Errors
/// The compiler refuses the source, or the self-test fails.
pub(in crate::export::bundle) fn run_self_test(
    folder: &Path,
    name: &str,
) -> Result<Result<f64, &'static str>, BundleError> {
    let sources = ["decode", "selftest"].map(|part| folder.join(format!("{name}_{part}.c")));
    let failed = |step: &'static str, reason: String| BundleError::SelfTest(step, reason);
    let temporary = std::env::temp_dir();
    let home = UnfinishedFolder::begin(&temporary).map_err(|error| {
        let (folder, cause) = (temporary.display(), system_cause(&error));
        let reason = format!("the folder for temporary files '{folder}' (TMPDIR) cannot be written: {cause}");
        failed("compiling the C source", reason)
    })?;
    let program = home.path().join("selftest");
    let trial = home.path().join("trial.c");
    let hello = "#include <math.h>\n#include <stdio.h>\nint main(void)\n{\n    return puts(\"\") < 0;\n}\n";
    let tried = std::fs::write(&trial, hello).and_then(|()| compile(&[&trial], &program, home.path()));
    match tried {
        Ok(output) if output.status.success() => {}
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Err("no C compiler found")),
        Err(error) if error.kind() == io::ErrorKind::TimedOut => {
            return Ok(Err("the C compiler 'cc' does not end with an empty program"));
        }
        _ => return Ok(Err("the C compiler 'cc' cannot compile an empty program")),
    }
    let output = compile(&[&sources[0], &sources[1]], &program, home.path());
    let output = output.map_err(|error| failed("compiling the C source", error.to_string()))?;
    if !output.status.success() {
        return Err(failed("compiling the C source", first_lines(&output.stderr)));
    }
    let output = output_within(&mut Command::new(&program), home.path(), LONGEST_RUN);
    let output = output.map_err(|error| failed("the self-test of the C source", error.to_string()))?;
    let text = first_lines(&output.stdout);
    let printed = text.split_once("largest deviation: ");
    let deviation = printed.and_then(|(_, rest)| rest.split(' ').next()?.parse().ok());
    match deviation {
        Some(deviation) if output.status.success() => Ok(Ok(deviation)),
        _ => Err(failed("the self-test of the C source", text)),
    }
}

fn compile(sources: &[&Path], program: &Path, home: &Path) -> io::Result<Output> {
    let mut command = Command::new(COMPILER);
    command
        .args(FLAGS.split(' '))
        .args(sources)
        .arg("-o")
        .arg(program)
        .arg("-lm");
    output_within(&mut command, home, LONGEST_RUN)
}

/// Longest time that the compiler or a self-test may take; the largest decoders take seconds.
const LONGEST_RUN: Duration = Duration::from_secs(120);

/// Runs a command, which is ended after `longest`. Its output is kept in `home` meanwhile, so that it never waits for a reader.
///
/// # Errors
/// It cannot be run, or takes longer ([`io::ErrorKind::TimedOut`]).
fn output_within(command: &mut Command, home: &Path, longest: Duration) -> io::Result<Output> {
    const INTERVAL: Duration = Duration::from_millis(5);
    let outputs = ["output", "errors"].map(|name| home.join(name));
    command.stdin(Stdio::null()).stdout(File::create(&outputs[0])?);
    command.stderr(File::create(&outputs[1])?);
    let begun = Instant::now();
    let mut child = command.spawn()?;
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break status;
        }
        if begun.elapsed() >= longest {
            // It may have ended just now.
            let _ = child.kill();
            child.wait()?;
            let reason = format!("it does not end within {} s", longest.as_secs_f64());
            return Err(io::Error::new(io::ErrorKind::TimedOut, reason));
        }
        thread::sleep(INTERVAL);
    };
    let [stdout, stderr] = outputs.map(fs::read);
    Ok(Output {
        status,
        stdout: stdout?,
        stderr: stderr?,
    })
}

/// Joins the first lines of a message.
fn first_lines(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    text.lines().take(3).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_program_that_does_not_end_is_ended() {
        let home = tempfile::tempdir().unwrap();
        let run = |script: &str, millis| {
            let mut command = Command::new("sh");
            output_within(command.args(["-c", script]), home.path(), Duration::from_millis(millis))
        };
        let begun = Instant::now();
        let error = run("exec sleep 1000", 50).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
        assert!(begun.elapsed() < Duration::from_secs(900), "{error}");
        // More output than a pipe holds.
        let output = run("head -c 1000000 /dev/zero; echo wrong >&2; exit 3", 600_000).unwrap();
        assert_eq!(
            (output.stdout.len(), output.stderr.as_slice()),
            (1_000_000, &b"wrong\n"[..])
        );
        assert_eq!(output.status.code(), Some(3));
    }
}
