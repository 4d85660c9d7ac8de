//! Damaged states of a training.

use decoupler_core::training::{Method, Trainer, TrainerState, TrainingError};

use crate::problems::{problem, trainer};

fn run(trainer: &mut Trainer, epochs: usize) {
    (0..epochs).for_each(|_| {
        trainer.step();
    });
}

#[test]
fn a_damaged_or_foreign_state_is_refused() {
    let mut trainer = trainer(Method::default());
    run(&mut trainer, 3);
    let text = serde_json::to_string(&trainer.state()).unwrap();
    assert!(
        serde_json::from_str::<TrainerState>(&text[..text.len() / 2]).is_err(),
        "truncated"
    );
    let edited = |edit: fn(&mut serde_json::Value)| {
        let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
        edit(&mut value);
        Trainer::resume(serde_json::from_value(value).unwrap(), problem())
            .err()
            .unwrap()
    };
    let damaged = |error| matches!(error, TrainingError::Damaged(_));
    assert!(damaged(edited(|value| value["shape"]["hidden"] = 7.into())), "layers");
    let gap = text.replacen("\"epoch\":[0,1,", "\"epoch\":[0,5,", 1);
    let error = serde_json::from_str::<TrainerState>(&gap).expect_err("a gap is detected");
    assert!(error.to_string().contains("epoch 1 is missing"), "{error}");
    assert!(damaged(edited(|value| value["best_epoch"] = 4.into())), "best epoch");
    assert!(
        damaged(edited(|value| value["stages"] = serde_json::json!([]))),
        "stages"
    );
    assert!(
        damaged(edited(|value| value["method"] = serde_json::json!("gradient_descent"))),
        "method"
    );
    assert!(
        matches!(
            edited(|value| value["weights"][0] = 3.5.into()),
            TrainingError::OtherSamples { .. }
        ),
        "samples"
    );
}
