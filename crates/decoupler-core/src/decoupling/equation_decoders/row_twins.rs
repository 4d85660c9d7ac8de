use crate::{
    decoupling::{LARGEST_ERROR, Solution},
    scene::{RowModel, Scene},
    sensor::{SensorError, SensorModel},
};

/// Row-wires that give the same readings as another one, by symmetry, where the row-wire of a row is not known.
///
/// The electrodes of a column-wire are evenly spaced, so readings stay the same if any nodes are mirrored at their middle.
/// Without sideways movement, row-wires mirror each other only as a whole, at rest as well. With it, a row has a twin if
/// each of its nodes, or its mirror image, is within reach of the nodes of one row-wire. The same positions as nodes of
/// another row-wire are no twin: they are the same answer.
#[derive(Clone, Debug, Default)]
pub(super) struct RowTwins {
    /// x of the row-wires that another one equals in all readings at rest.
    at_rest_x_mm: Vec<f64>,
    sideways: Option<Sideways>,
    /// True if every row has a twin.
    is_everywhere: bool,
}

/// Row-wires whose nodes move sideways.
#[derive(Clone, Debug)]
struct Sideways {
    rows_x_mm: Vec<f64>,
    largest_shift_mm: f64,
    /// Twice the x of the middle of the electrodes of a column-wire.
    twice_middle_mm: f64,
}

/// Difference of the logarithms of resistances at rest below which row-wires mirror each other.
const SAME_AT_REST: f64 = 1e-13;

impl RowTwins {
    /// Twins among `rows` of `model` with these logarithms of the resistances at rest; none where the scene tells the row.
    pub(super) fn of(model: &SensorModel, scene: &Scene, rows: &[usize], rest: &[Vec<f64>]) -> Self {
        let is_same = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= SAME_AT_REST);
        let has_twin = |index: &usize| rest.iter().filter(|other| is_same(&rest[*index], other)).count() > 1;
        let geometry = &model.geometry;
        let largest_shift_mm = scene.movement.largest_shift_mm();
        let electrodes = model.scale.nodes_per_column() - 1;
        let sideways = Sideways {
            rows_x_mm: rows.iter().map(|&row| geometry.row_x_mm(row)).collect(),
            largest_shift_mm,
            twice_middle_mm: 2.0 * geometry.column_node_x0_mm + geometry.column_node_pitch_mm * electrodes as f64,
        };
        Self {
            at_rest_x_mm: (0..rest.len())
                .filter(has_twin)
                .map(|index| geometry.row_x_mm(rows[index]))
                .collect(),
            sideways: (largest_shift_mm > 0.0 && rest.len() > 1).then_some(sideways),
            // Electrodes of one x see the distance from it alone, which height and x share.
            is_everywhere: rest.len() > 1 && electrodes == 0,
        }
    }

    /// Returns the standing of an answer with these coordinates, which is not the only one if it has a twin.
    pub(super) fn unless_twin(&self, solution: Solution, coordinates_mm: &[f64]) -> Solution {
        match solution {
            Solution::Unique if self.has(coordinates_mm) => Solution::Undetermined,
            solution => solution,
        }
    }

    /// Returns `true` if another row-wire than the one of these coordinates may have the same readings.
    fn has(&self, coordinates_mm: &[f64]) -> bool {
        let sideways = self.sideways.as_ref();
        self.is_everywhere
            || self.at_rest_x_mm.contains(&coordinates_mm[0])
            || sideways.is_some_and(|sideways| sideways.has(coordinates_mm))
    }
}

impl Sideways {
    fn has(&self, coordinates_mm: &[f64]) -> bool {
        let smallest_mm = LARGEST_ERROR * 2.0 * self.largest_shift_mm;
        let reach_mm = self.largest_shift_mm + smallest_mm;
        let x_mm = coordinates_mm.iter().step_by(3);
        let pairs = x_mm.map(|x_mm| (x_mm, self.twice_middle_mm - x_mm));
        self.rows_x_mm.iter().any(|row_x_mm| {
            let is_within = |x_mm: f64| (x_mm - row_x_mm).abs() <= reach_mm;
            let mut may_be = pairs.clone().map(|(x_mm, mirrored_mm)| {
                let is_other = is_within(mirrored_mm) && (mirrored_mm - x_mm).abs() > smallest_mm;
                (is_within(*x_mm) || is_within(mirrored_mm), is_other)
            });
            let mut has_other = false;
            may_be.all(|(is_possible, is_other)| {
                has_other |= is_other;
                is_possible
            }) && has_other
        })
    }
}

/// Logarithms of the resistances at rest of each of `rows`; none where the scene tells the row.
///
/// # Errors
/// If the sensor has no resistances at rest.
pub(super) fn rest_of_searched(
    model: &SensorModel,
    scene: &Scene,
    rows: &[usize],
) -> Result<Vec<Vec<f64>>, SensorError> {
    let at_rest = vec![glam::DVec3::ZERO; model.scale.nodes_per_row()];
    let searched = match scene.rows.model() {
        RowModel::Each => &[],
        RowModel::Shared => rows,
    };
    let rest = |&row: &usize| {
        let readings = model.row_resistances(row, &at_rest)?;
        Ok(readings.into_iter().map(f64::ln).collect())
    };
    searched.iter().map(rest).collect()
}
