//! Speed against accuracy: measured, queried, opened, cancelled and exported.

use std::{fs, path::Path};

use decoupler::window::SourceKind;
use decoupler_core::{
    dataset::Simulation,
    decoupling::{DecoderKind, Precision},
    evaluation::{Preset, RunSettings, TradeOffPoint, fastest_under, measure_trade_off, most_accurate_under},
    job::Job,
    scene::{Noise, Scene},
};
use decoupler_files::{export::format_percent, figure::point_name, import::Setup};

use crate::{
    driver::Driver,
    experiments::wait_for_the_end,
    sources::{Opened, open_small, trained_small},
    training::endless,
};

const TOPIC: &str = "Speed against accuracy";
const OPEN: &str = "Open in Train view";

fn open() -> Driver {
    let mut driver = Driver::open();
    driver.choose("Paper's array", "10×6_3×18");
    driver.click_button("Study");
    driver.click(TOPIC);
    driver
}

/// Ridge, Newton and small networks of both presets at two levels of noise.
pub(crate) fn tiny(driver: &mut Driver) {
    driver.type_into("Noise levels (%)", "0, 0.1");
    driver.type_into("Hidden nodes", "3");
    for decoder in ["Training mean", "Radial basis", "Fuzzy rules", "Network + Newton"] {
        driver.click(decoder);
    }
    driver.enter("Maximum samples", "100");
    driver.enter("Maximum epochs", "3");
    driver.assert_has("16 points");
}

pub(crate) fn measure(driver: &mut Driver) {
    driver.click("▶ Run");
    wait_for_the_end(driver);
}

/// The settings of a preset at a noise, with the numbers of [`tiny`], in the scene of `draft`.
fn settings(draft: &RunSettings, preset: Preset, noise: f64) -> RunSettings {
    let array = draft.simulation().unwrap();
    let noise = Noise {
        relative: noise,
        ..array.scene.noise
    };
    let of_preset = preset.simulation_in(noise);
    let mut settings = preset.settings_in(noise);
    settings.training.stopping.epochs = 3;
    settings.seed = draft.seed;
    settings.source = Simulation {
        sensor: array.sensor,
        scene: Scene {
            rows: of_preset.scene.rows,
            noise,
            ..array.scene
        },
        samples: 100,
        validation_samples: of_preset.validation_samples.min(20),
        test_samples: array.test_samples,
    }
    .into();
    settings
}

/// Returns the points of a setup measured by the library.
fn by_library(setup: &Setup, preset: Option<Preset>, decoders: &[DecoderKind]) -> Vec<TradeOffPoint> {
    let mut points = Vec::new();
    let on_point = |_, point: Result<TradeOffPoint, _>, _: Option<&_>| {
        points.push(TradeOffPoint {
            preset,
            ..point.unwrap()
        });
    };
    let sets = setup.sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ()).unwrap();
    measure_trade_off(
        setup.settings(),
        &sets.sets,
        &[3],
        decoders,
        &Job::UNINTERRUPTED,
        on_point,
    )
    .unwrap();
    points
}

const TINY: [DecoderKind; 3] = [DecoderKind::Ridge, DecoderKind::Network, DecoderKind::Newton];

/// The text of the answer to a question.
fn answer(driver: &Driver, question: &str) -> String {
    let texts = driver.texts().into_iter();
    let mut answers = texts.filter(|text| text.starts_with(&format!("{question}: ")));
    answers.next().unwrap_or_else(|| panic!("{:#?}", driver.texts()))
}

#[test]
fn every_point_agrees_with_the_library_and_both_questions_are_answered() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = open();
    tiny(&mut driver);
    measure(&mut driver);
    driver.assert_says("Speed against accuracy finished: 16 points in ");
    for (button, name, expected) in [
        ("All points, CSV", "points.csv", &b"noise,preset,decoder"[..]),
        ("Table, CSV", "table.csv", b"decoder,z_percent"),
        ("Figure, SVG", "charts.svg", b"<svg"),
        ("Figure, PNG", "charts.png", b"\x89PNG"),
    ] {
        let path = folder.path().join(name);
        driver.save(button, &path);
        driver.click("Dismiss");
        assert!(fs::read(&path).unwrap().starts_with(expected), "{name}");
    }
    let table = fs::read_to_string(folder.path().join("points.csv")).unwrap();
    let columns = |line: &str| line.split(',').count();
    let heading = columns(table.lines().next().unwrap());
    assert!(table.lines().all(|line| columns(line) == heading), "{table}");
    let svg = fs::read_to_string(folder.path().join("charts.svg")).unwrap();
    for text in [
        "diamonds: best preset",
        "time to decode a frame (µs)",
        "training time (s)",
        "Z error (%)",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    let mut lines = table.lines().skip(1);
    let draft = driver.state().draft;
    for noise in [0.0, 1e-3] {
        for preset in Preset::ALL {
            let setup = settings(&draft, preset, noise).into();
            for own in by_library(&setup, Some(preset), &TINY) {
                let precision = match own.report.precision {
                    Precision::Double => "f64",
                    Precision::Single => "f32",
                };
                let line = lines.next().unwrap();
                let start = format!("{noise:?},{preset},{},{precision},", own.report.kind);
                assert!(line.starts_with(&start), "{start}: {line}");
                let z = own.report.errors.percent().unwrap();
                assert!(
                    line.contains(&format!(",{z:?},")),
                    "times differ, errors do not: {z:?}: {line}"
                );
            }
        }
    }
    assert_eq!(lines.next(), None);
    for name in [
        "Ridge, paper preset",
        "Newton, best preset",
        "Network f32, best preset, 3 hidden",
    ] {
        let point = format!("Point {name}");
        driver.assert_has(&point);
    }

    driver.click_button("0.1 %");
    driver.settle();
    driver.enter("Fastest under", "1e9");
    driver.enter("Most accurate under", "1e9");
    let points = Preset::ALL.into_iter().flat_map(|preset| {
        let setup = settings(&draft, preset, 1e-3).into();
        by_library(&setup, Some(preset), &TINY)
    });
    let points = Vec::from_iter(points);
    let best = &points[most_accurate_under(&points, 1e9).unwrap()];
    let text = answer(&driver, "Most accurate");
    let percent = format_percent(best.report.errors.percent());
    assert!(text.contains(&point_name(best)) && text.contains(&percent), "{text}");
    assert!(fastest_under(&points, 1e9).is_some());
    assert!(!driver.is_enabled(OPEN), "nothing is marked");
    driver.click(&format!("Point {}", point_name(best)));
    assert_eq!(driver.shown(), "Study", "a click only marks");
    driver.enter("Fastest under", "1e-12");
    assert!(driver.has("No measured decoder is this accurate."));
    driver.click(OPEN);
    assert_eq!((driver.shown(), driver.state().draft), ("Train", best.settings));
}

#[test]
fn a_measurement_shows_its_points_as_they_arrive_and_can_be_cancelled() {
    let mut driver = open();
    tiny(&mut driver);
    let sizes: Vec<String> = (3..40).map(|hidden| hidden.to_string()).collect();
    driver.type_into("Hidden nodes", &sizes.join(" "));
    driver.enter("Maximum samples", "2000");
    driver.enter("Maximum epochs", "200");
    driver.click("▶ Run");
    driver.wait("the first points", |driver| {
        driver.has("Point Network, paper preset, 3 hidden")
    });
    assert!(driver.has("Point Ridge, paper preset"));
    assert!(!driver.is_enabled("▶ Run"), "one measurement at a time");
    driver.click("■ Cancel");
    assert!(
        driver.is_enabled("▶ Run"),
        "cancelling does not wait for the current point"
    );
    driver.assert_says("Speed against accuracy ended early: ");
    // The next one begins when the processor is free, and shows only its own points.
    driver.type_into("Hidden nodes", "3");
    driver.enter("Maximum epochs", "3");
    measure(&mut driver);
    driver.assert_says("Speed against accuracy finished: 16 points in ");
}

#[test]
fn a_measurement_waits_while_a_training_would_distort_its_times() {
    let mut opened = open_small(SourceKind::Array);
    opened.change(|settings| settings.training = endless().training);
    let mut driver = opened.driver;
    driver.click_button("Study");
    driver.click(TOPIC);
    tiny(&mut driver);
    driver.click_button("Train");
    driver.click("▶ Train");
    driver.click_button("Study");
    driver.click("▶ Run");
    driver.wait("the note", |driver| driver.says("would distort the times"));
    driver.harness().run_steps(20);
    assert!(!driver.has("Point Ridge, paper preset"), "nothing is measured");
    driver.click_button("Train");
    driver.click("■ Stop");
    driver.settle();
    driver.click_button("Study");
    wait_for_the_end(&mut driver);
    assert!(!driver.says("would distort the times"));
    driver.assert_says("Speed against accuracy finished: 16 points in ");
}

#[test]
fn a_measurement_waits_for_the_work_of_another_view_and_names_it() {
    let mut driver = trained_small(SourceKind::Array).driver;
    driver.wait_for_kept_run();
    driver.click_button("Study");
    driver.click(TOPIC);
    tiny(&mut driver);
    driver.click_button("Live");
    driver.click("▶ Start");
    driver.click_button("Study");
    driver.click("▶ Run");
    driver.wait("the note", |driver| {
        driver.says("Waiting: live decoding is under way and would distort the times.")
    });
    driver.harness().run_steps(20);
    assert!(!driver.has("Point Ridge, paper preset"), "nothing is measured");
    driver.click_button("Live");
    driver.click("■ Stop");
    driver.click_button("Study");
    wait_for_the_end(&mut driver);
    assert!(
        driver.says("Speed against accuracy finished: 16 points in "),
        "{:#?}",
        driver.texts()
    );
}

#[test]
fn an_invalid_plan_says_why() {
    let mut driver = open();
    driver.type_into("Noise levels (%)", "0, much");
    driver.assert_says("'much' is not a number");
    assert!(!driver.is_enabled("▶ Run"));
    driver.type_into("Noise levels (%)", "0");
    driver.type_into("Hidden nodes", "0");
    driver.assert_says("hidden nodes: 0 is not possible");
    driver.type_into("Hidden nodes", "3");
    assert!(driver.is_enabled("▶ Run"));
}

#[test]
fn decoders_of_a_recording_agree_with_the_library_and_a_point_is_opened() {
    let Opened {
        mut driver,
        setup,
        folder,
    } = open_small(SourceKind::Recording);
    driver.click_button("Study");
    driver.click(TOPIC);
    driver.type_into("Hidden nodes", "3");
    for decoder in ["Radial basis", "Fuzzy rules"] {
        driver.click(decoder);
    }
    driver.enter("Maximum epochs", "3");
    assert!(
        !driver.has("Newton") && !driver.has("Noise levels (%)"),
        "{:#?}",
        driver.texts()
    );
    // Mean and ridge once, then a network in two precisions by each of two methods.
    driver.assert_has("6 points");
    measure(&mut driver);
    driver.assert_says("finished: 6 points in ");
    for name in ["Ridge", "Network, lm, 3 hidden", "Network f32, br, 3 hidden"] {
        let point = format!("Point {name}");
        driver.assert_has(&point);
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
    let own = by_library(&setup, None, &[DecoderKind::Mean, DecoderKind::Ridge]);
    for (own, line) in own.iter().zip(table.lines().skip(1)) {
        let percent = own.report.errors.percent().unwrap();
        let start = format!("{},", own.report.kind);
        assert!(
            line.starts_with(&start) && line.contains(&format!(",{percent:?},")),
            "{line}"
        );
    }

    driver.click("Point Network, lm, 3 hidden");
    driver.click(OPEN);
    assert_eq!(driver.shown(), "Train");
    let loaded = driver.state().recording.settings;
    assert_eq!((loaded.hidden, loaded.training.method.short_name()), (3, "lm"));
    assert_eq!(loaded.source, setup.settings().source);
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
    driver.assert_says("answers of other programs agree within");
    driver.settle();
    driver.click("Dismiss");
    serde_json::from_str(&fs::read_to_string(path.join("metadata.json")).unwrap()).unwrap()
}

#[test]
fn the_decoder_of_the_marked_point_is_exported() {
    for source in [SourceKind::Array, SourceKind::Recording] {
        let Opened {
            mut driver,
            folder,
            setup,
        } = open_small(source);
        driver.click_button("Study");
        driver.click(TOPIC);
        if source == SourceKind::Array {
            driver.type_into("Noise levels (%)", "0.1");
            driver.enter("Maximum samples", "100");
        }
        driver.type_into("Hidden nodes", "3");
        driver.enter("Maximum epochs", "3");
        measure(&mut driver);
        let (ridge, network) = match source {
            SourceKind::Array => ("Point Ridge, paper preset", "Point Network, best preset, 3 hidden"),
            SourceKind::Recording => ("Point Ridge", "Point Network, lm, 3 hidden"),
        };
        driver.click(ridge);
        let metadata = save(&mut driver, "NumPy", &folder.path().join("ridge"));
        assert_eq!(metadata["decoder"], "ridge");
        let of = match source {
            SourceKind::Array => settings(setup.settings(), Preset::Paper, 1e-3).into(),
            SourceKind::Recording => setup.clone(),
        };
        let point = &by_library(&of, None, &[DecoderKind::Ridge])[0];
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

        driver.click(network);
        let metadata = save(&mut driver, "ONNX", &folder.path().join("network"));
        assert_eq!(
            (&metadata["decoder"], &metadata["hidden_nodes"]),
            (&"network".into(), &3.into())
        );
    }
}
