use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::value::to_raw_value;

use super::{
    AtomicFile, DocumentError, DocumentKind, TrainingRecord, document::PROGRAM, network_document::TrainingDocument,
    sealed::Sealed,
};
use crate::{
    evaluation::Channel,
    evaluation::{MeasuredSettings, Run, TargetErrors},
    import::Plan,
    network::Networks,
};

const KIND: DocumentKind = DocumentKind::MeasuredNetwork;

/// A network trained on measured samples, with the names and units of its readings and targets, the record of its training and
/// its errors. The file is JSON; a network that is read back gives bit-identical results.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredNetworkFile {
    /// Program and version that wrote the file.
    pub program: String,
    /// Settings of the run.
    pub settings: MeasuredSettings,
    /// Files, meanings of their columns, and division of their samples.
    pub plan: Plan,
    /// Names and units of the readings.
    pub inputs: Vec<Channel>,
    /// Names and units of the targets.
    pub targets: Vec<Channel>,
    /// Row-wires of the samples in ascending order, from 0, if they are known.
    pub row_wires: Option<Vec<usize>>,
    /// Best network of the training, or best network of each row-wire.
    pub network: Networks,
    /// Record of the training.
    pub training: TrainingRecord,
    /// Errors of the network on the test samples, target by target.
    pub errors: Vec<TargetErrors>,
    /// Errors of always answering the mean of the training samples.
    pub mean: Vec<TargetErrors>,
    /// Errors of ridge regression.
    pub ridge: Vec<TargetErrors>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RunDocument {
    settings: MeasuredSettings,
    plan: Plan,
    inputs: Vec<Channel>,
    targets: Vec<Channel>,
    row_wires: Option<Vec<usize>>,
    network: Networks,
    training: TrainingDocument,
    errors: Vec<TargetErrors>,
    mean: Vec<TargetErrors>,
    ridge: Vec<TargetErrors>,
}

impl MeasuredNetworkFile {
    /// Takes the best network of `run` so far, with its record and errors. The paths of `plan` should not depend on the working
    /// folder; `channels` are the names and units of readings and targets.
    ///
    /// # Errors
    /// [`DocumentError::Simulated`] if the samples are simulated.
    pub fn from_run(run: &Run, plan: Plan, channels: (&[Channel], &[Channel])) -> Result<Self, DocumentError> {
        let settings = run.settings().measured().ok_or(DocumentError::Simulated(KIND))?;
        let mut table = run.target_table().into_iter().map(|row| row.targets);
        let mut next = || table.next().unwrap_or_default();
        let (mean, ridge, errors) = (next(), next(), next());
        Ok(Self {
            program: PROGRAM.to_owned(),
            settings,
            plan,
            inputs: channels.0.to_vec(),
            targets: channels.1.to_vec(),
            row_wires: run.test().row_wires_read().map(<[usize]>::to_vec),
            network: run.network(),
            training: TrainingRecord::of(run),
            errors,
            mean,
            ridge,
        })
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// The network has values that could not be read back, or the path cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), DocumentError> {
        let unsound = |flaw: String| DocumentError::Unsound {
            path: path.to_owned(),
            flaw,
        };
        if let Some(flaw) = self.flaw() {
            return Err(unsound(flaw));
        }
        let Self {
            program,
            settings,
            plan,
            inputs,
            targets,
            row_wires,
            network,
            training,
            errors,
            mean,
            ridge,
        } = self.clone();
        let run = to_raw_value(&RunDocument {
            settings,
            plan,
            inputs,
            targets,
            row_wires,
            network,
            training: TrainingDocument::of(training),
            errors,
            mean,
            ridge,
        });
        let run = run.map_err(|error| unsound(error.to_string()))?;
        Ok(Sealed::new(KIND, &program, &run).save(path, AtomicFile::commit)?)
    }

    /// Reads the file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, is of another kind or version, or is damaged.
    pub fn load(path: &Path) -> Result<Self, DocumentError> {
        let (_, bytes) = KIND.read(path)?;
        let read = Self::parse(&bytes).and_then(|file| file.flaw().map_or(Ok(file), Err));
        read.map_err(|flaw| KIND.damaged(path, flaw))
    }

    fn parse(bytes: &[u8]) -> Result<Self, String> {
        let sealed = Sealed::read(bytes)?;
        let run: RunDocument = serde_json::from_str(sealed.run.get()).map_err(|error| error.to_string())?;
        Ok(Self {
            settings: run.settings,
            plan: run.plan,
            inputs: run.inputs,
            targets: run.targets,
            row_wires: run.row_wires,
            network: run.network,
            training: run.training.into_record()?,
            errors: run.errors,
            mean: run.mean,
            ridge: run.ridge,
            program: sealed.program,
        })
    }

    /// Describes the first defect of the file and its field.
    fn flaw(&self) -> Option<String> {
        let networks = self.network.values();
        let rows = self.row_wires.as_ref().map_or(1, Vec::len);
        if networks.len() != 1 && networks.len() != rows {
            return Some(format!("network: {} of them for {rows} row-wires", networks.len()));
        }
        for network in networks {
            if let Some(index) = network.mlp().weights().iter().position(|weight| !weight.is_finite()) {
                return Some(format!("network: weight {index} is not a finite number"));
            }
            let sizes = [
                ("inputs", network.inputs().channels(), self.inputs.len()),
                ("targets", network.outputs().channels(), self.targets.len()),
                ("hidden nodes", network.mlp().shape().hidden, self.settings.hidden),
            ];
            if let Some((what, found, expected)) = sizes.into_iter().find(|(_, found, expected)| found != expected) {
                return Some(format!("network: it has {found} {what}, where {expected} are named"));
            }
        }
        for (name, errors) in [("errors", &self.errors), ("mean", &self.mean), ("ridge", &self.ridge)] {
            let is_finite = |errors: &TargetErrors| {
                let figures = [
                    Some(errors.rmse),
                    Some(errors.mae),
                    Some(errors.worst),
                    errors.r2,
                    errors.percent_of_range,
                ];
                figures.into_iter().flatten().all(f64::is_finite)
            };
            if errors.len() != self.targets.len() {
                return Some(format!(
                    "{name}: {} of them for {} targets",
                    errors.len(),
                    self.targets.len()
                ));
            }
            if !errors.iter().all(is_finite) {
                return Some(format!("{name}: an error is not a finite number"));
            }
        }
        None
    }
}
