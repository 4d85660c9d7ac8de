use std::sync::{Arc, OnceLock};

use crate::{
    dataset::{Seed, Stream},
    decoupling::GaussianPrior,
    scene::{Loading, Scene},
    sensor::SensorModel,
};

/// Gaussian priors of row-wires: means and covariances of a scene's deformations. They are computed when the first is
/// needed, and shared by clones.
#[derive(Clone, Debug)]
pub(super) struct Priors {
    model: SensorModel,
    scene: Scene,
    rows: Vec<usize>,
    of_rows: Arc<OnceLock<Vec<GaussianPrior>>>,
}

/// Minimum prior standard deviation of a pattern, relative to the range.
const SMALLEST_SPREAD: f64 = 1e-3;

impl Priors {
    pub(super) fn new(model: &SensorModel, scene: &Scene, rows: &[usize]) -> Self {
        Self {
            model: *model,
            scene: *scene,
            // Nodes that move independently have the same prior on all row-wires.
            rows: match scene.loading {
                Loading::RandomNodes => rows.iter().take(1).copied().collect(),
                _ => rows.to_vec(),
            },
            of_rows: Arc::default(),
        }
    }

    /// Returns the prior of row-wire `row`.
    ///
    /// # Panics
    /// If `row` is not one of the given rows, unless all have the same prior.
    pub(super) fn of(&self, row: usize) -> &GaussianPrior {
        let of_rows = self.of_rows.get_or_init(|| {
            let mut rng = Seed(0).rng(Stream::Expectation);
            GaussianPrior::of_rows(&self.model, &self.scene, &self.rows, SMALLEST_SPREAD, &mut rng)
        });
        let place = match self.scene.loading {
            Loading::RandomNodes => Some(0),
            _ => self.rows.iter().position(|&known| known == row),
        };
        &of_rows[place.expect("the row is one of those given")]
    }
}
