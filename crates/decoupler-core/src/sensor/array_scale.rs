use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

use super::SensorError;

/// Maximum number of wires of one kind, or of nodes on a wire.
pub const LARGEST_COUNT: usize = 512;

/// The scale `M1×M2_M3×M4` of a sensor array, in the notation of the paper (section 2.2).
///
/// Parses `10x6_3x18` and `10×6_3×18`; formats as `10×6_3×18`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ArrayScale {
    /// M1 to M4.
    counts: [usize; 4],
}

impl ArrayScale {
    /// The three arrays of the paper's Table 3, smallest first.
    pub const PRESETS: [Self; 3] = [
        Self::derived(10, 6, 3),
        Self::derived(10, 8, 4),
        Self::derived(10, 10, 5),
    ];

    /// `M4 = 3·M2` as the paper requires: as many equations per row-wire as coordinates.
    const fn derived(rows: usize, nodes_per_row: usize, nodes_per_column: usize) -> Self {
        let counts = [rows, nodes_per_row, nodes_per_column, 3 * nodes_per_row];
        Self { counts }
    }

    /// Creates an array of M1 row-wires with M2 nodes over M4 column-wires with M3 nodes from `[M1, M2, M3, M4]`.
    ///
    /// # Errors
    /// If a count is outside `1..=LARGEST_COUNT`.
    pub fn new(counts: [usize; 4]) -> Result<Self, SensorError> {
        let names = [
            "row-wires (M1)",
            "nodes on a row-wire (M2)",
            "nodes on a column-wire (M3)",
            "column-wires (M4)",
        ];
        for (what, count) in names.into_iter().zip(counts) {
            if !(1..=LARGEST_COUNT).contains(&count) {
                return Err(SensorError::Count { what, count });
            }
        }
        Ok(Self { counts })
    }

    /// Returns M1, the number of row-wires on top.
    pub fn rows(self) -> usize {
        self.counts[0]
    }

    /// Returns M2, the number of nodes on each row-wire.
    pub fn nodes_per_row(self) -> usize {
        self.counts[1]
    }

    /// Returns M3, the number of nodes on each column-wire.
    pub fn nodes_per_column(self) -> usize {
        self.counts[2]
    }

    /// Returns M4, the number of column-wires at the bottom: of resistances read for each row-wire.
    pub fn columns(self) -> usize {
        self.counts[3]
    }

    /// Returns 3·M2, the number of coordinates of the nodes of one row-wire.
    pub fn coordinates_per_row(self) -> usize {
        3 * self.nodes_per_row()
    }

    /// Returns a note for the user if the array departs from the paper's rule M4 = 3·M2.
    pub fn note(self) -> Option<String> {
        let equations = self.columns();
        let coordinates = self.coordinates_per_row();
        (equations != coordinates).then(|| {
            let kind = if equations < coordinates { "fewer" } else { "more" };
            format!("{equations} column-wires, {kind} than the 3·M2 = {coordinates} of the paper's rule")
        })
    }
}

impl Default for ArrayScale {
    /// The paper's main array, 10×10_5×30.
    fn default() -> Self {
        Self::PRESETS[2]
    }
}

impl FromStr for ArrayScale {
    type Err = SensorError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let form = || SensorError::ScaleForm(text.to_owned());
        let mut counts = [0; 4];
        let (top, bottom) = text.trim().split_once('_').ok_or_else(form)?;
        for (layer, pair) in [top, bottom].iter().zip(counts.chunks_exact_mut(2)) {
            let (first, second) = layer.split_once(['x', 'X', '×']).ok_or_else(form)?;
            pair[0] = first.trim().parse().map_err(|_| form())?;
            pair[1] = second.trim().parse().map_err(|_| form())?;
        }
        Self::new(counts)
    }
}

impl fmt::Display for ArrayScale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [rows, nodes_per_row, nodes_per_column, columns] = self.counts;
        f.pad(&format!("{rows}×{nodes_per_row}_{nodes_per_column}×{columns}"))
    }
}

impl TryFrom<String> for ArrayScale {
    type Error = SensorError;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.parse()
    }
}

impl From<ArrayScale> for String {
    fn from(scale: ArrayScale) -> Self {
        scale.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_crosses_are_parsed_and_the_multiplication_sign_is_printed() {
        for text in ["10x6_3x18", "10×6_3×18", " 10X6_3x18 "] {
            assert_eq!(text.parse::<ArrayScale>().unwrap().to_string(), "10×6_3×18");
        }
    }

    #[test]
    fn invalid_scales_are_reported() {
        for text in [
            "10x6",
            "",
            "10x6_3",
            "ax6_3x18",
            "10x6_3x18x2",
            "-1x6_3x18",
            "1e3x6_3x18",
            "10×6×3×18",
        ] {
            let error = text.parse::<ArrayScale>().unwrap_err();
            assert!(matches!(error, SensorError::ScaleForm(_)), "{text}: {error}");
        }
        for text in ["0x6_3x18", "10x6_3x0", "10x6_3x513"] {
            let error = text.parse::<ArrayScale>().unwrap_err();
            assert!(matches!(error, SensorError::Count { .. }), "{text}: {error}");
        }
    }

    #[test]
    fn departing_from_the_papers_rule_is_allowed_with_a_note() {
        assert_eq!("10x6_3x18".parse::<ArrayScale>().unwrap().note(), None);
        let note = "10x6_3x20".parse::<ArrayScale>().unwrap().note().unwrap();
        assert!(
            note.contains("20") && note.contains("more") && note.contains("18"),
            "{note}"
        );
    }
}
