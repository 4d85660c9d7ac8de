//! Several starts of one run: shared samples, selection of the best start, and independence of threads and pauses.

use decoupler_core::{
    dataset::{Seed, Simulation},
    evaluation::{MAX_STARTS, Run, RunError, RunSets, RunSettings, StartTrainer, TrainingSize, Workload, best_start},
    job::Job,
    machine::MemoryBudget,
    sensor::SensorModel,
    training::{Method, StopReason, StoppingRules, Trainer, TrainerState},
};

fn settings(starts: usize) -> RunSettings {
    let mut settings = RunSettings {
        source: Simulation {
            sensor: SensorModel::new("10x6_3x18".parse().unwrap()),
            samples: 100,
            validation_samples: 40,
            test_samples: 20,
            ..Simulation::default()
        }
        .into(),
        hidden: 4,
        starts,
        seed: Seed(3),
        ..RunSettings::default()
    };
    settings.training.stopping.epochs = 12;
    settings
}

fn trained(settings: RunSettings) -> Run {
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    run
}

/// Current and best weights of every start as bits, and its epochs.
fn bits(run: &Run) -> Vec<(Vec<u64>, usize, Option<StopReason>)> {
    let of = |trainer: &StartTrainer| {
        let weights = |row: &Trainer| [row.present().weights(), row.best().weights()].concat();
        let bits = trainer
            .rows()
            .iter()
            .flat_map(weights)
            .map(|weight| weight.to_bits())
            .collect();
        (bits, trainer.latest().epoch, trainer.stop_reason())
    };
    run.trainers().iter().map(of).collect()
}

/// Resumes a run of these settings from saved states.
fn resumed(settings: RunSettings, states: Vec<TrainerState>) -> Result<Run, RunError> {
    let sets = RunSets::draw(&settings, MemoryBudget::UNLIMITED, &Job::UNINTERRUPTED)?;
    Run::new(settings, sets, Some(states), &Job::UNINTERRUPTED)
}

#[test]
fn the_first_start_is_the_run_of_one_start_and_the_others_differ() {
    let (one, four) = (trained(settings(1)), trained(settings(4)));
    assert_eq!(bits(&four)[0], bits(&one)[0]);
    let mut distinct: Vec<_> = bits(&four).into_iter().map(|(weights, ..)| weights).collect();
    distinct.sort();
    distinct.dedup();
    assert_eq!(distinct.len(), 4);
    assert_eq!(four.baselines(), one.baselines(), "the same sets");
    assert_eq!(
        bits(&trained(settings(2)))[..],
        bits(&four)[..2],
        "more starts do not change the first one"
    );
}

#[test]
fn the_start_with_the_lowest_validation_error_is_best() {
    for validation_samples in [40, 0] {
        let run = trained(RunSettings {
            source: Simulation {
                validation_samples,
                ..*settings(4).simulation().unwrap()
            }
            .into(),
            ..settings(4)
        });
        let starts = run.starts();
        let number = run.leader_number();
        assert_eq!(Some(number), best_start(&starts));
        let lowest = starts[number].deciding_mse();
        assert!(starts.iter().all(|start| lowest <= start.deciding_mse()));
        assert_eq!(starts[number].validation_mse.is_some(), validation_samples > 0);
        assert!(
            run.network()
                .values()
                .iter()
                .map(|network| network.mlp())
                .eq(run.trainers()[number].best())
        );
        assert_eq!(run.errors().percent(), starts[number].z_percent);
        assert_eq!(run.stop_reason(), run.leader().stop_reason());
    }
}

#[test]
fn a_run_continues_until_every_start_has_ended_or_all_are_stopped() {
    let mut settings = settings(6);
    settings.training.stopping = StoppingRules {
        epochs: 300,
        max_fail: 2,
        ..StoppingRules::default()
    };
    let mut run = Run::prepare(settings).unwrap();
    let some_ended = |run: &Run| run.trainers().iter().any(|trainer| trainer.stop_reason().is_some());
    while !some_ended(&run) {
        assert_eq!(run.step(), None);
    }
    let ended = run.trainers().iter().position(|t| t.stop_reason().is_some()).unwrap();
    let epochs = run.trainers()[ended].latest().epoch;
    assert_eq!(run.step(), None);
    assert_eq!(
        run.trainers()[ended].latest().epoch,
        epochs,
        "a start that has ended stays paused"
    );
    run.stop();
    assert_eq!(run.stop_reason(), Some(StopReason::Stopped));
    assert_ne!(run.trainers()[ended].stop_reason(), Some(StopReason::Stopped));
}

#[test]
fn every_start_continues_with_another_method_and_keeps_counting() {
    let mut settings = settings(2);
    settings.training.method = Method::all()[7];
    let mut run = Run::prepare(settings).unwrap();
    (0..5).for_each(|_| {
        run.step();
    });
    run.continue_with(Method::default()).unwrap();
    while run.step().is_none() {}
    for trainer in run.trainers() {
        let stages: Vec<_> = trainer
            .stages()
            .iter()
            .map(|s| (s.first_epoch, s.method.short_name()))
            .collect();
        assert_eq!(stages, [(0, "gd"), (6, "lm")]);
        assert_eq!(trainer.latest().epoch, 12);
        assert!(trainer.history()[12].training_mse < 0.5 * trainer.history()[5].training_mse);
    }
    assert_eq!(run.settings().training.method, Method::default());
}

#[test]
fn too_many_starts_are_refused() {
    for starts in [0, MAX_STARTS + 1] {
        let message = Run::prepare(settings(starts)).err().unwrap().to_string();
        assert!(
            message.contains("starts") && message.contains("from 1 to 100"),
            "{message}"
        );
    }
    let wide = RunSettings {
        hidden: 512,
        starts: 100,
        ..settings(1)
    };
    let memory = MemoryBudget::User(Workload::of(&wide, TrainingSize::drawn(&wide).unwrap()).bytes - 1);
    let error = RunSets::draw(&wide, memory, &Job::UNINTERRUPTED).err().unwrap();
    assert!(matches!(error, RunError::Memory { .. }), "{error}");
    let states = Run::prepare(settings(2)).unwrap().states();
    assert!(matches!(
        resumed(settings(3), states),
        Err(RunError::Starts { found: 2, .. })
    ));
}
