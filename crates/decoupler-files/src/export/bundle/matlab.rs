//! Bundles as one function file for MATLAB and GNU Octave.

use std::fmt::Write;

use decoupler_core::{
    decoupling::{Domain, NodeId, Operation},
    text::counted,
};
use ndarray::Array2;

use super::{
    contents::{Contents, PrintedHistory, infix},
    folder::AtomicFolder,
    meaning::wrapped,
    report::BundleError,
};

/// Writes the function.
///
/// # Errors
/// The operating system refuses.
pub(super) fn print(contents: &Contents, folder: &mut AtomicFolder) -> Result<String, BundleError> {
    folder.write(&format!("{}_decode.m", contents.name), function(contents))?;
    Ok(usage(contents))
}

/// Text of the function file.
fn function(contents: &Contents) -> String {
    let (meaning, rows) = (&contents.meaning, contents.rows);
    let name = format!("{}_decode", contents.name);
    let (input, channels) = (meaning.readings(), contents.channels());
    let (history, parts, arguments) = (contents.history(), contents.parts(), arguments(contents));
    let state = history.iter().map(|_| "state");
    let returned = Vec::from_iter(parts.iter().copied().chain(state)).join(", ");
    let mut legend = contents.legend("");
    let mut row_check = "row = ones(samples, 1);\n".to_owned();
    if contents.takes_row() {
        legend.push(format!(
            "ROW is the row of each sample, from 1 to {rows}; a scalar applies to all samples."
        ));
        row_check = format!(
            "if isscalar(row)\n    row = repmat(row, samples, 1);\nend\nif numel(row) ~= samples || \
             ~all(ismember(row, 1:{rows}))\n    error('row: give the row of each sample, from 1 to {rows}');\nend\n"
        );
    }
    if let Some(about) = contents.state_in_words() {
        legend.extend(wrapped(&format!(
            "TIME_S is the time of each sample in seconds, in order. STATE is [] at the start, and continues from an earlier \
             call. {about}"
        )));
    }
    let mut text = format!(
        "function [{returned}] = {name}({arguments})\n%{upper} {purpose}.\n%   [{upper_returned}] = {upper}({upper_arguments}) has \
         a line of {outputs} for each line of\n%   {readings}{others}.\n%   {legend}\n\nsamples = size({input}, 1);\n\
         if size({input}, 2) ~= {channels}\n    error('{input}: give {channels} columns');\nend\n{row_check}",
        upper = name.to_uppercase(),
        purpose = meaning.purpose(),
        upper_returned = returned.to_uppercase(),
        upper_arguments = arguments.to_uppercase(),
        outputs = contents.outputs_in_words(),
        readings = counted(channels, "reading"),
        others = contents.parts_in_words(),
        legend = legend.join("\n%   "),
    );
    for constant in contents.constants() {
        for (index, table) in constant.tables.iter().enumerate() {
            push_matrix(&mut text, &format!("{}_{{{}}}", constant.name, index + 1), table);
        }
    }
    for (part, id) in parts.iter().zip(contents.exported.parts()) {
        text += &format!("{part} = zeros(samples, {});\n", contents.size(id));
    }
    let body = contents.body(|id, operation| statement(contents, id, operation));
    let taken = parts.iter().map(|part| format!("    {part}(mine, :) = {part}_;\n"));
    let taken = taken.collect::<String>();
    let decoded = format!("    {input}_ = {input}(mine, :);\n{body}{taken}end\nend\n");
    text + &match &history {
        None => format!("for k = 1:{rows}\n    mine = find(row(:) == k);\n{decoded}"),
        Some(history) => format!(
            "if isscalar(time_s)\n    time_s = repmat(time_s, samples, 1);\nend\n\
             if nargin < 3 || isempty(state)\n    state = zeros({rows}, {channels});\nend\n\
             for mine = 1:samples\n    k = row(mine);\n{decoded}\n{}",
            remembering(history),
            rows = history.state_rows(),
        ),
    }
}

fn arguments(contents: &Contents) -> String {
    let mut arguments = contents.meaning.readings().to_owned();
    if contents.history().is_some() {
        arguments += ", time_s, state";
    }
    if contents.takes_row() {
        arguments += ", row";
    }
    arguments
}

fn statement(contents: &Contents, id: NodeId, operation: &Operation) -> String {
    // Names end in _, which keeps them apart from arguments and functions.
    let of = |id: NodeId| {
        let name = contents.name_of(id);
        match (&contents.exported.program.node(id).operation, contents.is_of_row(id)) {
            (Operation::Select { .. }, true) => format!("{name}_{{k}}"),
            (Operation::Select { .. }, false) => format!("{name}_{{1}}"),
            _ => format!("{name}_"),
        }
    };
    let name = format!("{}_", contents.name_of(id));
    let operands = Vec::from_iter(operation.operands().into_iter().map(of));
    let expression = match (operation, &operands[..]) {
        (Operation::Valid { of, domain }, [x]) => {
            let plain = contents.name_of(*of);
            let (is_valid, above) = match domain {
                Domain::Positive => (format!("isfinite({x}(:)) & {x}(:) > 0"), " above 0"),
                Domain::Finite => (format!("isfinite({x}(:))"), ""),
            };
            return format!(
                "    if ~all({is_valid})\n        error('{plain}: give finite numbers{above}');\n    end\n"
            );
        }
        (Operation::Affine { .. }, [x, weights, biases]) => format!("{x} * {weights} + {biases}"),
        (Operation::SquaredDistances { .. }, [x, points]) => {
            return format!(
                "    {name} = zeros(size({x}, 1), {count});\n    for g = 1:{count}\n        \
                 {name}(:, g) = sum(({x} - {points}(:, g)') .^ 2, 2);\n    end\n",
                count = contents.size(id),
            );
        }
        (Operation::Clip { .. }, [x, low, high]) => format!("min(max({x}, {low}), {high})"),
        (Operation::Concatenate(_), parts) => format!("[{}]", parts.join(", ")),
        (Operation::History { .. }, [x]) => {
            return format!("    [{name}, state] = remember(state, {x}, time_s(mine));\n");
        }
        (Operation::CountOutside { .. }, [x, low, high]) => format!("sum({x} < {low} | {x} > {high}, 2)"),
        _ => infix(operation, ["./", "", ""], &operands),
    };
    format!("    {name} = {expression};\n")
}

/// The function that takes a reading into a state: whether it has started, the latest time, the latest readings (the newest
/// first), and the averages.
fn remembering(history: &PrintedHistory) -> String {
    let constants = &history.constants;
    let list = |values: Vec<String>| format!("[{}]", values.join("; "));
    let (per_second, per_reading) = history.rates();
    let texts = |values: Vec<f64>| values.iter().map(|value| format!("{value:e}")).collect();
    let kept = constants.longest_lag();
    format!(
        "function [features, state] = remember(state, now, time_s)\n\
         has_started = state(1, 1) > 0;\nelapsed_s = time_s - state(2, 1);\n\
         if ~has_started || elapsed_s < 0 || elapsed_s > {pause:e}\n    \
         state([1, 3:end], :) = repmat(now, size(state, 1) - 1, 1);\n    state(1, :) = 1;\n    elapsed_s = NaN;\nend\n\
         if isfinite(time_s) || ~has_started\n    state(2, :) = time_s;\nend\n\
         if ~isfinite(elapsed_s)\n    elapsed_s = {usual:e};\nend\n\
         past = state({lags}, :);\n\
         weights = -expm1(-(elapsed_s * {per_second} + {per_reading}));\n\
         for k = 1:numel(weights)\n    average = {averages} + k;\n    \
         state(average, :) = state(average, :) + weights(k) * (now - state(average, :));\n    \
         past = [past; state(average, :)];\nend\n\
         {shift}{difference}features = [now, reshape(past', 1, [])];\nend\n",
        pause = history.pause_s,
        usual = constants.interval_s,
        lags = list(constants.lags.iter().map(|lag| (lag + 2).to_string()).collect()),
        per_second = list(texts(per_second)),
        per_reading = list(texts(per_reading)),
        averages = 2 + kept,
        shift = match kept {
            0 => String::new(),
            kept => format!("state(3:{}, :) = [now; state(3:{}, :)];\n", kept + 2, kept + 1),
        },
        difference = match constants.differences {
            true => "past = repmat(now, size(past, 1), 1) - past;\n",
            false => "",
        },
    )
}

fn push_matrix(text: &mut String, name: &str, matrix: &Array2<f64>) {
    let columns = matrix.ncols();
    let _ = write!(text, "{name} = [");
    for (index, value) in matrix.iter().enumerate() {
        let separator = match index {
            0 => "",
            _ if index.is_multiple_of(columns) => ";\n",
            _ if (index % columns).is_multiple_of(6) => " ...\n",
            _ => " ",
        };
        let _ = write!(text, "{separator}{value:e}");
    }
    text.push_str("];\n");
}

/// Lines of a program that decodes.
fn usage(contents: &Contents) -> String {
    let (state, about) = match contents.history() {
        Some(_) => (", state", " state is [] at the start."),
        None => ("", ""),
    };
    format!(
        "    [{}{state}] = {}_decode({})\n\nin MATLAB (from R2016b) or GNU Octave.{about}\n",
        contents.parts().join(", "),
        contents.name,
        arguments(contents),
    )
}
