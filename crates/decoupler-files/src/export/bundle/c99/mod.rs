//! Bundles as one C99 header and one source, with a self-test.

mod compile;
mod fixed;
mod header;
mod self_test;
mod source;

use std::fmt::{Display, Write};

use decoupler_core::decoupling::Precision;

use super::{
    contents::{Contents, word},
    fixed16::FixedProgram,
    folder::AtomicFolder,
    report::{BundleCheck, BundleError, BundleReport},
};
use compile::run_self_test;
use header::Header;
use self_test::self_test;

/// Writes header, source and self-test, compiles them where there is a compiler, and runs the self-test. `fixed` is the
/// program in fixed point, if that is wanted. Adds the outcome to `report`, and returns lines of a program that decodes.
///
/// # Errors
/// They cannot be written, compiled or run, or the self-test finds a larger deviation than `limit`, relative to the scales.
pub(super) fn print(
    contents: &Contents,
    fixed: Option<&FixedProgram>,
    folder: &mut AtomicFolder,
    report: &mut BundleReport,
) -> Result<String, BundleError> {
    let header = Header::of(contents, fixed);
    let source = match fixed {
        Some(fixed) => fixed::source(&header, fixed),
        None => source::source(&header),
    };
    let name = &contents.name;
    folder.write(&format!("{name}_decode.h"), header.text())?;
    folder.write(&format!("{name}_decode.c"), source)?;
    folder.write(&format!("{name}_selftest.c"), self_test(&header, report.limit))?;
    match run_self_test(folder.path(), name)? {
        Ok(deviation) => report.checks.push(BundleCheck {
            evaluator: "C source, compiled and run",
            deviation,
        }),
        Err(reason) => report.remarks.push(format!("the C source was not compiled: {reason}")),
    }
    Ok(usage(&header))
}

/// Lines of a program that decodes.
fn usage(header: &Header<'_>) -> String {
    let (contents, is_fixed) = (header.contents, header.fixed.is_some());
    let (name, upper) = (&contents.name, header.upper());
    let declared = match contents.history() {
        Some(_) => format!("    {name}_state state;\n    {name}_start(&state);\n"),
        None => String::new(),
    };
    let units = match is_fixed && !contents.meaning.is_array {
        true => format!(
            "Readings and targets are integers in the units {upper}_READING_UNITS and {upper}_TARGET_UNITS in the header:\n\
             round(reading / unit) goes in, and unit * number comes out.\n"
        ),
        false => String::new(),
    };
    format!(
        "    #include \"{name}_decode.h\"\n{declared}    {} {}[{upper}_CHANNELS];\n    {name}_answer answer;\n    \
         int status = {};\n\n\
         The status is {upper}_OK, or the reason why there is no answer. Compile {name}_decode.c with your program{}.\n\
         {units}The self-test compares the golden answers:\n\n    \
         cc -std=c99 -O2 {name}_decode.c {name}_selftest.c -lm -o selftest && ./selftest\n",
        header.number,
        header.readings,
        header.call("&state", "1", "time_s", header.readings),
        if is_fixed { "" } else { ", and link with -lm" },
    )
}

/// Name of the C type of this precision.
fn type_name(precision: Precision) -> &'static str {
    word(precision, ["float", "double"])
}

/// Formats a number that C reads back bit for bit.
fn number(precision: Precision, value: f64) -> String {
    match precision {
        Precision::Single => format!("{:e}f", value as f32),
        Precision::Double => format!("{value:e}"),
    }
}

/// Appends `static const kind name[…] = { … };` with the nested braces of `shape`. The elements are given row by row.
fn push_array(
    text: &mut String,
    kind: &str,
    name: &str,
    shape: &[usize],
    elements: impl IntoIterator<Item = impl Display>,
) {
    let brackets: String = shape.iter().map(|size| format!("[{size}]")).collect();
    let _ = write!(text, "static const {kind} {name}{brackets} = ");
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

    #[test]
    fn numbers_are_literals_of_c() {
        let cases = [
            (number(Precision::Double, 0.1), "1e-1"),
            (number(Precision::Double, -1.0 / 3.0), "-3.333333333333333e-1"),
            (number(Precision::Single, f64::from(0.1_f32)), "1e-1f"),
        ];
        for (literal, expected) in cases {
            assert_eq!(literal, expected);
        }
    }

    #[test]
    fn every_dimension_has_its_braces() {
        let mut text = String::new();
        push_array(&mut text, "int", "a", &[2, 2], [1, 2, 3, 4]);
        let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(words, "static const int a[2][2] = { { 1, 2, }, { 3, 4, }, };");
    }
}
