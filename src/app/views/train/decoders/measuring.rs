//! The thread that measures decoders. It yields to the window and ends after the last, or after the one in hand when
//! nobody waits for more.

use std::{
    fmt,
    sync::{
        Arc,
        mpsc::{Receiver, channel},
    },
    thread,
};

use super::{DecoderResult, DecodersState};
use crate::{
    app::threads::{Report, Wake, WorkerDied, next_event, yield_to_window},
    dataset::Dataset,
    evaluation::{DecoderReport, DecoderSet, SimulatedSettings},
    network::Networks,
};

/// The place of a decoder in the list, and what it is worth.
type News = (usize, Result<DecoderReport, String>);

/// The window's end of the thread; without it the thread ends after the decoder in hand.
#[derive(Default)]
pub struct DecoderMeasuring {
    news: Option<Receiver<News>>,
    /// Tells networks apart that are measured one after the other.
    number: u64,
}

impl DecoderMeasuring {
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
        self.news = None;
        state.measured = None;
    }

    /// Measures all decoders of `settings` with their trained `networks` on `test`. `wake` is called after each decoder
    /// and at the end.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn begin(
        &mut self,
        settings: SimulatedSettings,
        networks: Networks,
        test: Arc<Dataset>,
        wake: Wake,
    ) -> std::io::Result<()> {
        let (outgoing, incoming) = channel();
        let news = Report::new(outgoing, wake);
        let work = move || {
            yield_to_window();
            let set = DecoderSet::new(&settings, Some(networks)).map_err(|error| error.to_string());
            for (place, wanted) in DecoderResult::pending().into_iter().enumerate() {
                let measure = |set: &DecoderSet| match set.measure(wanted.kind, wanted.precision, &test) {
                    Ok(report) => report.ok_or_else(|| "it needs a trained network".to_owned()),
                    Err(error) => Err(error.to_string()),
                };
                let report = set.as_ref().map_err(String::clone).and_then(measure);
                // Nobody waits any more.
                if !news.try_send((place, report)) {
                    return;
                }
            }
        };
        thread::Builder::new().name("decoders".to_owned()).spawn(work)?;
        self.news = Some(incoming);
        Ok(())
    }

    /// Takes what the thread has to tell.
    pub fn take_news(&mut self, state: &mut DecodersState) {
        while let Some(news) = &self.news {
            match next_event(news) {
                Ok(Some((place, report))) => state.take(place, report),
                Ok(None) => return,
                Err(WorkerDied) => {
                    state.end("measuring ended unexpectedly: fold the table and unfold it again");
                    self.news = None;
                }
            }
        }
    }
}

impl fmt::Debug for DecoderMeasuring {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DecoderMeasuring").finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
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
        let (mut measuring, mut state) = (DecoderMeasuring::default(), DecodersState::default());
        let number = measuring.expect(&mut state);
        assert!(measuring.awaits(number) && state.is_measuring());
        let (waking, woken) = channel();
        let mut impossible = settings;
        impossible.source.samples = 0;
        let wake = move || waking.send(()).unwrap_or(());
        measuring
            .begin(impossible, run.network(), Arc::clone(run.test()), Arc::new(wake))
            .unwrap();
        // Until the thread has ended.
        while woken.recv().is_ok() {}
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
