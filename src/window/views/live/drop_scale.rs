use super::engine::{LiveFrame, Watched};

/// End of the colours of the readings: it follows the largest drop, in round steps and slowly downwards, so that colours
/// mean the same for a while.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DropScale {
    peak_percent: f64,
    watched: Option<Watched>,
}

/// Smallest end of the colours, in percent.
const MIN_PERCENT: f64 = 0.5;
/// Remainder of the peak after a frame.
const DECAY: f64 = 0.999;

impl DropScale {
    /// Takes a frame; wires at fault do not count.
    pub fn take(&mut self, frame: &LiveFrame) {
        let wire = match &frame.watched {
            Watched::Named(diagnosis) => Some(diagnosis.wire),
            Watched::Off(_) | Watched::Sound | Watched::Unexplained => None,
        };
        let is_sound = |row: usize, column: usize| {
            wire.is_none_or(|wire| !wire.is_row(frame.rows[row]) && !wire.columns().contains(&Some(column)))
        };
        let drops = frame.drops_percent.indexed_iter();
        let drops = drops.filter(|((row, column), drop)| is_sound(*row, *column) && drop.is_finite());
        let largest = drops.map(|(_, &drop)| drop).fold(0.0, f64::max);
        if self.watched.as_ref() != Some(&frame.watched) {
            // What a fault has made of the scale is forgotten.
            self.watched = Some(frame.watched.clone());
            self.peak_percent = 0.0;
        }
        self.peak_percent = largest.max(DECAY * self.peak_percent);
    }

    /// The end of the colours in percent: 1, 2 or 5 times a power of ten.
    pub fn largest_percent(&self) -> f64 {
        let peak = self.peak_percent.max(MIN_PERCENT);
        let decade = 10_f64.powf(peak.log10().floor());
        let steps = [1.0, 2.0, 5.0].map(|step| step * decade);
        steps
            .into_iter()
            .find(|step| *step >= peak * (1.0 - 1e-9))
            .unwrap_or(10.0 * decade)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_ends_at_round_numbers() {
        for (peak_percent, expected) in [
            (0.0, 0.5),
            (0.6, 1.0),
            (1.0, 1.0),
            (1.3, 2.0),
            (4.9, 5.0),
            (73.0, 100.0),
        ] {
            let scale = DropScale {
                peak_percent,
                watched: None,
            };
            let found = scale.largest_percent();
            assert!((found / expected - 1.0).abs() < 1e-9, "{peak_percent}: {found}");
        }
    }
}
