//! Results of a training on a recording in the Train view: surfaces, charts, tables, and the same for an array where both
//! have them.

use std::{fs, path::Path};

use decoupler::window::SourceKind;
use eframe::egui::vec2;
use egui_kittest::kittest::NodeT as _;

use crate::{
    driver::Driver,
    sources::{Opened, force, probe, run_of, skin_with_positions, trained_small},
};

/// Positions of the taxels of a grid in an order of their own.
const GRID: &str = "target,x,y\nd6,4,10\nd1,0,0\nd2,0,5\nd4,4,0\nd3,0,10\nd5,4,5\n";

/// The description of a surface for assistive technology: the range of its nodes.
#[track_caller]
fn range(driver: &Driver, surface: &str) -> String {
    let label = format!("{surface} surface");
    driver.get(&label).accesskit_node().value().unwrap_or_default()
}

/// Returns a window trained on the recording that `make` writes.
fn trained_on(make: impl Fn(&Path) -> decoupler_files::import::Setup) -> Opened {
    let folder = tempfile::tempdir().unwrap();
    let setup = make(folder.path());
    let mut driver = Driver::open();
    driver.take_recording(&setup);
    driver.train();
    driver.wait_for_last_epoch();
    Opened { driver, setup, folder }
}

#[test]
fn targets_with_positions_are_shown_as_surfaces() {
    let Opened { mut driver, folder, .. } = trained_on(|folder| skin_with_positions(folder, GRID));
    assert!(
        driver.says("d1 (mm) against time (s): actual, decoded")
            || driver.says("d1 (mm) against time (s): 90 % interval"),
        "all targets over time first"
    );
    driver.click("Surfaces");
    driver.settle();
    // Under the pointer a target is named, with its values.
    let middle = driver.get("Actual surface").rect().scale_from_center(0.5);
    let is_named = (0..400).any(|step| {
        let share = vec2((step % 20) as f32, (step / 20) as f32) / 20.0;
        driver.harness().hover_at(middle.lerp_inside(share));
        driver.harness().run_steps(2);
        driver.views().train.lights.node.is_some()
    });
    assert!(is_named);
    let texts = driver.texts().into_iter();
    let mut values = texts.filter(|text| text.starts_with("actual ") && text.contains(", decoded "));
    assert!(values.next().is_some(), "{:#?}", driver.texts());
    driver.harness().remove_cursor();
    // The first of the last 12 samples: d1 is the lowest and d6 the highest, or the other way round.
    let of_sample = |row: f64| {
        let (u, v) = ((0.37 * row).sin(), (0.23 * row).cos());
        let ends = [1.0 + 0.2 * v, 1.0 + 0.5 * u + 0.2 * v];
        (ends[0].min(ends[1]), ends[0].max(ends[1]))
    };
    let shown = |driver: &Driver| {
        let text = range(driver, "Actual");
        let numbers = text.strip_prefix("value ").unwrap().strip_suffix(" mm").unwrap();
        let (low, high) = numbers.split_once(" to ").unwrap();
        (low.parse::<f64>().unwrap(), high.parse::<f64>().unwrap())
    };
    let is_near = |one: (f64, f64), other: (f64, f64)| (one.0 - other.0).abs() < 5e-3 && (one.1 - other.1).abs() < 5e-3;
    assert!(is_near(shown(&driver), of_sample(48.0)), "{:?}", shown(&driver));
    assert!(range(&driver, "Decoded").starts_with("value "), "the network's");
    driver.enter("Test sample", "5");
    driver.settle();
    assert!(is_near(shown(&driver), of_sample(52.0)), "{:?}", shown(&driver));
    driver.click("Next sample");
    driver.settle();
    assert!(is_near(shown(&driver), of_sample(53.0)), "{:?}", shown(&driver));
    driver.click_button("Error");
    driver.settle();
    assert!(range(&driver, "Error").starts_with("error ") && driver.has("Colour scale of error (mm)"));
    assert!(driver.has("Colour scale of value (mm)"));
    let picture = folder.path().join("surfaces.svg");
    driver.save("Surfaces, SVG", &picture);
    assert!(fs::read_to_string(&picture).unwrap().contains("value (mm)"));
}

#[test]
fn scattered_positions_have_surfaces_and_positions_on_a_line_say_why_not() {
    // A hexagon around d6.
    let hexagon = "target,x,y\nd1,5,0\nd2,2.5,4.33\nd3,-2.5,4.33\nd4,-5,0\nd5,-2.5,-4.33\nd6,0,0\n";
    let Opened { mut driver, folder, .. } = trained_on(|folder| skin_with_positions(folder, hexagon));
    driver.click("Surfaces");
    driver.settle();
    assert!(range(&driver, "Decoded").starts_with("value "));
    driver.click("Top view");
    driver.settle();
    let picture = folder.path().join("surfaces.svg");
    driver.save("Surfaces, SVG", &picture);
    let svg = fs::read_to_string(&picture).unwrap();
    assert!(svg.contains("Between the nodes: thin-plate spline"));

    let oblique = "target,x,y\nd1,0,0\nd2,3,1\nd3,6,2\n";
    let Opened {
        driver,
        folder: _folder,
        ..
    } = trained_on(|folder| skin_with_positions(folder, oblique));
    assert!(!driver.has("Actual surface"));
    assert!(driver.says("No surface goes through the positions of the targets: all nodes are on one line"));
    assert!(
        driver.says("d1 (mm) against time (s)"),
        "all targets are shown over time"
    );
}

#[test]
fn without_positions_all_targets_are_shown_over_time_and_errors_over_a_position() {
    let Opened {
        mut driver,
        folder: _folder,
        ..
    } = trained_on(probe);
    for target in ["x (mm)", "y (mm)"] {
        driver.assert_says(&format!("{target} against time (s)"));
    }
    for of_array in ["Nodes", "Section", "Press", "PRESS"] {
        assert!(!driver.says(of_array), "{of_array}");
    }
    driver.click("Error map");
    driver.settle();
    assert!(driver.has("Error over the position"));
    driver.click("Regression");
    driver.settle();
    assert!(driver.says("decoded x (mm) against actual x (mm)"));
    driver.click("Target");
    driver.click_button("y (mm)");
    driver.settle();
    assert!(driver.says("decoded y (mm) against actual y (mm)"));
    driver.show_chart("Histogram");
    driver.settle();
    assert!(driver.says("error of y (mm), decoded − actual"));
    // A force has no map.
    let Opened {
        driver,
        folder: _folder,
        ..
    } = trained_on(force);
    assert!(!driver.has("Error map"));
}

#[test]
fn another_file_is_decoded_next_to_it_and_test_predictions_are_saved() {
    let Opened {
        mut driver,
        setup,
        folder,
    } = trained_small(SourceKind::Recording);
    let other = folder.path().join("other.csv");
    fs::write(&other, "time (s),u1 (V),u2 (V)\n0.5,2.1,0.3\n0.6,2.2,-0.4\n").unwrap();
    driver.act("Decode file");
    driver.type_into("File", &other.display().to_string());
    driver.click_button("Open");
    let decoded = folder.path().join("other-decoded.csv");
    driver.wait("the decoded file", |driver| {
        driver.says(&format!("Saved {}", decoded.display()))
    });
    let run = run_of(&setup);
    let mut rows = csv::Reader::from_path(&decoded).unwrap();
    let headings = rows.headers().unwrap().clone();
    let place = |name: &str| headings.iter().position(|heading| heading == name).unwrap();
    let (time, x, y) = (place("time (s)"), place("x (mm)"), place("y (mm)"));
    assert!(
        headings.iter().any(|heading| heading == "x_half_width_90 (mm)"),
        "{headings:?}"
    );
    let rows = Vec::from_iter(rows.records().map(Result::unwrap));
    let readings = ndarray::array![[2.1, 0.3], [2.2, -0.4]];
    let set =
        decoupler_core::dataset::Dataset::new(readings, ndarray::Array2::zeros((2, 2)), None, vec![0, 1]).unwrap();
    let answers = decoupler_core::decoupling::ProgramDecoder::new(run.program()).answers_to(&set);
    for (row, answers) in rows.iter().zip(answers.rows()) {
        assert_eq!(
            [x, y].map(|place| row[place].parse::<f64>().unwrap()),
            [answers[0], answers[1]]
        );
    }
    assert_eq!((&rows[0][time], rows.len()), ("0.5", 2));

    let predictions = folder.path().join("predictions.csv");
    driver.save("Test predictions, CSV", &predictions);
    let mut rows = csv::Reader::from_path(&predictions).unwrap();
    let headings = rows.headers().unwrap().clone();
    assert_eq!(
        headings.iter().take(4).collect::<Vec<_>>(),
        ["sample", "x_actual (mm)", "x_decoded (mm)", "x_half_width_90 (mm)"]
    );
    let rows = Vec::from_iter(rows.records().map(Result::unwrap));
    assert_eq!(rows.len(), run.test().samples());
    assert_eq!(rows[3][2].parse(), Ok(run.decouple_test()[[3, 0]]));
}

#[test]
fn ridge_takes_the_place_of_a_network_that_is_worse() {
    let Opened {
        mut driver,
        folder: _folder,
        ..
    } = trained_small(SourceKind::Recording);
    assert!(driver.says("The network is worse than ridge regression"));
    let errors = |driver: &Driver| {
        Vec::from_iter(
            driver
                .state()
                .result()
                .unwrap()
                .errors
                .targets()
                .iter()
                .map(|of| of.rmse),
        )
    };
    let ridge = Vec::from_iter(
        driver
            .state()
            .run
            .as_ref()
            .unwrap()
            .baselines
            .linear
            .targets()
            .iter()
            .map(|of| of.rmse),
    );
    assert!(errors(&driver)[0] > ridge[0]);
    driver.click("Use ridge");
    driver.wait("its answers", |driver| {
        driver.state().result().unwrap().network_alone.is_some()
    });
    driver.settle();
    for (chosen, ridge) in errors(&driver).into_iter().zip(ridge) {
        assert!((chosen / ridge - 1.0).abs() < 1e-6, "{chosen} {ridge}");
    }
    assert!(driver.says("x (mm), chosen: ") && !driver.says("The network is worse than ridge regression"));
    assert!(
        driver.state().result().unwrap().intervals.is_some(),
        "they are those of ridge"
    );
}

#[test]
fn a_result_of_other_settings_stays_and_that_of_another_recording_does_not() {
    let Opened {
        mut driver,
        setup,
        folder,
    } = trained_small(SourceKind::Recording);
    driver.enter("Hidden nodes", "7");
    assert!(driver.has("Result of the previous settings.") && driver.says("x (mm) against time (s)"));
    driver.click("Undo changes");
    assert!(!driver.has("Result of the previous settings."));
    assert_eq!(driver.state().setup().as_ref(), Ok(&setup));
    driver.take_recording(&force(folder.path()));
    assert!(!driver.says("x (mm) against time (s)") && !driver.says("Finished: "));
    assert!(driver.has("Ready: press Train"));
}

#[test]
fn the_wheel_zooms_the_values_over_time_and_a_click_goes_to_a_sample() {
    let Opened {
        mut driver,
        folder: _folder,
        ..
    } = trained_on(probe);
    let x = driver
        .texts()
        .into_iter()
        .find(|text| text.starts_with("x (mm) against time (s): "));
    let x = &*x.unwrap();
    let whole = driver.get(x).accesskit_node().description().unwrap();
    let middle = driver.get(x).rect().center();
    driver.harness().hover_at(middle);
    driver.wait("the values there", |driver| driver.says("x (mm): actual "));
    driver.harness().drag_at(middle);
    driver.harness().drop_at(middle);
    driver.settle();
    let sample = driver.snapshot();
    assert!((8..=16).contains(&sample), "{sample}");
    driver.harness().event(eframe::egui::Event::MouseWheel {
        unit: eframe::egui::MouseWheelUnit::Point,
        delta: vec2(0.0, 200.0),
        modifiers: eframe::egui::Modifiers::NONE,
        phase: eframe::egui::TouchPhase::Move,
        source: eframe::egui::MouseWheelSource::Wheel,
    });
    driver.settle();
    let seen = driver.get(x).accesskit_node().description().unwrap();
    assert_ne!(seen, whole, "fewer samples are in view");
}

#[test]
fn a_number_that_means_none_is_mended_by_a_button() {
    let folder = tempfile::tempdir().unwrap();
    let setup = probe(folder.path());
    let path = folder.path().join("probe.csv");
    let text = fs::read_to_string(&path).unwrap();
    let spoiled = text.lines().enumerate().map(|(line, text)| match line {
        40..=50 => format!(
            "{},-999,{}",
            text.rsplitn(3, ',').nth(2).unwrap(),
            text.rsplit(',').next().unwrap()
        ),
        _ => text.to_owned(),
    });
    fs::write(&path, Vec::from_iter(spoiled).join("\n")).unwrap();
    let mut driver = Driver::open();
    driver.take_recording(&setup);
    driver.train();
    driver.wait("the inspected file", |driver| {
        driver.says("x has −999 where other values are far away")
    });
    driver.click("Treat −999 as missing");
    let markers = |driver: &Driver| {
        let run = driver.state().run.as_ref().unwrap();
        Vec::from_iter(run.setup.plan().unwrap().import.missing.iter().map(ToString::to_string))
    };
    driver.wait("the next training", |driver| markers(driver) == ["x=-999"]);
    driver.wait_for_last_epoch();
    assert!(!driver.says("where other values are far away"));
    assert_eq!(
        driver.state().run.as_ref().unwrap().test.set.samples(),
        22,
        "a fifth of the other rows"
    );
}
