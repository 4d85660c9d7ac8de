/// Returns the position and value of the minimum in `range` of each of `count` functions of one variable: the minimum
/// over a grid with steps of about 1, which finds the deepest of several valleys, refined by golden-section search.
///
/// `of` returns the values of all functions, each at its own position, so that shared work is done once.
pub(super) fn minima(range: (f64, f64), count: usize, of: impl Fn(&[f64]) -> Vec<f64>) -> Vec<(f64, f64)> {
    let (low, high) = range;
    let steps = (high - low).ceil().max(1.0);
    let step = (high - low) / steps;
    let mut best = vec![(low, f64::INFINITY); count];
    for k in 0..=steps as usize {
        let at = low + step * k as f64;
        for (best, value) in best.iter_mut().zip(of(&vec![at; count])) {
            // The lowest position is kept if all values are NaN.
            if value < best.1 {
                *best = (at, value);
            }
        }
    }
    let mut valleys: Vec<Valley> = best.into_iter().map(|best| Valley::around(best, step, range)).collect();
    for inner in 0..2 {
        let at: Vec<f64> = valleys.iter().map(|valley| valley.inner[inner].0).collect();
        for (valley, value) in valleys.iter_mut().zip(of(&at)) {
            valley.inner[inner].1 = value;
        }
    }
    while valleys.iter().any(Valley::is_wide) {
        let at: Vec<f64> = valleys.iter_mut().map(Valley::narrow).collect();
        for (valley, value) in valleys.iter_mut().zip(of(&at)) {
            valley.take(value);
        }
    }
    valleys.into_iter().map(|valley| valley.best).collect()
}

/// Golden-section search of one function.
struct Valley {
    /// Position and value of the minimum so far.
    best: (f64, f64),
    left: f64,
    right: f64,
    /// Positions and values between the ends, in ascending order.
    inner: [(f64, f64); 2],
    /// Index of the [`Self::inner`] point to be evaluated; `None` once the valley is narrow.
    open: Option<usize>,
}

impl Valley {
    /// Width to which a valley is narrowed.
    const WIDTH: f64 = 0.02;

    fn around(best: (f64, f64), step: f64, (low, high): (f64, f64)) -> Self {
        let (left, right) = ((best.0 - step).max(low), (best.0 + step).min(high));
        let inner = [right - golden() * (right - left), left + golden() * (right - left)];
        Self {
            best,
            left,
            right,
            inner: inner.map(|at| (at, f64::NAN)),
            open: None,
        }
    }

    fn is_wide(&self) -> bool {
        self.right - self.left > Self::WIDTH
    }

    /// Narrows the valley, if it is wide, and returns where to evaluate the function next.
    fn narrow(&mut self) -> f64 {
        self.open = None;
        if !self.is_wide() {
            return self.best.0;
        }
        for inner in self.inner {
            if inner.1 < self.best.1 {
                self.best = inner;
            }
        }
        let [first, second] = self.inner;
        let (open, at) = if first.1 < second.1 {
            self.right = second.0;
            self.inner[1] = first;
            (0, self.right - golden() * (self.right - self.left))
        } else {
            self.left = first.0;
            self.inner[0] = second;
            (1, self.left + golden() * (self.right - self.left))
        };
        self.open = Some(open);
        self.inner[open].0 = at;
        at
    }

    /// Sets the value at the requested position.
    fn take(&mut self, value: f64) {
        if let Some(open) = self.open {
            self.inner[open].1 = value;
        }
    }
}

/// Inverse of the golden ratio.
fn golden() -> f64 {
    0.5 * (5.0_f64.sqrt() - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_deepest_valley_of_each_function_is_found_and_narrowed() {
        let two_valleys = |at: f64| ((at - 2.7).powi(2)).min((at + 20.3).powi(2) - 0.1);
        let parabola = |at: f64| (at - 4.1).powi(2);
        let found = minima((-30.0, 5.0), 2, |at| vec![two_valleys(at[0]), parabola(at[1])]);
        let (at, value) = found[0];
        assert!((at + 20.3).abs() < 0.02 && (value + 0.1).abs() < 1e-3, "{at} {value}");
        assert!((found[1].0 - 4.1).abs() < 0.02, "{found:?}");
        for (range, expected) in [((-3.0, 4.5), -3.0), ((7.0, 7.2), 7.0)] {
            assert_eq!(minima(range, 1, |at| at.to_vec())[0].0, expected);
        }
        assert_eq!(minima((1.0, 3.0), 1, |at| vec![-at[0]])[0].0, 3.0);
        assert_eq!(minima((1.0, 3.0), 1, |_| vec![f64::NAN])[0].0, 1.0);
        assert!(minima((1.0, 3.0), 0, |_| Vec::new()).is_empty());
    }
}
