/// A Gaussian in square-root form: mean and a factor L of the covariance `Σ = L Lᵀ`.
///
/// Precision matrices square the condition number of the equations; at a noise near rounding nothing would be left of
/// what the other factors add. L comes from a QR decomposition of the equations themselves, and factors that are added
/// later update L, not Σ (Potter's square-root filter; Bierman, Factorization Methods for Discrete Sequential
/// Estimation, 1977, section V.2). Variances are sums of squares.
pub(super) struct Gaussian {
    /// Mean, padded to whole vector registers like the columns of L.
    mean: Vec<f64>,
    /// L, column by column, each padded with zeros.
    root: Vec<f64>,
    /// Length of a padded column.
    stride: usize,
    /// Lᵀa of the direction that was asked for last.
    along: Vec<f64>,
    /// Covariances of all unknowns with that direction, padded.
    covariances: Vec<f64>,
}

/// Columns are padded to a multiple of this number.
const LANES: usize = 4;

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
    #[inline(always)]
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
            let (mut pivot, mut square) = (k, -1.0);
            for column in k..n {
                let rest = &columns[column * m + k..(column + 1) * m];
                let squares = dot(rest, rest);
                if squares > square {
                    (pivot, square) = (column, squares);
                }
            }
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
        let stride = n.next_multiple_of(LANES);
        let mut root = vec![0.0; n * stride];
        let mut row = vec![0.0; n];
        // x = L (Qᵀb + Lᵀc).
        let mut right = columns[n * m..n * m + n].to_vec();
        for (i, &unknown) in order.iter().enumerate() {
            row[i] = 1.0 / r(i, i);
            for j in i + 1..n {
                let sum = dot(&row[i..j], &columns[j * m + i..j * m + j]);
                row[j] = -sum / r(j, j);
            }
            for (j, &value) in row.iter().enumerate().skip(i) {
                root[j * stride + unknown] = value;
                right[j] += linear[unknown] * value;
            }
        }
        let mut mean = vec![0.0; stride];
        for (column, &value) in root.chunks_exact(stride).zip(&right) {
            add(&mut mean, value, column);
        }
        Some(Self {
            mean,
            root,
            stride,
            along: vec![0.0; n],
            covariances: vec![0.0; stride],
        })
    }

    /// Mean and variance along `direction`.
    #[inline(always)]
    pub(super) fn marginal(&mut self, direction: Direction<'_>) -> (f64, f64) {
        let columns = self.root.chunks_exact(self.stride);
        let mean = match direction {
            Direction::Unknown(unknown) => {
                for (along, column) in self.along.iter_mut().zip(columns) {
                    *along = column[unknown];
                }
                self.mean[unknown]
            }
            Direction::Form(form) => {
                for (along, column) in self.along.iter_mut().zip(columns) {
                    *along = dot(form, &column[..form.len()]);
                }
                dot(form, &self.mean[..form.len()])
            }
        };
        (mean, dot(&self.along, &self.along))
    }

    /// Multiplies by `exp(−½ precision t² + linear t)` with t along the direction of the last [`Self::marginal`], which
    /// gave `mean` and `variance`. False if that leaves no Gaussian.
    #[inline(always)]
    pub(super) fn multiply(&mut self, mean: f64, variance: f64, precision: f64, linear: f64) -> bool {
        let left = 1.0 + precision * variance;
        if !(left > 0.0 && left.is_finite()) {
            return false;
        }
        let shift = linear - precision / left * (mean + linear * variance);
        // Σ − precision/left Σ a aᵀ Σ = M Mᵀ with M = L − shrink L (Lᵀa) (Lᵀa)ᵀ.
        let shrink = precision / (left + left.sqrt());
        self.project();
        add_blocks(&mut self.mean, shift, &self.covariances);
        for (column, &along) in self.root.chunks_exact_mut(self.stride).zip(&self.along) {
            add_blocks(column, -shrink * along, &self.covariances);
        }
        true
    }
}

impl Gaussian {
    /// Computes L Lᵀa. Each block of unknowns stays in registers.
    #[inline(always)]
    fn project(&mut self) {
        let (blocks, along) = (self.covariances.as_chunks_mut::<LANES>().0, &self.along);
        for (block, covariances) in blocks.iter_mut().enumerate() {
            let (mut even, mut odd) = ([0.0; LANES], [0.0; LANES]);
            let column = |index: usize| -> &[f64; LANES] {
                let begin = index * self.stride + block * LANES;
                self.root[begin..begin + LANES].try_into().expect("a block")
            };
            let pairs = along.as_chunks::<2>();
            for (pair, along) in pairs.0.iter().enumerate() {
                let (of_even, of_odd) = (column(2 * pair), column(2 * pair + 1));
                for lane in 0..LANES {
                    even[lane] += along[0] * of_even[lane];
                    odd[lane] += along[1] * of_odd[lane];
                }
            }
            if let [along] = pairs.1 {
                let of_even = column(2 * pairs.0.len());
                for lane in 0..LANES {
                    even[lane] += along * of_even[lane];
                }
            }
            for lane in 0..LANES {
                covariances[lane] = even[lane] + odd[lane];
            }
        }
    }
}

/// Adds `factor` times `from`, both whole registers.
#[inline(always)]
fn add_blocks(to: &mut [f64], factor: f64, from: &[f64]) {
    for (to, from) in to
        .as_chunks_mut::<LANES>()
        .0
        .iter_mut()
        .zip(from.as_chunks::<LANES>().0)
    {
        for lane in 0..LANES {
            to[lane] += factor * from[lane];
        }
    }
}

/// In four strands of fixed order. Chunks are arrays, for slices of them are not compiled for vector registers.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a4, a_rest), (b4, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    let mut sums = [0.0; LANES];
    for (a, b) in a4.iter().zip(b4) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

#[inline(always)]
fn add(to: &mut [f64], factor: f64, from: &[f64]) {
    let ((to4, to_rest), (from4, from_rest)) = (to.as_chunks_mut::<LANES>(), from.as_chunks::<LANES>());
    for (to, from) in to4.iter_mut().zip(from4) {
        for lane in 0..LANES {
            to[lane] += factor * from[lane];
        }
    }
    for (to, from) in to_rest.iter_mut().zip(from_rest) {
        *to += factor * from;
    }
}
