use super::{header::Header, number, push_array};
use crate::export::bundle::{
    vectors::{Deviation, Vector},
    weights::Digits,
};
use decoupler_core::network::Quantity;

/// Golden vectors as a self-test has them.
pub(super) struct SelfTest<'a> {
    pub(super) header: &'a Header<'a>,
    pub(super) vectors: &'a [Vector],
    /// Largest deviations allowed, relative to the range of the outputs.
    pub(super) limits: Deviation,
    /// For a source in whole numbers.
    pub(super) whole: Option<WholeNumbers>,
}

/// Units of a source in whole numbers, and what it must answer.
pub(super) struct WholeNumbers {
    /// Number of units in 1 of each reading.
    pub(super) readings_per_one: Vec<f64>,
    /// Unit of each decoded output, as the network has it.
    pub(super) units: Vec<f64>,
    /// Whole numbers that must come out bit for bit, vector by vector.
    pub(super) bits: Vec<i32>,
}

impl SelfTest<'_> {
    /// Writes the program.
    pub(super) fn text(&self) -> String {
        let Self { header, vectors, .. } = self;
        let (name, portable) = (header.name, header.portable);
        let mut text = format!(
            "/* Decodes the golden vectors and compares the {output}s with those of the network, which takes the readings\n   \
             in double precision. Exits with 0 if they agree. */\n\
             #include \"{name}_decode.h\"\n\n#include <math.h>\n#include <stdio.h>\n\n\
             #define VECTORS {count}\n\n",
            output = portable.meaning.output(),
            count = vectors.len(),
        );
        if portable.takes_row() {
            let rows = vectors.iter().map(|vector| vector.row + 1);
            push_array(&mut text, "static const int rows[VECTORS]", &[vectors.len()], rows);
        }
        self.push_tables(&mut text);
        text + &self.main()
    }

    /// Appends readings, expected outputs and units.
    fn push_tables(&self, text: &mut String) {
        let Self { header, vectors, .. } = self;
        let (upper, portable) = (header.upper(), header.portable);
        let mut push = |name: &str, shape: &[usize], values: &mut dyn Iterator<Item = f64>| {
            let values = values.map(|value| number(Digits::Double, value));
            push_array(text, &format!("static const double {name}"), shape, values);
        };
        let of_vectors = |of: fn(&Vector) -> &Vec<f64>| vectors.iter().flat_map(of).copied();
        let (channels, outputs) = (portable.channels, [vectors.len(), portable.outputs]);
        let (each_channel, each_output) = (format!("[{upper}_CHANNELS]"), format!("[{upper}_OUTPUTS]"));
        let mut readings = of_vectors(|vector| &vector.readings);
        push(
            &format!("readings[VECTORS]{each_channel}"),
            &[vectors.len(), channels],
            &mut readings,
        );
        let mut answers = of_vectors(|vector| &vector.answers);
        push(&format!("expected[VECTORS]{each_output}"), &outputs, &mut answers);
        if self.is_single() {
            let mut answers = of_vectors(|vector| &vector.answers_to_taken);
            push(
                &format!("expected_of_rounded[VECTORS]{each_output}"),
                &outputs,
                &mut answers,
            );
        }
        push(
            &format!("scales{each_output}"),
            &outputs[1..],
            &mut portable.scales.iter().copied(),
        );
        if let Some(whole) = &self.whole {
            let mut per_one = whole.readings_per_one.iter().copied();
            push(&format!("readings_per_one{each_channel}"), &[channels], &mut per_one);
            push(
                &format!("units{each_output}"),
                &outputs[1..],
                &mut whole.units.iter().copied(),
            );
            let declaration = format!("static const int32_t expected_bits[VECTORS]{each_output}");
            push_array(text, &declaration, &outputs, &whole.bits);
        }
    }

    fn main(&self) -> String {
        let header = self.header;
        let (name, upper, portable) = (header.name, header.upper(), header.portable);
        let takes_row = portable.takes_row();
        let (row, first_row) = if takes_row {
            ("rows[v], ", "rows[0], ")
        } else {
            ("", "")
        };
        let (taken, in_units, same_bits) = if self.whole.is_some() {
            (
                "(int32_t)lround(readings[v][i] * readings_per_one[i])",
                "decoded[k] * units[k]",
                "            if (decoded[k] != expected_bits[v][k]) {\n                \
                 puts(\"an output differs from the model in whole numbers\");\n                \
                 return 1;\n            }\n",
            )
        } else if self.is_single() {
            ("(float)readings[v][i]", "(double)decoded[k]", "")
        } else {
            ("readings[v][i]", "decoded[k]", "")
        };
        let bad_row = if takes_row {
            format!(
                "    if ({name}_decode(0, taken, decoded) != {upper}_NO_SUCH_ROW ||\n        \
                 {name}_decode({upper}_ROWS + 1, taken, decoded) != {upper}_NO_SUCH_ROW) {{\n        \
                 puts(\"a row that the array does not have is not refused\");\n        \
                 return 1;\n    }}\n"
            )
        } else {
            String::new()
        };
        let outside = if portable.known_ranges().is_some() {
            format!(
                "        if ({name}_is_out_of_range({row}taken) < 0) {{\n            \
                 puts(\"the range of a golden vector is not known\");\n            \
                 return 1;\n        }}\n"
            )
        } else {
            String::new()
        };
        let bad_reading = if portable.quantity == Quantity::Raw {
            String::new()
        } else {
            format!(
                "    taken[{upper}_CHANNELS - 1] = 0;\n    \
                 if ({name}_decode({first_row}taken, decoded) != {upper}_BAD_READING) {{\n        \
                 puts(\"a reading of 0 is not refused\");\n        \
                 return 1;\n    }}\n"
            )
        };
        let compared = |expected: &str, largest: &str| {
            format!(
                "            deviation = fabs({in_units} - {expected}[v][k]) / scales[k];\n            \
                 if (!(deviation <= {largest})) {{\n                {largest} = deviation;\n            }}\n"
            )
        };
        let of_expected = compared("expected", "largest");
        let Deviation { total, of_arithmetic } = self.limits;
        let (declared, of_rounded, printed, agrees) = if self.is_single() {
            (
                ", of_arithmetic = 0",
                compared("expected_of_rounded", "of_arithmetic"),
                format!(
                    "    printf(\"without the rounding of the readings, by arithmetic: %.3e, limit {of_arithmetic:.1e}\\n\", \
                     of_arithmetic);\n"
                ),
                format!(" && of_arithmetic <= {of_arithmetic:e}"),
            )
        } else {
            ("", String::new(), String::new(), String::new())
        };
        format!(
            "int main(void)\n{{\n    \
             {reading} taken[{upper}_CHANNELS];\n    \
             {coordinate} decoded[{upper}_OUTPUTS];\n    \
             double deviation, largest = 0{declared};\n    \
             for (int v = 0; v < VECTORS; ++v) {{\n        \
             /* The readings as the decoder takes them. */\n        \
             for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n            \
             taken[i] = {taken};\n        }}\n        \
             if ({name}_decode({row}taken, decoded) != {upper}_OK) {{\n            \
             puts(\"a golden vector is refused\");\n            \
             return 1;\n        }}\n\
             {outside}        \
             for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n\
             {of_expected}{of_rounded}{same_bits}        }}\n    }}\n\
             {bad_row}{bad_reading}    \
             printf(\"largest deviation: %.3e of the range of the outputs, limit {total:.1e}\\n\", largest);\n\
             {printed}    \
             return largest <= {total:e}{agrees} ? 0 : 1;\n}}\n",
            reading = header.reading,
            coordinate = header.coordinate,
        )
    }

    fn is_single(&self) -> bool {
        self.header.reading == "float"
    }
}
