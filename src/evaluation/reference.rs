use ndarray::{Array2, Axis};
use rand::Rng;
use serde::{Deserialize, Serialize};

use super::Errors;
use crate::{
    dataset::Dataset,
    decoupling::Posterior,
    scene::Scene,
    sensor::{SensorError, SensorModel},
};

/// Reasons for which a test set has no Bayesian reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum NoReference {
    /// The posterior of a row did not converge.
    NotConverged,
    /// The rounding of the readings decides which part stays unknown, and no more is known of it than the order of magnitude.
    Rounding,
}

/// Factor by which the rounding of readings may be finer than the posterior takes it to be.
const FINER_ROUNDING: f64 = 4.0;
/// Share of the reference that may depend on that factor.
const OWED_TO_ROUNDING: f64 = 0.05;
/// Relative noise beside which no rounding of readings counts.
const SMALLEST_BESIDE_ROUNDING: f64 = 1e-13;
/// Number of samples, spread over the test set, on which that is tried.
const TRIED_SAMPLES: usize = 100;

/// Errors of the Bayesian reference on a test set whose readings have the scene's noise: the limit that physics sets to
/// decoders that know of the loading its range, or its mean and covariance.
///
/// For each row, Eq. (2) is linearised at the true deformation; with the noise and prior of the scene this has a
/// posterior, whose medians are the answers with the least expected absolute error. No decoder with the same knowledge
/// does better on average; one that has to find where to linearise can come close.
///
/// The prior of random nodes is uniform, cut at 0 and at the stroke; a Gaussian of the same spread would misjudge the
/// error by up to a quarter. Other loadings enter by mean and covariance, cut likewise: a decoder that learns the shape
/// of such a loading may fall below the reference. Each row is judged by its own readings and taken as known, even in
/// scenes whose decoders are not told the row; those cannot quite reach it.
///
/// Without noise the rounding of the readings takes its place. It hides much of what is badly seen; elsewhere the errors
/// are 0 or next to it, for simulated readings are rounded as the model at the truth is ([`Errors::times`]). Between the
/// two the errors depend on how finely the readings are rounded: there is no reference then. `rng` draws the samples that
/// estimate a prior without closed form.
///
/// # Errors
/// If the sensor has no resistances at rest.
///
/// # Panics
/// If a sample of `test` has no row-wire, or one that the scene does not read.
pub fn reference_errors(
    model: &SensorModel,
    scene: &Scene,
    test: &Dataset,
    rng: &mut impl Rng,
) -> Result<Result<Errors, NoReference>, SensorError> {
    let rows = test.row_wires_read().expect("samples of a scene know their row-wire");
    let mut posterior = Posterior::new(model, scene, rows, rng)?;
    let measured =
        |test: &Dataset, limits_mm: &Array2<f64>| Errors::measure(test, limits_mm, scene.stroke_mm(&model.geometry));
    let Some(limits) = limits_mm(&mut posterior, test) else {
        return Ok(Err(NoReference::NotConverged));
    };
    let errors = measured(test, &limits);
    if !errors.is_rounding() && scene.noise.in_test().relative < SMALLEST_BESIDE_ROUNDING {
        let every = test.samples().div_ceil(TRIED_SAMPLES).max(1);
        let tried: Vec<usize> = (0..test.samples()).step_by(every).collect();
        let some = test.select(&tried);
        let z_mm = measured(&some, &limits.select(Axis(0), &tried)).z_mm;
        let finer = limits_mm(&mut posterior.rounded_finer(FINER_ROUNDING), &some);
        let is_same = |finer: Array2<f64>| measured(&some, &finer).z_mm >= (1.0 - OWED_TO_ROUNDING) * z_mm;
        if !finer.is_some_and(is_same) {
            return Ok(Err(NoReference::Rounding));
        }
    }
    Ok(Ok(errors))
}

/// The answers of the posterior that knows where to linearise (samples × 3·M2); `None` if that of any row did not converge.
fn limits_mm(posterior: &mut Posterior, test: &Dataset) -> Option<Array2<f64>> {
    /// Samples whose posteriors are found at once.
    const BLOCK: usize = 64;
    let rows = test.row_wires_read().expect("samples of a scene know their row-wire");
    let mut limits_mm = Array2::zeros(test.targets().dim());
    let (mut readings_ohm, mut truths_mm) = (Vec::new(), Vec::new());
    for (block, mut limits_mm) in limits_mm.axis_chunks_iter_mut(Axis(0), BLOCK).enumerate() {
        let samples = block * BLOCK..block * BLOCK + limits_mm.nrows();
        let rows: Vec<usize> = samples.clone().map(|sample| rows[test.row_index(sample)]).collect();
        readings_ohm.clear();
        truths_mm.clear();
        for sample in samples {
            readings_ohm.extend_from_slice(test.sample_readings(sample));
            truths_mm.extend_from_slice(test.sample_targets(sample));
        }
        let limits_mm = limits_mm
            .as_slice_mut()
            .expect("rows of a standard array are contiguous");
        if !posterior.limits(&rows, &readings_ohm, &truths_mm, limits_mm) {
            return None;
        }
    }
    Some(limits_mm)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::{Movement, Noise},
    };

    fn errors(model: &SensorModel, noise: f64, movement: Movement, snapshots: usize) -> Result<Errors, NoReference> {
        let scene = Scene {
            movement,
            noise: Noise::relative(noise),
            ..Scene::default()
        };
        let rows: Vec<usize> = (0..model.scale.rows()).collect();
        let mut test =
            Dataset::simulate(model, &scene, snapshots * rows.len(), &mut Seed(2).rng(Stream::Test)).unwrap();
        test.disturb(model, &scene.noise, &mut Seed(2).rng(Stream::TestNoise))
            .unwrap();
        let mut rng = Seed(2).rng(Stream::Expectation);
        reference_errors(model, &scene, &test, &mut rng).unwrap()
    }

    fn z_mm(model: &SensorModel, noise: f64, snapshots: usize) -> f64 {
        errors(model, noise, Movement::Z, snapshots).unwrap().z_mm
    }

    #[test]
    fn no_limit_is_told_where_only_rounding_sets_it() {
        let model = SensorModel::new("2x6_3x18".parse().unwrap());
        assert_eq!(errors(&model, 0.0, Movement::SIDEWAYS, 10), Err(NoReference::Rounding));
        let sharp = errors(&model, 0.0, Movement::Z, 10).unwrap().z_mm;
        assert!(sharp < 1e-10, "{sharp}");
        // Six unknowns and four readings: whatever the rounding, a plane of deformations stays unknown.
        let blind = SensorModel::new("2x6_3x4".parse().unwrap());
        let [without, with] = [0.0, 1e-8].map(|noise| errors(&blind, noise, Movement::Z, 10).unwrap().z_mm);
        assert!(
            without > 0.05 && (without / with - 1.0).abs() < 0.02,
            "{without} {with}"
        );
    }

    /// Changes of the readings near their rounding, in the two ways in which they come: decoders that know nothing of the
    /// rounding fall below what the posterior takes for the limit.
    #[test]
    fn strokes_near_rounding_have_no_limit() {
        let model = SensorModel::new("4x3_2x9".parse().unwrap());
        let mut flat = model;
        flat.geometry.height_mm = 3e-6;
        for (model, largest_compression) in [(&model, 1e-12), (&model, 1e-11), (&flat, 0.2)] {
            let scene = Scene {
                largest_compression,
                ..Scene::default()
            };
            let test = Dataset::simulate(model, &scene, 80, &mut Seed(2).rng(Stream::Test)).unwrap();
            let found = reference_errors(model, &scene, &test, &mut Seed(2).rng(Stream::Expectation)).unwrap();
            assert_eq!(found, Err(NoReference::Rounding), "{largest_compression}");
        }
    }

    /// One node: the posterior is normal with standard deviation ε/s while that is small against the stroke; when it is
    /// large, readings tell nothing, and the middle of the stroke is off by a quarter of it.
    #[test]
    fn one_node_has_the_closed_form_at_both_ends() {
        let mut model = SensorModel::new("1x1_1x4".parse().unwrap());
        model.geometry.column_node_x0_mm = model.geometry.row_x0_mm;
        let noise = 1e-4;
        // With R = g·d the derivative of ln R is z/d², here averaged over where the node may be.
        let mut expected = 0.0;
        for step in 0..1000 {
            let z = 4.0 + (f64::from(step) + 0.5) / 1000.0;
            let information: f64 = (0..4).map(|k| (z / (z * z + (k as f64 - 1.5).powi(2))).powi(2)).sum();
            expected += noise / information.sqrt() * (2.0 / std::f64::consts::PI).sqrt() / 1000.0;
        }
        let found = z_mm(&model, noise, 20_000);
        assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
        let blind = z_mm(&model, 1.0, 5_000);
        assert!((blind - 0.25).abs() < 0.02, "{blind}");
        assert!(z_mm(&model, 0.0, 5) < 1e-14);
    }

    #[test]
    fn more_noise_never_helps() {
        let model = SensorModel::new("2x4_2x12".parse().unwrap());
        let errors = [1e-5, 1e-4, 1e-3, 1e-2].map(|noise| z_mm(&model, noise, 30));
        assert!(errors.is_sorted(), "{errors:?}");
    }
}
