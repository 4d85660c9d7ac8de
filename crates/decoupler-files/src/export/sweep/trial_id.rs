use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};
use siphasher::sip128::SipHasher24;

/// Digits of a written identifier.
const DIGITS: usize = 32;

/// 128-bit hash of what determines the result of a trial; names its files. SipHash-2-4 (Aumasson and Bernstein 2012) with
/// the key 0, which is the same in every version and on every machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct TrialId(u128);

impl TrialId {
    /// Hash of a text.
    pub(crate) fn of(text: &str) -> Self {
        Self(u128::from_le_bytes(SipHasher24::new().hash(text.as_bytes()).as_bytes()))
    }

    /// Returns true for the text of an identifier.
    pub(super) fn is_written(text: &str) -> bool {
        text.parse().is_ok_and(|id: Self| id.to_string() == text)
    }
}

impl fmt::Display for TrialId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:0DIGITS$x}", self.0)
    }
}

impl FromStr for TrialId {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = u128::from_str_radix(text, 16).ok();
        let id = number.filter(|_| text.len() == DIGITS).map(Self);
        id.ok_or_else(|| format!("'{text}' does not identify a trial"))
    }
}

impl TryFrom<String> for TrialId {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<TrialId> for String {
    fn from(id: TrialId) -> Self {
        id.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computed by a program that reproduces the authors' vector of the empty message with the key 00 01 … 0f, their bytes
    /// read from the last to the first.
    #[test]
    fn the_hash_is_that_of_the_published_algorithm() {
        for (text, id) in [
            ("", "f4f2ced447ab02427de0a38047d74950"),
            ("decoupler", "febf96383e2304c86ff7530a7ee5452c"),
        ] {
            assert_eq!(TrialId::of(text).to_string(), id);
            assert_eq!(id.parse(), Ok(TrialId::of(text)));
        }
        for other in ["", "1f", "xx", &"0".repeat(33), &"F".repeat(32)] {
            assert!(!TrialId::is_written(other), "{other}");
        }
    }
}
