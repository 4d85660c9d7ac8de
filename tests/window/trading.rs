//! The Trade-off view: measured, queried, loaded, cancelled and exported.

use std::{fs, path::Path};

use decoupler::window::{PlannedLevel, SourceKind, TradeOffEnding, TradeOffPlan};
use decoupler_core::{
    evaluation::{Preset, TradeOffPoint, fastest_under, measure_trade_off, most_accurate_under},
    job::Job,
};
use decoupler_files::export::format_percent;
use eframe::egui::vec2;

use crate::{
    driver::Driver,
    sources::{Opened, open_small},
};

fn open() -> Driver {
    let mut driver = Driver::open();
    driver.click("10×6");
    driver.click_button("Trade-off");
    driver
}

/// Ridge, Newton and small networks of both presets at two levels of noise.
pub(crate) fn tiny(driver: &mut Driver) -> TradeOffPlan {
    driver.type_into("Noise levels", "0, 1e-3");
    driver.type_into("Hidden nodes", "3");
    for decoder in ["Training mean", "Radial basis", "Fuzzy rules", "Network + Newton"] {
        driver.click(decoder);
    }
    driver.enter("Maximum samples", "100");
    driver.enter("Maximum epochs", "3");
    driver.enter("Test samples", "20");
    assert!(driver.has("16 points"), "{:#?}", driver.texts());
    driver.views().trade_off.plan(driver.state()).unwrap()
}

pub(crate) fn measure(driver: &mut Driver) {
    driver.click("▶ Measure");
    driver.wait("the end of the measurement", |driver| {
        driver.views().trade_off.running.is_none()
    });
}

/// Returns the points measured by the library.
fn by_library(plan: &TradeOffPlan, level: &PlannedLevel) -> Vec<TradeOffPoint> {
    let mut points = Vec::new();
    for run in &level.runs {
        let on_point = |_, point: Result<TradeOffPoint, _>, _: Option<&_>| points.push(point.unwrap());
        let sets = run.setup.sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ()).unwrap();
        let settings = run.setup.settings();
        measure_trade_off(
            settings,
            &sets.sets,
            &plan.hidden,
            &run.decoders,
            &Job::UNINTERRUPTED,
            on_point,
        )
        .unwrap();
    }
    points
}

#[test]
fn every_point_agrees_with_the_library_and_both_questions_are_answered() {
    let mut driver = open();
    let plan = tiny(&mut driver);
    measure(&mut driver);
    let outcome = driver.views().trade_off.outcome.as_ref().unwrap();
    assert_eq!(
        (outcome.points(), outcome.ending),
        ((16, 16), Some(TradeOffEnding::Complete))
    );
    for (level, planned) in outcome.levels.iter().zip(&plan.levels) {
        for (shown, own) in level.points.iter().zip(by_library(&plan, planned)) {
            assert_eq!(
                (shown.report.kind, shown.report.precision),
                (own.report.kind, own.report.precision)
            );
            assert_eq!(shown.report.errors, own.report.errors, "times differ, errors do not");
            assert_eq!(shown.settings, own.settings);
        }
    }
    for name in [
        "Ridge, paper preset",
        "Newton, best preset",
        "Network f32, best preset, 3 hidden",
    ] {
        for chart in ["Decoding", "Training"] {
            assert!(
                driver.has(&format!("{chart}: {name}")),
                "{name} in {chart}: {:#?}",
                driver.texts()
            );
        }
    }
    driver.click_button("1e-3");
    assert_eq!(driver.views().trade_off.look.level, 1);
    driver.settle();

    driver.enter("Fastest under", "5");
    driver.enter("Most accurate under", "1e9");
    let level = driver.views().trade_off.shown().unwrap();
    let fastest = level.points[fastest_under(&level.points, 5.0).unwrap()].clone();
    let best = level.points[most_accurate_under(&level.points, 1e9).unwrap()].clone();
    let is_best = format_percent(best.report.errors.percent());
    let answer = driver
        .texts()
        .into_iter()
        .find(|text| text.starts_with("Most accurate: "))
        .unwrap();
    assert!(answer.contains(&is_best), "{answer}");
    let answer = driver
        .texts()
        .into_iter()
        .find(|text| text.starts_with("Fastest: "))
        .unwrap();
    driver.click(&answer);
    let marked = driver.views().trade_off.look.marked.unwrap();
    assert_eq!(driver.views().trade_off.shown().unwrap().points[marked], fastest);
    driver.enter("Fastest under", "1e-12");
    assert!(driver.has("No measured decoder is this accurate."));

    driver.click("Load into Train view");
    assert_eq!((driver.shown(), driver.state().draft), ("Train", fastest.settings));
}

#[test]
fn a_click_on_a_point_loads_its_configuration() {
    let mut driver = open();
    let plan = tiny(&mut driver);
    measure(&mut driver);
    driver.click("Decoding: Ridge, best preset");
    assert_eq!(driver.shown(), "Train");
    let mut runs = plan.levels[0].runs.iter();
    let best = runs.find(|run| run.preset == Some(Preset::Best)).unwrap();
    let ridge = *best.setup.settings();
    let draft = driver.state().draft;
    assert_eq!(
        (
            draft.simulation().unwrap().scene,
            draft.inputs,
            draft.simulation().unwrap().samples
        ),
        (
            ridge.simulation().unwrap().scene,
            ridge.inputs,
            ridge.simulation().unwrap().samples
        )
    );
    driver.click_button("Trade-off");
    let (marked, level) = (
        driver.views().trade_off.look.marked.unwrap(),
        driver.views().trade_off.shown().unwrap(),
    );
    assert_eq!(level.points[marked].preset, Some(Preset::Best));
    let row = driver
        .texts()
        .into_iter()
        .find(|text| text.starts_with("Newton, paper preset: "))
        .unwrap();
    driver.click(&row);
    assert_ne!(
        driver.views().trade_off.look.marked,
        Some(marked),
        "a row of the table marks its point"
    );
    assert_eq!(driver.shown(), "Trade-off");
}

#[test]
fn measurements_are_saved_as_table_and_figures() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = open();
    tiny(&mut driver);
    assert!(driver.has("Measure now"));
    measure(&mut driver);
    let saved = [
        ("All points, CSV", "points.csv", &b"noise,preset,decoder"[..]),
        ("Charts, SVG", "charts.svg", b"<svg"),
        ("Charts, PNG", "charts.png", b"\x89PNG"),
    ];
    for (button, name, expected) in saved {
        let path = folder.path().join(name);
        driver.save(button, &path);
        assert!(driver.says("Saved "));
        driver.click("Dismiss");
        assert!(fs::read(&path).unwrap().starts_with(expected), "{name}");
    }
    let table = fs::read_to_string(folder.path().join("points.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + 16);
    let columns = |line: &str| line.split(',').count();
    let heading = columns(table.lines().next().unwrap());
    assert!(table.lines().all(|line| columns(line) == heading), "{table}");
    let points = &driver.views().trade_off.outcome.as_ref().unwrap().levels[0].points;
    let z = points[0].report.errors.percent().unwrap();
    assert!(table.lines().nth(1).unwrap().contains(&format!(",{z:?},")), "{table}");
    let svg = fs::read_to_string(folder.path().join("charts.svg")).unwrap();
    for text in [
        ">Newton<",
        "diamonds: best preset",
        "hollow: 32 bits",
        "time to decode a frame (µs)",
        "training time (s)",
        "Z error (%)",
    ] {
        assert!(svg.contains(text), "{text}");
    }
}

#[test]
fn a_measurement_shows_its_points_as_they_arrive_and_can_be_cancelled() {
    let mut driver = open();
    tiny(&mut driver);
    let sizes: Vec<String> = (3..40).map(|hidden| hidden.to_string()).collect();
    driver.type_into("Hidden nodes", &sizes.join(" "));
    driver.enter("Maximum samples", "2000");
    driver.enter("Maximum epochs", "200");
    driver.click("▶ Measure");
    driver.wait("the first points", |driver| {
        let outcome = driver.views().trade_off.outcome.as_ref();
        outcome.is_some_and(|outcome| outcome.points().0 >= 3)
    });
    assert!(driver.has("Decoding: Ridge, paper preset"));
    assert!(!driver.is_enabled("▶ Measure"), "one measurement at a time");
    driver.click("■ Cancel");
    assert!(
        driver.views().trade_off.running.is_none(),
        "cancelling does not wait for the current point"
    );
    let outcome = driver.views().trade_off.outcome.as_ref().unwrap();
    let (done, all) = outcome.points();
    assert!((3..all).contains(&done), "{done} of {all}");
    assert_eq!(outcome.ending, Some(TradeOffEnding::Cut));
    assert!(driver.says(&format!("Ended early: {done} of {all} points")));
    // The next one begins when the processor is free, and shows only its own points.
    driver.type_into("Hidden nodes", "3");
    driver.enter("Maximum epochs", "3");
    measure(&mut driver);
    assert_eq!(driver.views().trade_off.outcome.as_ref().unwrap().points(), (16, 16));
}

#[test]
fn an_invalid_plan_says_why() {
    let mut driver = open();
    driver.type_into("Noise levels", "0, much");
    assert!(driver.says("'much' is not a number"), "{:#?}", driver.texts());
    assert!(!driver.is_enabled("▶ Measure"));
    driver.type_into("Noise levels", "0");
    driver.type_into("Hidden nodes", "0");
    assert!(driver.says("Hidden nodes: 0 is not possible"), "{:#?}", driver.texts());
    driver.type_into("Hidden nodes", "3");
    assert!(driver.is_enabled("▶ Measure"));
}

#[test]
fn charts_and_form_fit_in_a_narrow_window() {
    let mut driver = Driver::open_sized(vec2(1024.0, 700.0));
    driver.click("10×6");
    driver.click_button("Trade-off");
    tiny(&mut driver);
    measure(&mut driver);
    driver.settle();
    assert!(driver.get("Export").rect().max.x < 1024.0);
    for label in ["▶ Measure", "■ Cancel", "Maximum samples"] {
        for (_, rect) in driver.places().into_iter().filter(|(text, _)| text == label) {
            assert!(rect.max.x < 272.0, "{label}: {rect}");
        }
    }
    for (text, rect) in driver.places() {
        if text.starts_with("Decoding: ") || text.starts_with("Training: ") {
            assert!(rect.max.x < 1024.0 && rect.min.x > 272.0, "{text}: {rect}");
        }
    }
}

#[test]
fn decoders_of_a_recording_agree_with_the_library_and_a_point_is_loaded() {
    let Opened {
        mut driver,
        setup,
        folder,
    } = open_small(SourceKind::Recording);
    driver.click_button("Trade-off");
    driver.type_into("Hidden nodes", "3");
    for decoder in ["Radial basis", "Fuzzy rules"] {
        driver.click(decoder);
    }
    driver.enter("Maximum epochs", "3");
    assert!(
        !driver.has("Newton") && !driver.has("Noise levels"),
        "{:#?}",
        driver.texts()
    );
    // Mean and ridge once, then a network in two precisions by each of two methods.
    assert!(driver.has("6 points"), "{:#?}", driver.texts());
    let plan = driver.views().trade_off.plan(driver.state()).unwrap();
    measure(&mut driver);
    let outcome = driver.views().trade_off.outcome.as_ref().unwrap();
    assert_eq!(
        (outcome.points(), outcome.ending),
        ((6, 6), Some(TradeOffEnding::Complete))
    );
    let own = by_library(&plan, &plan.levels[0]);
    assert_eq!(own.len(), outcome.levels[0].points.len());
    for (shown, own) in outcome.levels[0].points.iter().zip(own) {
        assert_eq!(
            (shown.report.kind, shown.report.precision),
            (own.report.kind, own.report.precision)
        );
        assert_eq!(shown.report.errors, own.report.errors, "times differ, errors do not");
        assert_eq!((shown.settings, shown.preset), (own.settings, None));
    }
    for name in ["Ridge", "Network, lm, 3 hidden", "Network f32, br, 3 hidden"] {
        assert!(
            driver.has(&format!("Decoding: {name}")),
            "{name}: {:#?}",
            driver.texts()
        );
    }
    let table = folder.path().join("points.csv");
    driver.save("All points, CSV", &table);
    driver.click("Dismiss");
    let table = fs::read_to_string(table).unwrap();
    assert!(table.starts_with("decoder,precision,hidden,method,"), "{table}");
    assert!(
        table.contains("percent_of_range") && !table.contains("z_percent"),
        "{table}"
    );
    assert_eq!(table.lines().count(), 1 + 6);

    driver.click("Decoding: Network, lm, 3 hidden");
    assert_eq!(driver.shown(), "Train");
    let loaded = driver.state().recording.settings;
    assert_eq!((loaded.hidden, loaded.training.method.short_name()), (3, "lm"));
    assert_eq!(loaded.source, setup.settings().source);
}

/// Text of the first row of the table that begins with `name`.
fn row(driver: &Driver, name: &str) -> String {
    let texts = driver.texts().into_iter();
    let mut rows = texts.filter(|text| text.starts_with(&format!("{name}: ")));
    rows.next().unwrap()
}

/// Exports the decoder of the marked point, waits until it is written, and returns the metadata of the bundle.
fn save(driver: &mut Driver, format: &str, path: &Path) -> serde_json::Value {
    driver.click("Export this decoder…");
    driver.choose_in_dialog("Format", format);
    driver.click_button("Save…");
    driver.harness().run_steps(5);
    driver.type_into("File", &path.display().to_string());
    driver.click_button("Save");
    driver.wait("the answer", |driver| driver.notice().is_some());
    assert!(
        driver.says("answers of other programs agree within"),
        "{:#?}",
        driver.texts()
    );
    driver.settle();
    driver.click("Dismiss");
    serde_json::from_str(&fs::read_to_string(path.join("metadata.json")).unwrap()).unwrap()
}

#[test]
fn the_decoder_of_the_marked_point_is_exported() {
    for source in [SourceKind::Array, SourceKind::Recording] {
        let Opened { mut driver, folder, .. } = open_small(source);
        driver.click_button("Trade-off");
        if source == SourceKind::Array {
            driver.type_into("Noise levels", "1e-3");
            driver.enter("Maximum samples", "100");
            driver.enter("Test samples", "20");
        }
        driver.type_into("Hidden nodes", "3");
        driver.enter("Maximum epochs", "3");
        measure(&mut driver);
        let (ridge, network) = match source {
            SourceKind::Array => ("Ridge, paper preset", "Network, best preset, 3 hidden"),
            SourceKind::Recording => ("Ridge", "Network, lm, 3 hidden"),
        };
        let marked = row(&driver, ridge);
        driver.click(&marked);
        let metadata = save(&mut driver, "NumPy", &folder.path().join("ridge"));
        assert_eq!(metadata["decoder"], "ridge");
        let look = driver.views().trade_off.look;
        let point = &driver.views().trade_off.shown().unwrap().points[look.marked.unwrap()];
        let errors = match source {
            SourceKind::Array => {
                assert_eq!(metadata["seed"], point.settings.seed.0);
                serde_json::to_value(point.report.errors.nodes().unwrap()).unwrap()
            }
            SourceKind::Recording => {
                let found = metadata["errors"].as_array().unwrap().iter();
                let found = found.map(|target| target["errors"].clone());
                let expected = serde_json::to_value(point.report.errors.targets()).unwrap();
                assert_eq!(serde_json::Value::from_iter(found), expected, "the errors of the point");
                metadata["errors"].clone()
            }
        };
        assert_eq!(metadata["errors"], errors, "the errors of the point");

        let marked = row(&driver, network);
        driver.click(&marked);
        let metadata = save(&mut driver, "ONNX", &folder.path().join("network"));
        assert_eq!(
            (&metadata["decoder"], &metadata["hidden_nodes"]),
            (&"network".into(), &3.into())
        );
    }
}
