use super::decimation::{STRETCHES, extremes};
use decoupler_core::training::EpochRecord;

/// Quantities whose extremes are kept.
const QUANTITIES: [fn(&EpochRecord) -> Option<f64>; 6] = [
    |epoch| Some(epoch.training_mse),
    |epoch| epoch.validation_mse,
    |epoch| epoch.test_mse,
    |epoch| Some(epoch.gradient_norm),
    |epoch| Some(epoch.parameter),
    |epoch| Some(epoch.validation_failures as f64),
];

/// Epochs of a training as far as its curves need them: of each stretch, those at which a quantity is least or largest.
/// However long the training, it holds a bounded number, and taking an epoch costs the same.
#[derive(Clone, Debug, Default)]
pub struct EpochOutline {
    /// Of all stretches one after the other; the last is still open.
    kept: Vec<EpochRecord>,
    /// Begin of each stretch in `kept`.
    begins: Vec<usize>,
    /// Number of epochs in a stretch, and of those taken into the open one.
    stretch: usize,
    open: usize,
}

impl EpochOutline {
    /// Nothing taken yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes epochs that follow those taken before; where they do not, as another start has taken the lead, those that
    /// they replace are forgotten.
    pub fn extend(&mut self, epochs: &[EpochRecord]) {
        if let Some(first) = epochs.first() {
            self.forget_from(first.epoch);
        }
        for epoch in epochs {
            if self.begins.is_empty() || self.open == self.stretch {
                self.begin();
            }
            self.kept.push(*epoch);
            self.open += 1;
            let from = self.begins.last().copied().unwrap_or(0);
            // Reduced whenever it has doubled, so that each epoch is looked at a few times only.
            if self.kept.len() - from > 4 * QUANTITIES.len() {
                self.reduce(from);
            }
        }
    }

    /// The epochs kept, in order.
    pub fn records(&self) -> &[EpochRecord] {
        &self.kept
    }

    /// Begins another stretch, after joining each two where there are too many.
    fn begin(&mut self) {
        if let Some(&from) = self.begins.last() {
            self.reduce(from);
        }
        self.stretch = self.stretch.max(1);
        if self.begins.len() == 2 * STRETCHES {
            self.stretch *= 2;
            let whole = std::mem::take(&mut self.kept);
            let begins = std::mem::take(&mut self.begins);
            for pair in begins.chunks(2) {
                let from = self.kept.len();
                self.begins.push(from);
                let next = begins.partition_point(|begin| *begin <= pair[pair.len() - 1]);
                let end = begins.get(next).copied().unwrap_or(whole.len());
                self.kept.extend_from_slice(&whole[pair[0]..end]);
                self.reduce(from);
            }
        }
        self.begins.push(self.kept.len());
        self.open = 0;
    }

    /// Keeps of the last stretch, which begins at `from`, what stands out.
    fn reduce(&mut self, from: usize) {
        let last = &self.kept[from..];
        let mut standing_out = Vec::with_capacity(3 * QUANTITIES.len());
        // Both ends, so that the curve begins and ends where it did.
        standing_out.extend([0, last.len().saturating_sub(1)]);
        for of in QUANTITIES {
            extremes(last, of, |place| standing_out.push(place));
        }
        standing_out.sort_unstable();
        standing_out.dedup();
        let reduced: Vec<EpochRecord> = standing_out
            .iter()
            .filter_map(|&place| last.get(place).copied())
            .collect();
        self.kept.truncate(from);
        self.kept.extend(reduced);
    }

    fn forget_from(&mut self, epoch: usize) {
        if self.kept.last().is_none_or(|last| last.epoch < epoch) {
            return;
        }
        let kept = self.kept.partition_point(|record| record.epoch < epoch);
        self.kept.truncate(kept);
        self.begins.retain(|begin| *begin < kept);
        self.open = self.begins.last().map_or(0, |begin| kept - begin);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn epoch(epoch: usize, training_mse: f64) -> EpochRecord {
        EpochRecord {
            epoch,
            training_mse,
            validation_mse: Some(0.5),
            test_mse: None,
            gradient_norm: 1.0 / (epoch + 1) as f64,
            parameter: if epoch == 71_234 { 1e6 } else { 1e-3 },
            effective_parameters: None,
            validation_failures: epoch % 3,
        }
    }

    fn history(epochs: usize) -> Vec<EpochRecord> {
        let mse = |at: usize| match at {
            31_337 => 9.0,
            150_001 => 1e-9,
            _ => 1.0 + 0.1 * (at as f64 * 0.01).sin(),
        };
        (0..epochs).map(|at| epoch(at, mse(at))).collect()
    }

    #[test]
    fn a_long_training_keeps_its_peaks_within_bounded_memory() {
        let history = history(200_000);
        let mut outline = EpochOutline::new();
        for news in history.chunks(777) {
            outline.extend(news);
        }
        let kept = outline.records();
        assert!(kept.len() < 60_000, "{}", kept.len());
        assert!(kept.windows(2).all(|pair| pair[0].epoch < pair[1].epoch));
        for peak in [0, 31_337, 71_234, 150_001, 199_999] {
            assert!(kept.iter().any(|record| *record == history[peak]), "epoch {peak}");
        }
        // Between any two of them nothing stands out of what they span.
        for (number, stretch) in history.chunks(2048).enumerate() {
            let largest = stretch.iter().map(|record| record.training_mse).fold(0.0, f64::max);
            let near = number.saturating_sub(1) * 2048..(number + 2) * 2048;
            let shown = kept.iter().filter(|record| near.contains(&record.epoch));
            assert!(shown.map(|record| record.training_mse).fold(0.0, f64::max) >= largest);
        }
    }

    #[test]
    fn a_short_training_is_kept_whole_and_another_leader_takes_its_place() {
        let history = history(1000);
        let mut outline = EpochOutline::new();
        outline.extend(&history[..400]);
        outline.extend(&history[400..]);
        assert_eq!(outline.records(), history);
        let other: Vec<EpochRecord> = (0..600).map(|at| epoch(at, 2.0)).collect();
        outline.extend(&other);
        assert_eq!(outline.records(), other);
        let tail: Vec<EpochRecord> = (500..700).map(|at| epoch(at, 3.0)).collect();
        outline.extend(&tail);
        let expected: Vec<EpochRecord> = other[..500].iter().chain(&tail).copied().collect();
        assert_eq!(outline.records(), expected);
    }
}
