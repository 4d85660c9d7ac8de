//! Measures decoders in the background. It ends after the last, or after the one in hand when nobody waits for more.

use std::sync::Arc;

use super::{DecoderResult, DecodersState};
use crate::{
    app::job::{Job, JobError, Report, Wake},
    dataset::Dataset,
    evaluation::{DecoderReport, DecoderSet, SimulatedSettings},
    network::Networks,
};

/// What the thread tells the window.
enum News {
    /// What the decoder at this place in the list is worth.
    Measured(usize, Result<DecoderReport, String>),
    /// Nothing more will come.
    Ended(Result<(), JobError>),
}

/// The window's end of the thread.
#[derive(Debug)]
pub struct DecoderMeasuring {
    job: Job<News>,
    /// Tells networks apart that are measured one after the other.
    number: u64,
}

impl DecoderMeasuring {
    /// Nothing measured yet. `wake` is called after each decoder and at the end.
    pub fn new(wake: Wake) -> Self {
        Self {
            job: Job::new("decoders", wake),
            number: 0,
        }
    }

    /// All decoders are to be measured once the networks of this number are there.
    pub fn expect(&mut self, state: &mut DecodersState) -> u64 {
        self.forget(state);
        state.measured = Some(DecoderResult::pending());
        self.number
    }

    /// Whether networks of this number are still those to be measured.
    pub fn awaits(&self, number: u64) -> bool {
        self.number == number
    }

    /// Forgets what was measured, and what is still to come: the network is another one from now on.
    pub fn forget(&mut self, state: &mut DecodersState) {
        self.number += 1;
        self.job.abandon();
        state.measured = None;
    }

    /// Measures all decoders of `settings` with their trained `networks` on `test`.
    pub fn begin(&mut self, settings: SimulatedSettings, networks: Networks, test: Arc<Dataset>) {
        self.job.start(
            move |report| measure_all(settings, networks, &test, report),
            News::Ended,
        );
    }

    /// Takes what the thread has to tell.
    pub fn take_news(&mut self, state: &mut DecodersState) {
        while let Some(news) = self.job.next_event() {
            match news {
                News::Measured(place, report) => state.take(place, report),
                News::Ended(Ok(())) => {}
                News::Ended(Err(error)) => state.end(&format!("{error}: fold the table and unfold it again")),
            }
        }
    }
}

fn measure_all(settings: SimulatedSettings, networks: Networks, test: &Dataset, report: &Report<News>) {
    let set = DecoderSet::new(&settings, Some(networks)).map_err(|error| error.to_string());
    for (place, wanted) in DecoderResult::pending().into_iter().enumerate() {
        if report.is_cancelled() {
            return;
        }
        let measure = |set: &DecoderSet| match set.measure(wanted.kind, wanted.precision, test) {
            Ok(report) => report.ok_or_else(|| "it needs a trained network".to_owned()),
            Err(error) => Err(error.to_string()),
        };
        report.send(News::Measured(
            place,
            set.as_ref().map_err(String::clone).and_then(measure),
        ));
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::evaluation::{Run, Simulation};

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
        let (mut measuring, mut state) = (DecoderMeasuring::new(Arc::new(|| ())), DecodersState::default());
        let number = measuring.expect(&mut state);
        assert!(measuring.awaits(number) && state.is_measuring());
        let mut impossible = settings;
        impossible.source.samples = 0;
        measuring.begin(impossible, run.network(), Arc::clone(run.test()));
        measuring.job.wait(Duration::from_secs(60));
        measuring.take_news(&mut state);
        assert!(!state.is_measuring());
        for result in state.measured.iter().flatten() {
            let reason = result.report.clone().unwrap().unwrap_err();
            assert!(reason.contains("training samples"), "{reason}");
        }
        measuring.forget(&mut state);
        assert!(state.measured.is_none() && !measuring.awaits(number));
    }
}
