//! The table: rooms and extremes, and the reasons that occurred.

use std::{collections::BTreeMap, fmt};

use crate::judge::{Cell, Verdict};

pub(crate) struct Table {
    cells: Vec<Cell>,
}

/// Numbers of cells that are right, refused, flagged and wrong.
type Counts = [usize; 4];

impl Table {
    pub(crate) fn new(cells: Vec<Cell>) -> Self {
        Self { cells }
    }

    pub(crate) fn wrong(&self) -> usize {
        self.cells.iter().filter(|cell| column(&cell.verdict) == 3).count()
    }

    fn counts(&self) -> BTreeMap<(&str, &str), Counts> {
        let mut counts = BTreeMap::new();
        for cell in &self.cells {
            counts.entry((cell.room, cell.extreme)).or_insert([0; 4])[column(&cell.verdict)] += 1;
        }
        counts
    }

    /// Reasons without their digits: the count and the first cell of each.
    fn reasons(&self) -> BTreeMap<(usize, &str, String), (usize, String)> {
        let mut reasons = BTreeMap::new();
        for cell in &self.cells {
            let text = match &cell.verdict {
                Verdict::Right => continue,
                Verdict::Refused(text) | Verdict::Flagged(text) | Verdict::Wrong(text) => text,
            };
            let key = (column(&cell.verdict), cell.room, without_numbers(text));
            let first = || (0, format!("{} ({text})", cell.sentence));
            reasons.entry(key).or_insert_with(first).0 += 1;
        }
        reasons
    }
}

fn column(verdict: &Verdict) -> usize {
    match verdict {
        Verdict::Right => 0,
        Verdict::Refused(_) => 1,
        Verdict::Flagged(_) => 2,
        Verdict::Wrong(_) => 3,
    }
}

/// Returns the text with `#` in place of every number.
fn without_numbers(text: &str) -> String {
    let mut plain = String::new();
    let mut in_number = false;
    for letter in text.chars() {
        let goes_on = letter.is_ascii_digit() || (in_number && "e.-+".contains(letter));
        if goes_on && !in_number {
            plain.push('#');
        } else if !goes_on {
            plain.push(letter);
        }
        in_number = goes_on;
    }
    plain
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\n{:<12}{:<46}{:>7}{:>9}{:>9}{:>7}",
            "room", "extreme", "right", "refused", "flagged", "WRONG"
        )?;
        let mut total = [0; 4];
        for ((room, extreme), counts) in self.counts() {
            let [right, refused, flagged, wrong] = counts;
            writeln!(f, "{room:<12}{extreme:<46}{right:>7}{refused:>9}{flagged:>9}{wrong:>7}")?;
            for (total, count) in total.iter_mut().zip(counts) {
                *total += count;
            }
        }
        let [right, refused, flagged, wrong] = total;
        writeln!(
            f,
            "{:<58}{right:>7}{refused:>9}{flagged:>9}{wrong:>7}",
            format!("all {} cells", self.cells.len())
        )?;
        for (kind, title) in [(1, "Refused"), (2, "Flagged"), (3, "WRONG")] {
            writeln!(f, "\n{title}, by reason (first cell of each)")?;
            for ((_, room, reason), (count, first)) in self.reasons().into_iter().filter(|((of, ..), _)| *of == kind) {
                // Wrong cells are listed with their numbers.
                let text = if kind == 3 { first } else { reason };
                writeln!(f, "{count:>6}  {room}: {}", text.chars().take(260).collect::<String>())?;
            }
        }
        Ok(())
    }
}
