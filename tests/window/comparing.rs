//! Finished trainings kept, compared, and restored after a restart; figures of the paper; pictures for print.

use std::{fmt::Write as _, fs, path::Path};

use decoupler::window::Effect;
use decoupler_core::evaluation::{Run, RunSettings};
use decoupler_files::export::{NetworkFile, format_number};
use eframe::egui::{Event, Key};

use crate::{
    driver::{Driver, small, trained},
    sources::{BOTH, Opened, open_small, probe, skin_with_positions, with_epochs},
};

const FIRST: &str = "10×6_3×18 h6 lm";
/// Folder in which the window keeps its runs.
const PLACE: &str = "runs";
const SECOND: &str = "10×6_3×18 h4 lm";

fn kept(driver: &Driver) -> usize {
    driver.runs().len()
}

fn train_and_keep(driver: &mut Driver, count: usize) {
    driver.train();
    driver.wait("the run in the list", |driver| kept(driver) == count);
}

fn trained_twice(driver: &mut Driver) {
    driver.configure_small();
    train_and_keep(driver, 1);
    driver.enter("Hidden nodes", "4");
    train_and_keep(driver, 2);
    driver.click_button("Compare");
}

fn wait_for_both(driver: &mut Driver) {
    driver.wait("both surfaces", |driver| {
        driver.has("Surface of A") && driver.has("Surface of B")
    });
}

/// Heights that the network of a run decodes from the first snapshot of its test set, as described to assistive
/// technology.
fn decoded_heights(run: &Run) -> String {
    let answers = run.decouple_test();
    let samples = run.test().snapshots().swap_remove(0);
    let nodes = samples.into_iter().flat_map(|sample| answers.row(sample).to_vec());
    let z = nodes.skip(2).step_by(3);
    let (low, high) = z.fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
    format!("z {low:.2} to {high:.2} mm")
}

/// Waits until the folder of the kept runs has been read.
fn wait_for_file(driver: &mut Driver) {
    driver.wait("the folder", |driver| driver.state().runs.path.is_some());
}

#[test]
fn two_runs_are_compared_and_survive_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("data").join(PLACE);
    let mut driver = Driver::open_keeping(&path);
    trained_twice(&mut driver);
    // The last two, the older one first.
    wait_for_both(&mut driver);
    driver.enter("Name of run 1", "Six hidden nodes");
    driver.wait("the new name", |driver| driver.has("Six hidden nodes as A"));

    let settings = [6, 4].map(|hidden| RunSettings { hidden, ..small() });
    let runs = settings.map(trained);
    let shown = runs.each_ref().map(|run| NetworkFile::from_run(run, None).unwrap());
    // The comparison is saved as displayed, with the names of the runs.
    let saved = folder.path().join("compared.svg");
    driver.save("Surfaces, SVG", &saved);
    driver.click("Dismiss");
    let svg = fs::read_to_string(saved).unwrap();
    let titles = [
        "A: Six hidden nodes, decoded".to_owned(),
        format!("B: {SECOND}, decoded"),
    ];
    assert_eq!(titles.map(|title| count(&svg, &title)), [1, 1]);
    assert_eq!(count(&svg, "z (mm)"), 3, "two axes and one key");
    let check = |driver: &Driver| {
        let [a, b] = shown.each_ref().map(|file| *file.scores.network.nodes().unwrap());
        for (letter, errors) in [("A", a), ("B", b)] {
            let cell = format!("Z error, %, {letter}: {}", format_number(errors.z_percent));
            driver.assert_has(&cell);
            let cell = format!("Worst node, mm, {letter}: {}", format_number(errors.worst_mm));
            driver.assert_has(&cell);
        }
        for (surface, run) in ["Surface of A", "Surface of B"].into_iter().zip(&runs) {
            assert_eq!(driver.get(surface).value(), Some(decoded_heights(run)));
        }
        for (index, file) in shown.iter().enumerate() {
            assert_eq!(driver.kept(index).training.history, file.training.history);
        }
    };
    check(&driver);
    let picture = folder.path().join("losses.svg");
    driver.save("Loss chart, SVG", &picture);
    driver.click("Dismiss");
    let picture = fs::read_to_string(picture).unwrap();
    for curve in ["A: Six hidden nodes, test", &format!("B: {SECOND}, training")] {
        assert!(picture.contains(curve), "{curve} is in the picture as in the window");
        driver.assert_has(curve);
    }
    driver.click("Next snapshot");
    assert_ne!(driver.get("Surface of A").value(), Some(decoded_heights(&runs[0])));
    driver.click_button("Error");
    driver.settle();
    // Closing the window waits for pending writes.
    drop(driver);

    let mut driver = Driver::open_keeping(&path);
    wait_for_file(&mut driver);
    driver.click_button("Compare");
    wait_for_both(&mut driver);
    assert!(driver.has("Six hidden nodes as A") && driver.has(&format!("{SECOND} as B")));
    check(&driver);
    assert!(driver.becomes_idle(), "an idle view draws nothing");
    driver.click("Open Six hidden nodes");
    driver.wait("the run in Train", |driver| driver.shown() == "Train");
    assert_eq!((driver.shown(), driver.state().draft), ("Train", small()));
}

#[test]
fn keys_step_through_the_snapshots_of_both_runs() {
    let mut driver = Driver::open();
    trained_twice(&mut driver);
    wait_for_both(&mut driver);
    driver.press(Key::PageDown);
    assert_eq!(driver.snapshot(), 1);
    driver.press(Key::PageUp);
    assert_eq!(driver.snapshot(), 0);
    assert!(!driver.is_enabled("Previous snapshot"));
}

#[test]
fn a_run_is_removed_only_when_that_is_confirmed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(PLACE);
    let mut driver = Driver::open_keeping(&path);
    trained_twice(&mut driver);
    // The surfaces move the list when they appear.
    wait_for_both(&mut driver);
    driver.click(&format!("Remove {FIRST}"));
    driver.click_button("Keep");
    assert_eq!(kept(&driver), 2);
    driver.click(&format!("Remove {FIRST}"));
    driver.click_button("Remove");
    driver.wait("the removal", |driver| kept(driver) == 1);
    assert!(driver.state().runs.pinned(0).is_none());
    drop(driver);
    let mut driver = Driver::open_keeping(&path);
    wait_for_file(&mut driver);
    let names: Vec<_> = driver.runs().iter().map(|run| &run.name).collect();
    assert_eq!(names, [SECOND]);
}

#[test]
fn a_damaged_run_is_reported_and_the_others_are_loaded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(PLACE);
    let mut driver = Driver::open_keeping(&path);
    driver.configure_small();
    train_and_keep(&mut driver, 1);
    drop(driver);
    let damaged = path.join("run-12.json");
    fs::write(&damaged, "{\"format\": \"decoupler netw").unwrap();
    let mut driver = Driver::open_keeping(&path);
    wait_for_file(&mut driver);
    driver.assert_says(&damaged.display().to_string());
    assert_eq!(kept(&driver), 1);
    driver.click("Dismiss");
    driver.click_button("Compare");
    driver.settle();
    assert!(driver.notice().is_none(), "reported once: {:?}", driver.notice());
    assert!(damaged.exists(), "nothing is lost");
}

/// Waits until a file in the folder contains this text.
fn wait_for_text(driver: &mut Driver, folder: &Path, text: &str) {
    let holds = |path: &Path| fs::read_to_string(path).is_ok_and(|found| found.contains(text));
    driver.wait(text, |_| {
        let files = fs::read_dir(folder).into_iter().flatten().flatten();
        files.map(|file| file.path()).any(|path| holds(&path))
    });
}

#[test]
fn two_windows_see_each_others_runs_names_pins_and_removals() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(PLACE);
    let [mut first, mut second] = [(); 2].map(|()| Driver::open_keeping(&path));
    first.configure_small();
    first.train();
    wait_for_text(&mut first, &path, FIRST);
    second.click_button("Compare");
    second.wait("the run of the first window", |driver| {
        driver.has(&format!("{FIRST} as A"))
    });
    second.enter("Name of run 1", "Renamed");
    wait_for_text(&mut second, &path, "Renamed");
    second.wait("its surface", |driver| driver.has("Surface of A"));
    drop(second);

    first.click_button("Compare");
    first.wait("the name", |driver| driver.has("Renamed as A"));
    first.wait("what was pinned", |driver| driver.has("Surface of A"));

    let mut third = Driver::open_keeping(&path);
    third.click_button("Compare");
    third.wait("the run", |driver| driver.has("Remove Renamed"));
    third.click("Remove Renamed");
    third.click_button("Remove");
    drop(third);
    first.harness().event(Event::WindowFocused(true));
    first.wait("the removal", |driver| !driver.has("Renamed as A"));
    first.settle();
    assert!(!first.has("Surface of A"));
    assert!(first.becomes_idle(), "an idle view draws nothing");
}

#[test]
fn displayed_pictures_are_saved_in_the_format_of_their_extension() {
    const CHART: &str = "Chart, SVG";
    let folder = tempfile::tempdir().unwrap();
    let mut driver = Driver::open();
    driver.open_menu();
    assert!(!driver.is_enabled("Figure…"), "nothing to save yet");
    driver.press(Key::Escape);
    driver.configure_small();
    driver.train();
    let at = |name: &str| folder.path().join(name);
    driver.save("Surfaces, PNG", &at("a.png"));
    driver.assert_says("Saved ");
    driver.click("Dismiss");
    let tabs = ["Loss", "Histogram", "Regression", "Nodes"];
    let mut pictures = Vec::new();
    for tab in tabs {
        driver.show_chart(tab);
        let path = at(&format!("{tab}.svg"));
        driver.save(CHART, &path);
        driver.click("Dismiss");
        let svg = fs::read_to_string(path).unwrap();
        assert!(svg.starts_with("<svg ") && !svg.contains("NaN"), "{tab}");
        pictures.push(svg);
    }
    // The nodes: a square and a disc each, and one of both next to the plot.
    assert_eq!(pictures[3].matches("<circle").count(), 60 + 1);
    driver.save(CHART, &at("nodes.bmp"));
    assert!(driver.says("give a name that ends in .png or .svg"));
    let png = image::open(at("a.png")).unwrap();
    assert!(png.width() > 2000);
}

/// The displayed surfaces as saved by the window.
fn saved_surfaces(driver: &mut Driver) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("surfaces.svg");
    driver.save("Surfaces, SVG", &path);
    driver.assert_says("Saved ");
    driver.click("Dismiss");
    fs::read_to_string(path).unwrap()
}

/// Number of occurrences of a text in a picture.
fn count(svg: &str, text: &str) -> usize {
    svg.matches(&format!(">{text}</text>")).count()
}

#[test]
fn saved_surfaces_use_the_current_camera_and_their_own_colours() {
    let mut driver = Driver::open();
    driver.configure_small();
    driver.train();
    let first = saved_surfaces(&mut driver);
    assert!(
        first == saved_surfaces(&mut driver),
        "the same view gives the same picture"
    );
    let press = |driver: &mut Driver, key| {
        // The keys on the actual surface press it.
        driver.get("Decoded surface").focus();
        driver.settle();
        driver.press(key);
    };
    press(&mut driver, Key::ArrowLeft);
    let turned = saved_surfaces(&mut driver);
    assert!(first != turned, "the camera was turned");
    press(&mut driver, Key::Home);
    assert!(first == saved_surfaces(&mut driver), "the camera was turned back");
    driver.click("Top view");
    let from_above = saved_surfaces(&mut driver);
    assert_eq!(
        [&first, &from_above].map(|svg| count(svg, "z (mm)")),
        [3, 1],
        "two axes and a key, the key alone"
    );
    driver.click("3-D");
    let titles = ["Actual", "Decoded", "Error", "error (mm)"];
    assert_eq!(titles.map(|title| count(&first, title)), [1, 1, 0, 0]);
    driver.click_button("Error");
    let error = saved_surfaces(&mut driver);
    let counts = titles.map(|title| count(&error, title));
    assert_eq!(counts, [1, 0, 1, 2], "the error's axis and key");
}

#[test]
fn two_runs_of_a_recording_are_compared_target_by_target() {
    let folder = tempfile::tempdir().unwrap();
    let setup = with_epochs(&probe(folder.path()), 2);
    let runs = folder.path().join(PLACE);
    let mut driver = Driver::open_keeping(&runs);
    driver.take_recording(&setup);
    train_and_keep(&mut driver, 1);
    let other = RunSettings {
        hidden: 3,
        ..*setup.settings()
    };
    let other = Box::new(setup.with_settings(other));
    driver.window_mut().apply(Effect::TakeSetup(other));
    driver.settle();
    train_and_keep(&mut driver, 2);
    driver.click_button("Compare");
    driver.wait("both charts", |driver| {
        let texts = driver.texts();
        let charts = texts
            .iter()
            .filter(|text| text.contains("decoded x (mm) against actual x (mm)"));
        charts.count() > 1
    });
    driver.settle();
    let kept = [0, 1].map(|index| driver.kept(index));
    for (file, letter) in kept.iter().zip(["A", "B"]) {
        let errors = file.scores.network.targets()[1];
        for (name, value) in [("RMSE", errors.rmse), ("R²", errors.r2.unwrap())] {
            let cell = format!("{name} of y (mm), {letter}: {}", format_number(value));
            driver.assert_has(&cell);
        }
    }
    driver.assert_says("decoded x (mm) against actual x (mm)");
    assert!(!driver.says("not comparable"));
    let picture = folder.path().join("regression.svg");
    driver.save("Regression of A, SVG", &picture);
    driver.click("Dismiss");
    assert!(fs::read_to_string(&picture).unwrap().contains("</svg>"));
    let name = driver.runs()[0].name.clone();
    driver.click(&format!("Open {name}"));
    driver.wait("the run in Train", |driver| driver.shown() == "Train");
    assert_eq!(
        (driver.shown(), driver.state().settings().hidden),
        ("Train", kept[0].settings.hidden)
    );
    drop(driver);

    // Without the file the figures stay, and the reason why there is no chart is shown.
    fs::remove_file(&setup.plan().unwrap().import.data).unwrap();
    let mut driver = Driver::open_keeping(&runs);
    wait_for_file(&mut driver);
    driver.click_button("Compare");
    driver.wait("the reason", |driver| driver.says("no longer exists"));
    driver.settle();
    assert!(driver.says("probe.csv") && driver.has(&format!("{name} as A")));
    let rmse = format_number(kept[0].scores.network.targets()[0].rmse);
    driver.assert_has(&format!("RMSE of x (mm), A: {rmse}"));
}

#[test]
fn targets_with_positions_are_compared_on_surfaces() {
    let folder = tempfile::tempdir().unwrap();
    let mut positions = "target,x,y\n".to_owned();
    for taxel in 0..6 {
        writeln!(positions, "d{},{},{}", taxel + 1, 5 * (taxel % 3), 4 * (taxel / 3)).unwrap();
    }
    let setup = with_epochs(&skin_with_positions(folder.path(), &positions), 2);
    let mut driver = Driver::open_keeping(&folder.path().join(PLACE));
    driver.take_recording(&setup);
    train_and_keep(&mut driver, 1);
    driver.click_button("Compare");
    driver.wait("its surface", |driver| driver.has("Surface of A"));
    let first = driver.get("Surface of A").value();
    driver.click("Next snapshot");
    assert_ne!(driver.get("Surface of A").value(), first);
    driver.click_button("Error");
    driver.settle();
    assert!(driver.has("Surface of A") && !driver.says("against actual"));
}

#[test]
fn a_training_has_one_time_in_every_view() {
    for source in BOTH {
        let Opened { mut driver, folder, .. } = {
            let mut opened = open_small(source);
            opened.change(|settings| settings.starts = 3);
            opened
        };
        driver.train();
        driver.wait_for_last_epoch();
        driver.wait_for_kept_run();
        driver.details();
        let texts = driver.texts();
        let mut after = texts.iter().skip_while(|text| *text != "Training time");
        let time = after.find(|text| *text != "Training time").unwrap();
        driver.wait("the status line", |driver| driver.has(&format!("{time} in total")));
        let report = folder.path().join("report.html");
        driver.save("Report, HTML", &report);
        driver.click("Dismiss");
        assert!(fs::read_to_string(report).unwrap().contains(&format!(" in {time} (")));
        driver.click_button("Compare");
        driver.wait("the run", |driver| {
            driver.has(&format!("Training time, A: {time}")) && driver.says(&format!("training time {time}"))
        });
    }
}
