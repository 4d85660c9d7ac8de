//! Failed trainings report the cause and what to change.

use decoupler_core::{
    settings::Value,
    training::{Method, SettingError, StopReason, StoppingRules, Trainer, TrainingSettings},
};

use crate::problems::{problem, start};

/// Names and values of settings.
type Values = &'static [(&'static str, f64)];

/// The method of this short name with these settings.
fn method(short_name: &str, values: &[(&str, f64)]) -> Method {
    let mut method = Method::named(short_name).unwrap();
    for (name, value) in values {
        let setting = method.settings().find(|setting| setting.name == *name).unwrap();
        setting.set(&mut method, &Value::Number(*value)).unwrap();
    }
    method
}

fn trained(method: Method, epochs: usize) -> Trainer {
    let stopping = StoppingRules {
        epochs,
        ..StoppingRules::default()
    };
    let mut trainer =
        Trainer::new(start(), problem(), TrainingSettings { method, stopping }).expect("the training can start");
    while trainer.step().is_none() {}
    trainer
}

#[test]
fn invalid_settings_are_refused_with_a_remedy() {
    let cases = [
        (
            "lm",
            vec![("mu", 1e12)],
            "mu is 1e12, above largest mu, which is 1e10: lower mu, or raise largest mu",
        ),
        ("br", vec![("largest mu", 1e-6)], "lower mu, or raise largest mu"),
        (
            "rp",
            vec![("first step length", 1e300)],
            "first step length is 1e300, above largest step length, which is 50",
        ),
        (
            "gdms",
            vec![("momentum", 1.0)],
            "momentum is 1: it must be from 0 to 0.999999",
        ),
        (
            "gdx",
            vec![("momentum", 1.0)],
            "momentum is 1: it must be from 0 to 0.999999",
        ),
    ];
    for (name, values, words) in cases {
        let settings = TrainingSettings {
            method: method(name, &values),
            stopping: StoppingRules::default(),
        };
        let refused: SettingError = settings.check().unwrap_err();
        assert!(refused.to_string().contains(words), "{name}: {refused}");
        assert!(Trainer::new(start(), problem(), settings).is_err(), "{name}");
    }
    // Momentum of gradients is the gradient of the epoch before, which is valid.
    assert!(method("gdm", &[("momentum", 1.0)]).check().is_ok());
}

/// The defect names only the method's own settings.
#[test]
fn stalled_or_diverged_trainings_report_cause_and_remedy() {
    let cases: [(&str, Values, &str); 8] = [
        ("scg", &[("lambda", 1e300)], "lambda to 5e-7 (now 1e300)"),
        ("gdx", &[("learning rate", 1e300)], "learning rate to 0.01 (now 1e300)"),
        (
            "gdx",
            &[("learning rate", 1e-300)],
            "learning rate to 0.01 (now 1e-300)",
        ),
        ("gd", &[("learning rate", 1e300)], "learning rate to 0.01 (now 1e300)"),
        (
            "gdm",
            &[("learning rate", 1e6), ("momentum", 1.0)],
            "learning rate to 0.01 (now 1e6), momentum to 0.9 (now 1)",
        ),
        ("gdms", &[("learning rate", 1e-9)], "learning rate to 0.01 (now 1e-9)"),
        (
            "rp",
            &[("first step length", 1e300), ("largest step length", 1e300)],
            "first step length to 0.07 (now 1e300)",
        ),
        ("lm", &[("mu", 1e300), ("largest mu", 1e300)], "mu to 0.001 (now 1e300)"),
    ];
    for (name, values, words) in cases {
        let trainer = trained(method(name, values), 30);
        let text = trainer.defect().unwrap_or_else(|| panic!("{name} has a defect"));
        assert!(text.contains("no better than its random start"), "{text}");
        assert!(text.contains(words), "{name}: {text}");
        let has_rate = method(name, &[])
            .settings()
            .any(|setting| setting.name == "learning rate");
        assert!(has_rate || !text.contains("learning rate"), "{name}: {text}");
    }
}

#[test]
fn valid_and_unfinished_trainings_have_no_defect() {
    for method in Method::all() {
        let trainer = trained(method, 200);
        assert_eq!(trainer.defect(), None, "{method}");
    }
    let settings = TrainingSettings::default();
    let trainer = Trainer::new(start(), problem(), settings).unwrap();
    assert_eq!(trainer.defect(), None);
}

/// Step lengths that only grow reduce the error for a while before it diverges.
#[test]
fn late_divergence_names_the_epoch_and_keeps_the_best_weights() {
    let mut found = false;
    for increase in [1.3, 1.6, 2.0, 3.0, 5.0] {
        let growing = [
            ("length increase", increase),
            ("length decrease", 0.999),
            ("largest step length", 1e300),
        ];
        let trainer = trained(method("rp", &growing), 3000);
        let Some(defect) = trainer.defect().filter(|defect| !defect.contains("random start")) else {
            continue;
        };
        found = true;
        let words = defect
            .strip_prefix("training diverged in epoch ")
            .expect("it is better than its start, so it diverged");
        let epoch: usize = words.split(';').next().unwrap().parse().unwrap();
        let history = trainer.history();
        let start_mse = history[0].training_mse;
        assert!(history[epoch..].iter().all(|record| record.training_mse > start_mse));
        assert!(history[epoch - 1].training_mse <= start_mse);
        assert!(defect.contains(&format!("diverged in epoch {epoch}")), "{}", defect);
        let errors = history.iter().filter_map(|record| record.validation_mse);
        assert_eq!(trainer.best_mse(), errors.fold(f64::INFINITY, f64::min));
        assert!(trainer.best_mse() < history[0].validation_mse.unwrap());
        assert_eq!(trainer.present().weights(), trainer.best().weights());
    }
    assert!(found, "one of these diverges after initial progress");
}

#[test]
fn remedies_name_only_settings_of_the_method() {
    for reason in [StopReason::Diverged, StopReason::MuLarge, StopReason::LambdaLarge] {
        for method in Method::all() {
            let text = format!("{reason} {}", reason.remedy(&method));
            let names: Vec<&str> = method.settings().map(|setting| setting.name).collect();
            for word in ["learning rate", "step length"] {
                let has_it = names.iter().any(|name| name.contains(word));
                assert!(has_it || !text.contains(word), "{method}: {text}");
            }
        }
    }
}
