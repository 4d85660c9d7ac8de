use super::triangle::Triangle;

/// Least squares with bounds, `min ‖A x − b‖²` with lowest ≤ x ≤ highest, for A of full column rank: block principal
/// pivoting on the triangular factor of A (Portugal, Júdice and Vicente 1994). Reuses its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct BoundedLeastSquares {
    /// Factor of [A, b].
    whole: Triangle,
    /// Factor of the columns of the free unknowns.
    free: Triangle,
    free_system: Vec<f64>,
    free_solution: Vec<f64>,
    places: Vec<Place>,
    solution: Vec<f64>,
    /// R x − Qᵀb.
    residual: Vec<f64>,
    /// Unknowns in the wrong place, with their right ones.
    wrong: Vec<(usize, Place)>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Free,
    Lowest,
    Highest,
}

/// Distance beyond a bound, in units of the unknowns, and slope relative to its terms, that are rounding.
const TOLERANCE: f64 = 1e-12;
/// Exchanges of all wrong unknowns at once that may fail to reduce their number; then they are exchanged one by one,
/// which always ends (Murty 1974).
const BLOCK_EXCHANGES: usize = 3;

impl BoundedLeastSquares {
    /// Solves the `system` [A, b] (row by row, `width` columns), with [`root` · I, 0] appended below unless `root` is 0.
    pub(super) fn solve(&mut self, system: &[f64], width: usize, root: f64, bounds: &[(f64, f64)]) -> &[f64] {
        let n = width - 1;
        self.factor(system, width, root);
        self.whole.solve(&mut self.solution);
        self.places.clear();
        self.places.resize(n, Place::Free);
        let (mut fewest, mut chances) = (usize::MAX, BLOCK_EXCHANGES);
        for _ in 0..20 + 5 * n {
            self.find_wrong(bounds);
            let count = self.wrong.len();
            if count == 0 {
                break;
            }
            if count < fewest {
                (fewest, chances) = (count, BLOCK_EXCHANGES);
            } else if chances > 0 {
                chances -= 1;
            } else {
                self.wrong.drain(..count - 1);
            }
            for &(unknown, place) in &self.wrong {
                self.places[unknown] = place;
            }
            self.solve_free(bounds);
        }
        for (value, (lowest, highest)) in self.solution.iter_mut().zip(bounds) {
            // Written so that NaN stays.
            if *value < *lowest {
                *value = *lowest;
            } else if *value > *highest {
                *value = *highest;
            }
        }
        &self.solution
    }

    /// Factors the `system` without solving it.
    pub(super) fn factor(&mut self, system: &[f64], width: usize, root: f64) {
        self.whole.factor(system, width, root);
    }

    /// Returns the largest standard deviation of the first `count` unknowns if b has errors of standard deviation 1 and no
    /// bounds are known, and ln det AᵀA, of the last factor.
    pub(super) fn spread(&mut self, count: usize) -> (f64, f64) {
        let log_determinant = (0..self.whole.unknowns()).map(|k| self.whole.row(k)[k].abs().ln());
        let log_determinant = 2.0 * log_determinant.sum::<f64>();
        (self.whole.largest_inverse_row(count), log_determinant)
    }

    fn find_wrong(&mut self, bounds: &[(f64, f64)]) {
        let n = bounds.len();
        self.residual.clear();
        for row in 0..n {
            let entries = &self.whole.row(row)[row..];
            let product: f64 = entries.iter().zip(&self.solution[row..]).map(|(r, x)| r * x).sum();
            self.residual.push(product - entries[n - row]);
        }
        self.wrong.clear();
        for (unknown, &(lowest, highest)) in bounds.iter().enumerate() {
            let value = self.solution[unknown];
            let right = match self.places[unknown] {
                Place::Free if value < lowest - TOLERANCE => Place::Lowest,
                Place::Free if value > highest + TOLERANCE => Place::Highest,
                Place::Free => continue,
                held => {
                    let (mut slope, mut size) = (0.0, 0.0);
                    for row in 0..=unknown {
                        let term = self.whole.row(row)[unknown] * self.residual[row];
                        slope += term;
                        size += term.abs();
                    }
                    let inwards = if held == Place::Lowest { -slope } else { slope };
                    if inwards <= TOLERANCE * size {
                        continue;
                    }
                    Place::Free
                }
            };
            self.wrong.push((unknown, right));
        }
    }

    /// Solves for the free unknowns, with the others at their bounds.
    fn solve_free(&mut self, bounds: &[(f64, f64)]) {
        let n = bounds.len();
        let free = self.places.iter().filter(|place| **place == Place::Free).count();
        for ((value, place), (lowest, highest)) in self.solution.iter_mut().zip(&self.places).zip(bounds) {
            match place {
                Place::Free => {}
                Place::Lowest => *value = *lowest,
                Place::Highest => *value = *highest,
            }
        }
        if free == 0 {
            return;
        }
        self.free_system.clear();
        for row in 0..n {
            let entries = self.whole.row(row);
            let mut right = entries[n];
            for (unknown, &entry) in entries[..n].iter().enumerate() {
                // Entries below the diagonal of the factor are scratch.
                let entry = if unknown < row { 0.0 } else { entry };
                if self.places[unknown] == Place::Free {
                    self.free_system.push(entry);
                } else {
                    right -= entry * self.solution[unknown];
                }
            }
            self.free_system.push(right);
        }
        self.free.factor(&self.free_system, free + 1, 0.0);
        self.free.solve(&mut self.free_solution);
        let places = self.places.iter().zip(&mut self.solution);
        let unknowns = places
            .filter(|(place, _)| **place == Place::Free)
            .map(|(_, value)| value);
        unknowns
            .zip(&self.free_solution)
            .for_each(|(value, found)| *value = *found);
    }
}
