//! The stopping rules are those of the field's toolbox.

use decoupler_core::training::{
    EpochRecord, ExampleSets, Examples, Method, StopReason, StoppingRules, Trainer, TrainingSettings,
};
use ndarray::Array2;

use crate::problems::{problem, start, trainer};

/// `val_fail` as the toolbox counts it: 0 at a new best validation error, incremented at an error above the best,
/// unchanged at an error equal to it.
fn toolbox_failures(history: &[EpochRecord]) -> Vec<usize> {
    let (mut best, mut failures) = (f64::INFINITY, 0);
    let count = |record: &EpochRecord| {
        let error = record.validation_mse.expect("samples are held out");
        if error < best {
            (best, failures) = (error, 0);
        } else if error > best {
            failures += 1;
        }
        failures
    };
    history.iter().map(count).collect()
}

fn failures(history: &[EpochRecord]) -> Vec<usize> {
    history.iter().map(|record| record.validation_failures).collect()
}

#[test]
fn validation_failures_count_epochs_without_a_new_best() {
    let mut fell_without_a_new_best = false;
    for method in Method::all() {
        let mut trainer = trainer(method);
        for _ in 0..150 {
            trainer.step();
        }
        assert_eq!(
            failures(trainer.history()),
            toolbox_failures(trainer.history()),
            "{method}"
        );
        fell_without_a_new_best |= trainer
            .history()
            .windows(2)
            .any(|pair| pair[1].validation_mse < pair[0].validation_mse && pair[1].validation_failures > 0);
    }
    assert!(
        fell_without_a_new_best,
        "the data do not distinguish this rule from counting increases"
    );
}

#[test]
fn training_stops_at_the_first_epoch_with_max_failures() {
    for method in Method::all() {
        for max_fail in [1, 3, 6] {
            let stopping = StoppingRules {
                epochs: 150,
                max_fail,
                ..StoppingRules::default()
            };
            let settings = TrainingSettings { method, stopping };
            let mut trainer = Trainer::new(start(), problem(), settings).expect("it can be trained");
            while trainer.step().is_none() {}
            let failures = toolbox_failures(trainer.history());
            let (last, before) = failures.split_last().expect("the start is recorded");
            assert!(
                before.iter().all(|failures| *failures < max_fail),
                "{method}, {max_fail}"
            );
            let ended_by_it = trainer.stop_reason() == Some(StopReason::ValidationRose);
            assert_eq!(
                ended_by_it,
                *last >= max_fail,
                "{method}, {max_fail}: {:?}",
                trainer.stop_reason()
            );
        }
    }
}

/// Validation targets of which no error is known.
#[test]
fn an_unknown_validation_error_is_a_failure() {
    let nan = Array2::from_elem((1, 2), f64::NAN);
    let problem = ExampleSets {
        validation: Some(Examples::new(Array2::zeros((1, 3)).view(), nan.view())),
        ..problem()
    };
    let settings = TrainingSettings::default();
    let mut trainer = Trainer::new(start(), problem, settings).expect("it can be trained");
    while trainer.step().is_none() {}
    assert_eq!(trainer.stop_reason(), Some(StopReason::ValidationRose));
    assert_eq!(trainer.history().len(), settings.stopping.max_fail);
}

#[test]
fn training_ends_at_the_first_epoch_that_reaches_the_goal() {
    for method in Method::all() {
        let mut endless = trainer(method);
        for _ in 0..40 {
            endless.step();
        }
        let goal_mse = endless.history()[30].training_mse;
        let first = endless
            .history()
            .iter()
            .position(|epoch| epoch.training_mse <= goal_mse);
        let stopping = StoppingRules {
            goal_mse,
            ..endless.settings().stopping
        };
        let mut trainer = Trainer::new(start(), problem(), TrainingSettings { method, stopping }).expect("as before");
        while trainer.step().is_none() {}
        assert_eq!(trainer.stop_reason(), Some(StopReason::GoalReached), "{method}");
        assert_eq!(Some(trainer.latest().epoch), first, "{method}");
    }
}

#[test]
fn another_method_starts_counting_from_zero() {
    let rp = Method::all()[3];
    let mut trainer = trainer(rp);
    while trainer.latest().validation_failures == 0 {
        trainer.step();
    }
    let best_mse = trainer.best_mse();
    trainer.continue_with(rp).expect("the training can continue");
    trainer.step();
    let latest = trainer.latest();
    // The best error so far remains the reference.
    let is_worse = latest.validation_mse > Some(best_mse);
    assert_eq!(latest.validation_failures, usize::from(is_worse));
}
