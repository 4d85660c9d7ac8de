use std::fmt;

use super::newton_report::Solution;

/// Number of rows decoded by solving the equations of the sensor, and of those whose answers cannot be relied on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SolvedRows {
    /// Rows decoded.
    pub rows: usize,
    /// Rows whose readings the answer does not explain.
    pub unsolved: usize,
    /// Rows whose readings other answers may explain as well.
    pub undetermined: usize,
}

impl SolvedRows {
    pub(super) fn count(&mut self, solution: Solution) {
        self.rows += 1;
        match solution {
            Solution::Unique => {}
            Solution::None => self.unsolved += 1,
            Solution::Undetermined => self.undetermined += 1,
        }
    }

    /// Returns `true` if every answer can be relied on.
    pub fn are_reliable(self) -> bool {
        self.unsolved == 0 && self.undetermined == 0
    }
}

impl fmt::Display for SolvedRows {
    /// Writes how many answers cannot be relied on, why, and what helps; nothing if all can.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            rows,
            unsolved,
            undetermined,
        } = *self;
        if unsolved > 0 {
            write!(
                f,
                "{unsolved} of {rows} rows were not solved: their answers do not explain the readings. Check that readings \
                 and geometry belong together, give the noise of the readings, or let nodes move along z only"
            )?;
        }
        if unsolved > 0 && undetermined > 0 {
            write!(f, "; ")?;
        }
        if undetermined > 0 {
            write!(
                f,
                "{undetermined} of {rows} rows are not determined by their readings: other deformations may explain \
                 them as well. Use more column-wires, nodes that move along fewer axes, known rows, or a layout without symmetry"
            )?;
        }
        Ok(())
    }
}
