use super::{
    FixedPointError,
    change::{Change, HiddenWidth},
    logarithm::LogTable,
    scaled::ScaledRow,
    tangent::TangentTable,
};
use crate::{
    export::bundle::portable::{ChannelRanges, Portable, PortableNetwork},
    network::Quantity,
};

/// Part of the range of the outputs below which the bound on the error should be.
pub(in crate::export::bundle) const USUAL_BOUND: f64 = 0.01;
/// Bits of an output weight with its sign.
const OUTPUT_WIDTH: u32 = 16;
/// Nanometres in a millimetre.
const NM_PER_MM: f64 = 1e6;
/// The networks of a file in whole numbers.
#[derive(Clone, Debug)]
pub(in crate::export::bundle) struct FixedNetworks {
    pub(in crate::export::bundle) quantity: Quantity,
    /// Readings are in units of 10^−`decimals` ohm: 0, 3, 6 or 9.
    pub(in crate::export::bundle) decimals: i32,
    pub(in crate::export::bundle) hidden_width: HiddenWidth,
    pub(in crate::export::bundle) networks: Vec<FixedNetwork>,
    pub(in crate::export::bundle) tangent: TangentTable,
    pub(in crate::export::bundle) logarithm: LogTable,
    /// Bound on the error of a coordinate within the limits of the readings, in mm.
    pub(in crate::export::bundle) bound_mm: f64,
    /// Widest range of a coordinate in training, in mm.
    pub(in crate::export::bundle) range_mm: f64,
}

/// One network in whole numbers.
#[derive(Clone, Debug)]
pub(in crate::export::bundle) struct FixedNetwork {
    /// Reading, or logarithm of one, from which the change of each channel is taken.
    pub(in crate::export::bundle) centres: Vec<i32>,
    /// Factor of the change of each channel, and the shift after it.
    pub(in crate::export::bundle) factors: Vec<i32>,
    pub(in crate::export::bundle) factor_shifts: Vec<u8>,
    /// Hidden nodes × channels.
    pub(in crate::export::bundle) hidden_weights: Vec<i32>,
    pub(in crate::export::bundle) hidden_biases: Vec<i64>,
    pub(in crate::export::bundle) hidden_shifts: Vec<u8>,
    /// Coordinates × hidden nodes.
    pub(in crate::export::bundle) output_weights: Vec<i32>,
    /// In nm, times 2 to the power of the shift.
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
        let range_mm = portable.output_range_mm().ok_or(FixedPointError::Raw)?;
        let sixteen = Self::with_width(portable, range_mm, HiddenWidth::Sixteen);
        if sixteen
            .as_ref()
            .is_ok_and(|fixed| fixed.bound_mm <= USUAL_BOUND * range_mm)
        {
            return sixteen;
        }
        let wide = Self::with_width(portable, range_mm, HiddenWidth::TwentyFour)?;
        if wide.bound_mm < range_mm {
            return Ok(wide);
        }
        let bound_mm = wide.bound_mm;
        Err(FixedPointError::Coarse { bound_mm, range_mm })
    }

    fn with_width(portable: &Portable, range_mm: f64, hidden_width: HiddenWidth) -> Result<Self, FixedPointError> {
        if portable.quantity == Quantity::Raw {
            return Err(FixedPointError::Raw);
        }
        let ranges = portable.ranges().ok_or(FixedPointError::NoRange)?;
        let limits = ranges.iter().flat_map(|range| &range.limits);
        let largest_ohm = limits.fold(0.0_f64, |largest, limits| largest.max(limits.1));
        // A factor of 2 for readings outside.
        let fits = |decimals: &i32| largest_ohm * 10.0_f64.powi(*decimals) <= f64::from(1 << 30);
        let decimals = [9, 6, 3, 0]
            .into_iter()
            .find(fits)
            .ok_or(FixedPointError::Reading(largest_ohm))?;
        let (tangent, logarithm) = (TangentTable::new(), LogTable::new());
        let tangent_error = tangent.error();
        let mut networks = Vec::new();
        let mut bound_mm = 0.0_f64;
        for (network, range) in portable.networks.iter().zip(ranges) {
            let changes: Vec<_> = (range.limits.iter().zip(&network.centre))
                .map(|(&limits, &centre_ohm)| Change::of(portable.quantity, decimals, limits, centre_ohm))
                .collect();
            let (fixed, bound_nm) = FixedNetwork::of(network, range, &changes, decimals, hidden_width, tangent_error)?;
            bound_mm = bound_mm.max(bound_nm / NM_PER_MM);
            networks.push(fixed);
        }
        Ok(Self {
            quantity: portable.quantity,
            decimals,
            hidden_width,
            networks,
            tangent,
            logarithm,
            bound_mm,
            range_mm,
        })
    }

    /// Unit of the readings in ohm.
    pub(in crate::export::bundle) fn unit_ohm(&self) -> f64 {
        10.0_f64.powi(-self.decimals)
    }

    /// A reading in units, at most the largest number.
    pub(in crate::export::bundle) fn reading(&self, ohm: f64) -> i32 {
        (ohm * 10.0_f64.powi(self.decimals)).round() as i32
    }

    /// Decodes a row: coordinates in nm, or `None` if a reading is not above 0.
    pub(in crate::export::bundle) fn decode(&self, network: usize, readings: &[f64]) -> Option<Vec<i32>> {
        let readings: Vec<_> = readings.iter().map(|&ohm| self.reading(ohm)).collect();
        self.decode_whole(network, &readings)
    }
}

impl FixedNetwork {
    /// Rounds a network. Also returns the bound on its error in nm.
    fn of(
        network: &PortableNetwork,
        range: &ChannelRanges,
        changes: &[Change],
        decimals: i32,
        width: HiddenWidth,
        tangent_error: f64,
    ) -> Result<(Self, f64), FixedPointError> {
        let (hidden, outputs) = network.output_weights.dim();
        let units = 10.0_f64.powi(decimals);
        let multipliers: Vec<_> = changes.iter().map(|change| change.multiplier(width)).collect();
        let mut fixed = Self {
            centres: changes.iter().map(|change| change.centre).collect(),
            factors: multipliers.iter().map(|multiplier| multiplier.factor).collect(),
            factor_shifts: multipliers.iter().map(|multiplier| multiplier.shift).collect(),
            hidden_weights: Vec::new(),
            hidden_biases: Vec::new(),
            hidden_shifts: Vec::new(),
            output_weights: Vec::new(),
            output_biases: Vec::new(),
            output_shifts: Vec::new(),
            limits: range
                .limits
                .iter()
                .map(|&(low, high)| ((low * units).ceil() as i32, (high * units).floor() as i32))
                .collect(),
        };
        let mut activation_errors = Vec::new();
        for node in 0..hidden {
            let error = fixed.push_node(network, changes, width, node)?;
            activation_errors.push(error + tangent_error);
        }
        let mut bound_nm = 0.0_f64;
        for coordinate in 0..outputs {
            let error = fixed.push_coordinate(network, coordinate, &activation_errors)?;
            bound_nm = bound_nm.max(error);
        }
        Ok((fixed, bound_nm))
    }

    /// Adds a hidden node. Returns the bound on the error that it passes on to the tangent's result.
    fn push_node(
        &mut self,
        network: &PortableNetwork,
        changes: &[Change],
        width: HiddenWidth,
        node: usize,
    ) -> Result<f64, FixedPointError> {
        let what = "the weights of a hidden node";
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
        let row = ScaledRow::of(&weights, width.bits(), argument_bits - input_bits, what)?;
        let sum_bits = row.bits + input_bits;
        let (sum_bias, of_bias) = whole_bias(bias.to_f64(), sum_bits, &row.weights, input_bits, what)?;
        error += row.error + of_bias + 0.5 / f64::from(1 << argument_bits);
        // Within the limits the sum is at least this far from 0, where the tangent is steepest.
        let nearest = (bias.to_f64().abs() - spread - error).max(0.0);
        let slope = 1.0 - libm::tanh(nearest).powi(2);
        self.hidden_weights.extend(row.weights);
        self.hidden_biases.push(sum_bias);
        self.hidden_shifts.push((sum_bits - argument_bits) as u8);
        Ok((slope * error).min(2.0))
    }

    /// Adds a coordinate. Returns the bound on its error in nm.
    fn push_coordinate(
        &mut self,
        network: &PortableNetwork,
        coordinate: usize,
        activation_errors: &[f64],
    ) -> Result<f64, FixedPointError> {
        let what = "the weights of a coordinate";
        let activation_bits = TangentTable::ACTIVATION_BITS as i32;
        let weights = network.output_weights.column(coordinate);
        let weights_nm: Vec<_> = weights.iter().map(|weight| weight.to_f64() * NM_PER_MM).collect();
        let row = ScaledRow::of(&weights_nm, OUTPUT_WIDTH, -activation_bits, what)?;
        let sum_bits = row.bits + activation_bits;
        let bias_nm = network.output_biases[coordinate].to_f64() * NM_PER_MM;
        let (sum_bias, of_bias) = whole_bias(bias_nm, sum_bits, &row.weights, activation_bits, what)?;
        let reach_nm = bias_nm.abs() + weights_nm.iter().map(|weight| weight.abs()).sum::<f64>();
        if reach_nm > f64::from(1 << 30) {
            return Err(FixedPointError::Range { what: "a coordinate" });
        }
        let of_activations = weights_nm
            .iter()
            .zip(activation_errors)
            .map(|(weight, error)| weight.abs() * error);
        let error = of_activations.sum::<f64>() + row.error + of_bias + 0.5;
        self.output_weights.extend(row.weights);
        self.output_biases.push(sum_bias);
        self.output_shifts.push(sum_bits as u8);
        Ok(error)
    }
}

/// A bias with so many bits after the point, and its rounding error. The sum with products of the weights and numbers
/// below 2^`input_bits` stays within 64 bits.
fn whole_bias(
    bias: f64,
    bits: i32,
    weights: &[i32],
    input_bits: i32,
    what: &'static str,
) -> Result<(i64, f64), FixedPointError> {
    let scale = 2.0_f64.powi(bits);
    let whole = (bias * scale).round();
    let products = weights
        .iter()
        .map(|&weight| f64::from(weight).abs() * 2.0_f64.powi(input_bits));
    // One bit is left for the rounding of the shift.
    if whole.abs() + products.sum::<f64>() < 2.0_f64.powi(61) {
        Ok((whole as i64, (bias - whole / scale).abs()))
    } else {
        Err(FixedPointError::Range { what })
    }
}
