//! Bundles as one function file for MATLAB and GNU Octave, and reading back its numbers.

use std::fmt::Write;

use super::{
    folder::{Call, Draft},
    layers::Layer,
    meaning::Meaning,
    portable::Portable,
    report::{BundleCheck, BundleError},
    weights::{Arithmetic, Weights, names},
};
use decoupler_core::{network::Quantity, text::counted};

/// Writes the function `name`. The matrices of the rows are stacked vertically.
pub(super) fn write(name: &str, portable: &Portable, weights: &Weights) -> String {
    let (channels, rows) = (portable.channels, portable.rows());
    let (input, output) = (portable.meaning.readings(), portable.meaning.outputs());
    let ranges = portable.known_ranges();
    let (argument, help, check) = if portable.takes_row() {
        (
            ", row",
            format!("%   ROW is the row of each sample, from 1 to {rows}; a scalar applies to all samples.\n"),
            format!(
                "if isscalar(row)\n    row = repmat(row, samples, 1);\nend\nif numel(row) ~= samples || \
                 ~all(ismember(row, 1:{rows}))\n    error('row: give the row of each sample, from 1 to {rows}');\n\
                 end\n"
            ),
        )
    } else {
        ("", String::new(), "row = ones(samples, 1);\n".to_owned())
    };
    let also = match ranges {
        Some(_) => {
            "the number of readings of each\n%   sample that lie beyond the range seen in training by more than a tenth of it"
        }
        None => "zeros, because the range of the readings in training is not known",
    };
    let (is_reading, readings) = match portable.quantity {
        Quantity::Raw => (format!("isfinite({input}(:))"), "finite numbers"),
        _ => (
            format!("isfinite({input}(:)) & {input}(:) > 0"),
            "finite numbers above 0",
        ),
    };
    let centre = portable.meaning.centre();
    let change = match portable.quantity {
        Quantity::Resistance | Quantity::Raw => format!("r - {centre}(k, :)"),
        Quantity::Conductance => format!("({centre}(k, :) - r) ./ r"),
        Quantity::LogResistance => format!("log1p((r - {centre}(k, :)) ./ {centre}(k, :))"),
    };
    let outputs = portable.outputs;
    let (upper, upper_argument) = (name.to_uppercase(), argument.to_uppercase());
    let (upper_input, upper_output) = (input.to_uppercase(), output.to_uppercase());
    let purpose = match &portable.meaning {
        Meaning::Array(_) => format!(
            "%{upper} Decodes readings of a tactile array into the coordinates of its nodes.\n\
             %   {upper_output} = {upper}({upper_input}{upper_argument}) has a line of {of_outputs} in mm (x_1, y_1, z_1, to {last})\n\
             %   for each line of {of_channels} in ohm (r_1 to r_{channels}).\n",
            of_outputs = counted(outputs, "coordinate"),
            of_channels = counted(channels, "resistance"),
            last = portable.meaning.targets().last().map_or("", |target| &target.name),
        ),
        own @ Meaning::Own { .. } => format!(
            "%{upper} Decodes readings into targets.\n\
             %   {upper_output} = {upper}({upper_input}{upper_argument}) has a line of {of_outputs} for each line of {of_channels}.\n\
             %   {legend}\n",
            of_outputs = counted(outputs, "target"),
            of_channels = counted(channels, "reading"),
            legend = own.legend().join("\n%   "),
        ),
    };
    let mut text = format!(
        "function [{output}, readings_outside] = {name}({input}{argument})\n\
         {purpose}\
         {help}\
         %   [{upper_output}, READINGS_OUTSIDE] = ... also has {also}.\n\
         \n\
         samples = size({input}, 1);\n\
         if size({input}, 2) ~= {channels} || ~all({is_reading})\n    \
         error('{input}: give {channels} columns of {readings}');\n\
         end\n\
         {check}",
    );
    for table in weights.tables(portable) {
        let columns = table.shape.last().copied().unwrap_or(1);
        push_matrix(&mut text, &table.name, columns, table.values.into_iter());
    }
    let mut outside = String::new();
    if let Some(ranges) = &ranges {
        let limits = || ranges.iter().flat_map(|range| &range.limits);
        let [lowest, highest] = portable.meaning.limits();
        push_matrix(&mut text, lowest, channels, limits().map(|limits| limits.0));
        push_matrix(&mut text, highest, channels, limits().map(|limits| limits.1));
        outside = format!("    readings_outside(mine) = sum(r < {lowest}(k, :) | r > {highest}(k, :), 2);\n");
    }
    text + &format!(
        "{output} = zeros(samples, {outputs});\n\
         readings_outside = zeros(samples, 1);\n\
         for k = 1:{rows}\n    \
         mine = find(row(:) == k);\n    \
         r = {input}(mine, :);\n    \
         v = {change};\n\
         {steps}    \
         {output}(mine, :) = v;\n\
         {outside}\
         end\n\
         end\n",
        steps = steps(portable),
    )
}

/// Statements from the changes `v` of the readings to the outputs, for row `k`.
fn steps(portable: &Portable) -> String {
    let mut text = String::new();
    let mut inputs = portable.channels;
    for (layer, names) in portable.layers().iter().zip(names(portable.layers())) {
        let block = |place: usize| format!("{}((k - 1) * {inputs} + (1:{inputs}), :)", names.tables[place]);
        let constants = |place: usize| format!("{}(k, :)", names.tables[place]);
        text += &match layer {
            Layer::Affine(_) => format!("    v = v * {} + {};\n", block(0), constants(1)),
            Layer::Tanh => "    v = tanh(v);\n".to_owned(),
            Layer::Gaussians { centres } => format!(
                "    centres = {};\n    \
                 gaussians = zeros(numel(mine), {count});\n    \
                 for g = 1:{count}\n        \
                 gaussians(:, g) = exp(-sum((v - centres(:, g)') .^ 2, 2));\n    \
                 end\n    \
                 v = gaussians;\n",
                block(0),
                count = centres.ncols(),
            ),
        };
        inputs = layer.outputs(inputs);
    }
    text
}

fn push_matrix(text: &mut String, name: &str, columns: usize, values: impl Iterator<Item = f64>) {
    let _ = write!(text, "{name} = [");
    for (index, value) in values.enumerate() {
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

/// Reads the matrices back.
///
/// # Errors
/// The name of the first that is missing, or has another number of values than `portable` needs.
pub(super) fn read_weights(text: &str, portable: &Portable) -> Result<Weights, String> {
    Weights::of_tables(portable, Arithmetic::DOUBLE, |table| {
        let missing = || format!("the matrix {} is missing or damaged", table.name);
        let rest = text
            .split(&format!("\n{} = [", table.name))
            .nth(1)
            .ok_or_else(missing)?;
        let inside = rest.split("];").next().ok_or_else(missing)?;
        let inside = inside.replace("...", " ").replace(';', " ");
        let values = inside
            .split_whitespace()
            .map(|number| number.parse::<f64>().map_err(|_| missing()));
        values.collect()
    })
}

/// Writes the function and reads its matrices back.
///
/// # Errors
/// It cannot be written or read back.
pub(super) fn export(draft: &mut Draft<'_>) -> Result<Vec<BundleCheck>, BundleError> {
    let (function, file) = (format!("{}_decode", draft.name), format!("{}_decode.m", draft.name));
    let damaged = |reason| BundleError::read_back(&file, reason);
    let bytes = draft.write(&file, write(&function, draft.portable, draft.weights))?;
    let text = String::from_utf8(bytes).map_err(|error| damaged(error.to_string()))?;
    let read = read_weights(&text, draft.portable).map_err(damaged)?;
    let deviation = draft.deviation_of(&read);
    Ok(vec![BundleCheck::of(
        "MATLAB matrices, read back and evaluated",
        deviation,
    )])
}

/// Returns the usage section of the README.
pub(super) fn call(call: &Call<'_>) -> String {
    let portable = call.portable;
    let (takes_row, channels, outputs) = (portable.takes_row(), portable.channels, portable.outputs);
    let meaning = &portable.meaning;
    let (input, output) = (meaning.readings(), meaning.outputs());
    let name = call.name;
    let row = if takes_row { ", row" } else { "" };
    format!(
        "    [{output}, readings_outside] = {name}_decode({input}{row})\n\n\
         in MATLAB (from R2016b) or GNU Octave. {input} is samples x {channels}, {output} samples x \
         {outputs}{row_text}.",
        row_text = if takes_row {
            ";\nrow is the row of each sample, from 1"
        } else {
            ""
        },
    )
}
