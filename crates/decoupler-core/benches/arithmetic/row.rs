//! Minimum arithmetic of decoding a row, in plain loops.

use std::hint::black_box;

use decoupler_core::sensor::ArrayScale;
use pulp::{Simd, WithSimd};

/// Number of square roots, divisions and products that any decoder needs for a row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowArithmetic {
    pub(crate) roots: usize,
    pub(crate) divisions: usize,
    pub(crate) products: usize,
}

impl RowArithmetic {
    /// Arithmetic of `evaluations` of Eq. (2) and its derivatives along z, each with its normal equations and their
    /// factorisation.
    pub(crate) fn of_newton(scale: ArrayScale, evaluations: usize) -> Self {
        let (nodes, columns) = (scale.nodes_per_row(), scale.columns());
        let distances = nodes * scale.nodes_per_column() * columns;
        let equations = (nodes + 1) * (nodes + 2) / 2 * columns;
        Self {
            roots: evaluations * distances,
            divisions: evaluations * distances,
            products: evaluations * (3 * distances + equations + nodes * nodes * nodes / 6),
        }
    }

    /// Returns the work of `rows` rows in plain loops.
    pub(crate) fn work(self, rows: usize) -> impl FnMut() {
        struct Loops<'a>(&'a mut [f64], &'a mut [f64], &'a [f64]);
        impl WithSimd for Loops<'_> {
            type Output = f64;

            #[inline(always)]
            fn with_simd<S: Simd>(self, _: S) -> f64 {
                const LANES: usize = 8;
                for value in self.0 {
                    *value = (*value + 30.0).sqrt();
                }
                for value in self.1 {
                    *value = 1.0 / *value;
                }
                let mut sums = [[0.0; LANES]; 4];
                for blocks in self.2.as_chunks::<LANES>().0.as_chunks::<4>().0 {
                    for (sums, block) in sums.iter_mut().zip(blocks) {
                        for lane in 0..LANES {
                            sums[lane] += 0.7 * block[lane];
                        }
                    }
                }
                sums.as_flattened().iter().sum()
            }
        }
        let (mut roots, mut quotients) = (vec![1.0; self.roots], vec![1.5; self.divisions]);
        let factors = vec![0.01; self.products];
        move || {
            for _ in 0..rows {
                black_box(pulp::Arch::new().dispatch(Loops(&mut roots, &mut quotients, &factors)));
            }
        }
    }
}
