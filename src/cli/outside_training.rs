use std::io::{Write, stderr};

use crate::network::DecouplingNetwork;

/// Lines that are told one by one; a damaged file may have thousands.
const MOST_TOLD: usize = 10;

/// Lines with readings or coordinates outside the range seen in training, where a network extrapolates.
#[derive(Default)]
pub(super) struct OutsideTraining {
    lines: usize,
    outside: usize,
    told: Vec<String>,
}

/// Readings and coordinates of one line that are outside.
pub(super) struct LineOutside {
    /// Number of readings; `None` if their range in training is not known.
    pub(super) readings: Option<usize>,
    /// Number of coordinates.
    pub(super) coordinates: usize,
}

impl OutsideTraining {
    /// Counts what of a line is outside.
    pub(super) fn count(
        &mut self,
        network: &DecouplingNetwork,
        line: u64,
        readings_ohm: &[f64],
        coordinates_mm: &[f64],
    ) -> LineOutside {
        let (inputs, outputs) = (network.inputs(), network.outputs());
        let range = inputs.range();
        let readings = range.map(|range| range.outside(inputs.quantity(), readings_ohm).collect::<Vec<_>>());
        let coordinates: Vec<usize> = outputs.far_outside(coordinates_mm).collect();
        self.lines += 1;
        let first_reading = readings
            .iter()
            .flatten()
            .next()
            .copied()
            .zip(range)
            .map(|(channel, range)| {
                let limits = range.extremes(channel);
                described(&format!("r_{}", channel + 1), readings_ohm[channel], "ohm", limits)
            });
        let first_coordinate = coordinates.first().map(|&channel| {
            let name = format!("{}_{}", ["x", "y", "z"][channel % 3], channel / 3 + 1);
            described(&name, coordinates_mm[channel], "mm", outputs.extremes(channel))
        });
        if let Some(first) = first_reading.or(first_coordinate) {
            self.outside += 1;
            if self.told.len() < MOST_TOLD {
                self.told.push(format!("line {line}: {first}"));
            }
        }
        LineOutside {
            readings: readings.map(|readings| readings.len()),
            coordinates: coordinates.len(),
        }
    }

    /// Warns of the lines on standard error.
    pub(super) fn warn(&self) {
        let Self { lines, outside, told } = self;
        if *outside == 0 {
            return;
        }
        let mut stderr = stderr().lock();
        for line in told {
            // Nobody is left to tell if this fails.
            let _ = writeln!(stderr, "warning: {line}");
        }
        let _ = writeln!(
            stderr,
            "warning: {outside} of {lines} lines are outside the range seen in training, where the network \
             extrapolates; the last two columns count such readings and coordinates: check these readings, or train with \
             a scene that covers them"
        );
    }
}

fn described(name: &str, value: f64, unit: &str, (low, high): (f64, f64)) -> String {
    format!("{name} is {value:.4e} {unit}; in training it was from {low:.4e} to {high:.4e}")
}
