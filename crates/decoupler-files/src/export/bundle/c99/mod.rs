//! Bundles as one C99 header and one source, with a self-test.

mod fixed;
mod floating;
mod header;

use std::{
    fmt::{Display, Write},
    fs::{self, File},
    io,
    path::Path,
    process::{Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use self::{fixed::readings, header::Header};
use super::{
    choice::BundlePrecision,
    fixed_point::FixedNetworks,
    folder::{Call, Draft},
    meaning::Meaning,
    portable::Portable,
    report::{BundleCheck, BundleError},
    vectors::{Deviation, Vector},
    weights::Weights,
};
use crate::{
    export::{bundle::weights::Digits, unfinished::UnfinishedFolder},
    machine::system_cause,
};
use header::{SelfTest, WholeNumbers};

/// Files of a bundle: names and contents.
pub(super) type Files = Vec<(String, String)>;

/// Writes header, source and self-test in floating point.
pub(super) fn write_floating(
    name: &str,
    portable: &Portable,
    weights: &Weights,
    vectors: &[Vector],
    limits: Deviation,
    notes: &[String],
) -> Files {
    let header = floating::header(name, portable, weights.arithmetic, notes);
    let self_test = SelfTest {
        header: &header,
        vectors,
        limits,
        whole: None,
    };
    files(&header, floating::source(&header, weights), self_test.text())
}

/// Writes header, source and self-test in fixed point.
pub(super) fn write_fixed(
    name: &str,
    portable: &Portable,
    networks: &FixedNetworks,
    vectors: &[Vector],
    limit: f64,
) -> Files {
    let units = fixed::units(portable, networks);
    let definitions = fixed::unit_definitions(name, portable, networks);
    let header = fixed::header(name, portable, networks, [&units, &definitions]);
    let self_test = SelfTest {
        header: &header,
        vectors,
        limits: Deviation {
            total: limit,
            of_arithmetic: limit,
        },
        whole: Some(WholeNumbers {
            readings_per_one: (0..portable.channels)
                .map(|channel| networks.readings.per_one(channel))
                .collect(),
            units: networks.outputs.all().collect(),
            bits: vectors.iter().flat_map(|vector| bits_of(networks, vector)).collect(),
        }),
    };
    files(&header, fixed::source(&header, networks), self_test.text())
}

fn bits_of(networks: &FixedNetworks, vector: &Vector) -> Vec<i32> {
    networks.decode(vector.row, &vector.readings).unwrap_or_default()
}

fn files(header: &Header<'_>, source: String, self_test: String) -> Files {
    let name = header.name;
    vec![
        (format!("{name}_decode.h"), header.text()),
        (format!("{name}_decode.c"), source),
        (format!("{name}_selftest.c"), self_test),
    ]
}

/// Writes the sources in floating point, compiles them where there is a compiler, and runs the self-test.
///
/// # Errors
/// They cannot be written, compiled or run.
pub(super) fn export(draft: &mut Draft<'_>) -> Result<Vec<BundleCheck>, BundleError> {
    let (portable, weights, golden) = (draft.portable, draft.weights, draft.vectors.golden());
    for (name, text) in write_floating(draft.name, portable, weights, golden, draft.limits, draft.remarks) {
        draft.write(&name, text)?;
    }
    let mut checks = vec![BundleCheck::of("model of the C source", draft.deviation_of(weights))];
    match run_self_test(draft.folder.path(), draft.name)? {
        Compiled::Ran { deviation } => checks.push(BundleCheck::of("C source, compiled and run", deviation)),
        Compiled::NoCompiler(reason) => draft.remarks.push(format!("the C source was not compiled: {reason}")),
    }
    Ok(checks)
}

/// Returns the usage section of the README.
pub(super) fn call(call: &Call<'_>) -> String {
    let portable = call.portable;
    let (name, takes_row, upper) = (call.name, portable.takes_row(), call.name.to_uppercase());
    let meaning = &portable.meaning;
    let (input, output) = (meaning.readings(), meaning.outputs());
    let row = if takes_row { "1, " } else { "" };
    let (reading, readings, coordinate, coordinates) = match (call.fixed, call.precision) {
        (Some(fixed), _) => (
            "int32_t",
            readings(portable, fixed),
            "int32_t",
            fixed::outputs(portable),
        ),
        (None, BundlePrecision::Single) => ("float", input, "float", output),
        (None, _) => ("double", input, "double", output),
    };
    let range = if portable.known_ranges().is_some() {
        format!(
            "\nint outside = {name}_is_out_of_range({row}{readings}); counts the readings beyond the range seen in \
             training."
        )
    } else {
        String::new()
    };
    let library = if call.fixed.is_some() { "" } else { " -lm" };
    let units = match (call.fixed, meaning) {
        (Some(_), Meaning::Own { .. }) => format!(
            "\nReadings and targets are integers in the units {upper}_READING_UNITS and {upper}_TARGET_UNITS \
             in the header:\nround(reading / unit) goes in, and unit * number comes out."
        ),
        _ => String::new(),
    };
    format!(
        "    #include \"{name}_decode.h\"\n    \
         {reading} {readings}[{upper}_CHANNELS];\n    \
         {coordinate} {coordinates}[{upper}_OUTPUTS];\n    \
         int status = {name}_decode({row}{readings}, {coordinates});\n\n\
         The status is {upper}_OK, or the reason why there is no answer. Compile {name}_decode.c with your program{libm}. The\n\
         self-test compares the golden vectors:\n\n    \
         cc -std=c99 -O2 {name}_decode.c {name}_selftest.c -lm -o selftest && ./selftest\n{units}{range}",
        libm = if library.is_empty() { "" } else { ", and link with -lm" },
    )
}

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
    /// Not compiled, with the reason.
    NoCompiler(&'static str),
}

/// Compiles the source and the self-test in `folder` and runs the self-test; no files are left there.
///
/// # Errors
/// The compiler refuses the source, or the self-test fails.
pub(in crate::export::bundle) fn run_self_test(folder: &Path, name: &str) -> Result<Compiled, BundleError> {
    run_sources(folder, &["decode", "selftest"].map(|part| format!("{name}_{part}.c")))
}

/// Compiles a source and its self-test in `folder` and runs the self-test; no files are left there.
///
/// # Errors
/// The compiler refuses the source, or the self-test fails.
pub(in crate::export::bundle) fn run_sources(folder: &Path, sources: &[String; 2]) -> Result<Compiled, BundleError> {
    let failed = |step: &'static str, reason: String| BundleError::SelfTest { step, reason };
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
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Ok(Compiled::NoCompiler("no C compiler found"));
        }
        Err(error) if error.kind() == io::ErrorKind::TimedOut => {
            return Ok(Compiled::NoCompiler(
                "the C compiler 'cc' does not end with an empty program",
            ));
        }
        Ok(output) if output.status.success() => {}
        _ => {
            return Ok(Compiled::NoCompiler(
                "the C compiler 'cc' cannot compile an empty program",
            ));
        }
    }
    let sources = sources.each_ref().map(|source| folder.join(source));
    let output = compile(&[&sources[0], &sources[1]], &program, home.path());
    let output = output.map_err(|error| failed("compiling the C source", error.to_string()))?;
    if !output.status.success() {
        return Err(failed("compiling the C source", first_lines(&output.stderr)));
    }
    let output = output_within(&mut Command::new(&program), home.path(), LONGEST_RUN);
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

fn compile(sources: &[&Path], program: &Path, home: &Path) -> io::Result<Output> {
    let mut command = Command::new(COMPILER);
    command.args(FLAGS).args(sources).arg("-o").arg(program).arg("-lm");
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

/// Name of the C type with these digits.
pub(super) fn type_name(digits: Digits) -> &'static str {
    match digits {
        Digits::Single => "float",
        Digits::Double => "double",
    }
}

/// Formats a number that C reads back bit for bit, limited to the range of `digits`.
pub(super) fn number(digits: Digits, value: f64) -> String {
    match digits {
        Digits::Single => format!("{:e}f", (value as f32).clamp(f32::MIN, f32::MAX)),
        Digits::Double => format!("{:e}", value.clamp(f64::MIN, f64::MAX)),
    }
}

/// Formats a 64-bit integer.
pub(super) fn long(value: i64) -> String {
    format!("INT64_C({value})")
}

/// Appends `declaration = { … };` with the nested braces of `shape`. The elements are given row by row.
pub(super) fn push_array(
    text: &mut String,
    declaration: &str,
    shape: &[usize],
    elements: impl IntoIterator<Item = impl Display>,
) {
    let _ = write!(text, "{declaration} = ");
    push_level(text, shape, &mut elements.into_iter(), 0);
    text.push_str(";\n\n");
}

fn push_level(text: &mut String, shape: &[usize], elements: &mut impl Iterator<Item = impl Display>, depth: usize) {
    /// Number of characters after which a line ends.
    const WIDTH: usize = 100;
    let Some((&size, inner)) = shape.split_first() else {
        return;
    };
    let indent = "    ".repeat(depth + 1);
    text.push_str("{\n");
    let mut line = indent.clone();
    for _ in 0..size {
        if inner.is_empty() {
            // The shape determines the number of elements.
            let Some(element) = elements.next() else { break };
            let _ = write!(line, "{element}, ");
            if line.len() > WIDTH {
                text.push_str(line.trim_end());
                text.push('\n');
                line.clone_from(&indent);
            }
        } else {
            text.push_str(&indent);
            push_level(text, inner, elements, depth + 1);
            text.push_str(",\n");
        }
    }
    if line.len() > indent.len() {
        text.push_str(line.trim_end());
        text.push('\n');
    }
    let _ = write!(text, "{}}}", "    ".repeat(depth));
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
        assert!(begun.elapsed() < Duration::from_secs(100), "{error}");
        // More output than a pipe holds.
        let output = run("head -c 1000000 /dev/zero; echo wrong >&2; exit 3", 60_000).unwrap();
        assert_eq!(
            (output.stdout.len(), output.stderr.as_slice()),
            (1_000_000, &b"wrong\n"[..])
        );
        assert_eq!(output.status.code(), Some(3));
    }

    #[test]
    fn numbers_are_literals_of_c() {
        let cases = [
            (number(Digits::Double, 0.1), "1e-1"),
            (number(Digits::Double, -1.0 / 3.0), "-3.333333333333333e-1"),
            (number(Digits::Single, f64::from(0.1_f32)), "1e-1f"),
            (number(Digits::Single, -1e39), "-3.4028235e38f"),
            (number(Digits::Double, f64::INFINITY), "1.7976931348623157e308"),
            (long(-5), "INT64_C(-5)"),
        ];
        for (literal, expected) in cases {
            assert_eq!(literal, expected);
        }
    }

    #[test]
    fn every_dimension_has_its_braces() {
        let mut text = String::new();
        push_array(&mut text, "static const int a[2][2]", &[2, 2], [1, 2, 3, 4]);
        let words: Vec<_> = text.split_whitespace().collect();
        assert_eq!(words.join(" "), "static const int a[2][2] = { { 1, 2, }, { 3, 4, }, };");
    }
}
