//! The committed look of every view in both themes. A visible difference fails the test; the new picture and one of the
//! differences are left next to the committed one. After a review, `UPDATE_SNAPSHOTS=1 cargo test --test window snapshots`
//! accepts the new pictures.
//!
//! Times differ from run to run and from machine to machine: they are covered, wherever they are.

use eframe::egui::{Rect, vec2};
use egui_kittest::{SnapshotOptions, SnapshotResults, try_image_snapshot_options};
use image::{Rgba, RgbaImage};

use crate::driver::Driver;

/// Returns true if a text contains a time: "12 ms", "0.8 µs", "3 min 5 s".
fn contains_a_time(text: &str) -> bool {
    let words: Vec<&str> = text
        .split(|c: char| c.is_whitespace() || "(),;·×".contains(c))
        .collect();
    let is_number = |word: &str| word.starts_with(|c: char| c.is_ascii_digit());
    let is_unit = |word: &str| ["µs", "ms", "s", "min", "h"].contains(&word.trim_end_matches('.'));
    words.windows(2).any(|pair| is_number(pair[0]) && is_unit(pair[1]))
}

/// Covers the line that contains a time, in the left column or from its beginning on: the words after it move with its length.
fn cover_line(picture: &mut RgbaImage, place: Rect) {
    let width = picture.width();
    let column_end = width * 27 / 100;
    let columns = if place.right() < column_end as f32 {
        0..column_end
    } else {
        (width * 45 / 100).min(place.left().max(0.0) as u32)..width
    };
    let bottom = (place.bottom() as u32 + 1).min(picture.height());
    for y in place.top().max(0.0) as u32..bottom {
        for x in columns.clone() {
            picture.put_pixel(x, y, Rgba([128, 128, 128, 255]));
        }
    }
}

fn compare(driver: &mut Driver, name: &str, results: &mut SnapshotResults) {
    let options = SnapshotOptions::new().output_path("tests/window/snapshots");
    for theme in ["dark", "light"] {
        let mut picture = driver.harness().render().unwrap();
        for (text, place) in driver.places() {
            if contains_a_time(&text) && place.is_positive() {
                cover_line(&mut picture, place);
            }
        }
        results.add(try_image_snapshot_options(
            &picture,
            format!("{name}-{theme}"),
            &options,
        ));
        driver.act(if theme == "dark" { "Light theme" } else { "Dark theme" });
        driver.settle();
    }
}

fn looks_as_before(driver: &mut Driver, name: &str) {
    let mut results = SnapshotResults::new();
    compare(driver, name, &mut results);
    results.unwrap();
}

/// Opens the window as for the first time.
fn open_first() -> Driver {
    let mut driver = Driver::open_first(vec2(1024.0, 700.0));
    driver.wait("the baselines", |driver| !driver.table().is_empty());
    driver.settle();
    driver
}

fn open() -> Driver {
    let mut driver = Driver::open_sized(vec2(1024.0, 700.0));
    driver.wait("the baselines", |driver| !driver.table().is_empty());
    driver.settle();
    driver
}

fn open_view(view: &str) -> Driver {
    let mut driver = open();
    driver.click_button(view);
    driver.settle();
    driver
}

#[test]
fn train_view_before_and_after_a_training() {
    let mut results = SnapshotResults::new();
    compare(&mut open_first(), "train-opened", &mut results);
    let mut driver = open();
    driver.configure_small();
    driver.train();
    driver.click_button("Error");
    driver.settle();
    compare(&mut driver, "train-trained", &mut results);
    results.unwrap();
}

#[test]
fn study_view() {
    looks_as_before(&mut open_view("Study"), "study");
}

#[test]
fn compare_view_with_two_runs() {
    let mut driver = open();
    driver.configure_small();
    driver.train();
    driver.enter("Hidden nodes", "4");
    driver.train();
    driver.click_button("Compare");
    driver.wait("both runs", |driver| driver.has("10×6_3×18 h4 lm as B"));
    driver.wait("both surfaces", |driver| {
        driver.has("Surface of A") && driver.has("Surface of B")
    });
    driver.settle();
    looks_as_before(&mut driver, "compare");
}

#[test]
fn sensor_view() {
    let mut driver = open_view("Sensor");
    driver.wait("the answer", |driver| driver.says("Condition number: "));
    driver.settle();
    looks_as_before(&mut driver, "sensor");
}
