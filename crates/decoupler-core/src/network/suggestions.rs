use std::ops::RangeInclusive;

/// Largest number of hidden nodes offered to the user.
pub const LARGEST_HIDDEN: usize = 512;

/// Numbers of hidden nodes suggested by the paper's rules of thumb; a starting point, not a bound.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HiddenSuggestions {
    /// Eq. (12): n₁ = √(n+m) + a, for a from 1 to 10.
    pub square_root: RangeInclusive<usize>,
    /// Eq. (13): n₁ = log₂ n.
    pub logarithm: usize,
}

impl HiddenSuggestions {
    /// Computes the suggestions for n `inputs` and m `outputs`, rounded to whole nodes.
    pub fn new(inputs: usize, outputs: usize) -> Self {
        let root = ((inputs + outputs) as f64).sqrt();
        Self {
            square_root: (root + 1.0).round() as usize..=(root + 10.0).round() as usize,
            logarithm: ((inputs as f64).log2().round() as usize).max(1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_array() {
        let suggestions = HiddenSuggestions::new(30, 30);
        assert_eq!(
            suggestions,
            HiddenSuggestions {
                square_root: 9..=18,
                logarithm: 5
            }
        );
        assert_eq!(HiddenSuggestions::new(1, 3).logarithm, 1);
    }
}
