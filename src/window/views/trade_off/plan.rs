use decoupler_core::{decoupling::DecoderKind, evaluation::Preset, training::Method};
use decoupler_files::import::Setup;

/// A measurement as it is run.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOffPlan {
    /// Levels, one after the other: those of noise of a simulated array, or a single one of a recording.
    pub levels: Vec<PlannedLevel>,
    /// Numbers of hidden nodes of the networks.
    pub hidden: Vec<usize>,
}

/// Runs of a level.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedLevel {
    /// Relative error of a reading, if it is simulated.
    pub noise: Option<f64>,
    /// Runs by which its decoders are fitted.
    pub runs: Vec<PlannedRun>,
}

/// A run by which decoders are fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedRun {
    /// Preset from which its settings were derived, if they were.
    pub preset: Option<Preset>,
    /// Setup, except for the hidden nodes.
    pub setup: Setup,
    /// Decoders to be measured.
    pub decoders: Vec<DecoderKind>,
}

impl TradeOffPlan {
    /// Returns the number of points.
    pub fn points(&self) -> usize {
        let of_decoder = |kind: &DecoderKind| {
            let networks = if kind.needs_network() { self.hidden.len() } else { 1 };
            networks * kind.precisions().len()
        };
        let runs = self.levels.iter().flat_map(|level| &level.runs);
        runs.flat_map(|run| &run.decoders).map(of_decoder).sum()
    }

    /// Name of the source.
    pub fn source_name(&self) -> String {
        let run = self.levels.iter().flat_map(|level| &level.runs).next();
        run.map_or(String::new(), |run| run.setup.source_name())
    }

    /// Training methods of its networks on a recording; empty for an array, whose presets have theirs.
    pub fn methods(&self) -> Vec<Method> {
        let runs = self.levels.iter().flat_map(|level| &level.runs);
        let recorded = runs.filter(|run| run.setup.plan().is_some());
        recorded.map(|run| run.setup.settings().training.method).collect()
    }
}
