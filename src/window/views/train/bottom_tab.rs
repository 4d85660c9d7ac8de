use crate::window::{
    shared::{Shared, SourceKind},
    test_view::Positions,
};

/// The charts below the surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BottomTab {
    /// Error against epoch.
    #[default]
    Loss,
    /// Gradient, damping or rate, and validation failures against epoch.
    TrainingState,
    /// Distribution of the errors of z, or of a target.
    ErrorHistogram,
    /// Decoupled against actual z, or decoded against actual values of a target.
    Regression,
    /// All targets of a sample of a recording, where surfaces take the place above.
    Sample,
    /// Error over the position, where targets of a recording are a position.
    ErrorMap,
    /// The nodes of the snapshot: the paper's Fig. 6.
    Nodes,
    /// A section through the surfaces of the snapshot.
    Section,
    /// Readings of the snapshot, where there is no room for a card of their own.
    Readings,
}

impl BottomTab {
    /// The word for the chart in a file's name.
    pub(super) fn file_word(self) -> &'static str {
        match self {
            Self::Loss => "loss",
            Self::TrainingState => "training-state",
            Self::ErrorHistogram => "histogram",
            Self::Regression => "regression",
            Self::Sample => "sample",
            Self::ErrorMap => "error-map",
            Self::Nodes => "nodes",
            Self::Section => "section",
            Self::Readings => "readings",
        }
    }

    const OF_ARRAY: [(Self, &'static str); 7] = [
        (Self::Loss, "Loss"),
        (Self::TrainingState, "Training state"),
        (Self::ErrorHistogram, "Histogram"),
        (Self::Regression, "Regression"),
        (Self::Nodes, "Nodes"),
        (Self::Section, "Section"),
        (Self::Readings, "Readings"),
    ];

    const OF_RECORDING: [(Self, &'static str); 6] = [
        (Self::Loss, "Loss"),
        (Self::TrainingState, "Training state"),
        (Self::ErrorHistogram, "Histogram"),
        (Self::Regression, "Regression"),
        (Self::Sample, "Sample"),
        (Self::ErrorMap, "Error map"),
    ];

    /// The charts of the current source, with their names. Readings are among them unless they have a card of their own.
    pub(super) fn offered(shared: &Shared, has_readings: bool) -> Vec<(Self, &'static str)> {
        let all = match shared.source {
            SourceKind::Array => &Self::OF_ARRAY[..],
            SourceKind::Recording => &Self::OF_RECORDING,
        };
        let is_offered = |tab: Self| match tab {
            Self::Readings => has_readings,
            // Without surfaces the sample takes their place.
            Self::Sample => has_target_surface(shared),
            Self::ErrorMap => has_error_map(shared),
            _ => true,
        };
        all.iter().copied().filter(|(tab, _)| is_offered(*tab)).collect()
    }
}

fn has_error_map(shared: &Shared) -> bool {
    let charts = shared.result().and_then(|result| result.charts.as_ref());
    charts.is_some_and(|charts| charts.error_map.is_ok())
}

/// Returns true if a surface goes through the displayed targets of the recording.
pub(super) fn has_target_surface(shared: &Shared) -> bool {
    let test = shared.recorded_test();
    test.is_some_and(|test| matches!(test.positions, Positions::Surface(_)))
}
