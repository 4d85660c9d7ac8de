use super::{
    FixedPointError, TwoLayers, Units,
    scaled::{Change, HiddenWidth, LogTable, ScaledRow, TangentTable},
};
use crate::export::bundle::portable::Portable;
use decoupler_core::network::Quantity;

/// Desired upper limit of the error bound, as a fraction of the range of the outputs.
pub(in crate::export::bundle) const USUAL_BOUND: f64 = 0.01;
/// Bits of an output weight with its sign.
const OUTPUT_WIDTH: u32 = 16;
/// Upper bound of an output in units for all activations.
const LARGEST_SUM: f64 = (1_u32 << 30) as f64;

/// The networks of a file in fixed point.
#[derive(Clone, Debug)]
pub(in crate::export::bundle) struct FixedNetworks {
    pub(in crate::export::bundle) quantity: Quantity,
    pub(in crate::export::bundle) readings: Units,
    pub(in crate::export::bundle) outputs: Units,
    /// Number of hidden nodes.
    pub(in crate::export::bundle) hidden: usize,
    pub(in crate::export::bundle) hidden_width: HiddenWidth,
    pub(in crate::export::bundle) networks: Vec<FixedNetwork>,
    pub(in crate::export::bundle) tangent: TangentTable,
    pub(in crate::export::bundle) logarithm: LogTable,
    /// Bound on the error of each output within the limits of the readings, including the rounding of readings to
    /// units, in the network's unit of the output.
    pub(in crate::export::bundle) bounds: Vec<f64>,
    /// Largest bound relative to the scale of its output.
    pub(in crate::export::bundle) relative_bound: f64,
}

/// One network in fixed point.
#[derive(Clone, Debug)]
pub(in crate::export::bundle) struct FixedNetwork {
    /// Reading, or its logarithm, relative to which the change of each channel is measured.
    pub(in crate::export::bundle) centres: Vec<i32>,
    /// Factor of the change of each channel, and the shift after it.
    pub(in crate::export::bundle) factors: Vec<i32>,
    pub(in crate::export::bundle) factor_shifts: Vec<u8>,
    /// Hidden nodes × channels.
    pub(in crate::export::bundle) hidden_weights: Vec<i32>,
    pub(in crate::export::bundle) hidden_biases: Vec<i64>,
    pub(in crate::export::bundle) hidden_shifts: Vec<u8>,
    /// Outputs × hidden nodes.
    pub(in crate::export::bundle) output_weights: Vec<i32>,
    /// In units of the output, times 2 to the power of the shift.
    pub(in crate::export::bundle) output_biases: Vec<i64>,
    pub(in crate::export::bundle) output_shifts: Vec<u8>,
    /// Limits beyond which a reading counts as outside.
    pub(in crate::export::bundle) limits: Vec<(i32, i32)>,
}

impl FixedNetworks {
    /// Rounds the weights of `portable` to 16 bits, or those of the hidden layer to 24 bits where 16 are too few.
    ///
    /// # Errors
    /// The range of the readings is not known, a number does not fit, or the bound on the error is as large as the range
    /// of the outputs.
    pub(in crate::export::bundle) fn of(portable: &Portable) -> Result<Self, FixedPointError> {
        let sixteen = Self::with_width(portable, HiddenWidth::Sixteen);
        if sixteen.as_ref().is_ok_and(|fixed| fixed.relative_bound <= USUAL_BOUND) {
            return sixteen;
        }
        let wide = Self::with_width(portable, HiddenWidth::TwentyFour)?;
        if wide.relative_bound < 1.0 {
            return Ok(wide);
        }
        Err(FixedPointError::Coarse {
            bound: wide.relative_bound,
            scale: portable.meaning.scale(),
            cure: portable.smaller_weights(),
        })
    }

    fn with_width(portable: &Portable, hidden_width: HiddenWidth) -> Result<Self, FixedPointError> {
        let layered = TwoLayers::of(portable).ok_or(FixedPointError::NoNetwork)?;
        let ranges = portable.known_ranges().ok_or(FixedPointError::NoRange)?;
        let (readings, outputs) = (
            Units::of_readings(portable, &ranges)?,
            Units::of_outputs(portable, &layered),
        );
        let (tangent, logarithm) = (TangentTable::new(), LogTable::new());
        let tangent_error = tangent.error();
        let mut networks = Vec::new();
        let mut bounds = vec![0.0_f64; portable.outputs];
        for (network, range) in layered.iter().zip(ranges) {
            let changes: Vec<_> = (range.limits.iter().zip(network.centre).enumerate())
                .map(|(channel, (&limits, &centre))| {
                    Change::of(portable.quantity, readings.per_one(channel), limits, centre)
                })
                .collect();
            let mut fixed = FixedNetwork::reading(&changes, hidden_width);
            fixed.limits = (range.limits.iter().enumerate())
                .map(|(channel, &(low, high))| {
                    let units = readings.per_one(channel);
                    // Rounded like the readings: no reading within the limits counts as outside.
                    ((low * units).round() as i32, (high * units).round() as i32)
                })
                .collect();
            let of_network = fixed.round(network, &changes, &outputs, hidden_width, tangent_error);
            let of_network = of_network.map_err(|what| FixedPointError::Range {
                what,
                cure: portable.smaller_weights(),
            })?;
            for (index, (bound, in_units)) in bounds.iter_mut().zip(of_network).enumerate() {
                *bound = bound.max(in_units * outputs.unit(index));
            }
            networks.push(fixed);
        }
        let relative_bound = bounds
            .iter()
            .zip(&portable.scales)
            .map(|(bound, scale)| bound / scale)
            .fold(0.0, f64::max);
        Ok(Self {
            quantity: portable.quantity,
            readings,
            outputs,
            hidden: layered.first().map_or(0, |network| network.hidden_biases.len()),
            hidden_width,
            networks,
            tangent,
            logarithm,
            bounds,
            relative_bound,
        })
    }

    /// Returns the nearest reading that a channel can represent.
    pub(in crate::export::bundle) fn representable(&self, channel: usize, reading: f64) -> f64 {
        f64::from(self.readings.whole(channel, reading)) * self.readings.unit(channel)
    }

    /// Decodes a row: outputs in units, or `None` if a resistance is not above 0.
    pub(in crate::export::bundle) fn decode(&self, network: usize, readings: &[f64]) -> Option<Vec<i32>> {
        let whole = |(channel, &reading)| self.readings.whole(channel, reading);
        let readings: Vec<_> = readings.iter().enumerate().map(whole).collect();
        self.decode_whole(network, &readings)
    }

    /// Returns the outputs of [`Self::decode`] in the units of the network.
    pub(in crate::export::bundle) fn in_own_units(&self, outputs: &[i32]) -> Vec<f64> {
        let of_units = |(&whole, unit)| f64::from(whole) * unit;
        outputs.iter().zip(self.outputs.all()).map(of_units).collect()
    }
}

impl FixedNetwork {
    /// Creates a network without nodes for these changes of the readings.
    fn reading(changes: &[Change], width: HiddenWidth) -> Self {
        let multipliers: Vec<_> = changes.iter().map(|change| change.multiplier(width)).collect();
        Self {
            centres: changes.iter().map(|change| change.centre).collect(),
            factors: multipliers.iter().map(|multiplier| multiplier.factor).collect(),
            factor_shifts: multipliers.iter().map(|multiplier| multiplier.shift).collect(),
            hidden_weights: Vec::new(),
            hidden_biases: Vec::new(),
            hidden_shifts: Vec::new(),
            output_weights: Vec::new(),
            output_biases: Vec::new(),
            output_shifts: Vec::new(),
            limits: Vec::new(),
        }
    }

    /// Adds the nodes and outputs of `network`, rounded. Returns the bounds on the errors of the outputs in their units, or
    /// the name of the number that does not fit.
    fn round(
        &mut self,
        network: &TwoLayers<'_>,
        changes: &[Change],
        units: &Units,
        width: HiddenWidth,
        tangent_error: f64,
    ) -> Result<Vec<f64>, &'static str> {
        let (hidden, outputs) = network.output_weights.dim();
        let mut activation_errors = Vec::new();
        for node in 0..hidden {
            let error = self.push_node(network, changes, width, node);
            activation_errors.push(error.ok_or("the weights of a hidden node")? + tangent_error);
        }
        (0..outputs)
            .map(|output| {
                let per_one = units.per_one(output);
                if network.reach(output) * per_one > LARGEST_SUM {
                    return Err("an output");
                }
                let bound = self.push_output(network, output, per_one, &activation_errors);
                bound.ok_or("the weights of an output")
            })
            .collect()
    }

    /// Adds a hidden node. Returns the bound on the error that it passes on to the tangent's result.
    fn push_node(
        &mut self,
        network: &TwoLayers<'_>,
        changes: &[Change],
        width: HiddenWidth,
        node: usize,
    ) -> Option<f64> {
        let mut bias = network.hidden_biases[node];
        let (mut weights, mut spread, mut error) = (Vec::new(), 0.0, 0.0);
        let input_bits = width.bits() as i32 - 1;
        // The largest change is one less than a power of two.
        let stretch = f64::from(1 << input_bits) / f64::from(width.largest_change());
        for (change, &weight) in changes.iter().zip(network.hidden_weights.column(node)) {
            bias = bias + weight * change.offset;
            let scaled = (weight * change.slope).to_f64() * change.span;
            weights.push(scaled * stretch);
            spread += scaled.abs();
            error += scaled.abs() * change.scaled_error(width);
        }
        let argument_bits = TangentTable::FRACTION_BITS as i32;
        let row = ScaledRow::of(&weights, width.bits(), argument_bits - input_bits)?;
        let sum_bits = row.bits + input_bits;
        let (sum_bias, of_bias) = whole_bias(bias.to_f64(), sum_bits, &row.weights, input_bits)?;
        error += row.error + of_bias + 0.5 / f64::from(1 << argument_bits);
        // Within the limits the sum is at least this far from 0, where the tangent is steepest.
        let nearest = (bias.to_f64().abs() - spread - error).max(0.0);
        let slope = 1.0 - libm::tanh(nearest).powi(2);
        self.hidden_weights.extend(row.weights);
        self.hidden_biases.push(sum_bias);
        self.hidden_shifts.push((sum_bits - argument_bits) as u8);
        Some((slope * error).min(2.0))
    }

    /// Adds an output with this many units in 1. Returns the bound on its error in units, unless a weight is too large.
    fn push_output(
        &mut self,
        network: &TwoLayers<'_>,
        output: usize,
        per_one: f64,
        activation_errors: &[f64],
    ) -> Option<f64> {
        let activation_bits = TangentTable::ACTIVATION_BITS as i32;
        let weights = network.output_weights.column(output);
        let weights: Vec<_> = weights.iter().map(|weight| weight.to_f64() * per_one).collect();
        let row = ScaledRow::of(&weights, OUTPUT_WIDTH, -activation_bits)?;
        let sum_bits = row.bits + activation_bits;
        let bias = network.output_biases[output].to_f64() * per_one;
        let (sum_bias, of_bias) = whole_bias(bias, sum_bits, &row.weights, activation_bits)?;
        let of_activations = weights
            .iter()
            .zip(activation_errors)
            .map(|(weight, error)| weight.abs() * error);
        let error = of_activations.sum::<f64>() + row.error + of_bias + 0.5;
        self.output_weights.extend(row.weights);
        self.output_biases.push(sum_bias);
        self.output_shifts.push(sum_bits as u8);
        Some(error)
    }
}

/// A bias with this many bits after the point, and its rounding error. The sum with products of the weights and numbers
/// below 2^`input_bits` stays within 64 bits; `None` otherwise.
fn whole_bias(bias: f64, bits: i32, weights: &[i32], input_bits: i32) -> Option<(i64, f64)> {
    let scale = 2.0_f64.powi(bits);
    let whole = (bias * scale).round();
    let products = weights
        .iter()
        .map(|&weight| f64::from(weight).abs() * 2.0_f64.powi(input_bits));
    // One bit is left for the rounding of the shift.
    if whole.abs() + products.sum::<f64>() < 2.0_f64.powi(61) {
        Some((whole as i64, (bias - whole / scale).abs()))
    } else {
        None
    }
}
