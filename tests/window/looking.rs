//! Layout: everything within the window, and no repainting while nothing happens.

use decoupler_core::training::Method;
use eframe::egui::{Vec2, accesskit::Role, vec2};
use egui_kittest::kittest::{By, Queryable as _};

use crate::{configuring::choose_method, driver::Driver};

const SIZES: [Vec2; 3] = [vec2(1440.0, 900.0), vec2(1024.0, 700.0), vec2(960.0, 640.0)];

#[test]
fn names_do_not_touch_their_values() {
    for size in SIZES {
        let mut driver = Driver::open_sized(size);
        for method in Method::all() {
            choose_method(&mut driver, method.name());
            for name in ["Method", "Epochs", "Largest compression"] {
                let label = driver.harness().get(By::new().role(Role::Label).value(name)).rect();
                let value = driver.get(name).rect();
                assert!(
                    !label.shrink(0.5).intersects(value),
                    "{name} at {size}: {label:?}, {value:?}"
                );
            }
        }
    }
}

#[test]
fn an_idle_window_draws_nothing() {
    let mut driver = Driver::open();
    driver.wait("the last events", |driver| !driver.table().is_empty());
    assert!(driver.becomes_idle(), "before a training");
    driver.configure_small();
    driver.train();
    driver.wait("the last events", |driver| {
        driver
            .state()
            .result()
            .is_some_and(|result| result.frame_time.is_some())
    });
    assert!(driver.becomes_idle(), "after a training");
    driver.click_button("Error");
    driver.click("Regression");
    assert!(driver.becomes_idle(), "with another picture");
}

#[test]
fn buttons_react_to_the_pointer() {
    let mut driver = Driver::open();
    for (button, next_theme) in [("▶ Train", "Light theme"), ("Recording", "Dark theme")] {
        // Inside the edge, next to the text.
        let place = driver.get(button).rect().left_center() + vec2(3.0, 0.0);
        let colour = |driver: &mut Driver| {
            driver.harness().run_steps(2);
            let picture = driver.harness().render().unwrap();
            picture.get_pixel(place.x as u32, place.y as u32).0
        };
        let at_rest = colour(&mut driver);
        driver.harness().hover_at(place);
        assert_ne!(at_rest, colour(&mut driver), "{button}");
        driver.harness().remove_cursor();
        assert_eq!(colour(&mut driver), at_rest, "{button}");
        driver.act(next_theme);
    }
}
