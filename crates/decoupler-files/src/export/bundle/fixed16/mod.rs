//! Programs in fixed point: 16-bit weights and activations, 64-bit sums; readings and targets are 32-bit numbers of small
//! units. For affine maps and hyperbolic tangents of the changes of the readings, such as networks and ridge.
//!
//! Every number has a range that holds for all readings, because each step begins with a saturation; sums therefore
//! cannot overflow. The bound on the error is computed by interval analysis over the range of readings in training and
//! a tenth of it on either side.

mod scaled;
mod units;

use decoupler_core::{
    dataset::PerRow,
    decoupling::{Domain, Function, NodeId, Operation},
};
use ndarray::Array2;

pub(super) use self::scaled::{CONDUCTANCE_BITS, INPUT_BITS, LARGEST_INPUT, TangentTable};
use self::{
    scaled::{Change, ScaledRow, whole_bias},
    units::Units,
};
use super::{
    contents::Contents,
    exported_program::{ExportedProgram, Limits, table},
    meaning::{Meaning, comment},
    report::BundleError,
};
use crate::export::format_number;

/// Upper bound of a target in units for all inputs of the last layer.
const LARGEST_TARGET: f64 = (1_u32 << 30) as f64;

/// A program in fixed point.
#[derive(Clone, Debug)]
pub(super) struct FixedProgram {
    pub(super) readings: Units,
    pub(super) targets: Units,
    /// The changes of the readings are relative ones, as of conductances.
    pub(super) is_relative: bool,
    pub(super) tangent: TangentTable,
    /// Number of row-wires with numbers of their own.
    pub(super) rows: usize,
    /// Inputs and sums of each layer. A hyperbolic tangent follows each but the last.
    pub(super) layers: Vec<[usize; 2]>,
    /// Of the readings: `centres` relative to which the change of each is measured, `factors` of the change, and
    /// `factor_shifts` after it. Of each layer: `weights` (sums × inputs), `biases` and `sum_shifts`. Limits beyond which a
    /// reading counts as outside: `lowest` and `highest`.
    pub(super) tables: Vec<FixedTable>,
    /// Bound on the error of each target within the limits of the readings, including the rounding of readings to units, in
    /// the unit of the target.
    pub(super) bounds: Vec<f64>,
}

/// Integers of a program.
#[derive(Clone, Debug)]
pub(super) struct FixedTable {
    pub(super) name: String,
    /// Type in C.
    pub(super) kind: &'static str,
    /// Shape for each row-wire.
    pub(super) shape: Vec<usize>,
    /// The values of all row-wires, one after the other.
    pub(super) values: Vec<i64>,
}

impl FixedProgram {
    /// Upper limit of the error bound, relative to the range of a target, above which there is a remark.
    pub(super) const USUAL_BOUND: f64 = 0.01;

    /// Rounds the numbers of a program.
    ///
    /// # Errors
    /// The range of the readings is not known, a step or a number has no form in integers, or the bound on the error is as
    /// large as the range of the targets.
    pub(super) fn of(contents: &Contents, limits: Option<&Limits>) -> Result<Self, BundleError> {
        let (exported, meaning, scales) = (&contents.exported, &contents.meaning, &contents.scales);
        let (is_relative, reference, layers) = chain(exported)?;
        let no_range = "fixed16 needs the range of the readings in training, which the network file does not have: train again, \
                        or choose precision f32";
        let limits = limits.ok_or_else(|| BundleError::Unsuitable(no_range.to_owned()))?;
        let cure = meaning.smaller_weights();
        let rows = exported.program.rows();
        let tables = |id: NodeId, row: usize| table(exported.program.nodes(), id, row);
        let [weights, biases] = *layers.last().expect("there is a layer of targets");
        let reach = |target: usize| {
            let of_row = |row: usize| {
                let weights = tables(weights, row).column(target);
                let most = match layers.len() {
                    // The targets of a single layer are sums of changes, whose size is that of the range.
                    1 => scales[target],
                    _ => weights.iter().map(|weight| weight.abs()).sum::<f64>(),
                };
                tables(biases, row)[[0, target]].abs() + most
            };
            (0..rows).map(of_row).fold(0.0, f64::max)
        };
        let mut fixed = Self {
            is_relative,
            tangent: TangentTable::new(),
            rows,
            layers: Vec::new(),
            tables: Vec::new(),
            bounds: vec![0.0; exported.outputs()],
            readings: Units::of_readings(meaning, limits)?,
            targets: Units::of_targets(meaning, scales, reach),
        };
        for row in 0..rows {
            let limits = PerRow::each(limits.clone());
            let layers = layers.iter().map(|layer| layer.map(|id| tables(id, row)));
            let bounds = fixed.push_row(tables(reference, row), &Vec::from_iter(layers), limits.at(row));
            let bounds = bounds.map_err(|what| {
                BundleError::Unsuitable(format!(
                    "fixed16 cannot hold the weights of {what}: {cure}, which keeps weights small, or choose precision f32"
                ))
            })?;
            for (target, (bound, of_row)) in fixed.bounds.iter_mut().zip(bounds).enumerate() {
                *bound = bound.max(of_row * fixed.targets.unit(target));
            }
        }
        let bound = fixed.relative_bound(scales);
        if bound < 1.0 {
            return Ok(fixed);
        }
        Err(BundleError::Unsuitable(format!(
            "in fixed point the error is only known to be below {bound:.3} times {}: {cure} (the decoder amplifies differences of \
             its readings too much), or choose precision f32",
            meaning.scale()
        )))
    }

    /// Largest bound relative to the scale of its target.
    pub(super) fn relative_bound(&self, scales: &[f64]) -> f64 {
        let relative = self.bounds.iter().zip(scales).map(|(bound, scale)| bound / scale);
        relative.fold(0.0, f64::max)
    }

    /// Adds the numbers of a row-wire, with weights and biases of each layer. Returns bounds on the errors of the targets in
    /// their units, or the name of what does not fit.
    fn push_row(
        &mut self,
        reference: &Array2<f64>,
        layers: &[[&Array2<f64>; 2]],
        limits: &[(f64, f64)],
    ) -> Result<Vec<f64>, &'static str> {
        let channels = limits.iter().zip(reference.iter()).enumerate();
        let changes = channels.map(|(channel, (&limits, &reference))| {
            Change::of(self.is_relative, self.readings.per_one(channel), limits, reference)
        });
        let changes: Vec<Change> = changes.collect();
        let shape = [changes.len()];
        let centres = changes.iter().map(|change| i64::from(change.centre));
        self.put("centres", "int32_t", &shape, centres);
        let (factors, shifts): (Vec<i64>, Vec<i64>) = changes.iter().map(Change::multiplier).unzip();
        self.put("factors", "int32_t", &shape, factors);
        self.put("factor_shifts", "uint8_t", &shape, shifts);
        // Each input is a number of 15 bits after the point times a slope, plus an offset.
        let mut slopes: Vec<f64> = changes.iter().map(Change::slope).collect();
        let mut offsets: Vec<f64> = changes.iter().map(|change| change.offset).collect();
        let mut errors: Vec<f64> = changes.iter().map(Change::error).collect();
        for (index, [weights, biases]) in layers.iter().enumerate() {
            let is_last = index + 1 == layers.len();
            let mut next_errors = Vec::new();
            let (mut whole_weights, mut whole_biases, mut shifts) = (Vec::new(), Vec::new(), Vec::new());
            for (sum, weights) in weights.columns().into_iter().enumerate() {
                // Sums in units of the target, or arguments of the tangent.
                let per_one = if is_last { self.targets.per_one(sum) } else { 1.0 };
                let pairs = || weights.iter().zip(&slopes).zip(&offsets);
                let bias = biases[[0, sum]] + pairs().map(|((weight, _), offset)| weight * offset).sum::<f64>();
                let scaled: Vec<f64> = pairs().map(|((weight, slope), _)| weight * slope * per_one).collect();
                let result_bits = if is_last { 0 } else { TangentTable::FRACTION_BITS as i32 };
                let what = if is_last { "a target" } else { "a hidden node" };
                let reach = (bias * per_one).abs() + scaled.iter().map(|weight| weight.abs()).sum::<f64>();
                if is_last && reach > LARGEST_TARGET {
                    return Err(what);
                }
                let row = ScaledRow::of(&scaled, result_bits - INPUT_BITS).ok_or(what)?;
                let sum_bits = row.bits + INPUT_BITS;
                let (bias, of_bias) = whole_bias(bias * per_one, sum_bits, &row.weights).ok_or(what)?;
                let of_inputs = scaled.iter().zip(&errors).map(|(weight, error)| weight.abs() * error);
                let rounding = 0.5 * 2.0_f64.powi(-result_bits);
                let error = of_inputs.sum::<f64>() + row.error + of_bias + rounding;
                let rounded = bias as f64 * 2.0_f64.powi(-sum_bits);
                next_errors.push(match is_last {
                    true => error,
                    false => self.tangent.passed_on(error, rounded, &scaled),
                });
                whole_weights.extend(row.weights.into_iter().map(i64::from));
                whole_biases.push(bias);
                shifts.push(i64::from(sum_bits - result_bits));
            }
            let (inputs, sums) = weights.dim();
            if index == self.layers.len() {
                self.layers.push([inputs, sums]);
            }
            let name = |of: &str| format!("{of}_{}", index + 1);
            self.put(&name("weights"), "int16_t", &[sums, inputs], whole_weights);
            self.put(&name("biases"), "int64_t", &[sums], whole_biases);
            self.put(&name("sum_shifts"), "uint8_t", &[sums], shifts);
            errors = next_errors;
            (slopes, offsets) = (vec![1.0; errors.len()], vec![0.0; errors.len()]);
        }
        let limits = limits.iter().enumerate();
        let whole = limits
            .map(|(channel, &(low, high))| (self.readings.whole(channel, low), self.readings.whole(channel, high)));
        let (lowest, highest): (Vec<i64>, Vec<i64>) = whole.unzip();
        self.put("lowest", "int32_t", &shape, lowest);
        self.put("highest", "int32_t", &shape, highest);
        Ok(errors)
    }

    /// Adds the values of a row-wire to those of the others.
    fn put(&mut self, name: &str, kind: &'static str, shape: &[usize], values: impl IntoIterator<Item = i64>) {
        match self.tables.iter_mut().find(|table| table.name == name) {
            Some(table) => table.values.extend(values),
            None => self.tables.push(FixedTable {
                name: name.to_owned(),
                kind,
                shape: shape.to_vec(),
                values: values.into_iter().collect(),
            }),
        }
    }

    /// Name of the readings, with their unit where they share one.
    pub(super) fn readings_name(&self, name: &'static str) -> &'static str {
        match (name, self.readings.decimals[0]) {
            ("resistances_ohm", 9) => "resistances_nanoohm",
            ("resistances_ohm", 6) => "resistances_microohm",
            ("resistances_ohm", 3) => "resistances_milliohm",
            _ => name,
        }
    }

    /// The sentences on units and bounds.
    pub(super) fn units_in_words(&self, meaning: &Meaning) -> String {
        let saturation = "All readings are decoded without overflow: numbers out of range saturate.";
        let named = meaning.named(&self.bounds).into_iter();
        let bounds = named.map(|(target, bound)| format!("{} ({})", format_number(bound), comment(&target.title())));
        let bounds = Vec::from_iter(bounds).join(", ");
        let units = match meaning.is_array {
            true => format!(
                "Readings are integers in units of {:e} ohm, coordinates integers in nanometres.",
                self.readings.unit(0)
            ),
            false => "Readings and targets are integers in the units below.".to_owned(),
        };
        format!("{units} {saturation} Error bounds for readings that are not out of range: {bounds}.")
    }

    /// Units of own data as initialisers of arrays; empty for an array, whose names contain the units.
    pub(super) fn unit_definitions(&self, upper: &str, meaning: &Meaning) -> String {
        if meaning.is_array {
            return String::new();
        }
        let define = |what: &str, units: &Units| {
            let units: Vec<String> = units.all().map(|unit| format!("{unit:e}")).collect();
            format!("#define {upper}_{what}_UNITS {{ {} }}\n", units.join(", "))
        };
        format!(
            "/* Units of the integers, in proportion to the units of the columns. */\n{}{}\n",
            define("READING", &self.readings),
            define("TARGET", &self.targets)
        )
    }
}

/// The steps of a program from the changes of the readings to the targets: whether changes are relative, the constants with
/// which readings are compared, and weights and biases of each layer.
///
/// # Errors
/// A step has no form in integers.
fn chain(exported: &ExportedProgram) -> Result<(bool, NodeId, Vec<[NodeId; 2]>), BundleError> {
    let operation = |id: NodeId| &exported.program.node(id).operation;
    let mut layers = Vec::new();
    let mut id = exported.targets;
    loop {
        id = match operation(id) {
            Operation::Affine { of, weights, biases } => {
                layers.push([*weights, *biases]);
                *of
            }
            Operation::Map(Function::Tanh, of) if !layers.is_empty() => *of,
            _ => break,
        };
    }
    layers.reverse();
    let difference = match operation(id) {
        Operation::Divide(difference, readings) if is_valid(operation(*readings)) => *difference,
        _ => id,
    };
    let step = match operation(difference) {
        Operation::Subtract(readings, reference) if is_valid(operation(*readings)) => {
            return Ok((difference != id, *reference, layers));
        }
        Operation::Map(Function::Gaussian, _) => "Gaussians",
        Operation::Map(..) => "logarithms",
        _ => "history of readings",
    };
    let message = format!("fixed16 has no {step}: choose precision f64 or f32");
    Err(BundleError::Unsuitable(message))
}

/// `true` for readings that were checked.
fn is_valid(operation: &Operation) -> bool {
    matches!(operation, Operation::Valid { of, domain: Domain::Finite | Domain::Positive } if of.index() == 0)
}
