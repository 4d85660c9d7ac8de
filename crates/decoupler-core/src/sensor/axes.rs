use serde::{Deserialize, Serialize};

/// Axes along which the nodes of the row-wires move, which set the number of unknowns of a node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Axes {
    /// Up and down only: one unknown each node.
    #[default]
    Z,
    /// Sideways too: three unknowns each node, in the order x, y, z.
    Xyz,
}

impl Axes {
    /// Unknowns of each node.
    pub fn count(self) -> usize {
        self.indices().len()
    }

    /// Indices of the unknown coordinates among x, y, z (0, 1, 2).
    pub fn indices(self) -> &'static [usize] {
        match self {
            Self::Z => &[2],
            Self::Xyz => &[0, 1, 2],
        }
    }
}
