use serde::Deserialize;

use crate::sensor::ArrayScale;

/// A row of the paper's Tables 1 to 3.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
pub struct PublishedErrors {
    /// Number of the table.
    pub table: u8,
    /// Array scale.
    pub array: ArrayScale,
    /// Number of hidden nodes.
    pub hidden: usize,
    /// Number of training samples; in Table 2, of all samples, each tested once.
    pub training_samples: usize,
    /// AveZerr, in percent.
    pub z_percent: f64,
    /// AveXerr, in percent.
    pub x_percent: f64,
    /// AveYerr, in percent.
    pub y_percent: f64,
}

/// Returns all rows of the paper's Tables 1 to 3.
pub fn published_errors() -> Vec<PublishedErrors> {
    let text = include_str!("../../../../assets/published_errors.csv");
    let rows = csv::Reader::from_reader(text.as_bytes()).into_deserialize();
    rows.collect::<Result<_, _>>()
        .expect("the file is part of the program and a test reads it")
}

impl PublishedErrors {
    /// Number of the table obtained by cross-validation.
    const CROSS_VALIDATION: u8 = 2;

    /// Returns the errors reported for this configuration without cross-validation, if there are any.
    pub fn of(array: ArrayScale, hidden: usize, training_samples: usize) -> Option<Self> {
        Self::find(array, hidden, training_samples, |table| table != Self::CROSS_VALIDATION)
    }

    /// Returns the errors reported for this configuration by cross-validation of all `samples`, if there are any.
    pub(super) fn of_cross_validation(array: ArrayScale, hidden: usize, samples: usize) -> Option<Self> {
        Self::find(array, hidden, samples, |table| table == Self::CROSS_VALIDATION)
    }

    fn find(array: ArrayScale, hidden: usize, samples: usize, in_table: impl Fn(u8) -> bool) -> Option<Self> {
        let matches = |row: &Self| {
            in_table(row.table) && (row.array, row.hidden, row.training_samples) == (array, hidden, samples)
        };
        published_errors().into_iter().find(matches)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_are_found_by_configuration() {
        assert_eq!(published_errors().len(), 11);
        let array = ArrayScale::default();
        assert_eq!(PublishedErrors::of(array, 12, 1000).unwrap().z_percent, 2.28);
        assert_eq!(
            PublishedErrors::of("10x8_4x24".parse().unwrap(), 12, 1000)
                .unwrap()
                .y_percent,
            2.36e-12
        );
        assert_eq!(PublishedErrors::of(array, 12, 100), None, "Table 2 is cross-validation");
        assert_eq!(PublishedErrors::of(array, 13, 1000), None);
        let cross_validated = |samples| PublishedErrors::of_cross_validation(array, 12, samples);
        assert_eq!(cross_validated(1000).unwrap().z_percent, 2.01);
        assert_eq!(cross_validated(100).unwrap().x_percent, 0.30);
        assert_eq!(cross_validated(500), None);
    }
}
