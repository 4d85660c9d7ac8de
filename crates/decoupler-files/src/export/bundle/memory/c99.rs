use super::ExportedMemory;
use crate::export::bundle::{
    c99::{Files, number, push_array},
    weights::Digits,
};

fn double(value: f64) -> String {
    number(Digits::Double, value)
}

impl ExportedMemory {
    /// Header, source and self-test in C99.
    pub(super) fn c99(&self, name: &str) -> Files {
        vec![
            (format!("{name}_memory.h"), self.header(name)),
            (format!("{name}_memory.c"), self.source(name)),
            (format!("{name}_memory_selftest.c"), self.self_test(name)),
        ]
    }

    fn header(&self, name: &str) -> String {
        let (upper, constants) = (name.to_uppercase(), &self.constants);
        let averages = match constants.averages.len() {
            0 => String::new(),
            _ => format!("    double averages[{upper}_AVERAGES][{upper}_READINGS];\n"),
        };
        format!(
            "/* The memory of {name}_decode: computes its features from readings as they come.\n{restarts} */\n\
             #ifndef {upper}_MEMORY_H\n#define {upper}_MEMORY_H\n\n\
             #define {upper}_READINGS {channels}\n#define {upper}_FEATURES {features}\n\
             #define {upper}_KEPT {kept}\n#define {upper}_AVERAGES {count}\n\
             /* Usual interval between samples in training, in seconds. */\n\
             #define {upper}_INTERVAL_S {interval}\n\n\
             /* The state of one sensor. A copy is a state to continue from. */\n\
             typedef struct {{\n    int has_started;\n    int latest;\n    \
             double readings[{upper}_KEPT][{upper}_READINGS];\n{averages}}} {name}_memory;\n\n\
             /* Forgets the past: the next sample is the first. */\n\
             void {name}_memory_init({name}_memory *memory);\n\n\
             /* Takes in the next sample, interval_s seconds after the one before, and writes its features. */\n\
             void {name}_memory_step({name}_memory *memory, const double readings[{upper}_READINGS],\n    \
             double interval_s, double features[{upper}_FEATURES]);\n\n\
             #endif\n",
            restarts = self.restarts(),
            channels = constants.channels,
            features = constants.features(),
            kept = self.kept(),
            count = constants.averages.len(),
            interval = double(constants.interval_s),
        )
    }

    fn source(&self, name: &str) -> String {
        let (upper, constants) = (name.to_uppercase(), &self.constants);
        let mut text = format!("#include \"{name}_memory.h\"\n\n#include <math.h>\n\n");
        if !constants.lags.is_empty() {
            push_array(
                &mut text,
                &format!("static const int lags[{}]", constants.lags.len()),
                &[constants.lags.len()],
                &constants.lags,
            );
        }
        if !constants.averages.is_empty() {
            let count = constants.averages.len();
            let rates = self.exponents().map(|(rate, _)| double(rate));
            push_array(
                &mut text,
                &format!("static const double per_second[{count}]"),
                &[count],
                rates,
            );
            let of_samples = self.exponents().map(|(_, constant)| double(constant));
            push_array(
                &mut text,
                &format!("static const double per_sample[{count}]"),
                &[count],
                of_samples,
            );
        }
        let start_averages = match constants.averages.len() {
            0 => "",
            _ => {
                "        for (int k = 0; k < UPPER_AVERAGES; ++k) {\n            memory->averages[k][i] = readings[i];\n        }\n"
            }
        };
        let past = |value: &str| match constants.differences {
            true => format!("readings[i] - {value}"),
            false => value.to_owned(),
        };
        let lags = match constants.lags.len() {
            0 => String::new(),
            count => format!(
                "    for (int k = 0; k < {count}; ++k) {{\n        \
                 const int at = (memory->latest - lags[k] + UPPER_KEPT) % UPPER_KEPT;\n        \
                 for (int i = 0; i < UPPER_READINGS; ++i) {{\n            \
                 *feature++ = {};\n        }}\n    }}\n",
                past("memory->readings[at][i]")
            ),
        };
        let averages = match constants.averages.len() {
            0 => "    (void)interval_s;\n".to_owned(),
            count => format!(
                "    const double elapsed_s = interval_s > 0 ? interval_s : 0;\n    \
                 for (int k = 0; k < {count}; ++k) {{\n        \
                 const double weight = -expm1(-(elapsed_s * per_second[k] + per_sample[k]));\n        \
                 for (int i = 0; i < UPPER_READINGS; ++i) {{\n            \
                 memory->averages[k][i] += weight * (readings[i] - memory->averages[k][i]);\n            \
                 *feature++ = {};\n        }}\n    }}\n",
                past("memory->averages[k][i]")
            ),
        };
        let functions = format!(
            "void {name}_memory_init({name}_memory *memory)\n{{\n    memory->has_started = 0;\n    memory->latest = 0;\n}}\n\n\
             void {name}_memory_step({name}_memory *memory, const double readings[UPPER_READINGS],\n    \
             double interval_s, double features[UPPER_FEATURES])\n{{\n    \
             double *feature = features;\n    \
             for (int i = 0; i < UPPER_READINGS && !memory->has_started; ++i) {{\n        \
             for (int k = 0; k < UPPER_KEPT; ++k) {{\n            \
             memory->readings[k][i] = readings[i];\n        }}\n{start_averages}    }}\n    \
             memory->has_started = 1;\n    \
             memory->latest = (memory->latest + 1) % UPPER_KEPT;\n    \
             for (int i = 0; i < UPPER_READINGS; ++i) {{\n        \
             memory->readings[memory->latest][i] = readings[i];\n        \
             *feature++ = readings[i];\n    }}\n{lags}{averages}}}\n"
        );
        text + &functions.replace("UPPER", &upper)
    }

    fn self_test(&self, name: &str) -> String {
        let (upper, frames) = (name.to_uppercase(), self.frames.len());
        let mut text = format!(
            "#include \"{name}_memory.h\"\n\n#include <math.h>\n#include <stdio.h>\n\n#define FRAMES {frames}\n\n"
        );
        let features = self.constants.features();
        push_array(
            &mut text,
            &format!("static const int is_first[{frames}]"),
            &[frames],
            self.frames.iter().map(|frame| u8::from(frame.is_first)),
        );
        push_array(
            &mut text,
            &format!("static const double interval_s[{frames}]"),
            &[frames],
            self.frames.iter().map(|frame| double(frame.interval_s)),
        );
        push_array(
            &mut text,
            &format!("static const double expected[{frames}][{features}]"),
            &[frames, features],
            self.frames
                .iter()
                .flat_map(|frame| frame.features.iter().map(|value| double(*value))),
        );
        text + &format!(
            "int main(void)\n{{\n    {name}_memory memory;\n    double found[{upper}_FEATURES];\n    double largest = 0;\n    \
             for (int k = 0; k < FRAMES; ++k) {{\n        \
             if (is_first[k]) {{\n            {name}_memory_init(&memory);\n        }}\n        \
             /* Continues from a copy, as from a stored state. */\n        \
             {name}_memory copy = memory;\n        \
             {name}_memory_step(&copy, expected[k], interval_s[k], found);\n        \
             memory = copy;\n        \
             for (int i = 0; i < {upper}_FEATURES; ++i) {{\n            \
             const double size = fabs(expected[k][i]) + fabs(expected[k][i % {upper}_READINGS]);\n            \
             const double off = fabs(found[i] - expected[k][i]) / (size > 0 ? size : 1);\n            \
             if (!(off <= largest)) {{\n                largest = off;\n            }}\n        }}\n    }}\n    \
             printf(\"largest deviation: %.3e, \\n\", largest);\n    \
             return largest <= 1e-12 ? 0 : 1;\n}}\n"
        )
    }
}
