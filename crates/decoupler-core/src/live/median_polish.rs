/// Rounds of median polish: two or three are enough.
const ROUNDS: usize = 6;

/// Values divided into a common part, one of each row and one of each column.
pub(super) struct Polished {
    pub(super) common: f64,
    pub(super) of_rows: Vec<f64>,
    pub(super) of_columns: Vec<f64>,
    /// Residuals: rows × columns.
    pub(super) rest: Vec<f64>,
}

impl Polished {
    /// Divides values, rows × columns, by median polish.
    pub(super) fn new(values: &[f64], columns: usize) -> Self {
        let rows = values.len() / columns;
        let mut found = Self {
            common: 0.0,
            of_rows: vec![0.0; rows],
            of_columns: vec![0.0; columns],
            rest: values.to_vec(),
        };
        for _ in 0..ROUNDS {
            for column in 0..columns {
                let shift = median((0..rows).map(|row| found.rest[row * columns + column]).collect());
                (0..rows).for_each(|row| found.rest[row * columns + column] -= shift);
                found.of_columns[column] += shift;
            }
            for row in 0..rows {
                let of_row = &mut found.rest[row * columns..(row + 1) * columns];
                let shift = median(of_row.to_vec());
                of_row.iter_mut().for_each(|e| *e -= shift);
                found.of_rows[row] += shift;
            }
            for parts in [&mut found.of_columns, &mut found.of_rows] {
                let shift = median(parts.clone());
                parts.iter_mut().for_each(|part| *part -= shift);
                found.common += shift;
            }
        }
        found
    }
}

/// Median of values, which must not be empty.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len().is_multiple_of(2) {
        0.5 * (values[middle - 1] + values[middle])
    } else {
        values[middle]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parts of rows and columns whose medians are 0 come back, whatever happens to less than half of the rows.
    #[test]
    fn additive_parts_are_found_beside_outliers() {
        let (rows, columns) = ([-2.0, 0.0, 1.0, 0.0, 3.0], [0.5, 0.0, -0.25]);
        let value = |index: usize| 10.0 + rows[index / 3] + columns[index % 3] - if index == 4 { 7.0 } else { 0.0 };
        let values: Vec<f64> = (0..15).map(value).collect();
        let found = Polished::new(&values, 3);
        assert_eq!(
            (found.common, &found.of_rows[..], &found.of_columns[..]),
            (10.0, &rows[..], &columns[..])
        );
        assert_eq!(found.rest[4], -7.0);
        assert!(
            found
                .rest
                .iter()
                .enumerate()
                .all(|(index, rest)| index == 4 || *rest == 0.0)
        );
    }
}
