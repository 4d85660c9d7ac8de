//! Pictures to look at: `cargo test --test window pictures -- --ignored`, then open `target/pictures`.

use std::fs;

use decoupler_files::import::Setup;
use eframe::egui::{Vec2, vec2};

use crate::{
    configuring::choose_method,
    driver::Driver,
    sources::{probe, skin_with_positions},
};

struct Album {
    driver: Driver,
    prefix: String,
}

impl Album {
    fn take(&mut self, name: &str) {
        self.driver.settle();
        self.snap(name);
    }

    fn snap(&mut self, name: &str) {
        let picture = self.driver.harness().render().unwrap();
        let path = format!("target/pictures/{}-{name}.png", self.prefix);
        picture.save(path).unwrap();
    }
}

#[test]
#[ignore = "writes pictures"]
fn pictures_of_the_window() {
    fs::create_dir_all("target/pictures").unwrap();
    for size in [vec2(1440.0, 900.0), vec2(1024.0, 700.0)] {
        for is_dark in [true, false] {
            album(size, is_dark);
        }
    }
}

#[test]
#[ignore = "writes pictures"]
fn pictures_of_recordings() {
    fs::create_dir_all("target/pictures").unwrap();
    let grid = "target,x,y\nd6,4,10\nd1,0,0\nd2,0,5\nd4,4,0\nd3,0,10\nd5,4,5\n";
    let folder = tempfile::tempdir().unwrap();
    let setups = [
        ("skin", skin_with_positions(folder.path(), grid)),
        ("probe", probe(folder.path())),
    ];
    for size in [vec2(1440.0, 900.0), vec2(1024.0, 700.0)] {
        for is_dark in [true, false] {
            for (name, setup) in &setups {
                album_of_recording(size, is_dark, name, setup);
            }
        }
    }
}

fn album_of_recording(size: Vec2, is_dark: bool, name: &str, setup: &Setup) {
    let theme = if is_dark { "dark" } else { "light" };
    let mut driver = Driver::open_sized(size);
    if !is_dark {
        driver.act("Light theme");
    }
    driver.take_recording(setup);
    let prefix = format!("{name}-{}x{}-{theme}", size.x, size.y);
    let mut album = Album { driver, prefix };
    album.take("1-opened");
    album.driver.train();
    album.driver.wait_for_last_epoch();
    album.take("2-trained");
    for tab in [
        "Training state",
        "State",
        "Histogram",
        "Regression",
        "Sample",
        "Error map",
    ] {
        if album.driver.has(tab) {
            album.driver.click(tab);
            album.take(&format!("3-{}", tab.replace(' ', "-").to_lowercase()));
        }
    }
    album.driver.click("More decoders");
    album.driver.wait("all decoders", |driver| {
        let decoders = &driver.views().train.decoders;
        decoders.measured.is_some() && !decoders.is_measuring()
    });
    album.take("4-decoders");
    album.driver.open_menu();
    album.take("5-menu");
}

fn album(size: Vec2, is_dark: bool) {
    let theme = if is_dark { "dark" } else { "light" };
    let mut driver = Driver::open_sized(size);
    if !is_dark {
        driver.act("Light theme");
    }
    let prefix = format!("{}x{}-{theme}", size.x, size.y);
    let mut album = Album { driver, prefix };
    album.take("1-opened");
    album.driver.click("▶ Train");
    album.driver.wait_for_epochs(3);
    album.snap("2-training");
    album.driver.wait_for_epochs(20);
    album.driver.click("■ Stop");
    album.driver.wait("the end", |driver| driver.says("stopped by you"));
    album.take("3-stopped");
    album.driver.enter("Epochs", "60");
    album.driver.train();
    album.take("4-trained");
    album.driver.click_button("Error");
    album.take("5-error");
    album.driver.click_button("Top view");
    album.take("6-error-top");
    album.driver.click_button("Decoded");
    album.take("7-top");
    album.driver.click_button("3-D");
    // The first has a shorter name in a narrow window.
    for tab in ["Training state", "State", "Histogram", "Regression", "Nodes", "Loss"] {
        if album.driver.has(tab) {
            album.driver.click(tab);
            album.take(&format!("8-{}", tab.replace(' ', "-").to_lowercase()));
        }
    }
    let surface = album.driver.get("Decoded surface").rect();
    let places = (0..400).map(|step| vec2((step % 20) as f32 / 20.0, (step / 20) as f32 / 20.0));
    for place in places {
        album.driver.harness().hover_at(surface.lerp_inside(place));
        album.driver.harness().run_steps(2);
        if album.driver.views().train.lights.node.is_some() {
            break;
        }
    }
    album.take("9-hover");
    album.driver.harness().remove_cursor();
    album.driver.open_menu();
    album.take("10-menu");
    album.driver.export("Network file, JSON");
    album.take("10-save");
    album.driver.type_into("File", "/nowhere/network.json");
    album.driver.click_button("Save");
    album.driver.wait("the refusal", |driver| driver.notice().is_some());
    album.take("11-refused");
    album.driver.click("Dismiss");
    choose_method(&mut album.driver, "Momentum, Eq. (11)");
    album.driver.enter("Learning rate", "1e6");
    album.driver.train();
    album.take("12-rising");
    album.driver.enter("Validation samples", "0");
    album.driver.train();
    album.take("12-diverged");
    album.driver.enter("Array scale", "10x6");
    album.driver.harness().run_steps(2);
    album.take("13-geometry-and-bad-array");
}
