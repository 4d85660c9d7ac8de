use std::{
    io,
    path::Path,
    process::{Command, Output},
};

use crate::export::bundle::{error::BundleError, vectors::Deviation};

const COMPILER: &str = "cc";
/// The flags under which the source has no warning.
const FLAGS: [&str; 7] = [
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-pedantic",
    "-Wconversion",
    "-O2",
];

/// Outcome of compiling and running a self-test.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::export::bundle) enum Compiled {
    /// Largest deviations of the golden vectors, relative to the range of the outputs.
    Ran { deviation: Deviation },
    /// Not compiled, and why.
    NoCompiler(&'static str),
}

/// Compiles the source and the self-test in `folder` and runs it; neither leaves anything there.
///
/// # Errors
/// The compiler refuses the source, or the self-test fails.
pub(in crate::export::bundle) fn run_self_test(folder: &Path, name: &str) -> Result<Compiled, BundleError> {
    let failed = |step: &'static str, reason: String| BundleError::SelfTest { step, reason };
    let home = tempfile::tempdir().map_err(|error| failed("compiling the C source", error.to_string()))?;
    let program = home.path().join("selftest");
    let trial = home.path().join("trial.c");
    let hello = "#include <math.h>\n#include <stdio.h>\nint main(void)\n{\n    return puts(\"\") < 0;\n}\n";
    let tried = std::fs::write(&trial, hello).and_then(|()| compile(&[&trial], &program));
    match tried {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Ok(Compiled::NoCompiler("no C compiler found"));
        }
        Ok(output) if output.status.success() => {}
        _ => {
            return Ok(Compiled::NoCompiler(
                "the C compiler 'cc' cannot compile an empty program",
            ));
        }
    }
    let sources = ["decode", "selftest"].map(|part| folder.join(format!("{name}_{part}.c")));
    let output = compile(&[&sources[0], &sources[1]], &program);
    let output = output.map_err(|error| failed("compiling the C source", error.to_string()))?;
    if !output.status.success() {
        return Err(failed("compiling the C source", first_lines(&output.stderr)));
    }
    let output = Command::new(&program).output();
    let output = output.map_err(|error| failed("the self-test of the C source", error.to_string()))?;
    let text = first_lines(&output.stdout);
    let printed = |name: &str| -> Option<f64> {
        let (_, rest) = text.split_once(name)?;
        rest.split([' ', ',']).next()?.parse().ok()
    };
    let total = printed("largest deviation: ");
    let deviation = total.map(|total| Deviation {
        total,
        of_arithmetic: printed("by arithmetic: ").unwrap_or(total),
    });
    match deviation {
        Some(deviation) if output.status.success() => Ok(Compiled::Ran { deviation }),
        _ => Err(failed("the self-test of the C source", text)),
    }
}

fn compile(sources: &[&Path], program: &Path) -> io::Result<Output> {
    let mut command = Command::new(COMPILER);
    command.args(FLAGS).args(sources).arg("-o").arg(program).arg("-lm");
    command.output()
}

/// The first lines of a message, as one.
fn first_lines(text: &[u8]) -> String {
    let text = String::from_utf8_lossy(text);
    text.lines().take(3).collect::<Vec<_>>().join("; ")
}
