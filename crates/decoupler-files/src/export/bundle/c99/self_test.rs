//! A program that decodes the golden readings and compares the answers.

use std::fmt::Write;

use decoupler_core::decoupling::Precision;

use super::{header::Header, number, push_array};
use crate::export::bundle::{fixed16::FixedProgram, golden::GoldenRow};

pub(super) struct SelfTest<'a> {
    pub(super) header: &'a Header<'a>,
    pub(super) fixed: Option<&'a FixedProgram>,
    /// Largest deviation allowed, relative to the range of the outputs.
    pub(super) limit: f64,
}

impl SelfTest<'_> {
    /// Text of the program.
    pub(super) fn text(&self) -> String {
        let contents = self.header.contents;
        let (name, upper) = (&contents.name, self.header.upper());
        let golden = contents.golden.rows();
        let mut text = format!(
            "/* Decodes the golden readings and compares the {}s with those of the {}, which takes the readings in double\n   \
             precision. Exits with 0 if they agree. */\n#include \"{name}_decode.h\"\n\n#include <math.h>\n#include <stdio.h>\n\n",
            contents.meaning.output(),
            contents.noun,
        );
        let _ = write!(text, "#define COUNT {}\n\n", golden.len());
        let (channels, outputs) = (contents.channels(), contents.outputs());
        let count = golden.len();
        if contents.takes_row() {
            push_array(&mut text, "int", "rows", &[count], golden.iter().map(|row| row.row + 1));
        }
        if contents.history().is_some() {
            let restarts = golden.iter().map(|row| u8::from(row.is_new_series));
            push_array(&mut text, "int", "is_new_series", &[count], restarts);
        }
        let mut push = |name: &str, shape: &[usize], values: &mut dyn Iterator<Item = f64>| {
            let values = values.map(|value| number(Precision::Double, value));
            push_array(&mut text, "double", name, shape, values);
        };
        if contents.history().is_some() {
            push(
                "times_s",
                &[count],
                &mut golden.iter().map(|row| row.time_s.unwrap_or(0.0)),
            );
        }
        let of = |pick: fn(&GoldenRow) -> &[f64]| golden.iter().flat_map(pick).copied();
        push("readings", &[count, channels], &mut of(|row| &row.readings));
        push("expected", &[count, outputs], &mut of(|row| &row.targets));
        push("scales", &[outputs], &mut contents.scales.iter().copied());
        if let Some(fixed) = self.fixed {
            push("per_one", &[channels], &mut fixed.readings_per_one());
            push("units", &[outputs], &mut fixed.target_units());
        }
        text + &self.main(&upper)
    }

    fn main(&self, upper: &str) -> String {
        let (header, contents) = (self.header, self.header.contents);
        let (name, outputs) = (&contents.name, header.outputs);
        let is_sequence = contents.history().is_some();
        // One state for each row-wire.
        let rows = contents.rows;
        let call = |index: &str, row: &str| {
            let state = match contents.takes_row() {
                true => &format!("&states[rows[{index}] - 1]"),
                false => "&states[0]",
            };
            header.call(state, row, &format!("times_s[{index}]"), "taken")
        };
        let (declared, started) = match is_sequence {
            true => (
                format!("    {name}_state states[{rows}];\n"),
                format!(
                    "        for (int r = 0; is_new_series[v] && r < {rows}; ++r) {{\n            {name}_start(&states[r]);\n        }}\n"
                ),
            ),
            false => (String::new(), String::new()),
        };
        let taken = match (self.fixed, header.reading) {
            (Some(_), _) => "(int32_t)lround(readings[v][i] * per_one[i])",
            (None, "float") => "(float)readings[v][i]",
            (None, _) => "readings[v][i]",
        };
        let decoded = match (self.fixed, header.target) {
            (Some(_), _) => format!("answer.{outputs}[k] * units[k]"),
            (None, "float") => format!("(double)answer.{outputs}[k]"),
            (None, _) => format!("answer.{outputs}[k]"),
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
        let bad_reading = match contents.exported.are_positive() {
            true => format!(
                "    taken[{upper}_CHANNELS - 1] = 0;\n    if ({} != {upper}_BAD_READING) {{\n        \
                 puts(\"a reading of 0 is not refused\");\n        return 1;\n    }}\n",
                call("0", "rows[0]"),
            ),
            false => String::new(),
        };
        let limit = self.limit;
        format!(
            "int main(void)\n{{\n    {reading} taken[{upper}_CHANNELS];\n    {name}_answer answer;\n    \
             double deviation, largest = 0;\n{declared}    \
             for (int v = 0; v < COUNT; ++v) {{\n        /* The readings as the decoder takes them. */\n        \
             for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n            taken[i] = {taken};\n        }}\n{started}        \
             if ({decoding} != {upper}_OK) {{\n            \
             puts(\"golden readings are refused\");\n            return 1;\n        }}\n        \
             for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n            \
             deviation = fabs({decoded} - expected[v][k]) / scales[k];\n            \
             if (!(deviation <= largest)) {{\n                largest = deviation;\n            }}\n        }}\n    }}\n\
             {bad_row}{bad_reading}    \
             printf(\"largest deviation: %.3e of the range of the outputs, limit {limit:.1e}\\n\", largest);\n    \
             return largest <= {limit:e} ? 0 : 1;\n}}\n",
            reading = header.reading,
            decoding = call("v", "rows[v]"),
        )
    }
}
