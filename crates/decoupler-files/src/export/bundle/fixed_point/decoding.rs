//! The decoder in whole numbers, step by step as the C source has it.

use super::{FixedNetworks, change::CONDUCTANCE_BITS, tangent::TangentTable};
use decoupler_core::network::Quantity;

impl FixedNetworks {
    /// Decodes readings in units: outputs in units, or `None` if a resistance is not above 0.
    pub(in crate::export::bundle) fn decode_whole(&self, network: usize, readings: &[i32]) -> Option<Vec<i32>> {
        let network = &self.networks[network];
        let channels = readings.len();
        let largest_change = i64::from(self.hidden_width.largest_change());
        let mut changes = Vec::new();
        for (channel, &reading) in readings.iter().enumerate() {
            if reading <= 0 && self.quantity != Quantity::Raw {
                return None;
            }
            let change = self.change(reading, network.centres[channel]);
            let scaled = shift(
                change * i64::from(network.factors[channel]),
                network.factor_shifts[channel],
            );
            changes.push(scaled.clamp(-largest_change, largest_change));
        }
        let mut activations = Vec::new();
        for (node, &bias) in network.hidden_biases.iter().enumerate() {
            let weights = &network.hidden_weights[node * channels..][..channels];
            let products = weights
                .iter()
                .zip(&changes)
                .map(|(&weight, change)| i64::from(weight) * change);
            let argument = shift(bias + products.sum::<i64>(), network.hidden_shifts[node]);
            let largest = i64::from(TangentTable::LARGEST);
            activations.push(i64::from(self.tangent.of(argument.clamp(-largest, largest) as i32)));
        }
        let hidden = activations.len();
        let outputs = network.output_biases.iter().enumerate().map(|(output, &bias)| {
            let weights = &network.output_weights[output * hidden..][..hidden];
            let products = weights
                .iter()
                .zip(&activations)
                .map(|(&weight, activation)| i64::from(weight) * activation);
            let sum = shift(bias + products.sum::<i64>(), network.output_shifts[output]);
            // Proven to fit when the weights were rounded.
            sum.clamp(i64::from(-i32::MAX), i64::from(i32::MAX)) as i32
        });
        Some(outputs.collect())
    }

    fn change(&self, reading: i32, centre: i32) -> i64 {
        match self.quantity {
            Quantity::Resistance | Quantity::Raw => i64::from(reading) - i64::from(centre),
            Quantity::Conductance => {
                let difference = i64::from(centre) - i64::from(reading);
                let relative = difference * (1_i64 << CONDUCTANCE_BITS) / i64::from(reading);
                relative.clamp(-(1 << 31), 1 << 31)
            }
            Quantity::LogResistance => i64::from(self.logarithm.of(reading)) - i64::from(centre),
        }
    }
}

/// value / 2^bits, rounded to the nearest, halves up.
fn shift(value: i64, bits: u8) -> i64 {
    if bits == 0 {
        return value;
    }
    (value + (1 << (bits - 1))) >> bits
}
