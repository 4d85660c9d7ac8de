//! The program in floating point.

use std::fmt::Write;

use decoupler_core::decoupling::{Domain, Function, NodeId, Operation, Precision};

use super::{header::Header, number, push_array, type_name};
use crate::export::bundle::contents::{Contents, PrintedHistory};

/// Writes the source.
pub(super) fn source(header: &Header<'_>) -> String {
    let (contents, upper) = (header.contents, header.upper());
    let mut text = format!(
        "#include \"{}_decode.h\"\n\n#include <float.h>\n#include <math.h>\n\n",
        contents.name
    );
    for (id, tables) in contents.constants() {
        let (shape, precision) = (contents.full_shape(id, tables.len()), contents.precision_of(id));
        let values = tables.iter().flatten().map(|&value| number(precision, value));
        push_array(&mut text, type_name(precision), contents.name_of(id), &shape, values);
    }
    if let Some(history) = contents.history() {
        text += &remembering(header, &history);
    }
    let _ = write!(text, "{}\n{{\n", header.signature());
    text += &row_check(contents, &upper);
    let body = contents
        .computed()
        .map(|(id, operation)| statements(contents, &upper, id, operation));
    text += &body.collect::<String>();
    text + &answer(header)
}

/// Statements that refuse other rows and set `network`.
pub(super) fn row_check(contents: &Contents, upper: &str) -> String {
    if !contents.takes_row() {
        return String::new();
    }
    let is_used = contents.constants().any(|(id, _)| contents.is_of_row(id));
    let network = if is_used {
        "    const int network = row - 1;\n"
    } else {
        ""
    };
    format!("    if (row < 1 || row > {upper}_ROWS) {{\n        return {upper}_NO_SUCH_ROW;\n    }}\n{network}")
}

/// A value of node `id` in this precision.
fn value(contents: &Contents, id: NodeId, index: &str, precision: Precision) -> String {
    let row = if contents.is_of_row(id) { "[network]" } else { "" };
    let value = format!("{}{row}[{index}]", contents.name_of(id));
    match contents.precision_of(id) == precision {
        true => value,
        false => format!("({}){value}", type_name(precision)),
    }
}

fn statements(contents: &Contents, upper: &str, id: NodeId, operation: &Operation) -> String {
    let (name, size, precision) = (contents.name_of(id), contents.size(id), contents.precision_of(id));
    let kind = type_name(precision);
    let of = |id: NodeId, index: &str| value(contents, id, index, precision);
    let declared = format!("    {kind} {name}[{size}];\n");
    let each = |size: usize, body: &str| format!("    for (int i = 0; i < {size}; ++i) {{\n        {body}\n    }}\n");
    let assigned = |expression: String| declared.clone() + &each(size, &format!("{name}[i] = {expression};"));
    let suffix = if precision == Precision::Single { "f" } else { "" };
    match operation {
        Operation::Valid { of, domain } => {
            let reading = value(contents, *of, "i", contents.precision_of(*of));
            let most = match contents.precision_of(*of) {
                Precision::Single => "FLT_MAX",
                Precision::Double => "DBL_MAX",
            };
            let lowest = match domain {
                Domain::Positive => format!("{reading} > 0"),
                Domain::Finite => format!("{reading} >= -{most}"),
            };
            each(
                size,
                &format!(
                    "if (!({lowest} && {reading} <= {most})) {{\n            return {upper}_BAD_READING;\n        }}"
                ),
            )
        }
        Operation::Subtract(one, other) => assigned(format!("{} - {}", of(*one, "i"), of(*other, "i"))),
        Operation::Divide(one, other) => assigned(format!("{} / {}", of(*one, "i"), of(*other, "i"))),
        Operation::Map(function, values) => {
            let x = of(*values, "i");
            assigned(match function {
                Function::Log1p => format!("log1p{suffix}({x})"),
                Function::Tanh => format!("tanh{suffix}({x})"),
                Function::Gaussian => format!("exp{suffix}(-{x})"),
            })
        }
        Operation::Affine {
            of: values,
            weights,
            biases,
        } => {
            let inputs = contents.size(*values);
            let sums = format!("{name}[k] += {} * {};", of(*values, "i"), of(*weights, "i][k"));
            let inner = format!("for (int k = 0; k < {size}; ++k) {{\n            {sums}\n        }}");
            assigned(of(*biases, "i")) + &each(inputs, &inner)
        }
        Operation::SquaredDistances { of: values, points } => {
            let inputs = contents.size(*values);
            let sums = format!(
                "const {kind} apart = {} - {};\n            {name}[k] += apart * apart;",
                of(*values, "i"),
                of(*points, "i][k")
            );
            let inner = format!("for (int k = 0; k < {size}; ++k) {{\n            {sums}\n        }}");
            assigned("0".to_owned()) + &each(inputs, &inner)
        }
        Operation::Clip { of: values, low, high } => {
            let (x, low, high) = (of(*values, "i"), of(*low, "i"), of(*high, "i"));
            assigned(format!("{x} < {low} ? {low} : {x} > {high} ? {high} : {x}"))
        }
        Operation::Concatenate(parts) => {
            let mut text = declared.clone();
            let mut first = 0;
            for part in parts {
                let target = if first == 0 {
                    "i".to_owned()
                } else {
                    format!("{first} + i")
                };
                text += &each(contents.size(*part), &format!("{name}[{target}] = {};", of(*part, "i")));
                first += contents.size(*part);
            }
            text
        }
        Operation::History { .. } => {
            declared
                + &format!(
                    "    remember(state, time_s, {}, {name});\n",
                    contents.meaning.readings()
                )
        }
        Operation::CountOutside { of: values, low, high } => {
            let x = of(*values, "i");
            let count = format!("{name} += !({x} >= {} && {x} <= {});", of(*low, "i"), of(*high, "i"));
            format!("    int {name} = 0;\n") + &each(contents.size(*values), &count)
        }
        Operation::Readings | Operation::Select { .. } | Operation::Blend { .. } => {
            unreachable!("given, or not exported")
        }
    }
}

/// Statements that check the outputs and write the answer.
fn answer(header: &Header<'_>) -> String {
    let (contents, upper) = (header.contents, header.upper());
    let targets = contents.name_of(contents.exported.targets);
    let most = match contents.outer_precision() {
        Precision::Single => "FLT_MAX",
        Precision::Double => "DBL_MAX",
    };
    let mut text = format!(
        "    for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n        \
         if (!({targets}[k] >= -{most} && {targets}[k] <= {most})) {{\n            return {upper}_BAD_READING;\n        }}\n    }}\n"
    );
    let copied = |id: NodeId| {
        let (name, computed) = (
            contents.name_of(id),
            value(contents, id, "k", contents.outer_precision()),
        );
        format!("    for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n        answer->{name}[k] = {computed};\n    }}\n")
    };
    text += &copied(contents.exported.targets);
    text += &contents.exported.half_widths.map_or_else(String::new, copied);
    if contents.exported.outside.is_some() {
        text += "    answer->readings_outside = readings_outside;\n";
    }
    text + &format!("    return {upper}_OK;\n}}\n")
}

/// The functions that start a state and that take a reading into it, in double precision.
fn remembering(header: &Header<'_>, history: &PrintedHistory) -> String {
    let (contents, constants) = (header.contents, &history.constants);
    let (name, channels) = (&contents.name, constants.channels);
    let (kept, averages) = (constants.longest_lag(), constants.averages.len());
    let mut text = String::new();
    let mut array = |kind: &str, name: &str, values: Vec<String>| {
        if !values.is_empty() {
            push_array(&mut text, kind, name, &[values.len()], values);
        }
    };
    array("int", "lags", constants.lags.iter().map(usize::to_string).collect());
    let double = |value: f64| number(Precision::Double, value);
    let (per_second, per_reading) = history.rates();
    let doubles = |values: Vec<f64>| values.into_iter().map(double).collect();
    array("double", "per_second", doubles(per_second));
    array("double", "per_reading", doubles(per_reading));
    let past = |value: &str| match constants.differences {
        true => format!("now - {value}"),
        false => value.to_owned(),
    };
    let start_of = |field: &str, count: usize| match count {
        0 => String::new(),
        count => format!(
            "        for (int k = 0; k < {count}; ++k) {{\n            for (int i = 0; i < {channels}; ++i) {{\n                \
             state->{field}[k][i] = readings[i];\n            }}\n        }}\n"
        ),
    };
    let of_lags = match constants.lags.len() {
        0 => String::new(),
        count => format!(
            "    for (int k = 0; k < {count}; ++k) {{\n        const int at = (state->latest - lags[k] + 1 + {kept}) % {kept};\n        \
             for (int i = 0; i < {channels}; ++i) {{\n            const double now = readings[i];\n            \
             *feature++ = {};\n        }}\n    }}\n",
            past("state->kept[at][i]")
        ),
    };
    let of_averages = match averages {
        0 => String::new(),
        count => format!(
            "    for (int k = 0; k < {count}; ++k) {{\n        \
             const double weight = -expm1(-(elapsed_s * per_second[k] + per_reading[k]));\n        \
             for (int i = 0; i < {channels}; ++i) {{\n            const double now = readings[i];\n            \
             state->averages[k][i] += weight * (now - state->averages[k][i]);\n            \
             *feature++ = {};\n        }}\n    }}\n",
            past("state->averages[k][i]")
        ),
    };
    let shifting = match kept {
        0 => String::new(),
        kept => format!(
            "    state->latest = (state->latest + 1) % {kept};\n    for (int i = 0; i < {channels}; ++i) {{\n        \
             state->kept[state->latest][i] = readings[i];\n    }}\n"
        ),
    };
    let elapsed = if averages > 0 { "" } else { "    (void)elapsed_s;\n" };
    let pause = match history.pause_s {
        f64::INFINITY => String::new(),
        pause_s => format!(" || elapsed_s > {}", double(pause_s)),
    };
    let reading = header.reading;
    text + &format!(
        "void {name}_start({name}_state *state)\n{{\n    state->has_started = 0;\n    state->has_time = 0;\n    \
         state->time_s = 0;\n    state->latest = 0;\n}}\n\n\
         static void remember({name}_state *state, double time_s, const {reading} readings[{channels}], double *feature)\n{{\n    \
         const int has_time = time_s >= -DBL_MAX && time_s <= DBL_MAX;\n    \
         double elapsed_s = {usual};\n    \
         if (has_time && state->has_time) {{\n        elapsed_s = time_s - state->time_s;\n        \
         if (elapsed_s < 0{pause}) {{\n            state->has_started = 0;\n            elapsed_s = {usual};\n        }}\n    }}\n    \
         if (has_time) {{\n        state->has_time = 1;\n        state->time_s = time_s;\n    }}\n    \
         if (!state->has_started) {{\n        state->has_started = 1;\n{kept_start}{averages_start}    }}\n{elapsed}    \
         for (int i = 0; i < {channels}; ++i) {{\n        *feature++ = readings[i];\n    }}\n\
         {of_lags}{of_averages}{shifting}}}\n\n",
        usual = double(constants.interval_s),
        kept_start = start_of("kept", kept),
        averages_start = start_of("averages", averages),
    )
}
