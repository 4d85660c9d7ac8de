//! The other decoders, and the built-in demo network.

use std::sync::{Arc, Mutex, PoisonError};

use decoupler_core::{
    dataset::{Dataset, Simulation},
    decoupling::{Decoder, DecoderKind, Precision},
    evaluation::{DecoderSet, Run, RunError, RunSets, RunSettings},
    job::Job,
    machine::node_pairs_per_row,
    network::{InputChoice, Networks, Quantity, ScalingChoice},
    scene::{Indenter, Loading, Rows, Scene},
};
use decoupler_files::machine::memory_budget;

use super::solving::{Answer, Question, Subject, decode};
use crate::window::{
    job::{Background, JobError, Report, Wake},
    test_view::Skin,
};

/// Decoders compared with the network, the fastest first.
pub(super) const KINDS: [DecoderKind; 5] = [
    DecoderKind::Mean,
    DecoderKind::Ridge,
    DecoderKind::RadialBasis,
    DecoderKind::Polish,
    DecoderKind::Newton,
];

/// Answer of a decoder to the pressed sensor `of`.
#[derive(Debug)]
pub(super) struct Compared {
    pub(super) kind: DecoderKind,
    pub(super) answer: Result<Answer, String>,
    pub(super) of: Arc<Dataset>,
}

/// Event of the job: an answer, or the reason why it died; nothing when it has ended.
type CompareEvent = Option<Result<Compared, JobError>>;

/// Decoders fitted so far, in the order of [`KINDS`], or why they could not be fitted.
type Fitted = Mutex<Vec<Result<Box<dyn Decoder>, String>>>;

/// The other decoders: fitted and asked in the background, one touch at a time; the newest touch wins.
pub(super) struct Comparison {
    job: Background<CompareEvent>,
    fitted: Arc<Fitted>,
    /// The network whose training the decoders share.
    of: Option<Arc<Networks>>,
    /// The pressed sensor that they were asked about last.
    asked: Option<Arc<Dataset>>,
    /// The latest answer of each, also to an earlier touch.
    pub(super) answers: Vec<Compared>,
    /// Reason why the job died.
    pub(super) failure: Option<String>,
}

impl std::fmt::Debug for Comparison {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Comparison").finish_non_exhaustive()
    }
}

impl Comparison {
    pub(super) fn new(wake: &Wake) -> Self {
        Self {
            job: Background::prompt("comparison", Arc::clone(wake)),
            fitted: Arc::default(),
            of: None,
            asked: None,
            answers: Vec::new(),
            failure: None,
        }
    }

    /// Takes answers, and asks about the pressed sensor of `question`, unless its network still learns.
    pub(super) fn follow(&mut self, question: &Question, pressed: &Arc<Dataset>) {
        let subject = question.subject.as_ref().filter(|subject| subject.is_idle);
        let networks = subject.map(|subject| &subject.networks);
        if self.of.as_ref().map(Arc::as_ptr) != networks.map(Arc::as_ptr) {
            self.job.abandon();
            (self.of, self.fitted) = (networks.cloned(), Arc::default());
            (self.asked, self.answers, self.failure) = (None, Vec::new(), None);
        }
        while let Some(event) = self.job.next_event() {
            match event {
                Some(Ok(compared)) => {
                    self.answers.retain(|other| other.kind != compared.kind);
                    self.answers.push(compared);
                }
                Some(Err(error)) => self.failure = Some(error.to_string()),
                None => {}
            }
        }
        let is_asked = self.asked.as_ref().is_some_and(|asked| Arc::ptr_eq(asked, pressed));
        let Some(subject) = subject.filter(|_| !is_asked) else {
            return;
        };
        if self.job.is_under_way() {
            // Its decoder answers, or is fitted, and then they are asked about this touch.
            return self.job.cancel();
        }
        (self.asked, self.failure) = (Some(Arc::clone(pressed)), None);
        let (subject, pressed, fitted) = (subject.clone(), Arc::clone(pressed), Arc::clone(&self.fitted));
        let stroke_mm = question.skin.stroke_mm;
        self.job.start(
            move |report| compare(&subject, (&pressed, stroke_mm), &fitted, report),
            |ended| ended.err().map(Err),
        );
    }
}

/// Asks one decoder after the other, each fitted when it is first asked.
fn compare(
    subject: &Subject,
    (pressed, stroke_mm): (&Arc<Dataset>, f64),
    fitted: &Fitted,
    report: &Report<CompareEvent>,
) {
    // Only one job runs at a time, and a panic leaves whole decoders.
    let mut fitted = fitted.lock().unwrap_or_else(PoisonError::into_inner);
    let mut set = None;
    for (index, kind) in KINDS.into_iter().enumerate() {
        if fitted.len() == index {
            let set = set.get_or_insert_with(|| decoder_set(subject, report));
            let decoder = set.as_ref().map_err(ToString::to_string).and_then(|set| {
                let decoder = set
                    .decoder(kind, Precision::Double)
                    .map_err(|error| error.to_string())?;
                decoder.ok_or_else(|| "it needs a trained network".to_owned())
            });
            if report.is_cancelled() {
                return;
            }
            fitted.push(decoder);
        }
        let answer = match &mut fitted[index] {
            Ok(decoder) => decode(&mut **decoder, pressed, stroke_mm).map(|(_, answer)| answer),
            Err(reason) => Err(reason.clone()),
        };
        let of = Arc::clone(pressed);
        report.send(Some(Ok(Compared { kind, answer, of })));
        if report.is_cancelled() {
            return;
        }
    }
}

/// Draws the samples that the network was trained on.
fn decoder_set(subject: &Subject, report: &Report<CompareEvent>) -> Result<DecoderSet, RunError> {
    let Subject { settings, networks, .. } = subject;
    let sets = RunSets::draw(settings, memory_budget(), &Job::new(&|| report.is_cancelled()))?;
    Ok(DecoderSet::new(
        *settings,
        sets.split.training,
        Some(Networks::clone(networks)),
    ))
}

/// A small network for the displayed sensor, trained quickly in the background once the user is about to press and there is
/// no other.
#[derive(Debug)]
pub(super) struct Demo {
    job: Background<Result<Result<Networks, RunError>, JobError>>,
    /// Settings of the network that is there or being trained; `None` for an array that is too large.
    settings: Option<RunSettings>,
    /// The network, or why it could not be trained.
    pub(super) subject: Option<Result<Subject, String>>,
}

impl Demo {
    pub(super) fn new(wake: &Wake) -> Self {
        Self {
            job: Background::prompt("demo network", Arc::clone(wake)),
            settings: None,
            subject: None,
        }
    }

    /// Takes the network for the sensor of `skin`, which is trained unless that takes long.
    pub(super) fn follow(&mut self, skin: &Skin) {
        let settings = demo_settings(skin);
        if self.settings != settings {
            (self.settings, self.subject) = (settings, None);
            self.job.abandon();
            if let Some(settings) = settings {
                let work = move |report: &Report<_>| train(settings, &Job::new(&|| report.is_cancelled()));
                self.job.start(work, |trained| trained);
            }
        }
        if let (Some(trained), Some(settings)) = (self.job.next_event(), settings) {
            let trained = trained.map_err(|error| error.to_string());
            let trained = trained.and_then(|trained| trained.map_err(|error| error.to_string()));
            self.subject = Some(trained.map(|networks| Subject {
                networks: Arc::new(networks),
                settings,
                is_demo: true,
                is_idle: true,
            }));
        }
    }

    /// Returns true while the network is being trained.
    pub(super) fn is_awaited(&self) -> bool {
        self.settings.is_some() && self.subject.is_none()
    }
}

fn train(settings: RunSettings, job: &Job<'_>) -> Result<Networks, RunError> {
    let sets = RunSets::draw(&settings, memory_budget(), job)?;
    let mut run = Run::new(settings, sets, None, job)?;
    run.finish(job)?;
    Ok(run.network())
}

/// Returns the settings of a small network that learns imprints of balls on the sensor of `skin` in a fraction of a second,
/// with its rows and stroke, and without noise; `None` for arrays for which training would take longer.
///
/// One network for each known row, with conductances scaled to [−1, 1], was the best choice for so few samples.
fn demo_settings(skin: &Skin) -> Option<RunSettings> {
    /// Number of training samples per row.
    const SAMPLES: usize = 200;
    /// Maximum number of pairs of nodes in all samples: about a tenth of a second.
    const MAX_PAIRS: f64 = 5e7;
    /// Maximum number of unknowns and readings of all rows, with which the time of an epoch grows.
    const MAX_CHANNELS: usize = 2000;
    let (scale, rows) = (skin.sensor.scale, skin.rows.len());
    let samples = SAMPLES * rows;
    let channels = rows * (scale.nodes_per_row() + scale.columns());
    if samples as f64 * node_pairs_per_row(&skin.sensor) > MAX_PAIRS || channels > MAX_CHANNELS {
        return None;
    }
    let scene = Scene {
        rows: match skin.rows[..] {
            [row] => Rows::One(row),
            _ => Rows::Known,
        },
        loading: Loading::Indenter(Indenter::default()),
        largest_compression: skin.stroke_mm / skin.sensor.geometry.height_mm,
        ..Scene::default()
    };
    let mut settings = RunSettings::from(Simulation {
        sensor: skin.sensor,
        scene,
        samples,
        validation_samples: 0,
        test_samples: rows,
    });
    settings.inputs = InputChoice {
        quantity: Quantity::Conductance,
        scaling: ScalingChoice::MinMax,
    };
    settings.hidden = 6;
    settings.training.stopping.epochs = 30;
    Some(settings)
}
