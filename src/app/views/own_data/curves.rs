use crate::{figure::EpochOutline, training::EpochRecord};

/// The epochs of a training as far as its curves need them, which grow with it: a curve drawn in each frame must not look at
/// all epochs.
#[derive(Debug, Default)]
pub(super) struct Curves {
    outline: EpochOutline,
    /// Number of epochs taken, and the last of them.
    taken: usize,
    last: Option<EpochRecord>,
}

impl Curves {
    /// Takes the epochs that have come since; all of them if these are of another training, or another start leads.
    pub(super) fn follow(&mut self, history: &[EpochRecord]) {
        let goes_on = self.taken > 0 && history.get(self.taken - 1) == self.last.as_ref();
        if !goes_on {
            (self.outline, self.taken) = (EpochOutline::new(), 0);
        }
        self.outline.extend(&history[self.taken..]);
        (self.taken, self.last) = (history.len(), history.last().copied());
    }

    /// The epochs kept, in order.
    pub(super) fn records(&self) -> &[EpochRecord] {
        self.outline.records()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn epochs(count: usize, scale: f64) -> Vec<EpochRecord> {
        let epoch = |epoch: usize| EpochRecord {
            epoch,
            training_mse: scale / (1.0 + epoch as f64),
            validation_mse: None,
            test_mse: None,
            gradient_norm: 1.0,
            parameter: 1.0,
            effective_parameters: None,
            validation_failures: 0,
        };
        (0..count).map(epoch).collect()
    }

    #[test]
    fn curves_grow_with_a_training_and_begin_anew_with_another() {
        let mut curves = Curves::default();
        for (count, scale) in [(3, 1.0), (7, 1.0), (9, 2.0), (2, 2.0), (0, 1.0), (4, 3.0)] {
            let history = epochs(count, scale);
            curves.follow(&history);
            assert_eq!(curves.records(), history, "{count} epochs, scale {scale}");
        }
    }
}
