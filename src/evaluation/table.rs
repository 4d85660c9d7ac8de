use super::{Baselines, Errors, PublishedErrors};

/// A row of an error table, with the same columns in the window, the terminal and files. A figure is `None` if it does
/// not exist: the paper gives percentages of the coordinate only.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ErrorRow {
    /// Name of the decoder or baseline.
    pub name: &'static str,
    /// AveZerr, in percent.
    pub z_percent: Option<f64>,
    /// AveXerr, in percent.
    pub x_percent: Option<f64>,
    /// AveYerr, in percent.
    pub y_percent: Option<f64>,
    /// Mean |decoupled z − z|, in millimetres.
    pub z_mm: Option<f64>,
    /// [`Self::z_mm`] in percent of the stroke.
    pub z_full_scale_percent: Option<f64>,
    /// Largest |decoupled z − z|, in millimetres.
    pub worst_mm: Option<f64>,
}

impl ErrorRow {
    /// Names of the figures, in the order of [`Self::values`].
    pub const COLUMNS: [&'static str; 6] = [
        "z_percent",
        "x_percent",
        "y_percent",
        "z_mm",
        "z_full_scale_percent",
        "worst_mm",
    ];

    /// Returns the figures, in the order of [`Self::COLUMNS`].
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

/// Returns the rows of an error table: the baselines, the network, the Bayesian reference as the limit of any decoder,
/// and the published errors, if there are any.
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
