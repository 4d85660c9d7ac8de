//! Bundles for NumPy: weights as `network.npz` (of other decoders `decoder.npz`), and a `decode.py` that uses them.

mod npz;

use decoupler_core::network::Quantity;

use self::npz::NamedArray;
use super::{
    folder::{Call, Draft},
    layers::Layer,
    meaning::Meaning,
    portable::Portable,
    report::{BundleCheck, BundleError},
    weights::{Arithmetic, Digits, Table, Weights, names},
};

/// Writes the weights and the limits of the readings. Every array has the maps of the rows along its first axis.
pub(super) fn write_weights(portable: &Portable, weights: &Weights) -> Vec<u8> {
    let of_table = |table: Table| NamedArray {
        name: table.name,
        digits: table.digits,
        shape: [&[weights.maps.len()], &table.shape[..]].concat(),
        values: table.values,
    };
    let mut arrays: Vec<_> = weights.tables(portable).into_iter().map(of_table).collect();
    if let Some(ranges) = portable.known_ranges() {
        let limit = |name: &str, pick: fn(&(f64, f64)) -> f64| NamedArray {
            name: name.to_owned(),
            // Rounded like the readings: no reading within the limits counts as outside.
            digits: weights.arithmetic.rest,
            shape: vec![ranges.len(), portable.channels],
            values: ranges.iter().flat_map(|range| range.limits.iter().map(pick)).collect(),
        };
        let [lowest, highest] = portable.meaning.limits();
        arrays.push(limit(lowest, |limits| limits.0));
        arrays.push(limit(highest, |limits| limits.1));
    }
    npz::write(&arrays)
}

/// Reads back the weights, which are in this arithmetic.
///
/// # Errors
/// A description of the damage.
pub(super) fn read_weights(bytes: &[u8], portable: &Portable, arithmetic: Arithmetic) -> Result<Weights, String> {
    let arrays = npz::read(bytes)?;
    Weights::of_tables(portable, arithmetic, |table| {
        let found = arrays.iter().find(|array| array.name == table.name);
        let array = found.ok_or_else(|| format!("there is no array '{}'", table.name))?;
        if array.digits == table.digits && array.shape[1..] == table.shape {
            Ok(array.values.clone())
        } else {
            Err(format!("'{}' has another shape or precision", table.name))
        }
    })
}

/// Writes the program.
pub(super) fn write_program(portable: &Portable, arithmetic: Arithmetic) -> String {
    let rows = portable.rows();
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
        "; row: row of each sample, from 1"
    } else {
        ""
    };
    let meaning = &portable.meaning;
    let (input, output) = (meaning.readings(), meaning.outputs());
    let is_reading = match portable.quantity {
        Quantity::Raw => "np.isfinite(r)",
        _ => "(r > 0) & np.isfinite(r)",
    };
    let dtype = match arithmetic.rest {
        Digits::Single => "np.float32",
        Digits::Double => "np.float64",
    };
    let (outside, counted) = if portable.known_ranges().is_some() {
        (
            format!(
                "        outside[mine] = ((r[mine] < MAPS[\"{lowest}\"][index]) | (r[mine] > MAPS[\"{highest}\"][index])).sum(axis=1)\n",
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

MAPS = dict(np.load(pathlib.Path(__file__).with_name("{noun}.npz")))
{half_widths}
def decode_by(index, r):
    """Decodes readings with the map of this index."""
    w = {{name: array[index] for name, array in MAPS.items() if name not in {not_of_maps}}}
    x = r.astype(w["{centre}"].dtype)
{steps}    return v.astype(r.dtype)



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
        mine = row == index + 1
        {output}[mine] = decode_by(index, r[mine])
{outside}    return {output}, outside
"#,
        channels = portable.channels,
        noun = portable.decoder,
        half_widths = meaning.half_widths().map_or_else(String::new, |half_widths| {
            format!("# Half-widths of the 90 % prediction intervals for all answers together, in the units of the targets.\nHALF_WIDTHS_90 = np.array({half_widths:?})\n")
        }),
        centre = meaning.centre(),
        not_of_maps = format_args!("(\"{}\", \"{}\")", meaning.limits()[0], meaning.limits()[1]),
        steps = steps(portable, arithmetic),
        above = if portable.quantity == Quantity::Raw {
            ""
        } else {
            " above 0"
        },
    )
}

/// Statements from the readings `x` to the answers `v`.
fn steps(portable: &Portable, arithmetic: Arithmetic) -> String {
    let centre = format!("w[\"{}\"]", portable.meaning.centre());
    let change = match portable.quantity {
        Quantity::Resistance | Quantity::Raw => format!("x - {centre}"),
        Quantity::Conductance => format!("({centre} - x) / x"),
        Quantity::LogResistance => format!("np.log1p((x - {centre}) / {centre})"),
    };
    let mut text = format!("    v = {change}\n");
    for (index, (layer, names)) in portable.layers().iter().zip(names(portable.layers())).enumerate() {
        if index > 0 && index == arithmetic.wide_layers {
            text += "    v = v.astype(r.dtype)\n";
        }
        let table = |place: usize| format!("w[\"{}\"]", names.tables[place]);
        text += &match layer {
            Layer::Affine(_) => format!("    v = v @ {} + {}\n", table(0), table(1)),
            Layer::Tanh => "    v = np.tanh(v)\n".to_owned(),
            Layer::Gaussians { .. } => {
                format!("    v = np.exp(-((v[:, :, None] - {}) ** 2).sum(axis=1))\n", table(0))
            }
        };
    }
    text
}

/// Writes weights and program, and reads the weights back.
///
/// # Errors
/// They cannot be written or read back.
pub(super) fn export(draft: &mut Draft<'_>) -> Result<Vec<BundleCheck>, BundleError> {
    let (portable, arithmetic) = (draft.portable, draft.weights.arithmetic);
    let file = format!("{}.npz", portable.decoder);
    let bytes = draft.write(&file, write_weights(portable, draft.weights))?;
    draft.write("decode.py", write_program(portable, arithmetic))?;
    let read = read_weights(&bytes, portable, arithmetic);
    let read = read.map_err(|reason| BundleError::read_back(&file, reason))?;
    let deviation = draft.deviation_of(&read);
    Ok(vec![BundleCheck::of(
        "NumPy weights, read back and evaluated",
        deviation,
    )])
}

/// Returns the usage section of the README.
pub(super) fn call(call: &Call<'_>) -> String {
    let portable = call.portable;
    let (takes_row, channels, outputs) = (portable.takes_row(), portable.channels, portable.outputs);
    let meaning = &portable.meaning;
    let (input, output) = (meaning.readings(), meaning.outputs());
    let row = if takes_row { ", row" } else { "" };
    format!(
        "    from decode import decode\n    \
         {output}, readings_outside = decode({input}{row})\n\n\
         {input} is samples x {channels}, {output} samples x {outputs}{row_text}.",
        row_text = if takes_row {
            ";\nrow is the row of each sample, from 1"
        } else {
            ""
        },
    )
}
