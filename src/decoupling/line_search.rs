/// Returns where in `range` a function of one variable is least, and its value there: the least of a grid of steps of
/// about 1, which finds the deepest of several valleys, then golden-section search within a step of it.
pub(super) fn least(range: (f64, f64), of: impl Fn(f64) -> f64) -> (f64, f64) {
    /// Width to which the valley is narrowed.
    const WIDTH: f64 = 0.02;
    let (low, high) = range;
    let steps = (high - low).ceil().max(1.0);
    let step = (high - low) / steps;
    let evaluated = |at: f64| (at, of(at));
    let grid = (0..=steps as usize).map(|k| evaluated(low + step * k as f64));
    let lower = |a: (f64, f64), b: (f64, f64)| if b.1 < a.1 { b } else { a };
    let mut best = grid.reduce(lower).expect("both ends");
    let (mut left, mut right) = ((best.0 - step).max(low), (best.0 + step).min(high));
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let mut inner = [right - golden * (right - left), left + golden * (right - left)].map(evaluated);
    while right - left > WIDTH {
        best = inner.into_iter().fold(best, lower);
        let [first, second] = inner;
        inner = if first.1 < second.1 {
            right = second.0;
            [evaluated(right - golden * (right - left)), first]
        } else {
            left = first.0;
            [second, evaluated(left + golden * (right - left))]
        };
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_deepest_valley_is_found_and_narrowed() {
        let two_valleys = |at: f64| ((at - 2.7).powi(2)).min((at + 20.3).powi(2) - 0.1);
        let (at, value) = least((-30.0, 5.0), two_valleys);
        assert!((at + 20.3).abs() < 0.02 && (value + 0.1).abs() < 1e-3, "{at} {value}");
        for (range, expected) in [((-3.0, 4.5), -3.0), ((7.0, 7.2), 7.0)] {
            assert_eq!(least(range, |at| at).0, expected);
        }
        assert_eq!(least((1.0, 3.0), |at| -at).0, 3.0);
    }
}
