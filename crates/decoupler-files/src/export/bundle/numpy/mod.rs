//! Bundles for NumPy: weights as `network.npz` (of other decoders `decoder.npz`), and a `decode.py` that uses them.

mod npz;

use decoupler_core::{
    decoupling::{RowChoice, RowProblemDescription},
    network::Quantity,
};

use self::npz::NamedArray;
use super::{
    folder::{Call, Draft},
    layers::Layer,
    meaning::Meaning,
    portable::Portable,
    report::{BundleCheck, BundleError},
    weights::{Arithmetic, Digits, Table, Weights, names},
};
use crate::export::bundle::iteration::{EXPLAINED, SHORTEST_SHARE, STARTS};

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
{half_widths}
def decode_by(index, r):
    """Decodes readings with the map of this index."""
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
        half_widths = meaning.half_widths().map_or_else(String::new, |half_widths| {
            format!("# Half-widths of the 90 % prediction intervals for all answers together, in the units of the targets.\nHALF_WIDTHS_90 = np.array({half_widths:?})\n")
        }),
        centre = meaning.centre(),
        not_of_maps = format_args!("(\"{}\", \"{}\")", meaning.limits()[0], meaning.limits()[1]),
        steps = steps(portable, arithmetic),
        warnings = if seeks_solution { "import warnings\n" } else { "" },
        solver = portable
            .equations
            .as_ref()
            .map_or_else(|| "\n".to_owned(), |equations| format!("\n{}", source(equations))),
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
         {input} is samples x {channels}, {output} samples x {outputs}{row_text}.{explained}",
        row_text = if takes_row {
            ";\nrow is the row of each sample, from 1"
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

/// Writes the constants and functions of the iteration on the equations of the sensor.
pub(super) fn source(equations: &RowProblemDescription) -> String {
    let RowProblemDescription { model, rows, .. } = equations;
    let (geometry, scale) = (&model.geometry, model.scale);
    let of_ranges = |ranges: &[(f64, f64)], pick: fn(&(f64, f64)) -> f64| list(ranges.iter().map(pick));
    let (rest, choice) = match &equations.row_choice {
        RowChoice::Given => (String::new(), GIVEN),
        RowChoice::Nearest => (String::new(), NEAREST),
        RowChoice::Tried { rest } => {
            let rows: Vec<String> = rest.iter().map(|row| list(row.iter().copied())).collect();
            (format!("REST_LOGARITHMS = np.array([{}])\n", rows.join(", ")), TRIED)
        }
    };
    let constants = format!(
        "# Eq. (2): g over a resistance is the sum of the reciprocal distances between the nodes of the row-wire and those\n\
         # of the column-wire. Lengths are in mm.\n\
         ROW_X = np.array({rows})\n\
         NODE_Y = np.array({nodes})\n\
         ELECTRODE_X = np.array({electrodes})\n\
         COLUMN_Y = np.array({columns})\n\
         AXES = {axes:?}\n\
         HEIGHT, OHM_PER_MM = {height:?}, {resistivity:?}\n\
         MIN = np.array({least})\n\
         MAX = np.array({most})\n\
         MIN_OF_STEP = np.array({least_of_step})\n\
         MAX_OF_STEP = np.array({most_of_step})\n\
         STEPS, TOLERANCE, STARTS, EXPLAINED = {steps}, {tolerance:e}, {starts}, {EXPLAINED:e}\n\
         {rest}\n\n",
        rows = list(rows.iter().map(|&row| geometry.row_x_mm(row))),
        nodes = list((0..scale.nodes_per_row()).map(|node| geometry.node_y_mm(scale, node))),
        electrodes = list((0..scale.nodes_per_column()).map(|node| geometry.column_node_mm(0, node).x)),
        columns = list((0..scale.columns()).map(|column| geometry.column_node_mm(column, 0).y)),
        axes = equations.axes.indices(),
        height = geometry.height_mm,
        resistivity = model.resistivity_ohm_per_mm,
        least = of_ranges(&equations.ranges, |range| range.0),
        most = of_ranges(&equations.ranges, |range| range.1),
        least_of_step = of_ranges(&equations.wide_ranges, |range| range.0),
        most_of_step = of_ranges(&equations.wide_ranges, |range| range.1),
        steps = equations.steps,
        tolerance = equations.tolerance,
        starts = if equations.seeks_solution { STARTS } else { 1 },
    );
    constants + &FUNCTIONS.replace("SHORTEST", &format!("{SHORTEST_SHARE:e}")) + choice
}

fn list(values: impl Iterator<Item = f64>) -> String {
    let texts: Vec<String> = values.map(|value| format!("{value:?}")).collect();
    format!("[{}]", texts.join(", "))
}

const FUNCTIONS: &str = r#"def evaluate(row, r, u):
    """Returns the residuals, reading over modelled resistance less 1, and their derivatives in proportion to the ranges."""
    moved = np.zeros((len(NODE_Y), 3))
    moved[:, AXES] = u.reshape(len(NODE_Y), -1)
    dx = (ROW_X[row] + moved[:, 0])[:, None, None] - ELECTRODE_X
    dy = (NODE_Y + moved[:, 1])[:, None, None] - COLUMN_Y[:, None]
    z = (HEIGHT - moved[:, 2])[:, None, None]
    inverse = 1 / np.sqrt(dx * dx + dy * dy + z * z)
    cube = inverse**3
    slopes = np.stack([-(dx * cube).sum(2), -(dy * cube).sum(2), (z * cube).sum(2)], axis=2)[:, :, AXES]
    per_ohm = r / OHM_PER_MM
    derivatives = slopes.transpose(1, 0, 2).reshape(len(r), -1) * per_ohm[:, None] * (MAX - MIN)
    return per_ohm * inverse.sum(axis=(0, 2)) - 1, derivatives

def misfit_of(row, r, u):
    return np.sqrt(np.mean(evaluate(row, r, u)[0] ** 2))

def iterate(row, r, u):
    """Takes Gauss-Newton steps from u; returns the misfit and the answer."""
    u = first = np.clip(u, MIN, MAX)
    before = misfit_of(row, r, u)
    for _ in range(STEPS):
        residuals, derivatives = evaluate(row, r, u)
        step = np.linalg.lstsq(derivatives, -residuals, rcond=None)[0]
        room, moves = np.where(step > 0, MAX_OF_STEP, MIN_OF_STEP) - u, step != 0
        share = min(1, *(room[moves] / (step * (MAX - MIN))[moves]), 1)
        if not np.isfinite(step).all() or share < SHORTEST:
            break
        u = u + share * step * (MAX - MIN)
        if np.abs(step).max() <= TOLERANCE:
            break
    u = np.clip(u, MIN, MAX)
    misfit = misfit_of(row, r, u)
    return (misfit, u) if misfit <= before else (before, first)

def attempt(row, r, outputs, starts):
    """Iterates from the first answer, and from other starts until the readings are explained."""
    at = outputs.reshape(-1, 3)
    moved = np.column_stack([at[:, 0] - ROW_X[row], at[:, 1] - NODE_Y, HEIGHT - at[:, 2]])
    begins = [moved[:, AXES].ravel(), (MIN + MAX) / 2, np.zeros(len(MIN)), MAX]
    best = None
    for begin in begins[:starts]:
        found = iterate(row, r, begin)
        if best is None or found[0] < best[0]:
            best = found
        if best[0] <= EXPLAINED:
            break
    return best

def coordinates_of(row, u):
    moved = np.zeros((len(NODE_Y), 3))
    moved[:, AXES] = u.reshape(len(NODE_Y), -1)
    return np.column_stack([ROW_X[row] + moved[:, 0], NODE_Y + moved[:, 1], HEIGHT - moved[:, 2]]).ravel()

"#;

const GIVEN: &str = r#"def solve(index, r):
    """Returns the misfit and the answer for the row-wire with this index."""
    misfit, u = attempt(index, r, decode_by(index, r[None])[0], STARTS)
    return misfit, coordinates_of(index, u)

"#;

const NEAREST: &str = r#"def solve(index, r):
    """Returns the misfit and the answer for the row-wire that is nearest to the first answer."""
    outputs = decode_by(index, r[None])[0]
    row = np.abs(ROW_X - outputs[::3].mean()).argmin()
    misfit, u = attempt(row, r, outputs, STARTS)
    return misfit, coordinates_of(row, u)

"#;

const TRIED: &str = r#"def solve(index, r):
    """Returns the misfit and the answer for the row-wire that explains the readings best."""
    unlike = ((np.log(r) - REST_LOGARITHMS) ** 2).sum(axis=1)
    best = None
    for starts in (1, STARTS):
        for row in np.argsort(unlike, kind="stable"):
            misfit, u = attempt(row, r, decode_by(row, r[None])[0], starts)
            if best is None or misfit < best[0]:
                best = misfit, coordinates_of(row, u)
            if best[0] <= EXPLAINED:
                return best
    return best

"#;
