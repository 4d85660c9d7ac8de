use super::{Baselines, Errors, PublishedErrors};

/// A row of an error table; the same columns in the window, the terminal and files. `None` where there is no such
/// figure: the paper gives percentages of the coordinate only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorRow {
    /// Whose errors.
    pub name: &'static str,
    /// AveZerr.
    pub z_percent: Option<f64>,
    /// AveXerr.
    pub x_percent: Option<f64>,
    /// AveYerr.
    pub y_percent: Option<f64>,
    /// Mean |decoupled z − z|.
    pub z_mm: Option<f64>,
    /// The same in percent of the stroke.
    pub z_full_scale_percent: Option<f64>,
    /// Largest |decoupled z − z|.
    pub worst_mm: Option<f64>,
}

impl ErrorRow {
    /// The names of the figures, in the order of [`Self::values`].
    pub const COLUMNS: [&'static str; 6] = [
        "z_percent",
        "x_percent",
        "y_percent",
        "z_mm",
        "z_full_scale_percent",
        "worst_mm",
    ];

    /// The figures.
    pub fn values(&self) -> [Option<f64>; 6] {
        let Self {
            name: _,
            z_percent,
            x_percent,
            y_percent,
            z_mm,
            z_full_scale_percent,
            worst_mm,
        } = *self;
        [z_percent, x_percent, y_percent, z_mm, z_full_scale_percent, worst_mm]
    }

    fn measured(name: &'static str, errors: &Errors) -> Self {
        Self {
            name,
            z_percent: errors.z_percent,
            x_percent: errors.x_percent,
            y_percent: errors.y_percent,
            z_mm: Some(errors.z_mm),
            z_full_scale_percent: Some(errors.z_full_scale_percent),
            worst_mm: Some(errors.worst_mm),
        }
    }

    fn published(published: &PublishedErrors) -> Self {
        Self {
            name: "published",
            z_percent: Some(published.z_percent),
            x_percent: Some(published.x_percent),
            y_percent: Some(published.y_percent),
            z_mm: None,
            z_full_scale_percent: None,
            worst_mm: None,
        }
    }
}

/// The rows of an error table: the baselines, the network, the Bayesian reference below which no decoder comes, and
/// what the paper reports if it does.
pub fn error_rows(network: &Errors, baselines: &Baselines, published: Option<&PublishedErrors>) -> Vec<ErrorRow> {
    let measured = [
        ErrorRow::measured("training mean", &baselines.mean),
        ErrorRow::measured("linear map", &baselines.linear),
        ErrorRow::measured("network", network),
    ];
    let reference = baselines.reference.as_ref();
    let reference = reference.map(|errors| ErrorRow::measured("reference", errors));
    measured
        .into_iter()
        .chain(reference)
        .chain(published.map(ErrorRow::published))
        .collect()
}
