use ndarray::Array2;
use rand::Rng;

use super::Errors;
use crate::{
    dataset::Dataset,
    decoupling::Posterior,
    scene::Scene,
    sensor::{SensorError, SensorModel},
};

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
/// are 0 or next to it, for simulated readings are rounded as the model at the truth is ([`Errors::times`]). `None` if the
/// posterior of any row did not converge. `rng` draws the samples that estimate a prior without closed form.
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
) -> Result<Option<Errors>, SensorError> {
    let rows = test.row_wires_read().expect("samples of a scene know their row-wire");
    let mut posterior = Posterior::new(model, scene, rows, rng)?;
    let mut limit_mm = Array2::zeros(test.targets().dim());
    for (sample, mut answer) in limit_mm.rows_mut().into_iter().enumerate() {
        let converged = posterior.limit(
            rows[test.row_index(sample)],
            test.sample_readings(sample),
            test.sample_targets(sample),
            answer.as_slice_mut().expect("a row of a standard array is contiguous"),
        );
        if !converged {
            return Ok(None);
        }
    }
    let errors = Errors::measure(test, &limit_mm, scene.stroke_mm(&model.geometry));
    Ok(Some(errors))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::{Movement, Noise},
    };

    fn errors(model: &SensorModel, noise: f64, movement: Movement, snapshots: usize) -> Option<Errors> {
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

    /// Sideways, rounding hides some deformation; along z it hides none.
    #[test]
    fn without_noise_rounding_sets_the_limit() {
        let model = SensorModel::new("2x6_3x18".parse().unwrap());
        let blurred = errors(&model, 0.0, Movement::SIDEWAYS, 10).unwrap().z_mm;
        let noisy = errors(&model, 1e-8, Movement::SIDEWAYS, 10).unwrap().z_mm;
        assert!(blurred > 1e-6 && blurred < 1.02 * noisy, "{blurred} {noisy}");
        let sharp = errors(&model, 0.0, Movement::Z, 10).unwrap().z_mm;
        assert!(sharp < 1e-10, "{sharp}");
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
