//! Bundles as one function file for MATLAB and GNU Octave, and the numbers in it as they are read back.

use std::fmt::Write;

use super::{
    metadata::coordinate_names,
    portable::Portable,
    weights::{Arithmetic, RoundedNetwork, Weights},
};
use crate::network::Quantity;

/// Matrices of the file: their names and numbers of columns, and the part of each network.
type Matrix = (&'static str, fn(&RoundedNetwork) -> &Vec<f64>);

const MATRICES: [Matrix; 5] = [
    ("centre_ohm", |network| &network.centre_ohm),
    ("hidden_weights", |network| &network.hidden_weights),
    ("hidden_biases", |network| &network.hidden_biases),
    ("output_weights", |network| &network.output_weights),
    ("output_biases", |network| &network.output_biases),
];

/// Writes the function `name`. The matrices of the rows stand one below the other.
pub(super) fn write(name: &str, portable: &Portable, weights: &Weights) -> String {
    let (channels, rows) = (portable.channels, portable.networks.len());
    let ranges = portable.ranges();
    let (argument, help, check) = if portable.takes_row() {
        (
            ", row",
            format!("%   ROW has the row-wire of each sample, from 1 to {rows}; one number stands for all.\n"),
            format!(
                "if isscalar(row)\n    row = repmat(row, samples, 1);\nend\nif numel(row) ~= samples || \
                 ~all(ismember(row, 1:{rows}))\n    error('row: give the row-wire of each sample, from 1 to {rows}');\n\
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
        Quantity::Raw => ("isfinite(resistances_ohm(:))", "finite numbers"),
        _ => (
            "isfinite(resistances_ohm(:)) & resistances_ohm(:) > 0",
            "finite numbers above 0",
        ),
    };
    let change = match portable.quantity {
        Quantity::Resistance | Quantity::Raw => "r - centre_ohm(k, :)",
        Quantity::Conductance => "(centre_ohm(k, :) - r) ./ r",
        Quantity::LogResistance => "log1p((r - centre_ohm(k, :)) ./ centre_ohm(k, :))",
    };
    let names = coordinate_names(portable);
    let mut text = format!(
        "function [coordinates_mm, readings_outside] = {name}(resistances_ohm{argument})\n\
         %{upper} Decodes readings of a tactile array into the coordinates of its nodes.\n\
         %   COORDINATES_MM = {upper}(RESISTANCES_OHM{upper_argument}) has a line of {outputs} coordinates in mm (x_1, y_1, z_1, to {last})\n\
         %   for each line of {channels} resistances in ohm (r_1 to r_{channels}).\n\
         {help}\
         %   [COORDINATES_MM, READINGS_OUTSIDE] = ... also has {counted}.\n\
         \n\
         samples = size(resistances_ohm, 1);\n\
         if size(resistances_ohm, 2) ~= {channels} || ~all({is_reading})\n    \
         error('resistances_ohm: give {channels} columns of {readings}');\n\
         end\n\
         {check}",
        upper = name.to_uppercase(),
        upper_argument = argument.to_uppercase(),
        outputs = portable.outputs,
        last = names.last().map_or("", String::as_str),
    );
    for (matrix, of) in MATRICES {
        let columns = match matrix {
            "centre_ohm" => channels,
            "hidden_weights" | "hidden_biases" => portable.hidden,
            _ => portable.outputs,
        };
        let values = weights.networks.iter().flat_map(|network| of(network).iter().copied());
        push_matrix(&mut text, matrix, columns, values);
    }
    let mut outside = "";
    if let Some(ranges) = &ranges {
        let limits = || ranges.iter().flat_map(|range| &range.limits);
        push_matrix(&mut text, "lowest_ohm", channels, limits().map(|limits| limits.0));
        push_matrix(&mut text, "highest_ohm", channels, limits().map(|limits| limits.1));
        outside = "    readings_outside(mine) = sum(r < lowest_ohm(k, :) | r > highest_ohm(k, :), 2);\n";
    }
    text + &format!(
        "coordinates_mm = zeros(samples, {outputs});\n\
         readings_outside = zeros(samples, 1);\n\
         for k = 1:{rows}\n    \
         mine = find(row(:) == k);\n    \
         r = resistances_ohm(mine, :);\n    \
         change = {change};\n    \
         hidden = tanh(change * hidden_weights((k - 1) * {channels} + (1:{channels}), :) + hidden_biases(k, :));\n    \
         coordinates_mm(mine, :) = hidden * output_weights((k - 1) * {hidden} + (1:{hidden}), :) + output_biases(k, :);\n\
         {outside}\
         end\n\
         end\n",
        outputs = portable.outputs,
        hidden = portable.hidden,
    )
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
        |[centre_ohm, hidden_weights, hidden_biases, output_weights, output_biases]| RoundedNetwork {
            centre_ohm,
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
