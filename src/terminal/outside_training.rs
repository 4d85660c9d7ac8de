use std::io::{Write, stderr};

use decoupler_core::{
    evaluation::{Channel, Problem},
    network::DecouplingNetwork,
};

/// Lines that are listed one by one; a damaged file may have thousands.
const MAX_LISTED: usize = 10;

/// Lines with readings or targets outside the range seen in training, where a network extrapolates.
pub(super) struct OutsideTraining<'a> {
    problem: &'a Problem,
    lines: usize,
    outside: usize,
    listed: Vec<String>,
}

/// Readings and targets of one line that are outside.
pub(super) struct LineOutside {
    /// Number of readings; `None` if their range in training is not known.
    pub(super) readings: Option<usize>,
    /// Number of targets.
    pub(super) targets: usize,
}

impl<'a> OutsideTraining<'a> {
    pub(super) fn new(problem: &'a Problem) -> Self {
        Self {
            problem,
            lines: 0,
            outside: 0,
            listed: Vec::new(),
        }
    }

    /// Counts what of a line is outside.
    pub(super) fn count(
        &mut self,
        network: &DecouplingNetwork,
        line: u64,
        readings: &[f64],
        answer: &[f64],
    ) -> LineOutside {
        let (inputs, outputs) = (network.inputs(), network.outputs());
        let range = inputs.range();
        let outside = || {
            range
                .into_iter()
                .flat_map(|range| range.outside(inputs.quantity(), readings))
        };
        let far_outside = || outputs.far_outside(answer);
        let of_line = LineOutside {
            readings: range.map(|_| outside().count()),
            targets: far_outside().count(),
        };
        self.lines += 1;
        if of_line.readings.unwrap_or(0) + of_line.targets == 0 {
            return of_line;
        }
        self.outside += 1;
        if self.listed.len() < MAX_LISTED {
            let first_reading = outside().next().zip(range).map(|(channel, range)| {
                let (name, extremes) = (&self.problem.inputs[channel], range.extremes(channel));
                described(name, readings[channel], extremes)
            });
            let first_target = || {
                let target = far_outside().next()?;
                let (name, extremes) = (&self.problem.targets[target], outputs.extremes(target));
                Some(described(name, answer[target], extremes))
            };
            if let Some(first) = first_reading.or_else(first_target) {
                self.listed.push(format!("line {line}: {first}"));
            }
        }
        of_line
    }

    /// Warns of the lines on standard error.
    pub(super) fn warn(&self) {
        let Self {
            lines, outside, listed, ..
        } = self;
        if *outside == 0 {
            return;
        }
        let mut stderr = stderr().lock();
        for line in listed {
            // There is no one to report to if this fails.
            let _ = writeln!(stderr, "warning: {line}");
        }
        let _ = writeln!(
            stderr,
            "warning: {outside} of {lines} lines are outside the range seen in training, where the network \
             extrapolates; the last two columns count such readings and targets: check these readings, or train with samples \
             that cover them"
        );
    }
}

fn described(channel: &Channel, value: f64, (low, high): (f64, f64)) -> String {
    let unit = channel.unit.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
    format!(
        "{} is {value:.4e}{unit}; in training it was from {low:.4e} to {high:.4e}",
        channel.name
    )
}
