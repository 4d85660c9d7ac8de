/// A Gaussian in square-root form: mean and a factor L of the covariance `Σ = L Lᵀ`.
///
/// Precision matrices square the condition number of the equations; at a noise near rounding nothing would be left of
/// what the other factors add. L comes from a QR decomposition of the equations themselves, and factors that are added
/// later update L, not Σ (Potter's square-root filter; Bierman, Factorization Methods for Discrete Sequential
/// Estimation, 1977, section V.2). Variances are sums of squares.
pub(super) struct Gaussian {
    mean: Vec<f64>,
    /// L, row by row.
    root: Vec<f64>,
    /// Lᵀa of the direction that was asked for last.
    along: Vec<f64>,
}

/// A direction in the space of the unknowns.
#[derive(Clone, Copy)]
pub(super) enum Direction<'a> {
    /// One unknown.
    Unknown(usize),
    /// A linear form: one coefficient for each unknown.
    Form(&'a [f64]),
}

impl Gaussian {
    /// `p(x) ∝ exp(−½ ‖A x − b‖² + cᵀ x)` with `rows` = `[A, b]` row by row; `None` unless the rows determine all of x.
    ///
    /// Householder's method with column pivoting, which is stable row by row when the rows differ in size by many
    /// decades (Cox and Higham 1998).
    pub(super) fn new(rows: &[f64], linear: &[f64]) -> Option<Self> {
        let n = linear.len();
        let m = rows.len() / (n + 1);
        if m < n {
            return None;
        }
        // Column by column, the right side last.
        let mut columns: Vec<f64> = Vec::with_capacity(rows.len());
        for column in 0..=n {
            columns.extend(rows.iter().skip(column).step_by(n + 1));
        }
        let mut order: Vec<usize> = (0..n).collect();
        for k in 0..n {
            let squares =
                |column: usize| -> f64 { columns[column * m + k..(column + 1) * m].iter().map(|x| x * x).sum() };
            let (pivot, square) = (k..n)
                .map(|column| (column, squares(column)))
                .fold((k, -1.0), |best, next| if next.1 > best.1 { next } else { best });
            if !(square > 0.0 && square.is_finite()) {
                return None;
            }
            if pivot != k {
                order.swap(k, pivot);
                let (left, right) = columns.split_at_mut(pivot * m);
                left[k * m..(k + 1) * m].swap_with_slice(&mut right[..m]);
            }
            let (done, rest) = columns.split_at_mut((k + 1) * m);
            let reflector = &mut done[k * m + k..];
            let length = square.sqrt();
            let diagonal = if reflector[0] > 0.0 { -length } else { length };
            // v = x − diagonal e₁ has vᵀv = 2 length (length + |x₁|).
            reflector[0] -= diagonal;
            let scale = 1.0 / (length * reflector[0].abs());
            for column in rest.chunks_exact_mut(m) {
                let column = &mut column[k..];
                let product = scale * dot(reflector, column);
                add(column, -product, reflector);
            }
            reflector[0] = diagonal;
        }
        let r = |i: usize, j: usize| columns[j * m + i];
        // L = P R⁻¹: row i of R⁻¹ belongs to unknown order[i].
        let mut root = vec![0.0; n * n];
        for (i, &unknown) in order.iter().enumerate() {
            let row = &mut root[unknown * n..(unknown + 1) * n];
            row[i] = 1.0 / r(i, i);
            for j in i + 1..n {
                let sum = dot(&row[i..j], &columns[j * m + i..j * m + j]);
                row[j] = -sum / r(j, j);
            }
        }
        // x = L (Qᵀb + Lᵀc).
        let mut right = columns[n * m..n * m + n].to_vec();
        for (unknown, &value) in linear.iter().enumerate() {
            add(&mut right, value, &root[unknown * n..(unknown + 1) * n]);
        }
        let mean = root.chunks_exact(n).map(|row| dot(row, &right)).collect();
        Some(Self {
            mean,
            root,
            along: vec![0.0; n],
        })
    }

    /// Mean and variance along `direction`.
    pub(super) fn marginal(&mut self, direction: Direction<'_>) -> (f64, f64) {
        let n = self.mean.len();
        let mean = match direction {
            Direction::Unknown(unknown) => {
                self.along.copy_from_slice(&self.root[unknown * n..(unknown + 1) * n]);
                self.mean[unknown]
            }
            Direction::Form(form) => {
                self.along.fill(0.0);
                for (&value, row) in form.iter().zip(self.root.chunks_exact(n)) {
                    add(&mut self.along, value, row);
                }
                dot(form, &self.mean)
            }
        };
        (mean, dot(&self.along, &self.along))
    }

    /// Multiplies by `exp(−½ precision t² + linear t)` with t along the direction of the last [`Self::marginal`], which
    /// gave `mean` and `variance`. False if that leaves no Gaussian.
    pub(super) fn multiply(&mut self, mean: f64, variance: f64, precision: f64, linear: f64) -> bool {
        let left = 1.0 + precision * variance;
        if !(left > 0.0 && left.is_finite()) {
            return false;
        }
        let shift = linear - precision / left * (mean + linear * variance);
        // Σ − precision/left Σ a aᵀ Σ = M Mᵀ with M = L − shrink L (Lᵀa) (Lᵀa)ᵀ.
        let shrink = precision / (left + left.sqrt());
        for (row, mean) in self.root.chunks_exact_mut(self.along.len()).zip(&mut self.mean) {
            let covariance = dot(row, &self.along);
            *mean += shift * covariance;
            add(row, -shrink * covariance, &self.along);
        }
        true
    }
}

/// In four strands, which the compiler turns into vectors.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(a, b)| a * b).sum();
    let mut sums = [0.0; 4];
    for (a, b) in a4.zip(b4) {
        for lane in 0..4 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

fn add(to: &mut [f64], factor: f64, from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += factor * from;
    }
}
