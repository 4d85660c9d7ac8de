use crate::export::bundle::iteration::{EXPLAINED, SHORTEST_SHARE, STARTS};
use decoupler_core::decoupling::{RowChoice, RowProblemDescription};

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
