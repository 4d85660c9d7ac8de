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
        let (contents, number, upper) = (self.contents, self.number, self.upper());
        let (name, noun, meaning, rows) = (&contents.name, contents.noun, &contents.meaning, contents.rows);
        let (mut include, mut units, mut definitions) = ("", String::new(), String::new());
        let mut overflow = format!(" Readings so extreme that the sums overflow give {upper}_BAD_READING.");
        if let Some(fixed) = self.fixed {
            (include, overflow) = ("#include <stdint.h>\n\n", String::new());
            (units, definitions) = (fixed.units_in_words(meaning), fixed.unit_definitions(&upper, meaning));
        }
        let (mut of_rows, mut about_rows) = (String::new(), String::new());
        if contents.takes_row() {
            of_rows = format!("#define {upper}_ROWS {rows}\n");
            about_rows = format!(" Rows are counted from 1 to {rows}.");
        }
        let mut further = String::new();
        if contents.exported.half_widths.is_some() {
            further += "    /* Half-widths of the 90 % prediction intervals, valid for all answers together. */\n";
            further += &format!("    {number} half_widths[{upper}_OUTPUTS];\n");
        }
        if contents.exported.outside.is_some() {
            let what = contents.outside_in_words();
            let what = wrapped(&format!("{what}, where the {noun} only guesses: 0 if there are none."));
            further += &format!("    /* {} */\n    int readings_outside;\n", what.join("\n       "));
        }
        let about = wrapped(&format!(
            "Decodes {}.{about_rows} Returns {upper}_OK, or leaves the answer as it is and returns what is wrong.{overflow}",
            meaning.either("one row-wire", "one sample")
        ));
        format!(
            "/* {purpose}.\n   {legend} */\n#ifndef {upper}_DECODE_H\n#define {upper}_DECODE_H\n\n{include}{of_rows}\
             #define {upper}_CHANNELS {channels}\n#define {upper}_OUTPUTS {outputs}\n\n{definitions}\
             #ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
             /* What the function returns. */\nenum {{\n    {upper}_OK = 0,\n    {upper}_NO_SUCH_ROW = -1,\n    \
             {upper}_BAD_READING = -2\n}};\n\ntypedef struct {{\n    {number} {targets}[{upper}_OUTPUTS];\n\
             {further}}} {name}_answer;\n\n{state}/* {about} */\n{signature};\n\n\
             #ifdef __cplusplus\n}}\n#endif\n\n#endif\n",
            purpose = meaning.purpose(),
            legend = contents.legend(&units).join("\n   "),
            channels = contents.channels(),
            outputs = contents.outputs(),
            targets = self.outputs,
            state = self.state(),
            about = about.join("\n   "),
            signature = self.signature(),
        )
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
            array("kept", history.constants.longest_lag()),
            array("averages", history.constants.averages.len()),
        )
    }
}
