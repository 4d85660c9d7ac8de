use std::{sync::Arc, time::Duration};

use decoupler_core::{
    evaluation::Run,
    network::{DecouplingNetwork, Mlp, Networks},
};
use decoupler_files::export::PastNetwork;

/// Best networks at past epochs: the networks that a run stopped at each epoch would have returned.
///
/// At most [`Self::MAX`] are kept, whose weights take at most [`Self::MAX_BYTES`]; beyond that every second one is
/// dropped, so that those of every 2ᵏ-th epoch remain. The latest is always kept.
#[derive(Clone, Debug, Default)]
pub struct PastNetworks {
    /// k: the epochs kept are multiples of 2ᵏ, except the latest.
    halvings: u32,
    /// In the order of their epochs.
    kept: Vec<Arc<Past>>,
}

/// Weights of a past epoch.
#[derive(Debug)]
struct Past {
    epoch: usize,
    best_epoch: usize,
    start: usize,
    elapsed: Duration,
    /// The network of each row-wire, or the shared network.
    weights: Vec<Mlp>,
}

impl PastNetworks {
    /// Maximum memory of the weights: 64 MiB.
    pub const MAX_BYTES: usize = 64 << 20;

    /// Maximum number of networks: more than a slider has points.
    pub const MAX: usize = 4096;

    /// Records the current state of `run`; to be called after each step.
    pub fn record(&mut self, run: &Run) {
        self.record_within(run, Self::MAX_BYTES, Self::MAX);
    }

    fn record_within(&mut self, run: &Run, max_bytes: usize, max_count: usize) {
        let leader = run.leader();
        let epochs = run.trainers().iter().map(|start| start.latest().epoch);
        let epoch = epochs.max().unwrap_or(0);
        let weights = run.best();
        let bytes: usize = weights.iter().map(|mlp| size_of_val(mlp.weights())).sum();
        let max_count = max_count.min(max_bytes / bytes.max(1));
        // A network that is no longer the latest is kept only at a multiple of 2ᵏ.
        let stride = self.stride();
        self.kept
            .pop_if(|latest| latest.epoch >= epoch || !latest.epoch.is_multiple_of(stride));
        self.kept.push(Arc::new(Past {
            epoch,
            best_epoch: leader.best_epoch(),
            start: run.leader_number(),
            elapsed: run.training_time(),
            weights,
        }));
        while self.kept.len() > max_count.max(1) {
            if self.kept.len() == 2 {
                self.kept.remove(0);
            } else {
                self.halvings += 1;
                let stride = self.stride();
                self.kept
                    .retain(|past| past.epoch == epoch || past.epoch.is_multiple_of(stride));
            }
        }
    }

    /// Returns the epochs whose networks are kept, in ascending order.
    pub fn epochs(&self) -> impl ExactSizeIterator<Item = usize> + DoubleEndedIterator + '_ {
        self.kept.iter().map(|past| past.epoch)
    }

    /// Number of epochs between consecutive networks, except the latest.
    pub fn stride(&self) -> usize {
        1 << self.halvings
    }

    /// Returns the last epoch at or before `epoch` whose network is kept, or the first epoch if there is none.
    pub fn nearest(&self, epoch: usize) -> Option<usize> {
        let after = self.kept.partition_point(|past| past.epoch <= epoch);
        self.kept.get(after.saturating_sub(1)).map(|past| past.epoch)
    }

    /// Returns the network at this epoch, if it is kept. `present` are the networks of the same run at any epoch, which
    /// provide the scalings.
    pub fn at(&self, epoch: usize, present: &Networks) -> Option<PastNetwork> {
        let place = self.kept.binary_search_by_key(&epoch, |past| past.epoch).ok()?;
        let past = &self.kept[place];
        let rows = present.values().iter().zip(&past.weights);
        let networks = rows.map(|(network, weights)| {
            DecouplingNetwork::new(network.inputs().clone(), weights.clone(), network.outputs().clone())
        });
        Some(PastNetwork {
            epoch,
            best_epoch: past.best_epoch,
            start: past.start,
            elapsed: past.elapsed,
            networks: Networks::each(networks.collect()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use decoupler_core::{
        evaluation::{Combination, RunSettings},
        scene::Rows,
        training::Method,
    };

    const NO_BOUND: [usize; 2] = [usize::MAX; 2];

    fn settings() -> RunSettings {
        let mut settings = RunSettings::default();
        settings.simulation_mut().unwrap().sensor.scale = "3x4_2x12".parse().unwrap();
        (
            settings.hidden,
            settings.simulation_mut().unwrap().samples,
            settings.training.stopping.epochs,
        ) = (3, 60, 40);
        settings
    }

    /// Trains to the end and records every epoch; calls `each` after it.
    fn record(
        settings: RunSettings,
        [max_bytes, max_count]: [usize; 2],
        mut each: impl FnMut(&PastNetworks, usize),
    ) -> (Run, PastNetworks) {
        let (mut run, mut past) = (Run::prepare(settings).unwrap(), PastNetworks::default());
        past.record_within(&run, max_bytes, max_count);
        let mut epoch = 0;
        while run.stop_reason().is_none() {
            run.step();
            epoch += 1;
            past.record_within(&run, max_bytes, max_count);
            each(&past, epoch);
        }
        (run, past)
    }

    #[test]
    fn the_network_of_an_epoch_equals_that_of_a_training_stopped_there() {
        let mut several = settings();
        several.starts = 3;
        let mut known = settings();
        known.simulation_mut().unwrap().scene.rows = Rows::Known;
        let committee = RunSettings {
            combine: Combination::Mean,
            ..several
        };
        for settings in [settings(), several, known, committee] {
            let (run, past) = record(settings, NO_BOUND, |_, _| {});
            let last = past.epochs().last().unwrap();
            for epoch in [0, 1, 7, last] {
                let mut stopped = Run::prepare(settings).unwrap();
                (0..epoch).for_each(|_| {
                    stopped.step();
                });
                let past = past.at(epoch, &run.network()).unwrap();
                assert_eq!(past.networks, stopped.network(), "epoch {epoch}");
                assert_eq!(past.best_epoch, stopped.leader().best_epoch());
                assert_eq!(past.start, stopped.leader_number());
                assert!(past.elapsed <= run.training_time());
            }
        }
    }

    #[test]
    fn memory_is_limited_and_multiples_of_a_power_of_two_are_kept() {
        let mut settings = settings();
        settings.training.method = Method::all()
            .into_iter()
            .find(|method| method.short_name() == "scg")
            .unwrap();
        let weights = Run::prepare(settings).unwrap().leader().weights();
        let max_bytes = 10 * 8 * weights;
        // Both bounds keep about ten.
        for bounds in [[max_bytes, usize::MAX], [usize::MAX, 10]] {
            let (_, past) = record(settings, bounds, |past, epoch| {
                let bytes = past.kept.iter().flat_map(|past| &past.weights);
                let bytes: usize = bytes.map(|mlp| size_of_val(mlp.weights())).sum();
                assert!(bytes <= bounds[0] && past.kept.len() <= bounds[1], "at {epoch}");
                let epochs: Vec<usize> = past.epochs().collect();
                let expected = (0..epoch).step_by(past.stride()).chain([epoch]);
                assert_eq!(epochs, expected.collect::<Vec<_>>(), "every {}", past.stride());
            });
            assert!(past.stride() >= 4 && past.epochs().len() > 5, "{past:?}");
            assert_eq!(past.nearest(past.stride() + 1), Some(past.stride()));
            assert_eq!(past.nearest(usize::MAX), past.epochs().next_back());
        }
    }

    #[test]
    fn a_single_network_is_kept_even_if_it_exceeds_the_bound() {
        let (run, past) = record(settings(), [1, usize::MAX], |past, epoch| {
            assert_eq!(past.epochs().collect::<Vec<_>>(), [epoch]);
        });
        let epoch = run.leader().latest().epoch;
        assert_eq!(past.at(epoch, &run.network()).unwrap().networks, run.network());
        assert!(past.at(epoch + 1, &run.network()).is_none());
        assert_eq!(PastNetworks::default().nearest(3), None);
    }
}
