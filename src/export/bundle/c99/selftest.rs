use super::{header::Header, literal::push_array};
use crate::export::bundle::vectors::Vector;

/// Golden vectors as a self-test has them.
pub(super) struct SelfTest<'a> {
    pub(super) header: &'a Header<'a>,
    pub(super) vectors: &'a [Vector],
    /// Unit of each decoded output, as the network has it; empty if they are decoded as such.
    pub(super) units: Vec<f64>,
    /// Largest deviation allowed, relative to the range of the outputs.
    pub(super) limit: f64,
    /// Whole numbers that must come out bit for bit, vector by vector.
    pub(super) bits: Option<Vec<i32>>,
}

impl SelfTest<'_> {
    /// Writes the program. `reading` writes a reading of a channel as a literal.
    pub(super) fn text(&self, reading: impl Fn(usize, f64) -> String) -> String {
        let Self {
            header,
            vectors,
            units,
            limit,
            bits,
        } = self;
        let (name, upper, portable) = (header.name, header.upper(), header.portable);
        let mut text = format!(
            "/* Decodes the golden vectors and compares the {output}s with those of the program that made them.\n   \
             Exits with 0 if they agree. */\n\
             #include \"{name}_decode.h\"\n\n#include <math.h>\n#include <stdio.h>\n\n\
             #define VECTORS {count}\n\n",
            count = vectors.len(),
            output = portable.meaning.output(),
        );
        if portable.takes_row() {
            let rows = vectors.iter().map(|vector| vector.network + 1);
            push_array(&mut text, "static const int rows[VECTORS]", &[vectors.len()], rows);
        }
        let declaration = format!("static const {} readings[VECTORS][{upper}_CHANNELS]", header.reading);
        let readings = vectors
            .iter()
            .flat_map(|vector| vector.readings.iter().enumerate())
            .map(|(channel, &value)| reading(channel, value));
        push_array(&mut text, &declaration, &[vectors.len(), portable.channels], readings);
        let declaration = format!("static const double expected[VECTORS][{upper}_OUTPUTS]");
        let expected = vectors
            .iter()
            .flat_map(|vector| &vector.answers)
            .map(|value| format!("{value:e}"));
        push_array(&mut text, &declaration, &[vectors.len(), portable.outputs], expected);
        let scales = portable.scales.iter().map(|scale| format!("{scale:e}"));
        text += "/* Ranges to which deviations are relative. */\n";
        let declaration = format!("static const double scales[{upper}_OUTPUTS]");
        push_array(&mut text, &declaration, &[portable.outputs], scales);
        let in_units = if units.is_empty() {
            "(double)decoded[k]"
        } else {
            let declaration = format!("static const double units[{upper}_OUTPUTS]");
            let units = units.iter().map(|unit| format!("{unit:e}"));
            push_array(&mut text, &declaration, &[portable.outputs], units);
            "(double)decoded[k] * units[k]"
        };
        let same_bits = if let Some(bits) = bits {
            let declaration = format!("static const int32_t expected_bits[VECTORS][{upper}_OUTPUTS]");
            push_array(&mut text, &declaration, &[vectors.len(), portable.outputs], bits);
            "            if (decoded[k] != expected_bits[v][k]) {\n                \
             puts(\"an output differs from the model in whole numbers\");\n                \
             return 1;\n            }\n"
        } else {
            ""
        };
        let row = if portable.takes_row() { "rows[v], " } else { "" };
        let bad_row = if portable.takes_row() {
            format!(
                "    if ({name}_decode(0, readings[0], decoded) != {upper}_NO_SUCH_ROW ||\n        \
                 {name}_decode({upper}_ROWS + 1, readings[0], decoded) != {upper}_NO_SUCH_ROW) {{\n        \
                 puts(\"a row that the array does not have is not refused\");\n        \
                 return 1;\n    }}\n"
            )
        } else {
            String::new()
        };
        let first_row = if portable.takes_row() { "rows[0], " } else { "" };
        let outside = if portable.ranges().is_some() {
            format!(
                "        if ({name}_is_out_of_range({row}readings[v]) < 0) {{\n            \
                 puts(\"the range of a golden vector is not known\");\n            \
                 return 1;\n        }}\n"
            )
        } else {
            String::new()
        };
        let is_signed = portable.quantity == crate::network::Quantity::Raw;
        let bad_reading = if is_signed {
            String::new()
        } else {
            format!(
                "    for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n        \
                 bad[i] = readings[0][i];\n    }}\n    \
                 bad[{upper}_CHANNELS - 1] = 0;\n    \
                 if ({name}_decode({first_row}bad, decoded) != {upper}_BAD_READING) {{\n        \
                 puts(\"a reading of 0 is not refused\");\n        \
                 return 1;\n    }}\n"
            )
        };
        let bad = if is_signed {
            String::new()
        } else {
            format!("    {} bad[{upper}_CHANNELS];\n", header.reading)
        };
        text + &format!(
            "int main(void)\n{{\n    \
             {coordinate} decoded[{upper}_OUTPUTS];\n\
             {bad}    \
             double largest = 0;\n    \
             for (int v = 0; v < VECTORS; ++v) {{\n        \
             if ({name}_decode({row}readings[v], decoded) != {upper}_OK) {{\n            \
             puts(\"a golden vector is refused\");\n            \
             return 1;\n        }}\n\
             {outside}        \
             for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n            \
             const double deviation = fabs({in_units} - expected[v][k]) / scales[k];\n            \
             if (!(deviation <= largest)) {{\n                \
             largest = deviation;\n            }}\n{same_bits}        }}\n    }}\n\
             {bad_reading}{bad_row}    \
             printf(\"largest deviation: %.3e of the range of the outputs, limit {limit:.1e}\\n\", largest);\n    \
             return largest <= {limit:e} ? 0 : 1;\n}}\n",
            coordinate = header.coordinate,
        )
    }
}
