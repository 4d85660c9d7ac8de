use std::str::FromStr;

/// Every n-th trial, from the i-th on: one of n parts that together have every trial once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shard {
    /// From 0.
    index: usize,
    count: usize,
}

impl Default for Shard {
    fn default() -> Self {
        Self { index: 0, count: 1 }
    }
}

impl Shard {
    /// Positions of its trials among this many.
    pub(super) fn positions(self, trials: usize) -> impl Iterator<Item = usize> {
        (self.index..trials).step_by(self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/');
        let parts = parts.and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
        match parts {
            Some((index, count)) if (1..=count).contains(&index) => Ok(Self {
                index: index - 1,
                count,
            }),
            _ => Err("give I/N, the part and the number of parts, from 1/N to N/N".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_of_any_number_have_every_trial_once() {
        for trials in [0, 1, 7, 24] {
            for count in 1..=30 {
                let shards = (1..=count).map(|index| format!("{index}/{count}").parse::<Shard>().unwrap());
                let mut positions: Vec<_> = shards.flat_map(|shard| shard.positions(trials)).collect();
                positions.sort_unstable();
                assert_eq!(positions, Vec::from_iter(0..trials), "{trials} in {count}");
            }
        }
        for wrong in ["", "1", "0/2", "3/2", "1/0", "-1/2", "1/2/3", "1/x"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
