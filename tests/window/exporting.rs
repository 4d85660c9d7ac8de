//! Files written from the window.

use std::fs;

use decoupler_files::export::{NetworkFile, format_number};
use eframe::egui::{Key, Modifiers};

use crate::{
    driver::{Driver, small, trained},
    folders::names,
    sources::{BOTH, Opened, network_figures, run_of, trained_small},
};

const NETWORK: &str = "Network file, JSON";
const ERRORS: &str = "Error table, CSV";
const LOSS: &str = "Loss curves, CSV";

fn trained_driver() -> Driver {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver
}

#[test]
fn saved_tables_contain_the_displayed_values() {
    for source in BOTH {
        let Opened {
            mut driver,
            setup,
            folder,
        } = trained_small(source);
        let [errors, loss] = ["errors.csv", "loss.csv"].map(|name| folder.path().join(name));
        driver.save(ERRORS, &errors);
        driver.click("Dismiss");
        driver.save(LOSS, &loss);

        let mut numbers = Vec::new();
        for record in csv::Reader::from_path(&errors).unwrap().records() {
            let record = record.unwrap();
            if record.iter().any(|cell| cell == "network") {
                numbers.extend(
                    record
                        .iter()
                        .filter_map(|cell| cell.parse::<f64>().ok())
                        .map(format_number),
                );
            }
        }
        let figures = network_figures(&run_of(&setup));
        driver.assert_shows(&figures);
        for figure in figures {
            let (_, number) = figure.rsplit_once(": ").unwrap();
            assert!(numbers.iter().any(|saved| saved == number), "{figure} in {numbers:?}");
        }

        let history = &driver.state().run.as_ref().unwrap().history;
        let mut rows = 0;
        for (record, epoch) in csv::Reader::from_path(&loss).unwrap().records().zip(history) {
            let record = record.unwrap();
            assert_eq!(record[0].parse(), Ok(epoch.epoch));
            assert_eq!(record[1].parse(), Ok(epoch.training_mse));
            assert_eq!(record[2].parse::<f64>().ok(), epoch.validation_mse);
            assert_eq!(record[3].parse::<f64>().ok(), epoch.test_mse);
            rows += 1;
        }
        assert_eq!(rows, history.len());
    }
}

#[test]
fn a_failed_save_is_explained_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("none").join("network.json");
    let mut driver = trained_driver();
    for button in [NETWORK, ERRORS, LOSS] {
        driver.save(button, &missing);
        let reason = format!(
            "cannot write '{}': the folder '{}' does not exist; make it first",
            missing.display(),
            folder.path().join("none").display()
        );
        driver.assert_has(&reason);
        driver.click("Dismiss");
        driver.save(button, folder.path());
        let reason = format!(
            "cannot write '{}': it is a folder; give the name of a file",
            folder.path().display()
        );
        driver.assert_has(&reason);
        driver.click("Dismiss");
    }
    assert!(names(folder.path()).is_empty());
    driver.save(NETWORK, &folder.path().join("network.json"));
    assert!(driver.says("Saved "), "after a failure the next one works");
}

#[test]
fn a_form_is_closed_without_writing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("errors.csv").display().to_string();
    let mut driver = trained_driver();
    driver.export(ERRORS);
    driver.type_into("File", &path);
    driver.click_button("Cancel");
    assert!(!driver.has("File"));
    driver.export(ERRORS);
    driver.type_into("File", &path);
    driver.press(Key::Escape);
    assert!(!driver.has("File"));
    driver.settle();
    assert!(driver.notice().is_none());
    assert!(names(folder.path()).is_empty());

    driver.export(ERRORS);
    driver.type_into("File", "  ");
    assert!(!driver.is_enabled("Save"), "a file needs a name");
    let (phase, shown) = (driver.state().phase, driver.snapshot());
    driver.press_with(Modifiers::COMMAND, Key::Enter);
    driver.press(Key::PageDown);
    assert_eq!(
        (driver.state().phase, driver.snapshot()),
        (phase, shown),
        "nothing happens behind the form"
    );
}

#[test]
fn enter_saves_and_the_suggested_name_distinguishes_runs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("loss.csv");
    let mut driver = trained_driver();
    // Without a desktop the form takes the place of the dialog.
    driver.export(LOSS);
    let suggested = driver.get("File").value().unwrap();
    assert!(suggested.ends_with("loss-10x6_3x18-h6-lm-seed0.csv"), "{suggested}");
    driver.settle();
    assert!(driver.get("File").is_focused(), "typing begins at once");
    driver.enter("File", &path.display().to_string());
    driver.wait("the file", |driver| driver.says("Saved "));
    assert_eq!(names(folder.path()), ["loss.csv"]);
    assert!(driver.has("Open folder"));
}

#[test]
fn a_success_notice_closes_by_itself_and_a_failure_stays() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    driver.wait_for_last_epoch();
    let missing = folder.path().join("none").join("network.json");
    driver.save(NETWORK, &missing);
    assert!(driver.says("does not exist"));
    // Fifteen seconds.
    driver.harness().run_steps(60);
    assert!(driver.says("does not exist"), "a failure waits for the user");
    let path = folder.path().join("network.json");
    driver.export(NETWORK);
    driver.type_into("File", &path.display().to_string());
    driver.click_button("Save");
    driver.wait("the file", |driver| driver.says("Saved "));
    assert!(!driver.says("does not exist"), "the same action has succeeded now");
    driver.harness().run_steps(60);
    assert_eq!(driver.notice(), None);
    assert!(driver.becomes_idle());
}

#[test]
fn every_network_format_is_exported_with_what_other_programs_may_deviate() {
    for source in BOTH {
        let Opened {
            mut driver,
            setup,
            folder,
        } = trained_small(source);
        let bundles = [
            ("ONNX, f64", "network.onnx"),
            ("ONNX, f32", "network.onnx"),
            ("C99, f64", "c99_f64_decode.c"),
            ("C99, f32", "c99_f32_decode.c"),
            ("C99, fixed16", "c99_fixed16_decode.c"),
            ("MATLAB/Octave, f64", "matlab_octave_f64_decode.m"),
            ("NumPy, f64", "network.npz"),
            ("NumPy, f32", "decode.py"),
        ];
        for (name, file) in bundles {
            let path = folder
                .path()
                .join(name.to_lowercase().replace(", ", "_").replace('/', "_"));
            driver.save(name, &path);
            let (format, _) = name.split_once(", ").unwrap();
            let text = format!("{format} written; answers of other programs agree within ");
            driver.assert_says(&text);
            assert!(driver.says(&path.display().to_string()));
            let found = names(&path);
            for expected in [file, "README.txt", "golden.csv", "metadata.json"] {
                assert!(found.iter().any(|name| name == expected), "{name}: {found:?}");
            }
            driver.click("Dismiss");
        }
        // The bundle names the source of its network.
        let metadata = fs::read_to_string(folder.path().join("onnx_f64/metadata.json")).unwrap();
        assert!(metadata.contains(&setup.source_name()), "{metadata}");
        let taken = folder.path().join("onnx_f64");
        driver.save("ONNX, f64", &taken);
        let second = folder.path().join("onnx_f64-2");
        driver.assert_says(&second.display().to_string());
        assert!(names(&second).iter().any(|name| name == "network.onnx"));
    }
}

#[test]
fn tables_are_copied_as_displayed() {
    for source in BOTH {
        let Opened {
            mut driver,
            setup,
            folder: _folder,
        } = trained_small(source);
        let figures = network_figures(&run_of(&setup));
        for form in ["Markdown", "LaTeX", "tab-separated"] {
            let copied = driver.copy(&format!("Error table, Copy as {form}"));
            let mut numbers = Vec::new();
            for line in copied.lines().filter(|line| line.contains("network")) {
                let cells = line.split(['\t', '|', '&', ' ']).map(str::trim);
                numbers.extend(cells.filter_map(|cell| cell.parse::<f64>().ok()).map(format_number));
            }
            for figure in &figures {
                let (_, number) = figure.rsplit_once(": ").unwrap();
                assert!(
                    numbers.iter().any(|copied| copied == number),
                    "{form}, {figure} in {copied}"
                );
            }
            driver.assert_has(&format!("Copied the error table as {form}"));
            driver.click("Dismiss");
        }
    }
}

#[test]
fn the_menu_says_in_each_view_why_nothing_can_be_exported_yet() {
    let mut driver = Driver::open();
    for (view, line, reason) in [
        ("Train", "Report…", "Nothing is trained yet: press Train first."),
        ("Study", "Data…", "Nothing has finished yet: press Run first."),
        ("Compare", "Network…", "No run is chosen as A: choose one in the list."),
    ] {
        driver.click_button(view);
        driver.settle();
        driver.open_menu();
        assert!(!driver.is_enabled(line), "{view}");
        driver.assert_has(reason);
        driver.press(Key::Escape);
        assert!(!driver.has(reason), "{view}: the menu is closed");
    }
    driver.assert_says("Every finished training is kept here");
}

#[test]
fn a_report_contains_the_displayed_errors_and_a_kept_run_is_exported_too() {
    let folder = tempfile::tempdir().unwrap();
    let mut driver = trained_driver();
    let report = folder.path().join("report.html");
    driver.save("Report, HTML", &report);
    driver.click("Dismiss");
    let html = fs::read_to_string(&report).unwrap();
    for cell in driver.table() {
        let (_, value) = cell.rsplit_once(": ").unwrap();
        assert!(html.contains(&format!("<td>{value}</td>")), "{cell}");
    }
    driver.click_button("Compare");
    let name = driver.runs()[0].name.clone();
    driver.wait("the run", |driver| driver.has("Surface of A"));
    let [network, of_kept] = ["network.json", "kept.html"].map(|name| folder.path().join(name));
    driver.save("A: Network file, JSON", &network);
    driver.click("Dismiss");
    driver.save("A: Report, HTML", &of_kept);
    assert_eq!(NetworkFile::load(&network).unwrap().settings, small());
    assert!(fs::read_to_string(of_kept).unwrap().contains(&format!("<h1>{name}: ")));
}

#[test]
fn export_names_its_network_and_offers_the_displayed_epoch() {
    let folder = tempfile::tempdir().unwrap();
    let [past, of_best, errors] = ["past.json", "best.json", "errors.csv"].map(|name| folder.path().join(name));
    let mut driver = trained_driver();
    driver.wait_for_last_epoch();
    let best = format!("Best network, epoch {}", trained(small()).leader().best_epoch());
    driver.choose_export("ONNX, f64");
    assert!(
        !driver.says("Displayed network"),
        "there is only one: {:#?}",
        driver.texts()
    );
    driver.press(Key::Escape);

    driver.get("Epoch of the displayed network").focus();
    driver.harness().run_steps(2);
    while driver.views().train.scrub.epoch().unwrap_or(15) > 4 {
        driver.press(Key::ArrowLeft);
    }
    driver.wait("the network of the epoch", |driver| {
        driver.says("Of the network of epoch 4.")
    });
    driver.choose_export("ONNX, f64");
    driver.assert_says("Displayed network, epoch 4");
    driver.choose_in_dialog("Network", &best);
    driver.assert_says(&best);
    driver.press(Key::Escape);
    driver.save("Network file of epoch 4, JSON", &past);
    driver.click("Dismiss");
    driver.choose_export(NETWORK);
    driver.choose_in_dialog("Network", &best);
    driver.click_button("Save…");
    driver.harness().run_steps(5);
    driver.type_into("File", &of_best.display().to_string());
    driver.click_button("Save");
    driver.wait("the file", |driver| driver.says("Saved "));
    driver.click("Dismiss");
    driver.save(ERRORS, &errors);

    let mut stopped = small();
    stopped.training.stopping.epochs = 4;
    let stopped = trained(stopped);
    let file = NetworkFile::load(&past).unwrap();
    assert_eq!(file.network, stopped.network());
    assert_eq!(file.scores, stopped.scores().unwrap());
    assert_eq!(file.training.best_epoch, stopped.leader().best_epoch());
    assert_eq!(file.training.history, stopped.leader().history());
    assert_eq!(file.training.stages, stopped.leader().stages());
    assert_eq!(file.settings, small());
    assert_eq!(NetworkFile::load(&of_best).unwrap().network, trained(small()).network());
    let table = fs::read_to_string(&errors).unwrap();
    let z_percent = file.scores.network.percent().unwrap().to_string();
    assert!(
        table.contains(&z_percent),
        "the table of the displayed network, {z_percent}: {table}"
    );
}
