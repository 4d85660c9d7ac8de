use decoupler_core::{
    decoupling::{DecoderKind, Precision},
    evaluation::{DecoderReport, DecoderSet, Source},
};

/// The table of decoders.
#[derive(Debug, Default)]
pub struct DecodersState {
    /// True while the table is unfolded.
    pub is_open: bool,
    /// Results for the current training; none while it is running.
    pub measured: Option<Vec<DecoderResult>>,
}

/// Result of a decoder.
#[derive(Clone, Debug, PartialEq)]
pub struct DecoderResult {
    /// Which.
    pub kind: DecoderKind,
    /// In what its network computes.
    pub precision: Precision,
    /// Report of the decoder, or why it cannot be used; none while it is still to be measured.
    pub report: Option<Result<DecoderReport, String>>,
}

impl DecoderResult {
    /// All decoders for this source, none measured yet.
    pub fn pending(source: &Source) -> Vec<Self> {
        let pending = |(kind, precision)| Self {
            kind,
            precision,
            report: None,
        };
        DecoderSet::kinds(source).map(pending).collect()
    }
}

impl DecodersState {
    /// Returns true while a result is still to come.
    pub fn is_measuring(&self) -> bool {
        let results = self.measured.iter().flatten();
        results.into_iter().any(|result| result.report.is_none())
    }

    /// Takes events about one decoder.
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
