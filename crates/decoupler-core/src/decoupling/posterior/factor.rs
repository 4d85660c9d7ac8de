use rand::Rng;

use super::pack::Pack;
use crate::{decoupling::row_problem::Range, scene::standard_normal};

/// A Gaussian factor `exp(−½ precision t² + linear t)`, possibly flat.
#[derive(Clone, Copy, Debug)]
pub(super) struct Factor<T = f64> {
    pub(super) precision: T,
    pub(super) linear: T,
}

/// Ranges side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ranges {
    pub(super) lowest: Pack,
    pub(super) highest: Pack,
    middle: Pack,
}

impl Factor {
    /// Returns the factor of t + `shift` as a function of t.
    pub(super) fn shifted(self, shift: f64) -> Self {
        Self {
            precision: self.precision,
            linear: self.linear - self.precision * shift,
        }
    }
}

impl Factor<Pack> {
    pub(super) const FLAT: Self = Self {
        precision: Pack::ZERO,
        linear: Pack::ZERO,
    };

    pub(super) fn set(&mut self, lane: usize, factor: Factor) {
        self.precision.set(lane, factor.precision);
        self.linear.set(lane, factor.linear);
    }

    pub(super) fn get(&self, lane: usize) -> Factor {
        Factor {
            precision: self.precision.get(lane),
            linear: self.linear.get(lane),
        }
    }

    /// Returns the factors of t if these are the factors of t + ε, with normal ε of variance `noise`.
    #[inline(always)]
    pub(super) fn blurred(self, noise: f64) -> Self {
        if noise == 0.0 {
            return self;
        }
        let share = Pack::ONE / (Pack::ONE + self.precision.max(Pack::ZERO) * Pack::splat(noise));
        Self {
            precision: self.precision * share,
            linear: self.linear * share,
        }
    }
}

impl Ranges {
    /// Zero-width ranges at 0.
    pub(super) const NONE: Self = Self {
        lowest: Pack::ZERO,
        highest: Pack::ZERO,
        middle: Pack::ZERO,
    };

    pub(super) fn set(&mut self, lane: usize, range: Range) {
        self.lowest.set(lane, range.lowest);
        self.highest.set(lane, range.highest);
        self.middle.set(lane, range.middle());
    }

    /// Clamps to the ranges; their middles for NaN.
    #[inline(always)]
    pub(super) fn clamp(&self, values: Pack) -> Pack {
        let raised = self.lowest.max(values);
        self.highest.min(raised).unless_nan(self.middle)
    }
}

/// A Gaussian around a point, with precision `JᵀJ + least · I = L Lᵀ`.
#[derive(Clone, Debug)]
pub(super) struct Component {
    centre: Vec<f64>,
    /// L without the entries above the diagonal, row by row.
    root: Vec<f64>,
    /// ln det L.
    log_determinant: f64,
}

/// An equally weighted mixture of Gaussians.
#[derive(Clone, Debug)]
pub(super) struct Mixture {
    components: Vec<Component>,
}

/// Index of entry (i, j), j ≤ i, of a triangular matrix.
fn place(i: usize, j: usize) -> usize {
    i * (i + 1) / 2 + j
}

impl Component {
    /// Computes the component from J (row by row, as wide as `centre` is long); `None` if numbers overflow.
    pub(super) fn new(centre: &[f64], jacobian: &[f64], least: f64) -> Option<Self> {
        let d = centre.len();
        let mut root = vec![0.0; place(d, 0)];
        for row in jacobian.chunks_exact(d) {
            for i in 0..d {
                let entries = &mut root[place(i, 0)..=place(i, i)];
                (entries.iter_mut().zip(row)).for_each(|(entry, value)| *entry += row[i] * value);
            }
        }
        // Cholesky factorisation in place.
        let mut log_determinant = 0.0;
        for i in 0..d {
            root[place(i, i)] += least;
            for j in 0..=i {
                let (of_i, of_j) = (place(i, 0), place(j, 0));
                let sum: f64 = (0..j).map(|k| root[of_i + k] * root[of_j + k]).sum();
                let rest = root[of_i + j] - sum;
                if i == j {
                    // Rounding of a large sum may cancel the contribution of `least`.
                    let pivot = rest.max(least).sqrt();
                    log_determinant += pivot.ln();
                    root[of_i + i] = pivot;
                } else {
                    root[of_i + j] = rest / root[of_j + j];
                }
            }
        }
        log_determinant.is_finite().then(|| Self {
            centre: centre.to_vec(),
            root,
            log_determinant,
        })
    }

    /// Solves `L Lᵀ x = right`.
    pub(super) fn solve(&self, right: &[f64]) -> Vec<f64> {
        let mut x = right.to_vec();
        for i in 0..x.len() {
            let sum: f64 = (0..i).map(|j| self.root[place(i, j)] * x[j]).sum();
            x[i] = (x[i] - sum) / self.root[place(i, i)];
        }
        self.solve_transposed(&mut x);
        x
    }

    /// Solves `Lᵀ x = right` in place.
    fn solve_transposed(&self, x: &mut [f64]) {
        for i in (0..x.len()).rev() {
            x[i] /= self.root[place(i, i)];
            let (before, at) = x.split_at_mut(i);
            let entries = &self.root[place(i, 0)..];
            (before.iter_mut().zip(entries)).for_each(|(value, entry)| *value -= entry * at[0]);
        }
    }

    fn draw(&self, rng: &mut impl Rng) -> Vec<f64> {
        let mut x: Vec<f64> = self.centre.iter().map(|_| standard_normal(rng)).collect();
        self.solve_transposed(&mut x);
        (x.iter_mut().zip(&self.centre)).for_each(|(x, centre)| *x += centre);
        x
    }

    /// Logarithm of the density, without the factor √(2π) of each variable; uses a vector as scratch.
    fn log_density(&self, x: &[f64], product: &mut [f64]) -> f64 {
        product.fill(0.0);
        let mut begin = 0;
        for (i, (x, centre)) in x.iter().zip(&self.centre).enumerate() {
            let apart = x - centre;
            let row = &self.root[begin..=begin + i];
            (product.iter_mut().zip(row)).for_each(|(sum, entry)| *sum += entry * apart);
            begin += i + 1;
        }
        self.log_determinant - 0.5 * product.iter().map(|value| value * value).sum::<f64>()
    }
}

impl Mixture {
    /// `None` without components.
    pub(super) fn new(components: Vec<Component>) -> Option<Self> {
        (!components.is_empty()).then_some(Self { components })
    }

    /// Number of components.
    pub(super) fn components(&self) -> usize {
        self.components.len()
    }

    /// Draws from a component.
    pub(super) fn draw(&self, component: usize, rng: &mut impl Rng) -> Vec<f64> {
        self.components[component].draw(rng)
    }

    /// Logarithm of the density, without the factor √(2π) of each variable.
    pub(super) fn log_density(&self, x: &[f64]) -> f64 {
        let mut apart = vec![0.0; x.len()];
        let logs: Vec<f64> = self
            .components
            .iter()
            .map(|component| component.log_density(x, &mut apart))
            .collect();
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = logs.iter().map(|log| (log - largest).exp()).sum();
        largest + (sum / logs.len() as f64).ln()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shifted_factor_is_the_shifted_function() {
        let factor = Factor {
            precision: 3.0,
            linear: 1.5,
        };
        let log = |factor: Factor, t: f64| factor.linear * t - 0.5 * factor.precision * t * t;
        let shifted = factor.shifted(0.7);
        // Up to a constant.
        let difference = |t: f64| log(factor, t + 0.7) - log(shifted, t);
        assert!((difference(-2.0) - difference(5.0)).abs() < 1e-12);
    }
}
