use crate::{
    decoupling::{DecoderKind, Precision},
    evaluation::DecoderReport,
};

/// The table of decoders.
#[derive(Debug, Default)]
pub struct DecodersState {
    /// Whether it is unfolded.
    pub is_open: bool,
    /// What was measured of the training on show; none before it stands still.
    pub measured: Option<Vec<DecoderResult>>,
}

/// What became of a decoder.
#[derive(Clone, Debug, PartialEq)]
pub struct DecoderResult {
    /// Which.
    pub kind: DecoderKind,
    /// In what its network computes.
    pub precision: Precision,
    /// What it is worth, or why it cannot be used; none while it is still to be measured.
    pub report: Option<Result<DecoderReport, String>>,
}

impl DecoderResult {
    /// All decoders, none measured yet.
    pub fn pending() -> Vec<Self> {
        let of_kind = |kind: DecoderKind| {
            let precisions = kind.precisions().iter().copied();
            precisions.map(move |precision| Self {
                kind,
                precision,
                report: None,
            })
        };
        DecoderKind::ALL.into_iter().flat_map(of_kind).collect()
    }
}

impl DecodersState {
    /// Whether something is still to come.
    pub fn is_measuring(&self) -> bool {
        let results = self.measured.iter().flatten();
        results.into_iter().any(|result| result.report.is_none())
    }

    /// Takes news about one decoder.
    pub fn take(&mut self, place: usize, report: Result<DecoderReport, String>) {
        if let Some(result) = self.measured.as_mut().and_then(|measured| measured.get_mut(place)) {
            result.report = Some(report);
        }
    }

    /// Nothing more will come: what is not there failed for this reason.
    pub fn end(&mut self, reason: &str) {
        let results = self.measured.iter_mut().flatten();
        for result in results.filter(|result| result.report.is_none()) {
            result.report = Some(Err(reason.to_owned()));
        }
    }
}
