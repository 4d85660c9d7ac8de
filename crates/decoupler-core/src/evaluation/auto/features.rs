use ndarray::{Array2, Axis};

use super::{
    super::{cross_validation::scatter, errors::extremes},
    AutoSamples,
    judge::Judge,
};
use crate::{
    dataset::{Dataset, Memory},
    decoupling::{KernelShape, Program, ProgramDecoder, ridge},
    network::{InputChoice, MinMax, NetworkError, Quantity},
};

/// Share of its range by which a reading of new samples may be outside of the range of this many: a tenth, and more where the
/// range of few samples is exceeded by others of the same kind.
pub(super) fn margin(samples: usize) -> f64 {
    (20.0 / samples as f64).max(0.1)
}

/// Samples with the features of a memory as readings.
#[derive(Clone)]
pub(super) struct Features {
    pub(super) memory: Memory,
    pub(super) set: Dataset,
}

impl Features {
    /// Returns the features of `memory`; `None` if they are not possible for the samples.
    pub(super) fn of(samples: &AutoSamples<'_>, memory: &Memory) -> Option<Self> {
        let (mut set, memory) = (samples.set.clone(), memory.clone());
        if !memory.is_empty() {
            let (history, of_samples) = samples.past?;
            set = set.with_readings(history.features(&memory).ok()?.select(Axis(0), of_samples));
        }
        Some(Self { memory, set })
    }

    /// This quantity of the features, or raw features if it is not defined for all.
    pub(super) fn quantity(&self, wanted: Quantity) -> Quantity {
        let is_defined = self.set.readings().iter().all(|&value| wanted.accepts(value));
        if is_defined { wanted } else { Quantity::Raw }
    }

    /// Returns `true` if the quantity is defined for all readings and clearly not linear in them.
    pub(super) fn suits(&self, quantity: Quantity) -> bool {
        /// Ratio of the largest to the smallest reading of a channel.
        const RATIO: f64 = 3.0;
        let is_curved = |column| {
            let (low, high) = extremes(column);
            high > RATIO * low
        };
        let readings = self.set.readings();
        let mut columns = readings.columns().into_iter();
        quantity == Quantity::Raw || self.quantity(quantity) == quantity && columns.any(is_curved)
    }

    /// Readings of the samples `inside`, limited as they will be in use: to the range of those outside, extended by a margin.
    pub(super) fn held_out(&self, outside: &[usize], inside: &[usize], quantity: Quantity) -> Array2<f64> {
        let all = self.set.readings();
        let mut readings = all.select(Axis(0), inside);
        if let Some(range) = MinMax::of(all.select(Axis(0), outside).view()) {
            for (channel, mut column) in readings.columns_mut().into_iter().enumerate() {
                let (low, high) = range.limits_within(quantity, channel, margin(self.set.samples()));
                column.mapv_inplace(|reading| reading.clamp(low, high));
            }
        }
        readings
    }

    /// Returns the held-out answers of ridge regression and the regression fitted to all samples.
    pub(super) fn ridge(&self, judge: &Judge, quantity: Quantity) -> Result<(Array2<f64>, Program), NetworkError> {
        let values = self.set.readings().mapv(|reading| quantity.of(reading));
        let fits = judge
            .repeats
            .iter()
            .map(|folds| ridge(values.view(), self.set.targets(), folds));
        let fits = fits.collect::<Result<Vec<_>, _>>()?;
        let centre = values.mean_axis(Axis(0)).ok_or(NetworkError::Empty)?.to_vec();
        let mut maps = fits.iter().flat_map(|fit| &fit.held_out).chain([&fits[0].map]);
        self.fitted(judge, quantity, |_| {
            let map = maps.next().ok_or(NetworkError::Empty)?;
            Ok(Program::of_map(map, quantity, &centre))
        })
    }

    /// Returns the held-out answers of kernel ridge regression and the regression fitted to all samples.
    pub(super) fn kernel(
        &self,
        judge: &Judge,
        (inputs, is_linear, subset): (InputChoice, bool, usize),
    ) -> Result<(Array2<f64>, Program), NetworkError> {
        let shape = KernelShape::choose(&self.set, inputs, is_linear, &judge.repeats[0])?;
        self.fitted(judge, inputs.quantity, |samples| {
            Program::kernel(&self.set.select(samples), &shape, subset)
        })
    }

    /// Returns the held-out answers of programs that are fitted to the samples outside of each fold, and the program that is
    /// fitted to all samples, which comes last.
    pub(super) fn fitted(
        &self,
        judge: &Judge,
        quantity: Quantity,
        mut fit: impl FnMut(&[usize]) -> Result<Program, NetworkError>,
    ) -> Result<(Array2<f64>, Program), NetworkError> {
        let mut answers = Array2::zeros(judge.truth.dim());
        for (outside, inside, rows) in judge.divisions() {
            let readings = self.held_out(&outside, inside, quantity);
            let of_part = ProgramDecoder::new(fit(&outside)?).answers(&vec![0; inside.len()], readings.view());
            scatter(&mut answers, &rows, &of_part);
        }
        Ok((answers, fit(&Vec::from_iter(0..self.set.samples()))?))
    }
}
