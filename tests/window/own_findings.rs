//! What recordings tell and what decoders make of them, in the window.

use std::{fmt::Write as _, fs, path::Path};

use decoupler::{
    app::Notice,
    dataset::Division,
    evaluation::recorded::{Findings, FittedModel},
    export::{describe_target, format_number},
};

use crate::{
    driver::Driver,
    recordings::{opened, opened_text, plan, trained},
};

/// A sentence of the library as the window shows it.
fn sentence(text: &str) -> String {
    let (first, rest) = text.split_at(1);
    format!("{}{rest}.", first.to_uppercase())
}

/// Measures what the recording tells, by ridge regression alone.
fn measure_by_ridge(driver: &mut Driver) {
    driver.click("Findings");
    driver.settle();
    driver.click_button("ridge");
    driver.click_button("Measure what the readings tell");
    driver.wait("what they tell", |driver| driver.says("folds by time; measured in"));
    driver.settle();
}

#[test]
fn what_the_readings_tell_is_told_as_by_the_library() {
    let (mut driver, path, _folder) = opened(160);
    measure_by_ridge(&mut driver);
    let watch = &mut |_| std::ops::ControlFlow::Continue(());
    let recording = plan(&path).recording(Path::new(""), watch).unwrap();
    let (division, model) = (Division::default(), Some(FittedModel::Ridge));
    let settings = decoupler::evaluation::RunSettings::from(decoupler::evaluation::Measured {
        rows: decoupler::scene::RowModel::Shared,
    });
    let found = Findings::measure(&settings, &recording.set, (&division, 5), model, &|_| (), &|| false);
    let found = found.unwrap().unwrap();
    for (name, target) in ["x", "y"].into_iter().zip(&found.targets) {
        for expected in [describe_target(name, target), target.curve.sentence(name)] {
            let expected = sentence(&expected);
            assert!(driver.has(&expected), "{expected} is not among {:#?}", driver.texts());
        }
    }
    for channel in &found.importance {
        let growth = channel.growth[0].unwrap();
        let expected = format!("{:.2} ({:.2} to {:.2})", growth.value, growth.low, growth.high);
        assert!(driver.says(&expected), "{expected} is not among {:#?}", driver.texts());
    }
    assert!(driver.says("RMSE of x (mm)"), "the learning curve is drawn");
    // What is changed since is said.
    driver.click("Columns");
    driver.settle();
    driver.mean("u2", "unused");
    driver.click("Findings");
    driver.settle();
    assert!(driver.says("have changed since"), "{:#?}", driver.texts());
}

#[test]
fn channels_that_tell_nothing_are_named_where_the_readings_are_judged() {
    let mut text = "time (s),u1 (V),u2 (V),u3 (V),x (N)\n".to_owned();
    for row in 0..80 {
        let (t, u) = (f64::from(row), f64::from((7 * row) % 13));
        writeln!(text, "{t},{u},{},2.5,{:.6}", 3.0 * u, 5.0 * u + 0.1 * t.cos()).unwrap();
    }
    let (mut driver, _path, _folder) = opened_text(&text);
    for column in ["u2", "u3"] {
        driver.mean(column, "input");
    }
    driver.mean("x", "target");
    measure_by_ridge(&mut driver);
    for expected in ["u3 is 2.5 in every sample", "u2 repeats u1"] {
        assert!(driver.says(expected), "{expected} is not among {:#?}", driver.texts());
    }
}

#[test]
fn measuring_is_stopped_and_a_training_waits_for_its_end() {
    let (mut driver, _path, _folder) = opened(160);
    driver.limit_epochs("100000");
    driver.click("Findings");
    driver.settle();
    driver.click_button("Measure what the readings tell");
    driver.wait("the first part", |driver| driver.says("Cross-validation…"));
    assert!(!driver.is_enabled("▶ Train"), "both at once would disturb each other");
    driver.click_button("Stop measuring");
    driver.settle();
    assert!(driver.is_enabled("▶ Train") && driver.has("Measure what the readings tell"));
}

#[test]
fn decoders_stand_beside_the_network_with_error_and_time() {
    let (mut driver, path, folder) = opened(120);
    driver.limit_epochs("5");
    driver.train_own_data();
    driver.click("Decoders");
    driver.settle();
    driver.click_button("Measure the decoders");
    driver.wait("the last decoder", |driver| {
        driver.says("Fuzzy") && !driver.says("Measuring…")
    });
    driver.settle();
    let table = trained(&plan(&path)).target_table();
    // The mean, ridge and the network, whose errors in 32 bits are the same in three digits.
    for (name, row) in [("Training mean", 0), ("Ridge", 1), ("Network", 2), ("Network f32", 2)] {
        let expected = format!("{name}: {}, ", format_number(table[row].targets[0].rmse));
        let rows: Vec<String> = driver
            .texts()
            .into_iter()
            .filter(|text| text.starts_with(&expected))
            .collect();
        assert!(
            rows.len() == 1 && rows[0].contains("µs"),
            "{expected}: {rows:?} of {:#?}",
            driver.texts()
        );
    }
    assert!(driver.says("time to decode a sample (µs)"), "the chart is drawn");
    let saved = folder.path().join("decoders.csv");
    driver.save("Decoder table, CSV", &saved);
    let text = fs::read_to_string(&saved).unwrap();
    assert!(
        text.starts_with("decoder,target,unit,rmse,r2,decoding_us,fit_seconds\n"),
        "{text}"
    );
    assert_eq!(
        text.lines().filter(|line| line.starts_with("Network,")).count(),
        2,
        "{text}"
    );
    let picture = folder.path().join("decoders.svg");
    driver.save("Chart, SVG", &picture);
    assert!(fs::read_to_string(&picture).unwrap().contains("</svg>"));
}

#[test]
fn a_network_of_own_data_leaves_for_other_programs() {
    let (mut driver, _path, folder) = opened(60);
    driver.limit_epochs("3");
    driver.train_own_data();
    for (name, file) in [
        ("ONNX, f64", "press.onnx"),
        ("NumPy, f32", "decode.py"),
        ("C99, fixed16", "decode.h"),
    ] {
        let taken = folder.path().join(file.replace('.', "_"));
        driver.save(name, &taken);
        let told = match driver.notice() {
            Some(Notice::Done(told)) => told.clone(),
            other => panic!("{other:?}"),
        };
        assert!(told.contains("of the range of a target"), "{told}");
        let files: Vec<String> = fs::read_dir(&taken)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        assert!(
            files.iter().any(|name| name.ends_with(file.split_at(file.len() - 3).1)),
            "{files:?}"
        );
        let read_me = fs::read_to_string(taken.join("README.txt")).unwrap();
        assert!(read_me.contains("u1 (V)") && read_me.contains("x (mm)"), "{read_me}");
    }
}
