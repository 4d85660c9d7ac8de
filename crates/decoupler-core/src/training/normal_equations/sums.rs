//! Sums over samples that the equations are made of.

use faer::{Mat, MatRef};

use crate::network::Shape;

/// Sums over samples.
pub(super) struct Sums {
    pub(super) shape: Shape,
    /// The entries of BᵀB that the solver needs.
    pub(super) gram: Mat<f64>,
    /// C: h·n1 × (h+1), column by column without gaps, so that it is also n1 × h(h+1).
    pub(super) c: Vec<f64>,
    /// H̃ᵀH̃.
    pub(super) g: Mat<f64>,
    /// Jwᵀe: n1 × h.
    pub(super) gradient_w: Mat<f64>,
    /// Jvᵀe: (h+1) × outputs.
    pub(super) gradient_v: Mat<f64>,
}

impl Sums {
    pub(super) fn new(shape: Shape, (rows, columns): (usize, usize)) -> Self {
        let (h, n1, h1) = (shape.hidden, shape.inputs + 1, shape.hidden + 1);
        Self {
            shape,
            gram: Mat::zeros(rows, columns),
            c: vec![0.0; h * n1 * h1],
            g: Mat::zeros(h1, h1),
            gradient_w: Mat::zeros(n1, h),
            gradient_v: Mat::zeros(h1, shape.outputs),
        }
    }

    /// C: h·n1 × (h+1).
    pub(super) fn c(&self) -> MatRef<'_, f64> {
        let h1 = self.shape.hidden + 1;
        MatRef::from_column_major_slice(&self.c, self.shape.hidden_weights(), h1)
    }

    pub(super) fn clear(&mut self) {
        self.c.fill(0.0);
        for sum in [&mut self.gram, &mut self.g, &mut self.gradient_w, &mut self.gradient_v] {
            sum.fill(0.0);
        }
    }

    /// Adds the sums of another part.
    pub(super) fn add(&mut self, other: &Self) {
        self.c.iter_mut().zip(&other.c).for_each(|(sum, value)| *sum += value);
        self.gram += &other.gram;
        self.g += &other.g;
        self.gradient_w += &other.gradient_w;
        self.gradient_v += &other.gradient_v;
    }
}
