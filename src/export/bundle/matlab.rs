//! Bundles as one function file for MATLAB and GNU Octave, and the numbers in it as they are read back.

use std::fmt::Write;

use super::{
    meaning::Meaning,
    portable::Portable,
    weights::{Arithmetic, RoundedNetwork, Weights},
};
use crate::network::Quantity;

/// Matrices of the file: their names and numbers of columns, and the part of each network.
type Matrix = (&'static str, fn(&RoundedNetwork) -> &Vec<f64>);

/// Stands for [`Meaning::centre`].
const CENTRE: &str = "";

const MATRICES: [Matrix; 5] = [
    (CENTRE, |network| &network.centre),
    ("hidden_weights", |network| &network.hidden_weights),
    ("hidden_biases", |network| &network.hidden_biases),
    ("output_weights", |network| &network.output_weights),
    ("output_biases", |network| &network.output_biases),
];

/// Writes the function `name`. The matrices of the rows stand one below the other.
pub(super) fn write(name: &str, portable: &Portable, weights: &Weights) -> String {
    let (channels, rows) = (portable.channels, portable.networks.len());
    let (input, output) = (portable.meaning.readings(), portable.meaning.outputs());
    let ranges = portable.ranges();
    let (argument, help, check) = if portable.takes_row() {
        (
            ", row",
            format!("%   ROW has the row of each sample, from 1 to {rows}; one number stands for all.\n"),
            format!(
                "if isscalar(row)\n    row = repmat(row, samples, 1);\nend\nif numel(row) ~= samples || \
                 ~all(ismember(row, 1:{rows}))\n    error('row: give the row of each sample, from 1 to {rows}');\n\
                 end\n"
            ),
        )
    } else {
        ("", String::new(), "row = ones(samples, 1);\n".to_owned())
    };
    let counted = match ranges {
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
             %   {upper_output} = {upper}({upper_input}{upper_argument}) has a line of {outputs} coordinates in mm (x_1, y_1, z_1, to {last})\n\
             %   for each line of {channels} resistances in ohm (r_1 to r_{channels}).\n",
            last = portable.meaning.targets().last().map_or("", |target| &target.name),
        ),
        own @ Meaning::Own { .. } => format!(
            "%{upper} Decodes readings into targets.\n\
             %   {upper_output} = {upper}({upper_input}{upper_argument}) has a line of {outputs} targets for each line of {channels} readings.\n\
             %   {legend}\n",
            legend = own.legend().join("\n%   "),
        ),
    };
    let mut text = format!(
        "function [{output}, readings_outside] = {name}({input}{argument})\n\
         {purpose}\
         {help}\
         %   [{upper_output}, READINGS_OUTSIDE] = ... also has {counted}.\n\
         \n\
         samples = size({input}, 1);\n\
         if size({input}, 2) ~= {channels} || ~all({is_reading})\n    \
         error('{input}: give {channels} columns of {readings}');\n\
         end\n\
         {check}",
    );
    for (matrix, of) in MATRICES {
        let columns = match matrix {
            CENTRE => channels,
            "hidden_weights" | "hidden_biases" => portable.hidden,
            _ => portable.outputs,
        };
        let values = weights.networks.iter().flat_map(|network| of(network).iter().copied());
        push_matrix(&mut text, name_of(matrix, portable), columns, values);
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
         change = {change};\n    \
         hidden = tanh(change * hidden_weights((k - 1) * {channels} + (1:{channels}), :) + hidden_biases(k, :));\n    \
         {output}(mine, :) = hidden * output_weights((k - 1) * {hidden} + (1:{hidden}), :) + output_biases(k, :);\n\
         {outside}\
         end\n\
         end\n",
        hidden = portable.hidden,
    )
}

fn name_of(matrix: &'static str, portable: &Portable) -> &'static str {
    if matrix == CENTRE {
        portable.meaning.centre()
    } else {
        matrix
    }
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
    let mut of_networks = vec![[const { Vec::new() }; MATRICES.len()]; portable.networks.len()];
    for (index, (name, of)) in MATRICES.iter().enumerate() {
        let name = name_of(name, portable);
        let missing = || format!("the matrix {name} is missing or damaged");
        let rest = text.split(&format!("\n{name} = [")).nth(1).ok_or_else(missing)?;
        let inside = rest
            .split("];")
            .next()
            .ok_or_else(missing)?
            .replace("...", " ")
            .replace(';', " ");
        let values = inside
            .split_whitespace()
            .map(|number| number.parse::<f64>().map_err(|_| missing()));
        let values: Vec<f64> = values.collect::<Result<_, _>>()?;
        let expected = Weights::of(portable, Arithmetic::DOUBLE);
        let sizes: usize = expected.networks.iter().map(|network| of(network).len()).sum();
        if values.len() != sizes {
            return Err(missing());
        }
        let size = (values.len() / of_networks.len()).max(1);
        for (network, values) in of_networks.iter_mut().zip(values.chunks(size)) {
            network[index] = values.to_vec();
        }
    }
    let networks = of_networks.into_iter().map(
        |[centre, hidden_weights, hidden_biases, output_weights, output_biases]| RoundedNetwork {
            centre,
            hidden_weights,
            hidden_biases,
            output_weights,
            output_biases,
        },
    );
    Ok(Weights {
        quantity: portable.quantity,
        arithmetic: Arithmetic::DOUBLE,
        networks: networks.collect(),
    })
}
