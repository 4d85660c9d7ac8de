//! Bundles for NumPy: weights as `network.npz` (of other decoders `decoder.npz`), and a `decode.py` that uses them.

mod iteration;
mod npz;

use self::npz::NamedArray;
use super::{
    error::BundleError,
    folder::{Call, Draft},
    meaning::Meaning,
    portable::Portable,
    report::BundleCheck,
    tables::{Table, names},
    weights::{Arithmetic, Digits, Weights},
};
use decoupler_core::{decoupling::Layer, network::Quantity};

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
            // Rounded as readings are, so that none within the limits is outside.
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

/// Reads the weights back, which are in this arithmetic.
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
        "; row: the row of each sample, from 1"
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
    let seeks_solution = portable
        .equations
        .as_ref()
        .is_some_and(|equations| equations.seeks_solution);
    let [counter, counting, warning] = if seeks_solution {
        [
            "    unexplained = 0\n",
            "            unexplained += misfit > EXPLAINED\n",
            "    if unexplained:\n        \
             warnings.warn(f\"{unexplained} of {len(r)} samples have noise or come from another sensor\")\n",
        ]
    } else {
        [""; 3]
    };
    let answer = match &portable.equations {
        None => format!("        {output}[mine] = decode_by(index, r[mine])\n"),
        Some(_) => format!(
            "        for sample in np.flatnonzero(mine):\n            \
             misfit, {output}[sample] = solve(index, r[sample])\n{counting}"
        ),
    };
    let legend: String = meaning.legend().iter().map(|line| format!("# {line}\n")).collect();
    format!(
        r#""""{purpose}; see README.txt."""
{legend}import pathlib
{warnings}
import numpy as np

MAPS = dict(np.load(pathlib.Path(__file__).with_name("{noun}.npz")))


def decode_by(index, r):
    """Answers readings by the map with this index."""
    w = {{name: array[index] for name, array in MAPS.items() if name not in {not_of_maps}}}
    x = r.astype(w["{centre}"].dtype)
{steps}    return v.astype(r.dtype)

{solver}def decode({input}{argument}):
    """Returns {answers}, and
    {counted}.

    {input}: samples x {channels}{row_text}
    """
    r = np.atleast_2d(np.asarray({input}, dtype={dtype}))
    if not ({is_reading}).all():
        raise ValueError("{input}: give finite numbers{above}")
{row}    {output}, outside = np.empty((len(r), {outputs}), r.dtype), np.zeros(len(r), int)
{counter}    for index in range({rows}):
        mine = row == index + 1
{answer}{outside}{warning}    return {output}, outside
"#,
        channels = portable.channels,
        noun = portable.decoder,
        centre = meaning.centre(),
        not_of_maps = format_args!("(\"{}\", \"{}\")", meaning.limits()[0], meaning.limits()[1]),
        steps = steps(portable, arithmetic),
        warnings = if seeks_solution { "import warnings\n" } else { "" },
        solver = portable.equations.as_ref().map_or_else(
            || "\n".to_owned(),
            |equations| format!("\n{}", iteration::source(equations))
        ),
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
            Layer::Rules { memberships, .. } => format!(
                "    logarithms = v @ {} + {}\n    \
                 strengths = np.exp(logarithms - logarithms.max(axis=1, keepdims=True))\n    \
                 strengths /= strengths.sum(axis=1, keepdims=True)\n    \
                 of_rules = (v @ {} + {}).reshape(len(v), {}, -1)\n    \
                 v = (strengths[:, :, None] * of_rules).sum(axis=1)\n",
                table(0),
                table(1),
                table(2),
                table(3),
                memberships.outputs(),
            ),
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

/// How to call it, for the README.
pub(super) fn call(call: &Call<'_>) -> String {
    let portable = call.portable;
    let (takes_row, channels, outputs) = (portable.takes_row(), portable.channels, portable.outputs);
    let meaning = &portable.meaning;
    let (input, output) = (meaning.readings(), meaning.outputs());
    let row = if takes_row { ", row" } else { "" };
    format!(
        "    from decode import decode\n    \
         {output}, readings_outside = decode({input}{row})\n\n\
         {input} is samples x {channels}, {output} samples x {outputs}{row_text}.{explained}",
        row_text = if takes_row {
            ";\nrow has the row of each sample, from 1"
        } else {
            ""
        },
        explained = if call.tells_unexplained() {
            "\nIt warns of samples that no deformation explains to 1e-10, as with noise."
        } else {
            ""
        },
    )
}
