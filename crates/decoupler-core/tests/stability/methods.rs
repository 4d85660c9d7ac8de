//! Training methods: wild settings, wild samples, wild weights.

use decoupler_core::{
    network::{Mlp, Shape},
    settings::Value,
    training::{ExampleSets, Examples, Method, StopReason, StoppingRules, Trainer, TrainingSettings},
};
use ndarray::{Array2, Axis, Slice};

use crate::judge::{Job, Verdict, agree, flagged, refused, wrong};

/// A training problem and the weights it starts from.
#[derive(Clone)]
struct Task {
    inputs: Array2<f64>,
    targets: Array2<f64>,
    hidden: usize,
    /// Factor applied to the initial weights.
    start: f64,
    has_validation: bool,
}

/// Numbers in [−1, 1] without repetition.
fn wave(row: usize, column: usize) -> f64 {
    (1.0 + 12.9898 * row as f64 + 78.233 * column as f64 + 0.71 * (row * column) as f64).sin()
}

impl Task {
    fn of(samples: usize, inputs: usize, hidden: usize, outputs: usize) -> Self {
        let inputs = Array2::from_shape_fn((samples, inputs), |(row, column)| wave(row, column));
        let targets = Array2::from_shape_fn((samples, outputs), |(row, output)| {
            (1.7 * inputs.row(row).sum() + output as f64).sin()
        });
        Self {
            inputs,
            targets,
            hidden,
            start: 1.0,
            has_validation: true,
        }
    }

    fn shape(&self) -> Shape {
        Shape {
            inputs: self.inputs.ncols(),
            hidden: self.hidden,
            outputs: self.targets.ncols(),
        }
    }

    fn start(&self) -> Mlp {
        let shape = self.shape();
        Mlp::from_weights(
            shape,
            (0..shape.weights()).map(|index| self.start * wave(index, 7)).collect(),
        )
    }

    /// The validation set, if there is one, is the last third of the samples.
    fn training_samples(&self) -> usize {
        let samples = self.inputs.nrows();
        if self.has_validation && samples > 2 {
            samples - samples / 3
        } else {
            samples
        }
    }

    fn problem(&self) -> ExampleSets {
        let cut = self.training_samples();
        let examples = |rows: std::ops::Range<usize>| {
            let (inputs, targets) = (&self.inputs, &self.targets);
            let at = |set: &Array2<f64>| set.slice_axis(Axis(0), Slice::from(rows.clone())).to_owned();
            Examples::new(at(inputs).view(), at(targets).view())
        };
        let samples = self.inputs.nrows();
        ExampleSets {
            training: examples(0..cut),
            validation: (cut < samples).then(|| examples(cut..samples)),
            test: None,
        }
    }

    /// Returns the error that determines the best weights, computed independently node by node.
    fn deciding_mse(&self, weights: &[f64]) -> f64 {
        let Shape {
            inputs,
            hidden,
            outputs,
        } = self.shape();
        let (cut, samples) = (self.training_samples(), self.inputs.nrows());
        let rows = if cut < samples { cut..samples } else { 0..samples };
        let (first, second) = weights.split_at((inputs + 1) * hidden);
        let (mut sum, count) = (0.0, (rows.len() * outputs) as f64);
        for row in rows {
            let node = |node: usize| {
                let terms = (0..inputs).map(|input| self.inputs[[row, input]] * first[input * hidden + node]);
                (terms.sum::<f64>() + first[inputs * hidden + node]).tanh()
            };
            let nodes: Vec<f64> = (0..hidden).map(node).collect();
            for output in 0..outputs {
                let terms = (0..hidden).map(|node| nodes[node] * second[node * outputs + output]);
                let answer = terms.sum::<f64>() + second[hidden * outputs + output];
                sum += (answer - self.targets[[row, output]]).powi(2);
            }
        }
        sum / count
    }
}

/// Trains and judges: the reported error is correct, the best weights of all epochs are kept, the reason for stopping
/// holds, and a network that stayed at its initial weights is flagged.
fn judge(task: &Task, settings: TrainingSettings) -> Verdict {
    let mut trainer = match Trainer::new(task.start(), task.problem(), settings) {
        Ok(trainer) => trainer,
        Err(error) => return refused(&error),
    };
    while trainer.step().is_none() {}
    let history = trainer.history();
    let is_number = |value: f64| !value.is_nan();
    if let Some(record) = history.iter().skip(1).find(|record| {
        !(is_number(record.training_mse) && is_number(record.gradient_norm) && is_number(record.parameter))
    }) {
        return wrong(format!("epoch {} of the history is NaN", record.epoch));
    }
    let weights = trainer.best().weights();
    if !weights.iter().all(|weight| weight.is_finite()) {
        return wrong("the best weights are not finite");
    }
    let deciding =
        |record: &decoupler_core::training::EpochRecord| record.validation_mse.unwrap_or(record.training_mse);
    // Without held-out samples, the latest weights minimise the objective of Bayesian regularisation, not the training
    // error.
    let is_latest_best = matches!(settings.method, Method::BayesianRegularization(_))
        && history.iter().all(|record| record.validation_mse.is_none());
    let lowest = match history.last().filter(|_| is_latest_best) {
        Some(latest) => deciding(latest),
        None => history.iter().map(deciding).fold(f64::INFINITY, f64::min),
    };
    let (best, start) = (task.deciding_mse(weights), task.deciding_mse(task.start().weights()));
    let defect = trainer.defect();
    if best.is_finite() && !(agree(best, trainer.best_mse(), 1e-6) || (best - trainer.best_mse()).abs() < 1e-22) {
        return wrong(format!(
            "the error is {best:e}, the reported error is {:e}",
            trainer.best_mse()
        ));
    }
    if !agree(lowest, trainer.best_mse(), 0.0) {
        return wrong("the best weights were not kept");
    }
    let latest = trainer.latest();
    let reason = trainer.stop_reason().unwrap();
    let holds = match reason {
        StopReason::GradientSmall => latest.gradient_norm <= settings.stopping.min_gradient,
        StopReason::GoalReached => latest.training_mse <= settings.stopping.goal_mse,
        StopReason::EpochsReached => latest.epoch == settings.stopping.epochs,
        _ => true,
    };
    if !holds {
        return wrong(format!("the reported reason for stopping does not hold: {reason}"));
    }
    match defect {
        Some(defect) => flagged(&defect),
        None if start > 0.0 && best >= 0.99 * start => wrong(format!(
            "the network has its random initial weights, without a remark: {reason}"
        )),
        None => Verdict::Right,
    }
}

/// Tasks of every extreme, with a sentence each.
fn tasks() -> Vec<(String, Task)> {
    let ordinary = Task::of(60, 3, 5, 2);
    let scaled = |inputs: f64, targets: f64, start: f64| Task {
        inputs: inputs * &ordinary.inputs,
        targets: targets * &ordinary.targets,
        start,
        ..ordinary.clone()
    };
    let repeat = |values: &Array2<f64>| values.select(Axis(0), &vec![0; values.nrows()]);
    let repeated = Task {
        inputs: repeat(&ordinary.inputs),
        targets: repeat(&ordinary.targets),
        ..ordinary.clone()
    };
    let unheld = Task {
        has_validation: false,
        ..ordinary.clone()
    };
    let mut tasks = vec![
        ("an ordinary task".to_owned(), ordinary.clone()),
        ("all samples the same".to_owned(), repeated),
        ("inputs constant".to_owned(), scaled(0.0, 1.0, 1.0)),
        ("targets constant".to_owned(), scaled(1.0, 0.0, 1.0)),
        ("nothing held out".to_owned(), unheld),
    ];
    for (samples, inputs, hidden, outputs) in [
        (1, 3, 5, 2),
        (2, 3, 5, 2),
        (3, 3, 5, 2),
        (5, 3, 100, 2),
        (60, 1, 1, 1),
        (60, 1, 40, 1),
        (60, 3, 1, 2),
        (30, 200, 3, 2),
        (30, 3, 3, 200),
        (400, 2, 2, 1),
        (60, 0, 2, 2),
        (5, 3, 0, 2),
        (5, 3, 2, 0),
    ] {
        let sentence = format!("{samples} samples of {inputs} inputs, {hidden} hidden nodes, {outputs} outputs");
        tasks.push((sentence, Task::of(samples, inputs, hidden, outputs)));
    }
    for factor in [1e-300, 1e-150, 1e-30, 1e-6, 1e6, 1e30, 1e150, 1e300] {
        tasks.push((format!("inputs times {factor:e}"), scaled(factor, 1.0, 1.0)));
        tasks.push((format!("targets times {factor:e}"), scaled(1.0, factor, 1.0)));
    }
    for start in [0.0, 1e-300, 1e-9, 30.0, 1e3, 1e9, 1e150, 1e300] {
        tasks.push((format!("weights times {start:e}"), scaled(1.0, 1.0, start)));
    }
    tasks
}

pub(crate) fn jobs() -> Vec<Job> {
    let mut jobs = Vec::new();
    let usual = StoppingRules {
        epochs: 40,
        ..StoppingRules::default()
    };
    let mut push = |method: Method, stopping, sentence: String, task: Task| {
        let sentence = format!("{}, {sentence}", method.short_name());
        let settings = TrainingSettings { method, stopping };
        jobs.push(Job::one(sentence, move || judge(&task, settings)));
    };
    for method in Method::all() {
        for (sentence, task) in tasks() {
            push(method, usual, sentence, task);
        }
        for row in method.settings() {
            let mut asked = method;
            let default = row.number(&method).expect("the settings of methods are numbers");
            let (least, most) = row.range().expect("the settings of methods are numbers").into_inner();
            for value in [
                least,
                most,
                1e-3 * default,
                0.5 * default,
                30.0 * default,
                1e3 * default,
                0.0,
                -1.0,
                1.0,
                1e12,
                1e-12,
                1e300,
                f64::NAN,
                f64::INFINITY,
            ] {
                row.set(&mut asked, &Value::Number(value)).expect("it takes numbers");
                for has_validation in [true, false] {
                    let task = Task {
                        has_validation,
                        ..Task::of(60, 3, 5, 2)
                    };
                    let sentence = format!("{} {value:e}, held out: {has_validation}", row.name);
                    push(asked, usual, sentence, task);
                }
            }
        }
        for stopping in [
            StoppingRules { epochs: 1, ..usual },
            StoppingRules { epochs: 0, ..usual },
            StoppingRules {
                goal_mse: f64::MAX,
                ..usual
            },
            StoppingRules {
                goal_mse: f64::NAN,
                ..usual
            },
            StoppingRules {
                min_gradient: f64::MAX,
                ..usual
            },
            StoppingRules { max_fail: 1, ..usual },
            StoppingRules { max_fail: 0, ..usual },
        ] {
            push(method, stopping, format!("{stopping:?}"), Task::of(60, 3, 5, 2));
        }
    }
    jobs
}
