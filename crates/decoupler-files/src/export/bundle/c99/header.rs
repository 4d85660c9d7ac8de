use std::fmt::Write;

use super::type_name;
use crate::export::bundle::{contents::Contents, fixed16::FixedProgram, meaning::wrapped};

/// Types and names of the interface.
pub(super) struct Header<'a> {
    pub(super) contents: &'a Contents,
    pub(super) fixed: Option<&'a FixedProgram>,
    /// Type of a reading and of a target.
    pub(super) number: &'static str,
    pub(super) readings: &'static str,
    pub(super) outputs: &'static str,
}

impl<'a> Header<'a> {
    pub(super) fn of(contents: &'a Contents, fixed: Option<&'a FixedProgram>) -> Self {
        let (readings, outputs) = (contents.meaning.readings(), contents.meaning.outputs());
        Self {
            contents,
            fixed,
            number: fixed.map_or(type_name(contents.outer_precision()), |_| "int32_t"),
            readings: fixed.map_or(readings, |fixed| fixed.readings_name(readings)),
            outputs: match fixed {
                Some(_) if contents.meaning.is_array => "coordinates_nm",
                _ => outputs,
            },
        }
    }

    /// The prefix in upper case.
    pub(super) fn upper(&self) -> String {
        self.contents.name.to_uppercase()
    }

    /// Declares the function that decodes.
    pub(super) fn signature(&self) -> String {
        let (name, upper) = (&self.contents.name, self.upper());
        let state = format!("{name}_state *state");
        let readings = format!("const {} {}[{upper}_CHANNELS]", self.number, self.readings);
        format!(
            "int {}({},\n    {name}_answer *answer)",
            self.function(),
            self.arguments(&state, "int row", "double time_s", &readings)
        )
    }

    /// Calls the function with these arguments, of which it may not take all.
    pub(super) fn call(&self, state: &str, row: &str, time: &str, readings: &str) -> String {
        format!(
            "{}({}, &answer)",
            self.function(),
            self.arguments(state, row, time, readings)
        )
    }

    fn function(&self) -> String {
        let is_sequence = self.contents.history().is_some();
        format!("{}_{}", self.contents.name, if is_sequence { "step" } else { "decode" })
    }

    fn arguments(&self, state: &str, row: &str, time: &str, readings: &str) -> String {
        let (is_sequence, takes_row) = (self.contents.history().is_some(), self.contents.takes_row());
        let [state, time] = [state, time].map(|argument| is_sequence.then_some(argument));
        let taken = [state, takes_row.then_some(row), time, Some(readings)];
        Vec::from_iter(taken.into_iter().flatten()).join(", ")
    }

    /// Text of the header file.
    pub(super) fn text(&self) -> String {
        let (contents, upper) = (self.contents, self.upper());
        let name = &contents.name;
        let of_units = self.fixed.map(|fixed| fixed.units_in_words(&contents.meaning));
        let lines = contents.legend(&of_units.unwrap_or_default());
        let mut text = format!(
            "/* {}.\n   {} */\n#ifndef {upper}_DECODE_H\n#define {upper}_DECODE_H\n\n",
            contents.meaning.purpose(),
            lines.join("\n   ")
        );
        text += if self.fixed.is_some() {
            "#include <stdint.h>\n\n"
        } else {
            ""
        };
        if contents.takes_row() {
            let _ = writeln!(text, "#define {upper}_ROWS {}", contents.rows);
        }
        let (channels, outputs) = (contents.channels(), contents.outputs());
        let _ = writeln!(
            text,
            "#define {upper}_CHANNELS {channels}\n#define {upper}_OUTPUTS {outputs}\n"
        );
        let of_units = self
            .fixed
            .map(|fixed| fixed.unit_definitions(&upper, &contents.meaning));
        text += &of_units.unwrap_or_default();
        text += "#ifdef __cplusplus\nextern \"C\" {\n#endif\n\n";
        let _ = write!(
            text,
            "/* What the function returns. */\nenum {{\n    {upper}_OK = 0,\n    {upper}_NO_SUCH_ROW = -1,\n    \
             {upper}_BAD_READING = -2\n}};\n\ntypedef struct {{\n    {} {}[{upper}_OUTPUTS];\n",
            self.number, self.outputs
        );
        if contents.exported.half_widths.is_some() {
            let _ = write!(
                text,
                "    /* Half-widths of the 90 % prediction intervals, valid for all answers together. */\n    \
                 {} half_widths[{upper}_OUTPUTS];\n",
                self.number
            );
        }
        if contents.exported.outside.is_some() {
            let what = wrapped(&format!(
                "{}, where the {} only guesses: 0 if there are none.",
                contents.outside_in_words(),
                contents.noun
            ));
            let what = what.join("\n       ");
            let _ = writeln!(text, "    /* {what} */\n    int readings_outside;");
        }
        let _ = write!(text, "}} {name}_answer;\n\n");
        text += &self.state();
        let row = match contents.takes_row() {
            true => format!(" Rows are counted from 1 to {}.", contents.rows),
            false => String::new(),
        };
        let overflow = match self.fixed {
            Some(_) => String::new(),
            None => format!(" Readings so extreme that the sums overflow give {upper}_BAD_READING."),
        };
        let about = wrapped(&format!(
            "Decodes {}.{row} Returns {upper}_OK, or leaves the answer as it is and returns what is wrong.{overflow}",
            contents.meaning.either("one row-wire", "one sample")
        ));
        let _ = write!(text, "/* {} */\n{};\n\n", about.join("\n   "), self.signature());
        text + "#ifdef __cplusplus\n}\n#endif\n\n#endif\n"
    }

    /// The state of a history, with its sizes.
    fn state(&self) -> String {
        let (Some(history), Some(about)) = (self.contents.history(), self.contents.state_in_words()) else {
            return String::new();
        };
        let (name, upper) = (&self.contents.name, self.upper());
        let array = |field: &str, count: usize| match count {
            0 => String::new(),
            count => format!("    double {field}[{count}][{upper}_CHANNELS];\n"),
        };
        format!(
            "/* {} A copy is a state to continue from. */\ntypedef struct {{\n    int has_started;\n    int has_time;\n    \
             double time_s;\n    int latest;\n{}{}}} {name}_state;\n\n\
             /* Forgets the past: the next reading is the first. */\nvoid {name}_start({name}_state *state);\n\n",
            wrapped(&about).join("\n   "),
            array("kept", history.kept),
            array("averages", history.averages),
        )
    }
}
