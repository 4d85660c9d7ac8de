use super::{header::Header, number, push_array};
use crate::export::bundle::{
    iteration::{EXPLAINED, SHORTEST_SHARE, STARTS},
    weights::Digits,
};
use decoupler_core::{
    decoupling::{RowChoice, RowProblemDescription},
    sensor::Axes,
};

/// Writes the tables and functions of the iteration on the equations of the sensor, and the function that decodes.
pub(super) fn source(header: &Header<'_>, equations: &RowProblemDescription) -> String {
    let upper = header.upper();
    let mut text = format!(
        "/* Eq. (2): g over a resistance is the sum of the reciprocal distances between the nodes of the row-wire and\n   \
         those of the column-wire. Lengths are in mm. */\n\
         #define READ_ROWS {rows}\n#define NODES {nodes}\n#define ELECTRODES {electrodes}\n\
         #define AXES {axes}\n#define UNKNOWNS (AXES * NODES)\n\
         #define HEIGHT {height}\n#define OHM_PER_MM {resistivity}\n\
         #define STEPS {steps}\n#define TOLERANCE {tolerance:e}\n#define STARTS {starts}\n#define EXPLAINED {EXPLAINED:e}\n\n",
        rows = equations.rows.len(),
        nodes = equations.model.scale.nodes_per_row(),
        electrodes = equations.model.scale.nodes_per_column(),
        axes = equations.axes.count(),
        height = number(Digits::Double, equations.model.geometry.height_mm),
        resistivity = number(Digits::Double, equations.model.resistivity_ohm_per_mm),
        steps = equations.steps,
        tolerance = equations.tolerance,
        starts = if equations.seeks_solution { STARTS } else { 1 },
    );
    for (name, shape, values) in tables(equations) {
        let sizes: String = shape.iter().map(|size| format!("[{size}]")).collect();
        let values = values.into_iter().map(|value| number(Digits::Double, value));
        push_array(&mut text, &format!("static const double {name}{sizes}"), &shape, values);
    }
    let [of_unknowns, to_unknowns, to_outputs] = match equations.axes {
        Axes::Z => [
            "const double x = row_x[row], y = node_y[n], z = HEIGHT - u[n];",
            "u[n] = HEIGHT - outputs[3 * n + 2];",
            "coordinates[3 * n] = row_x[row];\n        coordinates[3 * n + 1] = node_y[n];\n        \
             coordinates[3 * n + 2] = HEIGHT - u[n];",
        ],
        Axes::Xyz => [
            "const double x = row_x[row] + u[3 * n], y = node_y[n] + u[3 * n + 1], z = HEIGHT - u[3 * n + 2];",
            "u[3 * n] = outputs[3 * n] - row_x[row];\n        u[3 * n + 1] = outputs[3 * n + 1] - node_y[n];\n        \
             u[3 * n + 2] = HEIGHT - outputs[3 * n + 2];",
            "coordinates[3 * n] = row_x[row] + u[3 * n];\n        coordinates[3 * n + 1] = node_y[n] + u[3 * n + 1];\n        \
             coordinates[3 * n + 2] = HEIGHT - u[3 * n + 2];",
        ],
    };
    let slopes = match equations.axes {
        Axes::Z => "slopes[n] += z * cube;",
        Axes::Xyz => {
            "slopes[3 * n] -= dx * cube;\n                slopes[3 * n + 1] -= dy * cube;\n                \
             slopes[3 * n + 2] += z * cube;"
        }
    };
    text += &FUNCTIONS
        .replace("CHANNELS", &format!("{upper}_CHANNELS"))
        .replace("OUTPUTS", &format!("{upper}_OUTPUTS"))
        .replace("@of_unknowns", of_unknowns)
        .replace("@to_unknowns", to_unknowns)
        .replace("@to_outputs", to_outputs)
        .replace("@slopes", slopes)
        .replace("@shortest", &format!("{SHORTEST_SHARE:e}"));
    text + &decode(header, equations)
}

/// Names, shapes and values of the tables, row by row.
fn tables(equations: &RowProblemDescription) -> Vec<(&'static str, Vec<usize>, Vec<f64>)> {
    let RowProblemDescription { model, rows, .. } = equations;
    let (geometry, scale) = (&model.geometry, model.scale);
    let list = |name, values: Vec<f64>| (name, vec![values.len()], values);
    let of_ranges = |ranges: &[(f64, f64)], pick: fn(&(f64, f64)) -> f64| ranges.iter().map(pick).collect();
    let mut tables = vec![
        list("row_x", rows.iter().map(|&row| geometry.row_x_mm(row)).collect()),
        list(
            "node_y",
            (0..scale.nodes_per_row())
                .map(|node| geometry.node_y_mm(scale, node))
                .collect(),
        ),
        list(
            "electrode_x",
            (0..scale.nodes_per_column())
                .map(|node| geometry.column_node_mm(0, node).x)
                .collect(),
        ),
        list(
            "column_y",
            (0..scale.columns())
                .map(|column| geometry.column_node_mm(column, 0).y)
                .collect(),
        ),
        list("least", of_ranges(&equations.ranges, |range| range.0)),
        list("most", of_ranges(&equations.ranges, |range| range.1)),
        list("least_of_step", of_ranges(&equations.wide_ranges, |range| range.0)),
        list("most_of_step", of_ranges(&equations.wide_ranges, |range| range.1)),
    ];
    if let RowChoice::Tried { rest } = &equations.row_choice {
        tables.push(("rest_logarithms", vec![rest.len(), scale.columns()], rest.concat()));
    }
    tables
}

/// Returns the decoding function, which depends on how the row-wire is known.
fn decode(header: &Header<'_>, equations: &RowProblemDescription) -> String {
    let upper = header.upper();
    let (readings, coordinates) = (header.readings, header.coordinates);
    let search = match &equations.row_choice {
        RowChoice::Given => format!(
            "    const int wire = network;\n    \
             decode_by(network, {readings}, outputs);\n    \
             misfit = attempt(wire, {readings}, outputs, STARTS, u);\n"
        ),
        RowChoice::Nearest => format!(
            "    int wire = 0;\n    \
             double x = 0;\n    \
             decode_by(network, {readings}, outputs);\n    \
             for (int n = 0; n < NODES; ++n) {{\n        \
             x += outputs[3 * n] / NODES;\n    \
             }}\n    \
             for (int other = 1; other < READ_ROWS; ++other) {{\n        \
             if (fabs(row_x[other] - x) < fabs(row_x[wire] - x)) {{\n            \
             wire = other;\n        \
             }}\n    \
             }}\n    \
             misfit = attempt(wire, {readings}, outputs, STARTS, u);\n"
        ),
        RowChoice::Tried { .. } => TRIED
            .replace("READINGS", readings)
            .replace("CHANNELS", &format!("{upper}_CHANNELS")),
    };
    let network = match equations.row_choice {
        RowChoice::Tried { .. } => String::new(),
        _ => header.network_of_row(),
    };
    let judged = if equations.seeks_solution {
        format!("misfit <= EXPLAINED ? {upper}_OK : {upper}_NOT_EXPLAINED")
    } else {
        format!("{upper}_OK")
    };
    format!(
        "{signature}\n\
         {{\n    \
         double outputs[{upper}_OUTPUTS], u[UNKNOWNS] = {{0}}, misfit;\n\
         {network}    \
         for (int k = 0; k < {upper}_CHANNELS; ++k) {{\n        \
         if (!({readings}[k] > 0 && {readings}[k] <= DBL_MAX)) {{\n            \
         return {upper}_BAD_READING;\n        \
         }}\n    \
         }}\n\
         {search}    \
         if (!(misfit <= DBL_MAX)) {{\n        \
         return {upper}_BAD_READING;\n    \
         }}\n    \
         write_coordinates(wire, u, {coordinates});\n    \
         return {judged};\n\
         }}\n\n",
        signature = header.decode_signature(),
    )
}

/// Finds the row-wire by trial.
const TRIED: &str = "    int wire = 0;
    misfit = DBL_MAX;
    for (int starts = 1; misfit > EXPLAINED; starts = STARTS) {
        int is_tried[READ_ROWS] = {0};
        for (int n = 0; n < READ_ROWS && misfit > EXPLAINED; ++n) {
            int next = -1;
            double min_unlike = 0, of_next, tried[UNKNOWNS];
            for (int other = 0; other < READ_ROWS; ++other) {
                double unlike = 0;
                for (int k = 0; k < CHANNELS; ++k) {
                    const double difference = log(READINGS[k]) - rest_logarithms[other][k];
                    unlike += difference * difference;
                }
                if (!is_tried[other] && (next < 0 || unlike < min_unlike)) {
                    next = other;
                    min_unlike = unlike;
                }
            }
            is_tried[next] = 1;
            decode_by(next, READINGS, outputs);
            of_next = attempt(next, READINGS, outputs, starts, tried);
            if (of_next < misfit) {
                misfit = of_next;
                wire = next;
                for (int i = 0; i < UNKNOWNS; ++i) {
                    u[i] = tried[i];
                }
            }
        }
        if (starts == STARTS) {
            break;
        }
    }
";

const FUNCTIONS: &str = "/* Writes the derivatives of the residuals, reading over modelled resistance less 1, in proportion to the ranges of
   the unknowns, and the residuals as the last column. Returns the root mean square of the residuals. */
static double evaluate(int row, const double r[CHANNELS], const double u[UNKNOWNS], double system[CHANNELS][UNKNOWNS + 1])
{
    double squares = 0;
    for (int k = 0; k < CHANNELS; ++k) {
        const double per_ohm = r[k] / OHM_PER_MM;
        double *slopes = system[k], sum = 0;
        for (int i = 0; i < UNKNOWNS; ++i) {
            slopes[i] = 0;
        }
        for (int n = 0; n < NODES; ++n) {
            @of_unknowns
            for (int j = 0; j < ELECTRODES; ++j) {
                const double dx = x - electrode_x[j], dy = y - column_y[k];
                const double inverse = 1 / sqrt(dx * dx + dy * dy + z * z);
                const double cube = inverse * inverse * inverse;
                sum += inverse;
                @slopes
            }
        }
        for (int i = 0; i < UNKNOWNS; ++i) {
            slopes[i] *= per_ohm * (most[i] - least[i]);
        }
        slopes[UNKNOWNS] = per_ohm * sum - 1;
        squares += slopes[UNKNOWNS] * slopes[UNKNOWNS];
    }
    return sqrt(squares / CHANNELS);
}

/* Minimises the linearised residuals by Householder reflections; returns 0 if they do not determine the step. */
static int solve(double a[CHANNELS][UNKNOWNS + 1], double step[UNKNOWNS])
{
    double diagonal[UNKNOWNS];
    for (int p = 0; p < UNKNOWNS; ++p) {
        double norm = 0, half;
        for (int k = p; k < CHANNELS; ++k) {
            norm += a[k][p] * a[k][p];
        }
        norm = a[p][p] > 0 ? -sqrt(norm) : sqrt(norm);
        a[p][p] -= norm;
        half = -norm * a[p][p];
        if (!(half > 0)) {
            return 0;
        }
        for (int c = p + 1; c <= UNKNOWNS; ++c) {
            double product = 0;
            for (int k = p; k < CHANNELS; ++k) {
                product += a[k][p] * a[k][c];
            }
            product /= half;
            for (int k = p; k < CHANNELS; ++k) {
                a[k][c] -= product * a[k][p];
            }
        }
        diagonal[p] = norm;
    }
    for (int p = UNKNOWNS - 1; p >= 0; --p) {
        double value = -a[p][UNKNOWNS];
        for (int c = p + 1; c < UNKNOWNS; ++c) {
            value -= a[p][c] * step[c];
        }
        step[p] = value / diagonal[p];
    }
    return 1;
}

static void put_within(double u[UNKNOWNS])
{
    for (int i = 0; i < UNKNOWNS; ++i) {
        u[i] = fmin(fmax(u[i], least[i]), most[i]);
    }
}

/* Takes Gauss-Newton steps from u; returns the misfit of the answer in u. */
static double iterate(int row, const double r[CHANNELS], double u[UNKNOWNS])
{
    double system[CHANNELS][UNKNOWNS + 1], step[UNKNOWNS], first[UNKNOWNS], before, misfit;
    put_within(u);
    for (int i = 0; i < UNKNOWNS; ++i) {
        first[i] = u[i];
    }
    before = evaluate(row, r, u, system);
    for (int steps = 0; steps < STEPS; ++steps) {
        double share = 1, length = 0;
        int is_finite = 1;
        evaluate(row, r, u, system);
        if (!solve(system, step)) {
            break;
        }
        for (int i = 0; i < UNKNOWNS; ++i) {
            const double length_mm = step[i] * (most[i] - least[i]);
            const double room_mm = (step[i] > 0 ? most_of_step[i] : least_of_step[i]) - u[i];
            if (length_mm > 0 || length_mm < 0) {
                share = fmin(share, room_mm / length_mm);
            }
            length = fmax(length, fabs(step[i]));
            is_finite = is_finite && fabs(step[i]) <= DBL_MAX;
        }
        if (!is_finite || share < @shortest) {
            break;
        }
        for (int i = 0; i < UNKNOWNS; ++i) {
            u[i] += share * step[i] * (most[i] - least[i]);
        }
        if (length <= TOLERANCE) {
            break;
        }
    }
    put_within(u);
    misfit = evaluate(row, r, u, system);
    if (misfit <= before) {
        return misfit;
    }
    for (int i = 0; i < UNKNOWNS; ++i) {
        u[i] = first[i];
    }
    return before;
}

/* Iterates from the first answer, and from mid-range, from rest and from the whole stroke until the readings are
   explained; returns the misfit of the best answer, in u. */
static double attempt(int row, const double r[CHANNELS], const double outputs[OUTPUTS], int starts, double best[UNKNOWNS])
{
    double misfit = DBL_MAX, u[UNKNOWNS];
    for (int n = 0; n < NODES; ++n) {
        @to_unknowns
    }
    for (int start = 0; start < starts && misfit > EXPLAINED; ++start) {
        double found;
        for (int i = 0; i < UNKNOWNS && start > 0; ++i) {
            u[i] = start == 1 ? 0.5 * (least[i] + most[i]) : start == 2 ? 0 : most[i];
        }
        found = iterate(row, r, u);
        if (found < misfit || start == 0) {
            misfit = found;
            for (int i = 0; i < UNKNOWNS; ++i) {
                best[i] = u[i];
            }
        }
    }
    return misfit;
}

static void write_coordinates(int row, const double u[UNKNOWNS], double coordinates[OUTPUTS])
{
    for (int n = 0; n < NODES; ++n) {
        @to_outputs
    }
}

";
