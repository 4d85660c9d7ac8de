/// Column by which the rows are sorted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SortBy {
    /// Its place; none before the user chooses one.
    pub column: Option<usize>,
    /// Largest first.
    pub is_descending: bool,
}

impl SortBy {
    /// Returns the rows in this order. `cell` gives the figure of a row in a column, if it has one, and a text: rows without
    /// a figure come last, by their texts.
    pub fn order<'a>(self, rows: usize, cell: impl Fn(usize, usize) -> (Option<f64>, &'a str)) -> Vec<usize> {
        let mut order: Vec<usize> = (0..rows).collect();
        let Some(column) = self.column else { return order };
        order.sort_by(|&one, &other| {
            let ((one, text), (other, other_text)) = (cell(one, column), cell(other, column));
            let ordering = match (one, other) {
                (Some(one), Some(other)) => one.total_cmp(&other),
                (None, None) => text.cmp(other_text),
                (one, other) => return other.is_some().cmp(&one.is_some()),
            };
            if self.is_descending {
                ordering.reverse()
            } else {
                ordering
            }
        });
        order
    }
}
