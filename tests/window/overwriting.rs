//! Existing files in the form for a path: none is overwritten without asking.

use std::{fs, path::Path};

use decoupler_files::export::{NetworkFile, RecipeFile};
use eframe::egui::{Event, Key};

use crate::{
    driver::Driver,
    folders::names,
    recordings::{opened, recording, written},
};

const RECIPE: &str = "Recipe, JSON";

/// Asks for an export with this path, without waiting for an answer.
#[track_caller]
fn ask(driver: &mut Driver, export: &str, path: &Path) {
    driver.export(export);
    driver.type_into("File", &path.display().to_string());
    driver.click_button("Save");
}

#[test]
fn an_existing_file_is_replaced_only_if_the_user_confirms() {
    let (mut driver, _path, folder) = opened(40);
    let path = written(&folder, "mine.json", "mine");
    ask(&mut driver, RECIPE, &path);
    driver.wait("the question", |driver| driver.says("mine.json already exists"));
    // Neither pressing Enter again nor a second click in the same place confirms.
    driver.press(Key::Enter);
    assert!(!driver.has("Save"));
    driver.settle();
    assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
    driver.click_button("Cancel");
    driver.settle();
    assert!(!driver.has("File") && driver.notice().is_none());
    assert_eq!(fs::read_to_string(&path).unwrap(), "mine");

    // Another name is asked about again.
    ask(&mut driver, RECIPE, &path);
    driver.wait("the question", |driver| driver.has("Replace"));
    let other = folder.path().join("other.json");
    driver.type_into("File", &other.display().to_string());
    assert!(!driver.has("Replace"));
    driver.click_button("Save");
    driver.wait("the file", |driver| driver.says("Saved "));
    assert!(RecipeFile::load(&other).is_ok());
    assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
    driver.click("Dismiss");

    ask(&mut driver, RECIPE, &path);
    driver.wait("the question", |driver| driver.has("Replace"));
    driver.click_button("Replace");
    driver.wait("the file", |driver| driver.says("Saved "));
    assert!(RecipeFile::load(&path).is_ok());
}

#[test]
fn a_recording_in_use_is_never_overwritten_by_whatever_path() {
    let (mut driver, path, folder) = opened(40);
    let tests = written(&folder, "tests.csv", &recording(20));
    driver.unfold_to("Samples", "Test file…");
    driver.open_form("Test file…");
    driver.type_into("File", &tests.display().to_string());
    driver.click_button("Open");
    driver.wait("its samples", |driver| driver.has("Test: 20"));
    let (before, before_tests) = (fs::read(&path).unwrap(), fs::read(&tests).unwrap());
    fs::create_dir(folder.path().join("sub")).unwrap();
    let dotted = folder.path().join("sub/../press.csv");
    let mut paths = vec![path.clone(), dotted, tests.clone()];
    #[cfg(unix)]
    {
        let link = folder.path().join("link.csv");
        std::os::unix::fs::symlink(&path, &link).unwrap();
        paths.push(link);
    }
    for used in paths {
        ask(&mut driver, RECIPE, &used);
        driver.wait("the refusal", |driver| driver.says("is in use"));
        assert!(!driver.has("Replace"), "{:#?}", driver.texts());
        driver.click_button("Cancel");
        driver.settle();
    }
    assert_eq!(
        (fs::read(&path).unwrap(), fs::read(&tests).unwrap()),
        (before, before_tests)
    );
}

#[test]
fn a_network_kept_in_the_list_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = written(&folder, "press.csv", &recording(40));
    let mut driver = Driver::open_keeping(&folder.path().join("runs"));
    driver.open_recordings(&[&path]);
    driver.limit_epochs("2");
    driver.train_recording();
    let kept = folder.path().join("runs");
    // A file that is being written has a temporary name.
    let written = || names(&kept).into_iter().find(|name| name.ends_with(".json"));
    driver.wait("the network", |_| kept.is_dir() && written().is_some());
    driver.settle();
    let kept = kept.join(written().unwrap());
    ask(&mut driver, RECIPE, &kept);
    driver.wait("the refusal", |driver| driver.says("is in use"));
    assert!(NetworkFile::load(&kept).is_ok());
}

#[test]
fn typing_replaces_the_suggested_path() {
    let (mut driver, path, folder) = opened(40);
    let target = folder.path().join("typed.json");
    driver.export(RECIPE);
    driver.settle();
    driver.harness().event(Event::Text(target.display().to_string()));
    driver.settle();
    assert_eq!(driver.get("File").value().unwrap(), target.display().to_string());
    driver.press(Key::Enter);
    driver.wait("the file", |driver| driver.says("Saved "));
    assert!(RecipeFile::load(&target).is_ok());
    driver.click("Dismiss");

    // So do the forms for files that are read.
    driver.open_form("Add file…");
    driver.settle();
    driver.harness().event(Event::Text(path.display().to_string()));
    driver.settle();
    assert_eq!(driver.get("File").value().unwrap(), path.display().to_string());
}
