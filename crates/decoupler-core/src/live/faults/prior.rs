use rand::Rng;

use crate::{
    decoupling::{GaussianPrior, Range, ranges},
    scene::Scene,
    sensor::SensorModel,
};

/// Gaussian prior of the unknowns of one row-wire (node by node, each node's axes together) with what a fit and its
/// evidence need of it.
#[derive(Clone, Debug)]
pub(in crate::live) struct FitPrior {
    pub(super) mean_mm: Vec<f64>,
    /// Inverse of the covariance in 1/mm²: unknowns × unknowns.
    pub(super) precision: Vec<f64>,
    /// ln det of the precision.
    pub(super) log_determinant: f64,
}

/// A standard deviation, in proportion to the range, below which no pattern is taken as known beforehand.
const SMALLEST_SPREAD: f64 = 1e-2;

impl FitPrior {
    /// About the middle of every range with the range's width as standard deviation, for one row-wire of any scene with
    /// the ranges of `scene`: it only keeps what the readings do not determine from growing without bound.
    pub(super) fn weak(model: &SensorModel, scene: &Scene) -> Self {
        let ranges = ranges(model, scene);
        Self::of(&GaussianPrior::independent(&ranges, 1.0), &ranges)
    }

    /// Priors of `rows` in `scene`.
    pub(in crate::live) fn of_rows(
        model: &SensorModel,
        scene: &Scene,
        rows: &[usize],
        rng: &mut impl Rng,
    ) -> Vec<Self> {
        let ranges = ranges(model, scene);
        let priors = GaussianPrior::of_rows(model, scene, rows, SMALLEST_SPREAD, rng);
        priors.iter().map(|prior| Self::of(prior, &ranges)).collect()
    }

    fn of(prior: &GaussianPrior, ranges: &[Range]) -> Self {
        let widths = ranges.iter().map(|range| range.width());
        let mut precision = Vec::with_capacity(ranges.len() * ranges.len());
        for (i, row_width) in widths.clone().enumerate() {
            for (j, column_width) in widths.clone().enumerate() {
                let root = &prior.inverse_root;
                let sum: f64 = (i.max(j)..ranges.len()).map(|k| root[(k, i)] * root[(k, j)]).sum();
                precision.push(sum / (row_width * column_width));
            }
        }
        let diagonal = widths.clone().enumerate();
        Self {
            mean_mm: prior
                .mean
                .iter()
                .zip(widths)
                .map(|(mean, width)| mean * width)
                .collect(),
            precision,
            log_determinant: 2.0
                * diagonal
                    .map(|(i, width)| (prior.inverse_root[(i, i)] / width).ln())
                    .sum::<f64>(),
        }
    }
}
