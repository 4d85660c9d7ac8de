//! A program that decodes the golden readings and compares the answers.

use std::fmt::Write;

use decoupler_core::decoupling::Precision;

use super::{header::Header, number, push_array};
use crate::export::bundle::{exported_program::are_positive, golden::GoldenRow};

/// Text of the program; `limit` is the largest deviation allowed, relative to the range of the outputs.
pub(super) fn self_test(header: &Header<'_>, limit: f64) -> String {
    let contents = header.contents;
    let (name, is_sequence) = (&contents.name, contents.history().is_some());
    let golden = contents.golden.printed();
    let mut text = format!(
        "/* Decodes the golden readings and compares the {}s with those of the {}, which takes the readings in double\n   \
             precision. Exits with 0 if they agree. */\n#include \"{name}_decode.h\"\n\n#include <math.h>\n#include <stdio.h>\n\n",
        contents.meaning.output(),
        contents.noun,
    );
    let (channels, outputs, count) = (contents.channels(), contents.outputs(), golden.len());
    let _ = write!(text, "#define COUNT {count}\n\n");
    if contents.takes_row() {
        push_array(&mut text, "int", "rows", &[count], golden.iter().map(|row| row.row + 1));
    }
    if is_sequence {
        let restarts = golden.iter().map(|row| u8::from(row.is_new_series));
        push_array(&mut text, "int", "is_new_series", &[count], restarts);
    }
    let mut push = |name: &str, shape: &[usize], values: &mut dyn Iterator<Item = f64>| {
        let values = values.map(|value| number(Precision::Double, value));
        push_array(&mut text, "double", name, shape, values);
    };
    if is_sequence {
        let mut times_s = golden.iter().map(|row| row.time_s.unwrap_or(0.0));
        push("times_s", &[count], &mut times_s);
    }
    let of = |pick: fn(&GoldenRow) -> &[f64]| golden.iter().flat_map(pick).copied();
    push("readings", &[count, channels], &mut of(|row| &row.readings));
    push("expected", &[count, outputs], &mut of(|row| &row.targets));
    push("scales", &[outputs], &mut contents.scales.iter().copied());
    if let Some(fixed) = header.fixed {
        push("per_one", &[channels], &mut fixed.readings.all().map(|unit| 1.0 / unit));
        push("units", &[outputs], &mut fixed.targets.all());
    }
    text + &main(header, limit)
}

fn main(header: &Header<'_>, limit: f64) -> String {
    let (contents, upper) = (header.contents, header.upper());
    let (name, number, outputs) = (&contents.name, header.number, header.outputs);
    // One state for each row-wire.
    let rows = contents.rows;
    let call = |index: &str, row: &str| {
        let state = match contents.takes_row() {
            true => &format!("&states[rows[{index}] - 1]"),
            false => "&states[0]",
        };
        header.call(state, row, &format!("times_s[{index}]"), "taken")
    };
    let (declared, started) = match contents.history().is_some() {
        true => (
            format!("    {name}_state states[{rows}];\n"),
            format!(
                "        for (int r = 0; is_new_series[v] && r < {rows}; ++r) {{\n            {name}_start(&states[r]);\n        }}\n"
            ),
        ),
        false => (String::new(), String::new()),
    };
    let (taken, unit) = match header.fixed {
        Some(_) => ("lround(readings[v][i] * per_one[i])", " * units[k]"),
        None => ("readings[v][i]", ""),
    };
    let bad_row = match contents.takes_row() {
        true => format!(
            "    if ({} != {upper}_NO_SUCH_ROW ||\n        {} != {upper}_NO_SUCH_ROW) {{\n        \
                 puts(\"a row that does not exist is not refused\");\n        return 1;\n    }}\n",
            call("0", "0"),
            call("0", &format!("{upper}_ROWS + 1")),
        ),
        false => String::new(),
    };
    let bad_reading = match are_positive(&contents.exported.program) {
        true => format!(
            "    taken[{upper}_CHANNELS - 1] = 0;\n    if ({} != {upper}_BAD_READING) {{\n        \
                 puts(\"a reading of 0 is not refused\");\n        return 1;\n    }}\n",
            call("0", "rows[0]"),
        ),
        false => String::new(),
    };
    format!(
        "int main(void)\n{{\n    {number} taken[{upper}_CHANNELS];\n    {name}_answer answer;\n    \
             double deviation, largest = 0;\n{declared}    \
             for (int v = 0; v < COUNT; ++v) {{\n        /* The readings as the decoder takes them. */\n        \
             for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n            taken[i] = ({number}){taken};\n        }}\n{started}        \
             if ({decoding} != {upper}_OK) {{\n            \
             puts(\"golden readings are refused\");\n            return 1;\n        }}\n        \
             for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n            \
             deviation = fabs((double)answer.{outputs}[k]{unit} - expected[v][k]) / scales[k];\n            \
             if (!(deviation <= largest)) {{\n                largest = deviation;\n            }}\n        }}\n    }}\n\
             {bad_row}{bad_reading}    \
             printf(\"largest deviation: %.3e of the range of the outputs, limit {limit:.1e}\\n\", largest);\n    \
             return largest <= {limit:e} ? 0 : 1;\n}}\n",
        decoding = call("v", "rows[v]"),
    )
}
