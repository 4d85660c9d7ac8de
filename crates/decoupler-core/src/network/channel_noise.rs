/// Errors of the values of each channel: standard deviations in the unit of the values.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelNoise {
    /// Independent error of each channel.
    pub own: Vec<f64>,
    /// Error common to all channels, which are all up or all down together: a drift.
    pub common: Vec<f64>,
}

impl ChannelNoise {
    /// No error in any channel.
    pub fn none(channels: usize) -> Self {
        Self {
            own: vec![0.0; channels],
            common: vec![0.0; channels],
        }
    }

    /// Variance of the error of Σ weight · value.
    pub fn variance(&self, weights: impl IntoIterator<Item = f64>) -> f64 {
        let (mut own, mut common) = (0.0, 0.0);
        for (weight, (of_own, of_common)) in weights.into_iter().zip(self.own.iter().zip(&self.common)) {
            own += (weight * of_own).powi(2);
            common += weight * of_common;
        }
        own + common * common
    }

    /// Returns `true` if no channel has an error.
    pub fn is_none(&self) -> bool {
        self.own.iter().chain(&self.common).all(|&deviation| deviation == 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::normal::standard_normal;
    use rand::{SeedableRng, rngs::ChaCha8Rng};

    #[test]
    fn the_variance_of_a_sum_is_that_of_samples() {
        let noise = ChannelNoise {
            own: vec![0.1, 0.4, 0.0],
            common: vec![0.2, 0.3, -0.5],
        };
        let weights = [1.0, -2.0, 0.5];
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let draws = 40_000;
        let squares: f64 = (0..draws)
            .map(|_| {
                let drift = standard_normal(&mut rng);
                let error = |c: usize, own: f64| weights[c] * (noise.own[c] * own + noise.common[c] * drift);
                let sum: f64 = (0..3).map(|c| error(c, standard_normal(&mut rng))).sum();
                sum * sum
            })
            .sum();
        let ratio = noise.variance(weights) / (squares / f64::from(draws));
        assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
        assert!(!noise.is_none() && ChannelNoise::none(3).is_none());
    }
}
