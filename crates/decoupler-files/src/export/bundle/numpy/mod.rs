//! Bundles for NumPy: constants as `network.npz` (of other decoders `decoder.npz`), and a `decode.py` that uses them.

mod npz;

use decoupler_core::decoupling::{Domain, NodeId, Operation, Precision};

use super::{
    contents::{Contents, PrintedHistory, infix, word},
    folder::AtomicFolder,
    report::BundleError,
};

/// Writes constants and program.
///
/// # Errors
/// The operating system refuses.
pub(super) fn print(contents: &Contents, folder: &mut AtomicFolder) -> Result<String, BundleError> {
    folder.write(&format!("{}.npz", contents.noun), npz::write(contents.constants()))?;
    folder.write("decode.py", program(contents))?;
    Ok(usage(contents))
}

/// Text of the program.
fn program(contents: &Contents) -> String {
    let (noun, meaning, rows) = (contents.noun, &contents.meaning, contents.rows);
    let (input, channels) = (meaning.readings(), contents.channels());
    let history = contents.history();
    let (mut row, mut row_text, mut row_check) = ("", "", "    row = np.ones(len(r), int)\n".to_owned());
    if contents.takes_row() {
        row = if history.is_some() { ", row=1" } else { ", row" };
        row_text = "; row: row of each sample, from 1";
        row_check = format!(
            "    row = np.broadcast_to(np.asarray(row), len(r))\n    if not np.isin(row, np.arange(1, {rows} + 1)).all():\n        \
             raise ValueError(\"row: give rows from 1 to {rows}\")\n"
        );
    }
    let check = format!(
        "    r = np.atleast_2d(np.asarray({input}, dtype={dtype}))\n    if r.shape[1] != {channels}:\n        \
         raise ValueError(\"{input}: give {channels} columns\")\n{row_check}",
        dtype = dtype(contents.outer_precision()),
    );
    let returned = format!(
        "Returns {}{}, each with a line for each sample.",
        contents.outputs_in_words(),
        contents.parts_in_words()
    );
    let (state, functions) = match &history {
        Some(history) => (", state, time_s", remembering(contents, history)),
        None => ("", String::new()),
    };
    let decode = match history {
        Some(_) => format!(
            "def decode({input}, time_s, state=None{row}):\n    \"\"\"{returned} The last value is the state.\n\n    \
             {input}: samples x {channels}, in order of time; time_s: time of each in seconds, NaN where it is not known;\n    \
             state: None at the start, or the state to continue from{row_text}\n    \"\"\"\n{check}    \
             time_s = np.broadcast_to(np.asarray(time_s, dtype=float), len(r))\n    \
             state = start() if state is None else np.array(state)\n    \
             answers = [compute(r[k : k + 1], row[k] - 1, state, time_s[k]) for k in range(len(r))]\n    \
             return (*(np.concatenate(part) for part in zip(*answers)), state)\n"
        ),
        None => format!(
            "def decode({input}{row}):\n    \"\"\"{returned}\n\n    {input}: samples x {channels}{row_text}\n    \"\"\"\n{check}    \
             answers = [compute(r[row == index + 1], index) for index in range({rows})]\n    \
             joined = tuple(np.concatenate(part)[np.argsort(np.argsort(row, kind=\"stable\"), kind=\"stable\")] for part in zip(*answers))\n    \
             return joined if len(joined) > 1 else joined[0]\n"
        ),
    };
    format!(
        "\"\"\"{purpose}; see README.txt.\"\"\"\n# {legend}\n\nimport pathlib\n\nimport numpy as np\n\n\
         CONSTANTS = dict(np.load(pathlib.Path(__file__).with_name(\"{noun}.npz\")))\n\n\n\
         def compute({input}, index{state}):\n    \"\"\"Answers to samples of the row-wire with this index.\"\"\"\n    \
         c = CONSTANTS\n{body}    return ({parts},)\n\n\n{functions}{decode}",
        purpose = meaning.purpose(),
        legend = contents.legend("").join("\n# "),
        body = contents.body(|id, operation| statement(contents, id, operation)),
        parts = returned_parts(contents).join(", "),
    )
}

/// The parts of an answer, in the precision of the bundle.
fn returned_parts(contents: &Contents) -> Vec<String> {
    let exported = &contents.exported;
    let numbers = [Some(exported.targets), exported.half_widths].into_iter().flatten();
    let numbers = numbers.map(|id| value(contents, id, contents.outer_precision()));
    let outside = exported.outside.map(|id| contents.name_of(id).to_owned());
    numbers.chain(outside).collect()
}

fn dtype(precision: Precision) -> &'static str {
    word(precision, ["np.float32", "np.float64"])
}

/// A value in this precision.
fn value(contents: &Contents, id: NodeId, precision: Precision) -> String {
    let name = contents.name_of(id);
    let value = match (&contents.exported.program.node(id).operation, contents.is_of_row(id)) {
        (Operation::Select { .. }, true) => format!("c[\"{name}\"][index]"),
        (Operation::Select { .. }, false) => format!("c[\"{name}\"]"),
        _ => name.to_owned(),
    };
    match contents.precision_of(id) == precision {
        true => value,
        false => format!("{value}.astype({})", dtype(precision)),
    }
}

fn statement(contents: &Contents, id: NodeId, operation: &Operation) -> String {
    let (name, precision) = (contents.name_of(id), contents.precision_of(id));
    let operands = operation.operands().into_iter();
    let operands = Vec::from_iter(operands.map(|operand| value(contents, operand, precision)));
    let expression = match (operation, &operands[..]) {
        (Operation::Valid { domain, .. }, [x]) => {
            let (is_valid, above) = match domain {
                Domain::Positive => (format!("({x} > 0) & np.isfinite({x})"), " above 0"),
                Domain::Finite => (format!("np.isfinite({x})"), ""),
            };
            return format!(
                "    if not ({is_valid}).all():\n        raise ValueError(\"{x}: give finite numbers{above}\")\n"
            );
        }
        (Operation::Affine { .. }, [x, weights, biases]) => format!("{x} @ {weights} + {biases}"),
        (Operation::SquaredDistances { .. }, [x, points]) => {
            format!("np.stack([(({x} - point) ** 2).sum(axis=1) for point in {points}.T], axis=1)")
        }
        (Operation::Clip { .. }, [x, low, high]) => format!("np.clip({x}, {low}, {high})"),
        (Operation::Concatenate(_), parts) => format!("np.concatenate([{}], axis=1)", parts.join(", ")),
        (Operation::History { .. }, [x]) => format!("remember(state, {x}[0], time_s)[None]"),
        (Operation::CountOutside { .. }, [x, low, high]) => format!("(({x} < {low}) | ({x} > {high})).sum(axis=1)"),
        _ => infix(operation, ["/", "np.", ""], &operands),
    };
    format!("    {name} = {expression}\n")
}

/// The functions that start a state and take a reading into it.
fn remembering(contents: &Contents, history: &PrintedHistory) -> String {
    let constants = &history.constants;
    let (per_second, per_reading) = history.rates();
    let lags = Vec::from_iter(constants.lags.iter().map(|lag| lag - 1));
    let pause = match history.pause_s {
        f64::INFINITY => "np.inf".to_owned(),
        pause_s => format!("{pause_s:?}"),
    };
    format!(
        "# Usual interval between samples in training, and the pause after which the past is forgotten, in seconds.\n\
         INTERVAL_S, PAUSE_S = {usual:?}, {pause}\n\
         KEPT, LAGS = {kept}, np.array({lags:?}, dtype=int)\n\
         PER_SECOND, PER_READING = np.array({per_second:?}, dtype=float), np.array({per_reading:?}, dtype=float)\n\n\n\
         def start():\n    \"\"\"The state before the first reading. {about} A copy is a state to continue from.\"\"\"\n    \
         # Whether it has started, the latest time, the latest readings (the newest first), and the averages.\n    \
         return np.zeros(({rows}, {channels}))\n\n\n\
         def remember(state, now, time_s):\n    \
         \"\"\"Takes the next readings into the state; returns them with their past.\"\"\"\n    \
         has_started, latest_s = state[0, 0] > 0, state[1, 0]\n    \
         elapsed_s = time_s - latest_s if has_started else np.nan\n    \
         if not has_started or elapsed_s < 0 or elapsed_s > PAUSE_S:\n        \
         state[0], state[2:], elapsed_s = 1, now, np.nan\n    \
         if np.isfinite(time_s) or not has_started:\n        state[1] = time_s\n    \
         elapsed_s = elapsed_s if np.isfinite(elapsed_s) else INTERVAL_S\n    \
         kept, averages = state[2 : 2 + KEPT], state[2 + KEPT :]\n    \
         past_of_lags = kept[LAGS] if len(LAGS) else kept[:0]\n    \
         averages += -np.expm1(-(elapsed_s * PER_SECOND + PER_READING))[:, None] * (now - averages)\n    \
         past = np.concatenate([past_of_lags, averages])\n    \
         kept[1:], kept[:1] = kept[:-1].copy(), now\n    \
         return np.concatenate([now, {past}])\n\n\n",
        kept = constants.longest_lag(),
        rows = history.state_rows(),
        usual = constants.interval_s,
        channels = constants.channels,
        about = contents.state_in_words().unwrap_or_default(),
        past = match constants.differences {
            true => "(now - past).ravel()",
            false => "past.ravel()",
        },
    )
}

/// Lines of a program that decodes.
fn usage(contents: &Contents) -> String {
    let (input, parts) = (contents.meaning.readings(), contents.parts().join(", "));
    let row = if contents.takes_row() { ", row" } else { "" };
    match contents.history() {
        Some(_) => format!(
            "    from decode import decode\n    state = None\n    {parts}, state = decode({input}, time_s, state{row})\n\n\
             takes as many samples as have come since the last call.\n"
        ),
        None => format!("    from decode import decode\n    {parts} = decode({input}{row})\n"),
    }
}
