use std::fmt::Write;

use decoupler_core::network::Quantity;

use super::{number, push_array};
use crate::export::bundle::{
    meaning::{Meaning, comment, wrapped},
    portable::Portable,
    vectors::{Deviation, Vector},
    weights::Digits,
};

/// Names and types shared by the header, source and self-test of a bundle in C.
pub(super) struct Header<'a> {
    /// Prefix of all names.
    pub(super) name: &'a str,
    pub(super) portable: &'a Portable,
    /// Type and name of the readings.
    pub(super) reading: &'static str,
    pub(super) readings: &'static str,
    /// Type and name of the outputs.
    pub(super) coordinate: &'static str,
    pub(super) coordinates: &'static str,
    /// Sentences on units; empty if the names of the columns contain them.
    pub(super) units: &'a str,
    /// Definitions of units.
    pub(super) definitions: &'a str,
    /// Remarks on the precision.
    pub(super) notes: &'a [String],
}

impl Header<'_> {
    /// Returns the prefix in upper case.
    pub(super) fn upper(&self) -> String {
        self.name.to_uppercase()
    }

    fn row(&self) -> &'static str {
        if self.portable.takes_row() { "int row, " } else { "" }
    }

    /// Declares the function that decodes.
    pub(super) fn decode_signature(&self) -> String {
        let Self {
            name,
            reading,
            readings,
            coordinate,
            coordinates,
            ..
        } = self;
        let upper = self.upper();
        format!(
            "int {name}_decode({row}const {reading} {readings}[{upper}_CHANNELS],\n    \
             {coordinate} {coordinates}[{upper}_OUTPUTS])",
            row = self.row()
        )
    }

    /// Declares the function that counts readings outside the range of training.
    pub(super) fn range_signature(&self) -> String {
        let (upper, row) = (self.upper(), self.row());
        let Self {
            name,
            reading,
            readings,
            ..
        } = self;
        format!("int {name}_is_out_of_range({row}const {reading} {readings}[{upper}_CHANNELS])")
    }

    /// Statements that set `network`, at the start of both functions.
    pub(super) fn network_of_row(&self) -> String {
        if !self.portable.takes_row() {
            return "    const int network = 0;\n".to_owned();
        }
        let upper = self.upper();
        format!(
            "    if (row < 1 || row > {upper}_ROWS) {{\n        \
             return {upper}_NO_SUCH_ROW;\n    \
             }}\n    \
             const int network = row - 1;\n"
        )
    }

    fn note_lines(&self) -> impl Iterator<Item = String> {
        let note = |note: &String| wrapped(&comment(&format!("Note: {note}.")));
        self.notes.iter().flat_map(note)
    }

    /// Text of the header file.
    pub(super) fn text(&self) -> String {
        let (upper, portable) = (self.upper(), self.portable);
        let mut text = match &portable.meaning {
            Meaning::Array(_) => format!(
                "/* Decodes the readings of one row-wire of a tactile array into the coordinates of its nodes.\n   \
                 {units} Channels are r_1 to r_{channels}; outputs are x_1, y_1, z_1, x_2, ...{notes} */\n",
                units = self.units,
                channels = portable.channels,
                notes = self.note_lines().map(|line| format!("\n   {line}")).collect::<String>(),
            ),
            own @ Meaning::Own { .. } => {
                let mut lines = own.legend();
                lines.extend(self.units.lines().map(|line| line.trim_start().to_owned()));
                lines.extend(self.note_lines());
                format!("/* Decodes readings into targets.\n   {} */\n", lines.join("\n   "))
            }
        };
        let _ = write!(text, "#ifndef {upper}_DECODE_H\n#define {upper}_DECODE_H\n\n");
        if self.reading == "int32_t" {
            text += "#include <stdint.h>\n\n";
        }
        if portable.takes_row() {
            let _ = writeln!(text, "#define {upper}_ROWS {}", portable.rows());
        }
        let (channels, outputs, definitions) = (portable.channels, portable.outputs, self.definitions);
        let _ = write!(
            text,
            "#define {upper}_CHANNELS {channels}\n\
             #define {upper}_OUTPUTS {outputs}\n\n\
             {definitions}{half_widths}\
             #ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
             /* What the functions return. */\n\
             enum {{\n    {upper}_OK = 0,\n    {upper}_NO_SUCH_ROW = -1,\n    {upper}_BAD_READING = -2\n}};\n\n",
            half_widths = portable.meaning.half_widths().map_or_else(String::new, |half_widths| {
                let half_widths: Vec<String> = half_widths.iter().map(|value| format!("{value:?}")).collect();
                format!(
                    "/* Half-widths of the 90 % prediction intervals for all answers together, in the units of the targets, to initialise an array. */\n\
                     #define {upper}_HALF_WIDTHS_90 {{{}}}\n\n",
                    half_widths.join(", ")
                )
            }),
        );
        let row = if portable.takes_row() {
            format!(" Rows are counted from 1 to {}.", portable.rows())
        } else {
            String::new()
        };
        let _ = write!(
            text,
            "/* Decodes {one}.{row} Returns {upper}_OK, or leaves the {coordinates} as they are and returns\n   \
             what is wrong.{overflow} */\n{};\n\n",
            self.decode_signature(),
            one = portable.meaning.sample(),
            coordinates = portable.meaning.output().to_owned() + "s",
            overflow = match self.reading {
                "int32_t" => String::new(),
                _ => format!(" Readings so extreme that the sums overflow give {upper}_BAD_READING."),
            },
        );
        if portable.known_ranges().is_some() {
            let _ = write!(
                text,
                "/* Returns the number of readings beyond the range seen in training by more than a tenth of it, where the\n   \
                 {decoder} only guesses: 0 if there are none. Negative if the row is wrong. */\n{};\n\n",
                self.range_signature(),
                decoder = portable.decoder,
            );
        }
        text + "#ifdef __cplusplus\n}\n#endif\n\n#endif\n"
    }
}

/// Appends the function that counts readings outside the limits, with these.
pub(super) fn push_out_of_range(
    text: &mut String,
    header: &Header<'_>,
    limits: impl Iterator<Item = (String, String)> + Clone,
) {
    let (rows, channels) = (header.portable.rows(), header.portable.channels);
    let sizes = format!("[{rows}][{}_CHANNELS]", header.upper());
    let shape = [rows, channels];
    let reading = header.reading;
    let low = limits.clone().map(|limits| limits.0);
    push_array(text, &format!("static const {reading} lowest{sizes}"), &shape, low);
    push_array(
        text,
        &format!("static const {reading} highest{sizes}"),
        &shape,
        limits.map(|limits| limits.1),
    );
    *text += &format!(
        "{signature}\n\
         {{\n    \
         int outside = 0;\n\
         {network}    \
         for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n        \
         if (!({readings}[i] >= lowest[network][i] && {readings}[i] <= highest[network][i])) {{\n            \
         ++outside;\n        \
         }}\n    \
         }}\n    \
         return outside;\n\
         }}\n",
        signature = header.range_signature(),
        network = header.network_of_row(),
        upper = header.upper(),
        readings = header.readings,
    );
}

/// Golden vectors of a self-test.
pub(super) struct SelfTest<'a> {
    pub(super) header: &'a Header<'a>,
    pub(super) vectors: &'a [Vector],
    /// Largest deviations allowed, relative to the range of the outputs.
    pub(super) limits: Deviation,
    /// For a source in fixed point.
    pub(super) whole: Option<WholeNumbers>,
}

/// Units of a source in fixed point, and its expected outputs.
pub(super) struct WholeNumbers {
    /// Number of units in 1 of each reading.
    pub(super) readings_per_one: Vec<f64>,
    /// Unit of each decoded output, relative to the output of the network.
    pub(super) units: Vec<f64>,
    /// Expected integers, bit for bit, vector by vector.
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
                 puts(\"an output differs from the fixed-point model\");\n                \
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
                 puts(\"a row that does not exist is not refused\");\n        \
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
