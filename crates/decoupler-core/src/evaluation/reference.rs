use std::fmt;

use ndarray::{Array2, Axis};
use rand::{Rng, RngExt, SeedableRng, rngs::ChaCha8Rng};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Baselines, Errors, TestErrors};
use crate::{
    dataset::Dataset,
    decoupling::{Posterior, SampledPosterior},
    scene::{Loading, Scene},
    sensor::{SensorError, SensorModel},
};

/// Reason why a test set has no Bayesian reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum NoReference {
    /// The posterior of a row did not converge.
    NotConverged,
    /// The error is determined by the rounding of the readings, which is known only in order of magnitude.
    Rounding,
    /// The posterior could not be sampled well enough.
    Sampling,
    /// Sampling the posteriors would take too long.
    TooLarge,
}

/// Factor by which the rounding of readings may be finer than the posterior assumes.
const FINER_ROUNDING: f64 = 4.0;
/// Maximum share of the reference that may depend on that factor.
const MAX_DUE_TO_ROUNDING: f64 = 0.05;
/// Relative noise above which the rounding of readings is negligible.
const MIN_NOISE_ABOVE_ROUNDING: f64 = 1e-13;
/// Number of samples, spread over the test set, on which the effect of rounding is tested.
const ROUNDING_SAMPLES: usize = 100;

/// Returns the errors of the Bayesian reference on a test set whose readings have the scene's noise: the physical limit
/// for decoders of the row's own readings.
///
/// The prior is the distribution from which the scene draws. The medians of the posterior of each row are the answers
/// with the minimum expected absolute error: no decoder of the same readings is better on average. Each row is decoded
/// from its own readings and assumed to be known, even in scenes whose decoders do not know the row; such decoders
/// cannot quite reach the reference.
///
/// The prior of random nodes is uniform between 0 and the stroke. Eq. (2) is linearised at the true deformation, and
/// expectation propagation finds the medians; a decoder that has to find the point of linearisation can come close.
/// Other loadings have priors of any shape, such as few parameters of a press, and posteriors with several modes and
/// curved valleys, which are sampled without linearisation (`SampledPosterior`). There is no reference if there are too
/// few effective samples, or if the true deformations are not distributed like samples of their posteriors, as they
/// must be.
///
/// Without noise, the rounding of the readings acts as noise. It dominates for poorly determined deformations; for
/// others the errors are 0 or nearly 0, since simulated readings are rounded in the same way as the model at the true
/// deformation ([`Errors::times`]). Between these cases the errors depend on how finely the readings are rounded, and
/// there is no reference. `rng` draws the samples.
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
    let is_noisy = !scene.noise.in_test().is_none();
    if scene.loading != Loading::RandomNodes && is_noisy {
        return Ok(sampled_medians_mm(model, scene, test, rng)?
            .map(|medians_mm| Errors::measure(test, &medians_mm, scene.stroke_mm(&model.geometry))));
    }
    let linearised = linearised_errors(model, scene, test, rng)?;
    // Without noise, other loadings have a limit only if the readings determine everything, regardless of the prior.
    let is_limit = |errors: &Errors| scene.loading == Loading::RandomNodes || errors.is_rounding();
    Ok(linearised.and_then(|errors| Some(errors).filter(is_limit).ok_or(NoReference::Rounding)))
}

/// Returns the errors of the medians of posteriors linearised at the true deformation.
fn linearised_errors(
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
    if !errors.is_rounding() && scene.noise.in_test().relative < MIN_NOISE_ABOVE_ROUNDING {
        let every = test.samples().div_ceil(ROUNDING_SAMPLES).max(1);
        let tried: Vec<usize> = (0..test.samples()).step_by(every).collect();
        let some = test.select(&tried);
        let z_mm = measured(&some, &limits.select(Axis(0), &tried)).z_mm;
        let finer = limits_mm(&mut posterior.rounded_finer(FINER_ROUNDING), &some);
        let is_same = |finer: Array2<f64>| measured(&some, &finer).z_mm >= (1.0 - MAX_DUE_TO_ROUNDING) * z_mm;
        if !finer.is_some_and(is_same) {
            return Ok(Err(NoReference::Rounding));
        }
    }
    Ok(Ok(errors))
}

/// Returns the medians of the posteriors linearised at the true deformation (samples × 3·M2); `None` if that of any row
/// did not converge.
fn limits_mm(posterior: &mut Posterior, test: &Dataset) -> Option<Array2<f64>> {
    /// Number of samples whose posteriors are computed at once.
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

/// Returns the medians of the posteriors of all samples (samples × 3·M2), by importance sampling from the scene's
/// prior.
fn sampled_medians_mm(
    model: &SensorModel,
    scene: &Scene,
    test: &Dataset,
    rng: &mut impl Rng,
) -> Result<Result<Array2<f64>, NoReference>, SensorError> {
    let rows = test.row_wires_read().expect("samples of a scene know their row-wire");
    if SampledPosterior::node_pairs(model, scene) * test.samples() as f64 > MAX_NODE_PAIRS {
        return Ok(Err(NoReference::TooLarge));
    }
    let seed: u64 = rng.random();
    // Each row and each sample has its own stream, so that results do not depend on the number of threads.
    let stream = |number: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(number as u64);
        rng
    };
    let mut medians_mm = test.targets().to_owned();
    let (mut total_mm, mut owed_mm, mut ranks) = (0.0, 0.0, Vec::new());
    for (row_index, &row) in rows.iter().enumerate() {
        let samples: Vec<usize> = (0..test.samples())
            .filter(|&sample| test.row_index(sample) == row_index)
            .collect();
        if samples.is_empty() {
            continue;
        }
        let mut posterior = SampledPosterior::new(model, scene, row)?;
        let prior = posterior.prior_samples(&mut stream(test.samples() + row_index));
        let found: Vec<_> = samples
            .par_iter()
            .map_with(posterior, |posterior, &sample| {
                let (readings_ohm, truth_mm) = (test.sample_readings(sample), test.sample_targets(sample));
                posterior.medians(readings_ohm, truth_mm, &prior, &mut stream(sample))
            })
            .collect();
        for (sample, found) in samples.into_iter().zip(found) {
            let pairs = found.coordinates_mm.iter().zip(test.sample_targets(sample));
            let error_mm: f64 = pairs.map(|(median, truth)| (median - truth).abs()).sum();
            total_mm += error_mm;
            owed_mm += error_mm * SAMPLING_ERROR / found.effective_samples;
            ranks.push(found.rank_of_truth);
            medians_mm
                .row_mut(sample)
                .iter_mut()
                .zip(found.coordinates_mm)
                .for_each(|(to, from)| *to = from);
        }
    }
    // Written so that NaN is rejected.
    let is_trusted = owed_mm <= MAX_DUE_TO_SAMPLING * total_mm && are_uniform(&mut ranks);
    Ok(if is_trusted {
        Ok(medians_mm)
    } else {
        Err(NoReference::Sampling)
    })
}

/// Relative increase of the expected error of a median of n independent samples over that of the true median, times n.
/// For a normal distribution it is half the variance π/2n of the median times the density at it, divided by the mean
/// absolute deviation (both √(2/π)): π/4n.
const SAMPLING_ERROR: f64 = std::f64::consts::FRAC_PI_4;
/// Maximum share of the reference due to the finite number of samples.
const MAX_DUE_TO_SAMPLING: f64 = 0.02;
/// Maximum number of pairs of nodes for which posteriors are sampled: a few minutes on one core.
const MAX_NODE_PAIRS: f64 = 1e11;

/// Tests whether values are from the uniform distribution on 0 to 1 (Kolmogorov-Smirnov test); uniform values are
/// rejected once in 100 000 sets.
fn are_uniform(values: &mut [f64]) -> bool {
    const LARGEST_DISTANCE: f64 = 2.5;
    values.sort_by(f64::total_cmp);
    let count = values.len() as f64;
    let distance =
        |(index, &value): (usize, &f64)| (value - index as f64 / count).max((index + 1) as f64 / count - value);
    let largest = values.iter().enumerate().map(distance).fold(0.0, f64::max);
    values.iter().all(|value| value.is_finite()) && largest * count.sqrt() <= LARGEST_DISTANCE
}

/// Reason why the Bayesian reference of an error table is not a bound for decoders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ReferenceNote {
    /// There is no reference.
    Missing(NoReference),
    /// The error of the reference is above that of the training mean.
    AboveMean,
}

impl ReferenceNote {
    /// Returns the note on the reference of these baselines; `None` if it is a bound.
    pub fn of(baselines: &Baselines) -> Option<Self> {
        match &baselines.reference {
            None => baselines.no_reference.map(Self::Missing),
            Some(reference) if is_above(reference, &baselines.mean) => Some(Self::AboveMean),
            Some(_) => None,
        }
    }
}

fn is_above(reference: &TestErrors, mean: &TestErrors) -> bool {
    reference
        .nodes()
        .zip(mean.nodes())
        .is_some_and(|(reference, mean)| reference.z_mm > mean.z_mm)
}

impl fmt::Display for ReferenceNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Missing(NoReference::NotConverged) => {
                "There is no Bayesian reference: the posterior of some row did not converge. Lower the compression, or let \
                 nodes move along z only."
            }
            Self::Missing(NoReference::Rounding) => {
                "There is no Bayesian reference: the deformation affects only the last digits of the readings, so that their \
                 rounding determines the error. Raise the compression or the height, let nodes move along z only, or add \
                 noise of 1e-12 or more."
            }
            Self::Missing(NoReference::Sampling) => {
                "There is no Bayesian reference: too few of the deformations sampled from the loading explain the readings \
                 to estimate their posterior. Raise the noise, or let nodes move along z only."
            }
            Self::Missing(NoReference::TooLarge) => {
                "There is no Bayesian reference: sampling the posteriors of this many rows of this size would take \
                 many minutes. Lower the number of test samples, or the size of the array."
            }
            Self::AboveMean => {
                "The Bayesian reference is not a bound here, since it is above the training mean: the readings determine \
                 almost nothing, and the two differ by chance. Lower the noise, or draw more test samples."
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Dataset, Seed, Stream},
        evaluation::Errors,
        scene::{Movement, Noise, Scene},
        sensor::SensorModel,
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
    fn there_is_no_limit_where_only_rounding_determines_it() {
        let model = SensorModel::new("2x6_3x18".parse().unwrap());
        assert_eq!(errors(&model, 0.0, Movement::SIDEWAYS, 10), Err(NoReference::Rounding));
        let sharp = errors(&model, 0.0, Movement::Z, 10).unwrap().z_mm;
        assert!(sharp < 1e-10, "{sharp}");
        // Six unknowns and four readings: regardless of rounding, a plane of deformations is undetermined.
        let blind = SensorModel::new("2x6_3x4".parse().unwrap());
        let [without, with] = [0.0, 1e-8].map(|noise| errors(&blind, noise, Movement::Z, 10).unwrap().z_mm);
        assert!(
            without > 0.05 && (without / with - 1.0).abs() < 0.02,
            "{without} {with}"
        );
    }

    /// Changes of the readings close to their rounding, from a small height or a small compression: decoders that
    /// ignore rounding have smaller errors than the posterior predicts.
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

    /// For one node the posterior is normal with standard deviation ε/s while that is small compared with the stroke.
    /// When it is large, readings determine nothing, and the mean error of answering half the stroke is a quarter of
    /// the stroke.
    #[test]
    fn one_node_agrees_with_the_closed_form_in_both_limits() {
        let mut model = SensorModel::new("1x1_1x4".parse().unwrap());
        model.geometry.column_node_x0_mm = model.geometry.row_x0_mm;
        let noise = 1e-4;
        // With R = g·d the derivative of ln R is z/d², here averaged over the possible positions of the node.
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

    /// Returns the weighted median of (value, weight) pairs.
    fn weighted_median(mut pairs: Vec<(f64, f64)>) -> f64 {
        pairs.sort_by(|one, other| one.0.total_cmp(&other.0));
        let total: f64 = pairs.iter().map(|(_, weight)| weight).sum();
        let mut below = 0.0;
        let middle = pairs.iter().find(|(_, weight)| {
            below += weight;
            below >= 0.5 * total
        });
        middle.unwrap().0
    }

    /// Returns the errors of the weighted medians of 20 000 deformations drawn from the scene. Weights are the
    /// likelihood of the readings as documented for [`Noise`]; a drifting gain is integrated by the midpoint rule.
    fn by_prior_sampling(model: &SensorModel, scene: &Scene, test: &Dataset) -> f64 {
        let sampler = scene.sampler(model);
        let mut rng = Seed(77).rng(Stream::Expectation);
        let draws: Vec<_> = (0..20_000).map(|_| sampler.draw(&mut rng)).collect();
        let Noise {
            relative,
            additive_ohm,
            drift,
            ..
        } = scene.noise;
        let gains: Vec<(f64, f64)> = if drift == 0.0 {
            vec![(1.0, 1.0)]
        } else {
            let at = |k: i32| 0.25 * f64::from(k);
            (-14..=14)
                .map(|k| (1.0 + drift * at(k), (-0.5 * at(k) * at(k)).exp()))
                .collect()
        };
        let mut answers = test.targets().to_owned();
        for row in 0..model.scale.rows() {
            let ohms: Vec<Vec<f64>> = draws
                .iter()
                .map(|draw| model.row_resistances(row, draw.row_mm(row)).unwrap())
                .collect();
            for sample in (0..test.samples()).filter(|&sample| test.row_index(sample) == row) {
                let log_density = |ohms: &[f64], gain: f64| -> f64 {
                    let pairs = ohms.iter().zip(test.sample_readings(sample));
                    pairs
                        .map(|(ohm, reading)| {
                            let deviation = (relative * gain * ohm).hypot(additive_ohm);
                            -0.5 * ((reading - gain * ohm) / deviation).powi(2) - deviation.ln()
                        })
                        .sum()
                };
                let logs: Vec<Vec<f64>> = (ohms.iter())
                    .map(|ohms| gains.iter().map(|&(gain, _)| log_density(ohms, gain)).collect())
                    .collect();
                let largest = logs.iter().flatten().copied().fold(f64::NEG_INFINITY, f64::max);
                let weight = |logs: &Vec<f64>| -> f64 {
                    logs.iter()
                        .zip(&gains)
                        .map(|(log, (_, share))| share * (log - largest).exp())
                        .sum()
                };
                let weights: Vec<f64> = logs.iter().map(weight).collect();
                for node in 0..model.scale.nodes_per_row() {
                    let places = draws.iter().zip(&weights).filter(|(_, weight)| **weight > 1e-9);
                    let places =
                        places.map(|(draw, &weight)| (model.geometry.height_mm - draw.row_mm(row)[node].z, weight));
                    answers[[sample, 3 * node + 2]] = weighted_median(places.collect());
                }
            }
        }
        Errors::measure(test, &answers, scene.stroke_mm(&model.geometry)).z_mm
    }

    /// With only the mean and covariance of the loading, the reference of a ball would be twice as large. A tilted edge
    /// lifts off, which leaves nodes at exactly 0.
    #[test]
    fn references_of_all_loadings_agree_with_prior_sampling() {
        let model = SensorModel::new("2x3_2x9".parse().unwrap());
        let noises = [
            Noise::relative(5e-3),
            Noise {
                additive_ohm: 0.3,
                ..Noise::default()
            },
            Noise {
                drift: 0.05,
                ..Noise::relative(1e-2)
            },
        ];
        for (loading, noise) in ["indenter:sphere", "indenter:edge", "smooth:3"].into_iter().zip(noises) {
            let scene = Scene {
                loading: loading.parse().unwrap(),
                noise,
                ..Scene::default()
            };
            let mut test = Dataset::simulate(&model, &scene, 16, &mut Seed(5).rng(Stream::Test)).unwrap();
            test.disturb(&model, &noise, &mut Seed(5).rng(Stream::TestNoise))
                .unwrap();
            let mut rng = Seed(5).rng(Stream::Expectation);
            let found = reference_errors(&model, &scene, &test, &mut rng).unwrap().unwrap().z_mm;
            let expected = by_prior_sampling(&model, &scene, &test);
            assert!((found / expected - 1.0).abs() < 0.04, "{loading}: {found} {expected}");
        }
    }

    /// The depth of a single node of a smooth field is uniform, like that of a random node, so sampling and
    /// linearisation agree at all noise levels.
    #[test]
    fn sampling_agrees_with_linearisation_where_both_are_valid() {
        let model = SensorModel::new("1x1_1x4".parse().unwrap());
        for noise in [0.3, 1e-2, 1e-3, 1e-5, 1e-8] {
            let random = Scene {
                noise: Noise::relative(noise),
                ..Scene::default()
            };
            let smooth = Scene {
                loading: "smooth:4".parse().unwrap(),
                ..random
            };
            let mut test = Dataset::simulate(&model, &random, 60, &mut Seed(6).rng(Stream::Test)).unwrap();
            test.disturb(&model, &random.noise, &mut Seed(6).rng(Stream::TestNoise))
                .unwrap();
            let z_mm = |scene| {
                let mut rng = Seed(6).rng(Stream::Expectation);
                reference_errors(&model, scene, &test, &mut rng).unwrap().unwrap().z_mm
            };
            let (sampled, linearised) = (z_mm(&smooth), z_mm(&random));
            assert!(
                (sampled / linearised - 1.0).abs() < 0.03,
                "{noise}: {sampled} {linearised}"
            );
        }
    }

    #[test]
    fn a_test_set_inconsistent_with_its_posteriors_has_no_reference() {
        let mut uniform: Vec<f64> = (0..100).map(|k| (f64::from(k) + 0.5) / 100.0).collect();
        assert!(are_uniform(&mut uniform));
        assert!(!are_uniform(&mut [0.99; 20]) && !are_uniform(&mut [f64::NAN; 20]));
        // Readings of another sensor: no press explains them.
        let model = SensorModel::new("2x3_2x9".parse().unwrap());
        let mut other = model;
        other.resistivity_ohm_per_mm *= 1.2;
        let scene = Scene {
            loading: "indenter".parse().unwrap(),
            noise: Noise::relative(1e-3),
            ..Scene::default()
        };
        let mut test = Dataset::simulate(&other, &scene, 40, &mut Seed(5).rng(Stream::Test)).unwrap();
        test.disturb(&other, &scene.noise, &mut Seed(5).rng(Stream::TestNoise))
            .unwrap();
        let found = reference_errors(&model, &scene, &test, &mut Seed(5).rng(Stream::Expectation)).unwrap();
        assert_eq!(found, Err(NoReference::Sampling));
    }

    #[test]
    fn a_reference_above_the_mean_is_not_a_bound() {
        let model = SensorModel::new("2x2_2x6".parse().unwrap());
        let set = Dataset::simulate(&model, &Scene::default(), 4, &mut Seed(0).rng(Stream::Test)).unwrap();
        let off = |by_mm: f64| {
            let answers = set.targets().mapv(|value| value + by_mm);
            TestErrors::Nodes(Errors::measure(&set, &answers, 1.0))
        };
        let baselines = |reference: Option<TestErrors>| Baselines {
            mean: off(0.25),
            linear: off(0.1),
            no_reference: reference.is_none().then_some(NoReference::NotConverged),
            reference,
        };
        assert_eq!(ReferenceNote::of(&baselines(Some(off(0.2)))), None);
        assert_eq!(
            ReferenceNote::of(&baselines(Some(off(0.26)))),
            Some(ReferenceNote::AboveMean)
        );
        let missing = ReferenceNote::of(&baselines(None)).unwrap().to_string();
        assert!(missing.contains("converge") && missing.contains("Lower"), "{missing}");
    }
}
