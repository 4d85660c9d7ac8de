//! Bundles for NumPy: weights as `network.npz`, and a `decode.py` that uses them.

mod npz;

use self::npz::NamedArray;
use super::{
    meaning::Meaning,
    portable::Portable,
    weights::{Arithmetic, Digits, RoundedNetwork, Weights},
};
use crate::network::Quantity;

/// Writes the weights and the limits of the readings. Every array has the networks of the rows along its first axis.
pub(super) fn write_weights(portable: &Portable, weights: &Weights) -> Vec<u8> {
    let Arithmetic { hidden, rest } = weights.arithmetic;
    let (channels, outputs) = (portable.channels, portable.outputs);
    let array = |name: &str, digits, shape: &[usize], of: &dyn Fn(&RoundedNetwork) -> Vec<f64>| NamedArray {
        name: name.to_owned(),
        digits,
        shape: [&[weights.networks.len()], shape].concat(),
        values: weights.networks.iter().flat_map(of).collect(),
    };
    let mut arrays = vec![
        array(portable.meaning.centre(), hidden, &[channels], &|network| {
            network.centre.clone()
        }),
        array("hidden_weights", hidden, &[channels, portable.hidden], &|network| {
            network.hidden_weights.clone()
        }),
        array("hidden_biases", hidden, &[portable.hidden], &|network| {
            network.hidden_biases.clone()
        }),
        array("output_weights", rest, &[portable.hidden, outputs], &|network| {
            network.output_weights.clone()
        }),
        array("output_biases", rest, &[outputs], &|network| {
            network.output_biases.clone()
        }),
    ];
    if let Some(ranges) = portable.ranges() {
        let limit = |name: &str, pick: fn(&(f64, f64)) -> f64| NamedArray {
            name: name.to_owned(),
            // Rounded as readings are, so that none within the limits is outside.
            digits: rest,
            shape: vec![ranges.len(), channels],
            values: ranges.iter().flat_map(|range| range.limits.iter().map(pick)).collect(),
        };
        let [lowest, highest] = portable.meaning.limits();
        arrays.push(limit(lowest, |limits| limits.0));
        arrays.push(limit(highest, |limits| limits.1));
    }
    npz::write(&arrays)
}

/// Reads the weights back.
///
/// # Errors
/// A description of the damage.
pub(super) fn read_weights(bytes: &[u8], portable: &Portable) -> Result<Weights, String> {
    let arrays = npz::read(bytes)?;
    let array = |name: &str| {
        let found = arrays.iter().find(|array| array.name == name);
        found.ok_or_else(|| format!("there is no array '{name}'"))
    };
    let of_network = |name: &str, index: usize| {
        let array = array(name)?;
        let size: usize = array.shape.iter().skip(1).product();
        let values = array.values.get(index * size..).and_then(|rest| rest.get(..size));
        values
            .map(<[f64]>::to_vec)
            .ok_or_else(|| format!("'{name}' is too short"))
    };
    let centre_name = portable.meaning.centre();
    let centre = array(centre_name)?;
    let networks = (0..centre.shape[0]).map(|index| {
        Ok(RoundedNetwork {
            centre: of_network(centre_name, index)?,
            hidden_weights: of_network("hidden_weights", index)?,
            hidden_biases: of_network("hidden_biases", index)?,
            output_weights: of_network("output_weights", index)?,
            output_biases: of_network("output_biases", index)?,
        })
    });
    Ok(Weights {
        quantity: portable.quantity,
        arithmetic: Arithmetic {
            hidden: centre.digits,
            rest: array("output_weights")?.digits,
        },
        networks: networks.collect::<Result<_, String>>()?,
    })
}

/// Writes the program.
pub(super) fn write_program(portable: &Portable, arithmetic: Arithmetic) -> String {
    let rows = portable.networks.len();
    let (argument, row) = if portable.takes_row() {
        let check = format!(
            "    row = np.broadcast_to(np.asarray(row), len(r))\n    if not np.isin(row, np.arange(1, {rows} + 1)).all():\n        \
             raise ValueError(\"row: give rows from 1 to {rows}\")\n"
        );
        (", row", check)
    } else {
        ("", "    row = np.ones(len(r))\n".to_owned())
    };
    let row_text = if portable.takes_row() {
        "; row: the row of each sample, from 1"
    } else {
        ""
    };
    let meaning = &portable.meaning;
    let (input, output, centre) = (
        meaning.readings(),
        meaning.outputs(),
        format!("w[\"{}\"]", meaning.centre()),
    );
    let change = match portable.quantity {
        Quantity::Resistance | Quantity::Raw => format!("x - {centre}"),
        Quantity::Conductance => format!("({centre} - x) / x"),
        Quantity::LogResistance => format!("np.log1p((x - {centre}) / {centre})"),
    };
    let is_reading = match portable.quantity {
        Quantity::Raw => "np.isfinite(r)",
        _ => "(r > 0) & np.isfinite(r)",
    };
    let dtype = match arithmetic.rest {
        Digits::Single => "np.float32",
        Digits::Double => "np.float64",
    };
    let (outside, counted) = if portable.ranges().is_some() {
        (
            format!(
                "        outside[mine] = ((r[mine] < w[\"{lowest}\"]) | (r[mine] > w[\"{highest}\"])).sum(axis=1)\n",
                lowest = meaning.limits()[0],
                highest = meaning.limits()[1],
            ),
            "the number of readings of each sample outside the range of training",
        )
    } else {
        (String::new(), "zeros, because the range of training is not known")
    };
    let outputs = portable.outputs;
    let (purpose, answers) = match meaning {
        Meaning::Array(_) => (
            "Decodes readings of a tactile array in ohm into the coordinates of its nodes in mm",
            format!("the coordinates in mm (samples x {outputs}: x_1, y_1, z_1, x_2, ...)"),
        ),
        Meaning::Own { .. } => (
            "Decodes readings into targets",
            format!("the targets (samples x {outputs})"),
        ),
    };
    let legend: String = meaning.legend().iter().map(|line| format!("# {line}\n")).collect();
    format!(
        r#""""{purpose}; see README.txt."""
{legend}import pathlib

import numpy as np

NETWORKS = dict(np.load(pathlib.Path(__file__).with_name("network.npz")))


def decode({input}{argument}):
    """Returns {answers}, and
    {counted}.

    {input}: samples x {channels}{row_text}
    """
    r = np.atleast_2d(np.asarray({input}, dtype={dtype}))
    if not ({is_reading}).all():
        raise ValueError("{input}: give finite numbers{above}")
{row}    {output}, outside = np.empty((len(r), {outputs}), r.dtype), np.zeros(len(r), int)
    for index in range({rows}):
        mine, w = row == index + 1, {{name: array[index] for name, array in NETWORKS.items()}}
        x = r[mine].astype({centre}.dtype)
        sums = ({change}) @ w["hidden_weights"] + w["hidden_biases"]
        {output}[mine] = np.tanh(sums.astype(r.dtype)) @ w["output_weights"] + w["output_biases"]
{outside}    return {output}, outside
"#,
        channels = portable.channels,
        above = if portable.quantity == Quantity::Raw {
            ""
        } else {
            " above 0"
        },
    )
}
