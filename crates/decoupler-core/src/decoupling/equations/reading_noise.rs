use super::ROUNDING;
use crate::scene::NoiseSource;

/// Distribution of the readings of a row-wire about the model's resistances.
///
/// A reading m of the resistance P = γ R, with the gain γ of the snapshot, is normal with standard deviation
/// √((relative · P)² + additive²), where the rounding of a converter counts as additive noise of step/√12. In the relative
/// misfit ρ = m/P − 1, which is nearly linear in the displacements, its negative log-likelihood is, up to a constant,
///
/// `½ w² + ln(σ/(1 + ρ)),   w = ρ/σ,   σ² = relative² + (additive · (1 + ρ)/m)²`.
///
/// Readings at an end of the converter's range only bound P. The noise is at least the rounding of the readings.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReadingNoise {
    source: NoiseSource,
    relative: f64,
}

/// Second-order expansion of a reading's negative log-likelihood in its misfit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Expansion {
    /// w.
    pub(super) standardised: f64,
    /// Twice the negative log-likelihood, up to a constant.
    pub(super) deviance: f64,
    pub(super) slope: f64,
    /// A non-negative approximation of the second derivative.
    pub(super) curvature: f64,
}

/// Smallest ratio of reading to model, and largest ratio of noise to reading, whose squares are finite.
const SMALLEST_RATIO: f64 = 1e-100;
const LARGEST_ADDITIVE: f64 = 1e100;

impl ReadingNoise {
    pub(super) fn new(source: NoiseSource) -> Self {
        Self {
            relative: libm::hypot(source.noise.relative, ROUNDING),
            source,
        }
    }

    /// True if readings are exact apart from their rounding.
    pub(super) fn is_none(&self) -> bool {
        self.source.is_none()
    }

    /// Standard deviation of the gain error that a snapshot's readings share.
    pub(super) fn drift(&self) -> f64 {
        self.source.noise.drift
    }

    /// Expands the likelihood of `reading_ohm` at this misfit.
    pub(super) fn expand(&self, reading_ohm: f64, misfit: f64) -> Expansion {
        match self.source.rounded_from_ohm(reading_ohm) {
            Some((0.0, f64::INFINITY)) => Expansion::default(),
            Some((lowest, f64::INFINITY)) => self.expand_bound(lowest / reading_ohm, reading_ohm, misfit, 1.0),
            Some((0.0, highest)) => self.expand_bound(highest / reading_ohm, reading_ohm, misfit, -1.0),
            Some((lowest, highest)) => {
                let step_ohm = (highest - lowest) / 12.0_f64.sqrt();
                self.expand_normal(
                    libm::hypot(self.source.noise.additive_ohm, step_ohm) / reading_ohm,
                    misfit,
                )
            }
            None => self.expand_normal(self.source.noise.additive_ohm / reading_ohm, misfit),
        }
    }

    fn expand_normal(&self, additive: f64, misfit: f64) -> Expansion {
        let additive = additive.min(LARGEST_ADDITIVE);
        let ratio = (1.0 + misfit).max(SMALLEST_RATIO);
        let deviation = self.deviation(additive, ratio);
        let (of_relative, of_additive) = (self.relative / deviation, additive / deviation);
        let standardised = misfit / deviation;
        let scale = (of_relative * of_relative + of_additive * of_additive * ratio) / deviation;
        let normaliser = of_relative * of_relative / ratio;
        Expansion {
            standardised,
            deviance: standardised * standardised + 2.0 * (deviation / ratio).ln(),
            slope: standardised * scale - normaliser,
            curvature: scale * scale + normaliser / ratio,
        }
    }

    /// Expands the likelihood of a resistance above (`sign` 1) or below (−1) the bound `edge` · `reading_ohm`: a
    /// half-parabola outside.
    fn expand_bound(&self, edge: f64, reading_ohm: f64, misfit: f64, sign: f64) -> Expansion {
        let ratio = (1.0 + misfit).max(SMALLEST_RATIO) * edge;
        let beyond = ratio - 1.0;
        if sign * beyond <= 0.0 {
            return Expansion::default();
        }
        let deviation = self.deviation(self.source.noise.additive_ohm / (edge * reading_ohm), ratio);
        let (standardised, scale) = (beyond / deviation, edge / deviation);
        Expansion {
            standardised,
            deviance: standardised * standardised,
            slope: standardised * scale,
            curvature: scale * scale,
        }
    }

    fn deviation(&self, additive: f64, ratio: f64) -> f64 {
        if additive == 0.0 {
            self.relative
        } else {
            libm::hypot(self.relative, additive * ratio)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{scene::Noise, sensor::SensorModel};

    fn of(noise: Noise) -> ReadingNoise {
        ReadingNoise::new(noise.source(&SensorModel::new("2x3_2x9".parse().unwrap())).unwrap())
    }

    /// Against the normal density of the reading, and difference quotients of it.
    #[test]
    fn the_deviance_is_that_of_the_normal_density_and_the_slope_its_derivative() {
        for (relative, additive_ohm) in [(0.1, 0.0), (0.0, 3.0), (0.05, 2.0), (1e-3, 0.0), (1.0, 40.0)] {
            let noise = of(Noise {
                additive_ohm,
                ..Noise::relative(relative)
            });
            let reading_ohm = 37.0;
            let deviance = |resistance_ohm: f64| {
                let deviation = f64::hypot(relative * resistance_ohm, additive_ohm);
                ((reading_ohm - resistance_ohm) / deviation).powi(2) + 2.0 * deviation.ln()
            };
            let misfit_at = |resistance_ohm: f64| reading_ohm / resistance_ohm - 1.0;
            let of_misfit = |misfit: f64| noise.expand(reading_ohm, misfit);
            for (a, b) in [(36.0, 39.0), (20.0, 37.0), (90.0, 40.0)] {
                let ours = of_misfit(misfit_at(a)).deviance - of_misfit(misfit_at(b)).deviance;
                let truth = deviance(a) - deviance(b);
                assert!(
                    (ours - truth).abs() < 1e-9 * (1.0 + truth.abs()),
                    "{relative} {additive_ohm}: {ours} {truth}"
                );
                let (misfit, step) = (misfit_at(a), 1e-6);
                let quotient = (of_misfit(misfit + step).deviance - of_misfit(misfit - step).deviance) / (2.0 * step);
                let slope = 2.0 * of_misfit(misfit).slope;
                assert!(
                    (quotient - slope).abs() < 1e-6 * slope.abs() + 1e-6,
                    "{relative}: {quotient} {slope}"
                );
            }
        }
    }

    /// A clipped reading only says that the resistance is at least as large.
    #[test]
    fn clipped_readings_are_bounds() {
        let noise = of(Noise {
            converter_bits: Some(8),
            ..Noise::relative(1e-3)
        });
        let (_, top_ohm) = Noise {
            converter_bits: Some(8),
            ..Noise::default()
        }
        .range_ohm(&SensorModel::new("2x3_2x9".parse().unwrap()))
        .unwrap();
        assert_eq!(noise.expand(top_ohm, -0.5), Expansion::default());
        let beyond = noise.expand(top_ohm, 0.5);
        assert!(beyond.slope > 0.0 && beyond.standardised > 100.0, "{beyond:?}");
    }

    #[test]
    fn expansions_of_extreme_readings_are_finite() {
        for noise in [
            Noise::default(),
            Noise::relative(1.0),
            Noise {
                additive_ohm: 1e12,
                ..Noise::default()
            },
        ] {
            for reading_ohm in [1e-300, 1e-12, 1.0, 1e12, 1e300] {
                for misfit in [-1.0, -1.0 + 1e-16, 0.0, 1e-16, 1e24] {
                    let found = of(noise).expand(reading_ohm, misfit);
                    let values = [found.standardised, found.slope, found.curvature];
                    assert!(
                        values.iter().all(|value| value.is_finite()),
                        "{reading_ohm:e} {misfit:e}: {found:?}"
                    );
                }
            }
        }
    }
}
