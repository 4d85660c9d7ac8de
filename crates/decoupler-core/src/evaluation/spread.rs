/// Minimum, quartiles and maximum of a set of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// Minimum of the numbers.
    pub smallest: f64,
    /// Value below which a quarter of the numbers lie.
    pub lower_quartile: f64,
    /// Value below which half of the numbers lie.
    pub median: f64,
    /// Value below which three quarters of the numbers lie.
    pub upper_quartile: f64,
    /// Maximum of the numbers.
    pub largest: f64,
}

impl Spread {
    /// Summarises the finite numbers among `values`; returns `None` if there are none. Quartiles are interpolated
    /// linearly (Hyndman and Fan 1996, definition 7).
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        let quantile = |share: f64| {
            let place = share * last as f64;
            let below = place.floor() as usize;
            let (low, high) = (sorted[below], sorted[(below + 1).min(last)]);
            low + (place - below as f64) * (high - low)
        };
        Some(Self {
            smallest: sorted[0],
            lower_quartile: quantile(0.25),
            median: quantile(0.5),
            upper_quartile: quantile(0.75),
            largest: sorted[last],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_are_those_of_definition_7() {
        // R: quantile(c(1, 2, 4, 8, 16, 32), type = 7)
        let spread = Spread::of([32.0, 1.0, f64::NAN, 4.0, 16.0, 8.0, 2.0]).unwrap();
        let expected = Spread {
            smallest: 1.0,
            lower_quartile: 2.5,
            median: 6.0,
            upper_quartile: 14.0,
            largest: 32.0,
        };
        assert_eq!(spread, expected);
    }

    #[test]
    fn one_value_is_all_of_its_spread_and_none_has_none() {
        let spread = Spread::of([3.0]).unwrap();
        assert_eq!((spread.smallest, spread.median, spread.largest), (3.0, 3.0, 3.0));
        assert_eq!(Spread::of([f64::INFINITY]), None);
    }
}
