use std::fmt::Write;

use super::push_array;
use crate::export::bundle::{
    meaning::{Meaning, comment, wrapped},
    portable::Portable,
};

/// Names and types that the header, source and self-test of a bundle in C have in common.
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
    /// Sentences on units; empty where the names of the columns have them.
    pub(super) units: &'a str,
    /// Definitions of units.
    pub(super) definitions: &'a str,
    /// Remarks on the precision.
    pub(super) notes: &'a [String],
}

impl Header<'_> {
    /// The prefix in capitals.
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
             {definitions}\
             #ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
             /* What the functions return. */\n\
             enum {{\n    {upper}_OK = 0,\n    {upper}_NO_SUCH_ROW = -1,\n    {upper}_BAD_READING = -2{not_explained}\n}};\n\n",
            not_explained = match &portable.equations {
                Some(equations) if equations.seeks_solution => format!(",\n    {upper}_NOT_EXPLAINED = 1"),
                _ => String::new(),
            },
        );
        let row = if portable.takes_row() {
            format!(" Rows are counted from 1 to {}.", portable.rows())
        } else {
            String::new()
        };
        let _ = write!(
            text,
            "/* Decodes {one}.{row} Returns {upper}_OK, or leaves the {coordinates} as they are and returns\n   \
             what is wrong.{overflow}{not_explained} */\n{};\n\n",
            self.decode_signature(),
            one = portable.meaning.sample(),
            coordinates = portable.meaning.output().to_owned() + "s",
            not_explained = match &portable.equations {
                Some(equations) if equations.seeks_solution => format!(
                    "\n   {upper}_NOT_EXPLAINED: the coordinates are the best found, but the readings have noise or come from\n   \
                     another sensor."
                ),
                _ => String::new(),
            },
            overflow = match self.reading {
                "int32_t" => String::new(),
                _ => format!(
                    " Readings so extreme that the sums overflow and leave no answer\n   give {upper}_BAD_READING."
                ),
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
