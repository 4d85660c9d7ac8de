//! The program in floating point.

use std::fmt::Write;

use decoupler_core::decoupling::{Domain, NodeId, Operation, Precision};

use super::{header::Header, number, push_array, type_name};
use crate::export::bundle::contents::{Contents, PrintedHistory, infix, word};

/// Writes the source.
pub(super) fn source(header: &Header<'_>) -> String {
    let (contents, upper) = (header.contents, header.upper());
    let mut text = format!(
        "#include \"{}_decode.h\"\n\n#include <float.h>\n#include <math.h>\n\n",
        contents.name
    );
    for constant in contents.constants() {
        let precision = constant.precision;
        let values = constant.values().map(|value| number(precision, value));
        push_array(&mut text, type_name(precision), constant.name, &constant.shape, values);
    }
    if let Some(history) = contents.history() {
        text += &remembering(header, &history);
    }
    let _ = write!(text, "{}\n{{\n", header.signature());
    let is_of_row = contents.constants().any(|constant| constant.tables.len() > 1);
    text += &row_check(contents, &upper, is_of_row);
    text += &contents.body(|id, operation| statements(contents, &upper, id, operation));
    text + &answer(header)
}

/// Statements that refuse other rows, and set `network` where constants are those of a row.
pub(super) fn row_check(contents: &Contents, upper: &str, is_of_row: bool) -> String {
    if !contents.takes_row() {
        return String::new();
    }
    let network = match is_of_row {
        true => "    const int network = row - 1;\n",
        false => "",
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
    let operands = Vec::from_iter(operation.operands().into_iter().map(|operand| {
        let index = if contents.is_matrix(operand) { "i][k" } else { "i" };
        value(contents, operand, index, precision)
    }));
    let declared = format!("    {kind} {name}[{size}];\n");
    let each = |size: usize, body: &str| format!("    for (int i = 0; i < {size}; ++i) {{\n        {body}\n    }}\n");
    let assigned = |expression: &str| declared.clone() + &each(size, &format!("{name}[i] = {expression};"));
    let sums = |inputs: NodeId, body: &str| {
        let inner = format!("for (int k = 0; k < {size}; ++k) {{\n            {body}\n        }}");
        each(contents.size(inputs), &inner)
    };
    let suffix = if precision == Precision::Single { "f" } else { "" };
    match (operation, &operands[..]) {
        (Operation::Valid { domain, .. }, [reading]) => {
            let most = largest(precision);
            let lowest = match domain {
                Domain::Positive => format!("{reading} > 0"),
                Domain::Finite => format!("{reading} >= -{most}"),
            };
            let is_valid = format!("{lowest} && {reading} <= {most}");
            let refusal = format!("if (!({is_valid})) {{\n            return {upper}_BAD_READING;\n        }}");
            each(size, &refusal)
        }
        (Operation::Affine { of, .. }, [x, weight, bias]) => {
            assigned(bias) + &sums(*of, &format!("{name}[k] += {x} * {weight};"))
        }
        (Operation::SquaredDistances { of, .. }, [x, point]) => {
            let body = format!("const {kind} apart = {x} - {point};\n            {name}[k] += apart * apart;");
            assigned("0") + &sums(*of, &body)
        }
        (Operation::Clip { .. }, [x, low, high]) => {
            assigned(&format!("{x} < {low} ? {low} : {x} > {high} ? {high} : {x}"))
        }
        (Operation::Concatenate(parts), values) => {
            let (mut text, mut shift, mut first) = (declared, String::new(), 0);
            for (part, value) in parts.iter().zip(values) {
                text += &each(contents.size(*part), &format!("{name}[{shift}i] = {value};"));
                first += contents.size(*part);
                shift = format!("{first} + ");
            }
            text
        }
        (Operation::History { .. }, _) => {
            let readings = contents.meaning.readings();
            format!("{declared}    remember(state, time_s, {readings}, {name});\n")
        }
        (Operation::CountOutside { of, .. }, [x, low, high]) => {
            let count = format!("{name} += !({x} >= {low} && {x} <= {high});");
            format!("    int {name} = 0;\n") + &each(contents.size(*of), &count)
        }
        _ => assigned(&infix(operation, ["/", "", suffix], &operands)),
    }
}

/// Name of the largest number.
fn largest(precision: Precision) -> &'static str {
    word(precision, ["FLT_MAX", "DBL_MAX"])
}

/// Statements that check the outputs and write the answer.
fn answer(header: &Header<'_>) -> String {
    let (contents, upper) = (header.contents, header.upper());
    let targets = contents.name_of(contents.exported.targets);
    let most = largest(contents.outer_precision());
    let mut text = format!(
        "    for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n        \
         if (!({targets}[k] >= -{most} && {targets}[k] <= {most})) {{\n            return {upper}_BAD_READING;\n        }}\n    }}\n"
    );
    let copied = |id: NodeId| {
        let name = contents.name_of(id);
        let computed = value(contents, id, "k", contents.outer_precision());
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
    // A feature is the past or its difference from the reading.
    let minus = if constants.differences { "readings[i] - " } else { "" };
    let channel_loop = format!("for (int i = 0; i < {channels}; ++i) {{");
    let loops = |count: usize, indent: &str, first: &str, body: &str| match count {
        0 => String::new(),
        _ => format!(
            "{indent}for (int k = 0; k < {count}; ++k) {{\n{first}{indent}    {channel_loop}\n{body}{indent}    }}\n{indent}}}\n"
        ),
    };
    let start_of = |field: &str, count: usize| {
        let body = format!("                state->{field}[k][i] = readings[i];\n");
        loops(count, "        ", "", &body)
    };
    let first = format!("        const int at = (state->latest - lags[k] + 1 + {kept}) % {kept};\n");
    let body = format!("            *feature++ = {minus}state->kept[at][i];\n");
    let of_lags = loops(constants.lags.len(), "    ", &first, &body);
    let first = "        const double weight = -expm1(-(elapsed_s * per_second[k] + per_reading[k]));\n";
    let body = format!(
        "            state->averages[k][i] += weight * (readings[i] - state->averages[k][i]);\n            \
         *feature++ = {minus}state->averages[k][i];\n"
    );
    let of_averages = loops(averages, "    ", first, &body);
    let shifting = match kept {
        0 => String::new(),
        kept => format!(
            "    state->latest = (state->latest + 1) % {kept};\n    {channel_loop}\n        \
             state->kept[state->latest][i] = readings[i];\n    }}\n"
        ),
    };
    let elapsed = if averages > 0 { "" } else { "    (void)elapsed_s;\n" };
    let pause = match history.pause_s {
        f64::INFINITY => String::new(),
        pause_s => format!(" || elapsed_s > {}", double(pause_s)),
    };
    let reading = header.number;
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
         {channel_loop}\n        *feature++ = readings[i];\n    }}\n\
         {of_lags}{of_averages}{shifting}}}\n\n",
        usual = double(constants.interval_s),
        kept_start = start_of("kept", kept),
        averages_start = start_of("averages", averages),
    )
}
