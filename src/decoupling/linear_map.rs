use faer::Mat;
use ndarray::{Array2, ArrayView2, Axis, Slice};

use super::Decoupler;
use crate::{
    dataset::Dataset,
    network::{MinMax, ScalingError},
};

/// The affine map from resistances to coordinates that fits the training set best in the least-squares sense.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearMap {
    inputs: MinMax,
    /// (varying inputs + 1) × varying outputs, the constant last.
    coefficients: Array2<f64>,
    outputs: MinMax,
}

impl LinearMap {
    /// Fits by the singular value decomposition of the scaled resistances; directions that the training set does not
    /// resolve (singular values below rounding) are left out, which gives the smallest map among equals.
    ///
    /// # Errors
    /// Values that cannot be scaled.
    pub fn fit(training: &Dataset) -> Result<Self, ScalingError> {
        let inputs = MinMax::fit(training.resistances_ohm.view())?;
        let outputs = MinMax::fit(training.coordinates_mm.view())?;
        let (n1, m) = (inputs.varying().len() + 1, outputs.varying().len());
        let triangle = triangle(training, &inputs, &outputs);
        let rows = n1.min(triangle.nrows());
        let (a, y) = triangle.as_ref().subrows(0, rows).split_at_col(n1);
        // Finite input always converges; a zero map is the honest answer if it ever does not.
        let fitted = a.thin_svd().ok().map(|svd| {
            let singular = svd.S().column_vector();
            let smallest = f64::EPSILON * training.samples().max(n1) as f64 * singular[0];
            let mut projected = svd.U().transpose() * y;
            for (k, &value) in singular.iter().enumerate() {
                let inverse = if value > smallest { 1.0 / value } else { 0.0 };
                projected.row_mut(k).iter_mut().for_each(|entry| *entry *= inverse);
            }
            svd.V() * projected
        });
        let coefficients = Array2::from_shape_fn((n1, m), |(i, t)| fitted.as_ref().map_or(0.0, |b| b[(i, t)]));
        Ok(Self {
            inputs,
            coefficients,
            outputs,
        })
    }
}

/// The triangular factor of [inputs, 1, outputs], all scaled: its least-squares problems are those of the whole set. Found
/// a chunk of samples at a time, each joined to the factor of those before it, so that memory does not grow with
/// their number (Golub and Van Loan, Matrix Computations, section 6.5.2).
fn triangle(training: &Dataset, inputs: &MinMax, outputs: &MinMax) -> Mat<f64> {
    /// Samples of a chunk.
    const CHUNK: usize = 512;
    let columns = inputs.varying().len() + 1 + outputs.varying().len();
    let mut factor = Mat::<f64>::zeros(0, columns);
    for first in (0..training.samples()).step_by(CHUNK) {
        let chunk = Slice::from(first..training.samples().min(first + CHUNK));
        let x = inputs.scale(training.resistances_ohm.slice_axis(Axis(0), chunk));
        let y = outputs.scale(training.coordinates_mm.slice_axis(Axis(0), chunk));
        let (before, n) = (factor.nrows(), x.ncols());
        let joined = Mat::from_fn(before + x.nrows(), columns, |row, column| {
            if row < before {
                factor[(row, column)]
            } else if column < n {
                x[[row - before, column]]
            } else if column == n {
                1.0
            } else {
                y[[row - before, column - n - 1]]
            }
        });
        factor = joined.qr().thin_R().to_owned();
    }
    factor
}

impl Decoupler for LinearMap {
    fn decouple(&self, resistances_ohm: ArrayView2<'_, f64>) -> Array2<f64> {
        let scaled = self.inputs.scale(resistances_ohm);
        let n = scaled.ncols();
        let answer = scaled.dot(&self.coefficients.slice_axis(Axis(0), Slice::from(..n))) + self.coefficients.row(n);
        self.outputs.restore(answer.view())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        dataset::{Seed, Stream},
        scene::Scene,
        sensor::SensorModel,
    };

    fn draw(scale: &str, samples: usize) -> Dataset {
        let model = SensorModel::new(scale.parse().unwrap());
        Dataset::simulate(&model, &Scene::default(), samples, &mut Seed(0).rng(Stream::Training)).unwrap()
    }

    #[test]
    fn an_affine_relation_is_found_exactly() {
        let mut set = draw("10x6_3x18", 300);
        let readings = set.resistances_ohm.clone();
        for (mut target, reading) in set.coordinates_mm.rows_mut().into_iter().zip(readings.rows()) {
            target[2] = 3.0 * reading[0] - 0.5 * reading[17] + 4.0;
        }
        let answer = LinearMap::fit(&set).unwrap().decouple(readings.view());
        for (ours, truth) in answer.column(2).iter().zip(set.coordinates_mm.column(2)) {
            assert!((ours - truth).abs() < 1e-10 * truth.abs());
        }
    }

    #[test]
    fn too_few_or_duplicate_samples_give_a_finite_map() {
        for set in [
            draw("1x6_3x18", 1),
            draw("1x6_3x18", 2),
            draw("10x6_3x18", 10).select(&[3; 50]),
        ] {
            let answer = LinearMap::fit(&set)
                .unwrap()
                .decouple(draw("10x6_3x18", 10).resistances_ohm.view());
            assert!(answer.iter().all(|value| value.is_finite()));
        }
    }
}
