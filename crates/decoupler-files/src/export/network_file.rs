use std::{io::Write as _, path::Path, sync::Arc};

use decoupler_core::{
    dataset::Dataset,
    evaluation::{ErrorTable, PastNetwork, Problem, Run, RunSettings, Scores},
    network::Networks,
};
use serde::{Deserialize, Serialize};
use serde_json::value::{RawValue, to_raw_value};

use super::{
    AtomicFile, DocumentError, DocumentKind, TrainingRecord, WriteError,
    atomic::{LARGEST_BYTES, too_large},
    document::PROGRAM,
    soundness::defect,
    unfinished::folder_of,
};
use crate::import::{InputLines, Recorded, Setup, SetupError};

const KIND: DocumentKind = DocumentKind::Network;

/// A trained network with its settings, the description of its channels, the record of its training, and its errors; for a
/// recording also the plan that reads it. The file is JSON; a network that is read back gives bit-identical results.
///
/// Paths of recordings are stored relative to the folder of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkFile {
    /// Program and version that wrote the file.
    pub program: String,
    /// Settings of the run: source, method, stopping rules, seed.
    pub settings: RunSettings,
    /// Origin of recorded samples, with absolute paths; `None` for a simulated array.
    pub recorded: Option<Recorded>,
    /// Names, units and positions of readings and targets.
    pub problem: Problem,
    /// Row-wires of the samples in ascending order, from 0, if they are known.
    pub row_wires: Option<Vec<usize>>,
    /// Best network of the training, or best network of each row-wire.
    pub network: Networks,
    /// Record of the training.
    pub training: TrainingRecord,
    /// Errors of the network and of the baselines on the test set.
    pub scores: Scores,
}

/// The part of the file that the checksum covers.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    settings: RunSettings,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    recorded: Option<Recorded>,
    problem: Problem,
    row_wires: Option<Vec<usize>>,
    network: Networks,
    training: TrainingRecord,
    scores: Scores,
}

impl NetworkFile {
    /// Takes the best network of `run` so far, with its record and errors; `recorded` is the origin of its samples if they are
    /// recorded.
    ///
    /// # Errors
    /// [`DocumentError::NoPlan`] if the samples are recorded and nothing says where.
    pub fn from_run(run: &Run, recorded: Option<&Recorded>) -> Result<Self, DocumentError> {
        let scores = run.scores().ok_or(DocumentError::NoPlan(KIND))?;
        Ok(Self {
            program: PROGRAM.to_owned(),
            settings: *run.settings(),
            recorded: KIND.recorded_of(run, recorded)?,
            problem: Problem::clone(run.problem()),
            row_wires: run.test().row_wires_read().map(<[usize]>::to_vec),
            network: run.network(),
            training: TrainingRecord::of(run),
            scores,
        })
    }

    /// Takes the network that `run` would have kept had it been stopped at a past epoch, with its record until then and its
    /// errors.
    ///
    /// # Errors
    /// As [`Self::from_run`].
    pub fn from_past(run: &Run, recorded: Option<&Recorded>, past: &PastNetwork) -> Result<Self, DocumentError> {
        let mut file = Self::from_run(run, recorded)?;
        file.scores.network = run.errors_of(&past.networks.decouple(run.test()));
        file.network = past.networks.clone();
        file.training = TrainingRecord::until(run, past);
        Ok(file)
    }

    /// Returns a parser of lines with the inputs of the network of a recording.
    pub fn input_lines(&self) -> InputLines {
        let recorded = self.recorded.as_ref();
        let row_wire = recorded.and_then(|recorded| recorded.plan.import.row_wire.clone());
        let has_rows = self.network.only().is_none();
        let row_wires = self.row_wires.clone().filter(|_| has_rows);
        InputLines::new(self.problem.inputs.clone(), row_wire, row_wires)
    }

    /// Setup of the run.
    pub fn setup(&self) -> Setup {
        let plan = self.recorded.as_ref().map(|recorded| recorded.plan.clone());
        Setup::of(self.settings, plan).expect("a file of a recording has its plan, as reading and writing check")
    }

    /// Returns the test set of the run, drawn or read again, as a report of it needs.
    ///
    /// # Errors
    /// The recording is missing or has changed, or the settings are impossible.
    pub fn test_set(&self) -> Result<Arc<Dataset>, SetupError> {
        if let Some(settings) = self.settings.simulated() {
            return Ok(Arc::new(settings.draw_test()?));
        }
        let sets = self.setup().sets(Path::new(""), &|| false, &mut |_| ())?;
        let sets = sets.expect("nothing cancels it");
        sets.check_saved(self.recorded.as_ref())?;
        Ok(sets.sets.test)
    }

    /// Name of the source: the array scale, or the stem of the first recording.
    pub fn source_name(&self) -> String {
        self.setup().source_name()
    }

    /// Errors of the network and of the baselines, next to the published ones if there are any.
    pub fn error_table(&self) -> ErrorTable {
        let published = self.settings.simulated().and_then(|settings| settings.published());
        ErrorTable::of_scores(&self.problem, &self.scores, published.as_ref())
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// The network has values that could not be read back, or the path cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), DocumentError> {
        self.save_by(path, AtomicFile::commit)
    }

    /// As [`Self::save`]; `commit` puts the file in its place.
    pub(super) fn save_by(&self, path: &Path, commit: Commit) -> Result<(), DocumentError> {
        let unsound = |defect: String| DocumentError::Unsound {
            path: path.to_owned(),
            defect,
        };
        if let Some(defect) = defect(self) {
            return Err(unsound(defect));
        }
        let Self {
            program,
            settings,
            recorded,
            problem,
            row_wires,
            network,
            training,
            scores,
        } = self.clone();
        let document = Document {
            settings,
            recorded: recorded.map(|recorded| recorded.relative_to(folder_of(path))),
            problem,
            row_wires,
            network,
            training,
            scores,
        };
        let run = to_raw_value(&document).map_err(|error| unsound(error.to_string()))?;
        Ok(Sealed::new(KIND, &program, &run).save(path, commit)?)
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or is damaged.
    pub fn load(path: &Path) -> Result<Self, DocumentError> {
        let bytes = KIND.read(path)?;
        let read = Self::parse(&bytes, folder_of(path));
        let sound = read.and_then(|file| defect(&file).map_or(Ok(file), Err));
        sound.map_err(|defect| KIND.damaged(path, defect))
    }

    /// Describes the first defect that would keep the file from being read back.
    pub fn defect(&self) -> Option<String> {
        defect(self)
    }

    fn parse(bytes: &[u8], folder: &Path) -> Result<Self, String> {
        let Sealed { program, run, .. } = Sealed::read(bytes)?;
        let document: Document = serde_json::from_str(run.get()).map_err(|error| error.to_string())?;
        Ok(Self {
            program,
            settings: document.settings,
            recorded: document.recorded.map(|recorded| recorded.within(folder)),
            problem: document.problem,
            row_wires: document.row_wires,
            network: document.network,
            training: document.training,
            scores: document.scores,
        })
    }
}

/// Layout of a file with a checksum: a heading and the record of a run. A change anywhere in the record is noticed.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Sealed<'a> {
    format: String,
    pub(super) version: u64,
    pub(super) program: String,
    /// CRC-32 of the text of `run`, as hexadecimal digits.
    crc32: String,
    #[serde(borrow)]
    pub(super) run: &'a RawValue,
}

impl<'a> Sealed<'a> {
    pub(super) fn new(kind: DocumentKind, program: &str, run: &'a RawValue) -> Self {
        Self {
            format: kind.format().to_owned(),
            version: kind.version(),
            program: program.to_owned(),
            crc32: checksum(run),
            run,
        }
    }

    /// Reads a file and checks its checksum.
    ///
    /// # Errors
    /// A description of the damage.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, String> {
        let sealed: Self = serde_json::from_slice(bytes).map_err(|error| error.to_string())?;
        if sealed.crc32 == checksum(sealed.run) {
            Ok(sealed)
        } else {
            Err("its checksum shows that something in it has changed".to_owned())
        }
    }

    /// Writes the file at `path`, whole or not at all; `commit` puts it in its place.
    ///
    /// # Errors
    /// The path cannot be written, or the file would be too large to be read again.
    pub(super) fn save(&self, path: &Path, commit: Commit) -> Result<(), WriteError> {
        /// More than the heading takes.
        const HEADING: u64 = 1 << 10;
        let error = |source| WriteError::io(path, source);
        if self.run.get().len() as u64 + HEADING > LARGEST_BYTES {
            return Err(error(too_large()));
        }
        let mut file = AtomicFile::create(path)?;
        serde_json::to_writer(&mut file, self).map_err(|source| error(source.into()))?;
        writeln!(file).map_err(error)?;
        commit(file)
    }
}

/// Puts a written file in its place: [`AtomicFile::commit`] or [`AtomicFile::commit_new`].
pub(super) type Commit = fn(AtomicFile) -> Result<(), WriteError>;

fn checksum(run: &RawValue) -> String {
    format!("{:08x}", crc32fast::hash(run.get().as_bytes()))
}
