//! Measures decoders in the background. It ends after the last, or after the one in hand when no one waits for more.

use std::{path::Path, sync::Arc};

use decoupler_core::{
    dataset::Dataset,
    decoupling::{DecoderKind, Precision},
    evaluation::{DecoderReport, DecoderSet, Source},
    network::Networks,
};
use decoupler_files::import::Setup;

use crate::window::{
    job::{Job, JobError, Report, Wake},
    shared::{Phase, Shared},
    training_worker::RunId,
};

/// Message of the thread to the window.
enum MeasuringEvent {
    /// Report of the decoder at this place in the list.
    Measured(usize, Result<DecoderReport, String>),
    /// Nothing more will come.
    Ended(Result<(), JobError>),
}

/// The window's end of the thread.
#[derive(Debug)]
pub struct DecoderMeasuring {
    job: Job<MeasuringEvent>,
    /// The training whose networks are measured, and how many epochs had been run.
    of: Option<(RunId, usize)>,
}

impl DecoderMeasuring {
    /// Nothing measured yet. `wake` is called after each decoder and at the end.
    pub fn new(wake: Wake) -> Self {
        Self {
            job: Job::new("decoders", wake),
            of: None,
        }
    }

    /// Takes events, forgets what is of a network that is another one by now, and measures the displayed networks once they
    /// are paused and their table is unfolded.
    pub fn follow(&mut self, shared: &Shared, state: &mut DecodersState) {
        self.take_events(state);
        let standing = shared.run.as_ref().and_then(|run| {
            let result = run.result.as_ref()?;
            result
                .is_idle
                .then_some((run, (run.id, result.epochs_run), &result.networks))
        });
        let is_other = standing.is_some_and(|(_, of, _)| self.of.is_some_and(|measured| measured != of));
        if is_other || shared.phase == Phase::Training {
            self.forget(state);
        }
        let is_wanted = state.is_open && state.measured.is_none();
        if let (true, Phase::Paused | Phase::Ended(_), Some((run, of, networks))) = (is_wanted, shared.phase, standing)
        {
            self.of = Some(of);
            state.measured = Some(DecoderResult::pending(&run.settings().source));
            self.begin(run.setup.clone(), (**networks).clone(), Arc::clone(run.test.set()));
        }
    }

    fn forget(&mut self, state: &mut DecodersState) {
        self.job.abandon();
        (self.of, state.measured) = (None, None);
    }

    /// Measures all decoders of `setup` with their trained `networks` on `test`.
    fn begin(&mut self, setup: Setup, networks: Networks, test: Arc<Dataset>) {
        self.job.start(
            move |report| measure_all(&setup, networks, &test, report),
            MeasuringEvent::Ended,
        );
    }

    /// Takes what the thread has to report.
    fn take_events(&mut self, state: &mut DecodersState) {
        while let Some(news) = self.job.next_event() {
            match news {
                MeasuringEvent::Measured(place, report) => state.take(place, report),
                MeasuringEvent::Ended(Ok(())) => {}
                MeasuringEvent::Ended(Err(error)) => state.end(&format!("{error}: close the table and open it again")),
            }
        }
    }
}

fn measure_all(setup: &Setup, networks: Networks, test: &Dataset, report: &Report<MeasuringEvent>) {
    let is_cancelled = || report.is_cancelled();
    let sets = setup.sets(Path::new(""), &is_cancelled, &mut |_| ());
    let set = match sets {
        Ok(None) => return,
        Ok(Some(sets)) => Ok(DecoderSet::on_set(
            *setup.settings(),
            sets.sets.split.training,
            Some(networks),
        )),
        Err(error) => Err(error.to_string()),
    };
    for (place, wanted) in DecoderResult::pending(&setup.settings().source).into_iter().enumerate() {
        if is_cancelled() {
            return;
        }
        let measure = |set: &DecoderSet| match set.measure(wanted.kind, wanted.precision, test) {
            Ok(report) => report.ok_or_else(|| "it needs a trained network".to_owned()),
            Err(error) => Err(error.to_string()),
        };
        report.send(MeasuringEvent::Measured(
            place,
            set.as_ref().map_err(String::clone).and_then(measure),
        ));
    }
}

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

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use decoupler_core::evaluation::{Run, SimulatedSettings, Simulation};

    use super::*;

    #[test]
    fn decoders_that_cannot_be_measured_say_why_and_none_is_left_waiting() {
        let mut settings = SimulatedSettings {
            hidden: 2,
            ..SimulatedSettings::default()
        };
        settings.source = Simulation {
            samples: 20,
            validation_samples: 0,
            test_samples: 4,
            ..settings.source
        };
        settings.source.sensor.scale = "2x3_2x9".parse().unwrap();
        let run = Run::prepare(settings).unwrap();
        let (waking, woken) = channel();
        let wake = move || waking.send(()).unwrap_or(());
        let (mut measuring, mut state) = (DecoderMeasuring::new(Arc::new(wake)), DecodersState::default());
        state.measured = Some(DecoderResult::pending(&run.settings().source));
        assert!(state.is_measuring());
        let mut impossible = settings;
        impossible.source.samples = 0;
        measuring.begin(impossible.into(), run.network(), Arc::clone(run.test()));
        while state.is_measuring() {
            woken.recv().unwrap();
            measuring.take_events(&mut state);
        }
        assert!(!state.is_measuring());
        for result in state.measured.iter().flatten() {
            let reason = result.report.clone().unwrap().unwrap_err();
            assert!(reason.contains("training samples"), "{reason}");
        }
        measuring.forget(&mut state);
        assert!(state.measured.is_none());
    }
}
