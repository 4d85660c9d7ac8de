//! The suite over views: every view and topic with both sources at common sizes and zooms. Each control has a name, each
//! picture a description, no text is cut off at its side, nothing lies outside of the window or on something else. `PICTURES=FOLDER cargo test --test window every_view` also writes a
//! picture of each view at each size in both themes.

use std::{
    collections::BTreeSet,
    env, fs,
    path::{Path, PathBuf},
};

use decoupler::window::SourceKind;
use eframe::egui::{
    Rect, Shape, Vec2,
    accesskit::Role,
    epaint::{ClippedShape, TextShape},
    vec2,
};
use egui_kittest::kittest::{By, NodeT as _, Queryable as _};

use crate::{
    driver::Driver,
    live::number,
    sources::{BOTH, Opened, open_small},
    trading,
};

/// The views, as named in the top bar.
pub(crate) const VIEWS: [&str; 5] = ["Train", "Study", "Compare", "Sensor", "Live"];

/// Topics of the Study view that it does not show first.
const TOPICS: [&str; 6] = [
    "Table 2",
    "Table 3",
    "Sweep",
    "What the readings determine",
    "Cross-validation",
    MEASURED,
];

/// The topic that is studied.
const MEASURED: &str = "Speed against accuracy";

/// The Train view with the columns of the recording.
const COLUMNS: &str = "Train, columns";

/// The Live view once it has decoded.
const DECODED: &str = "Live, decoded";

/// Sizes of the window in pixels.
const SIZES: [Vec2; 4] = [
    vec2(1440.0, 900.0),
    vec2(1366.0, 768.0),
    vec2(1024.0, 700.0),
    vec2(960.0, 640.0),
];

/// Zooms of the window in percent: of everything at once, so that there are fewer points.
const ZOOMS_PERCENT: [f32; 3] = [100.0, 120.0, 140.0];

/// Roles of controls.
pub(crate) const CONTROLS: [Role; 10] = [
    Role::Button,
    Role::CheckBox,
    Role::RadioButton,
    Role::ComboBox,
    Role::Slider,
    Role::SpinButton,
    Role::Tab,
    Role::TextInput,
    Role::MultilineTextInput,
    Role::SearchInput,
];

/// Shows a view and waits for what it computes without being asked.
pub(crate) fn show(driver: &mut Driver, view: &str) {
    driver.click_button(view);
    if view == "Sensor" && driver.has("Array scale") {
        driver.wait("the analysis", |driver| driver.says("Condition number: "));
    }
    if view == "Compare" {
        driver.wait("the run", |driver| {
            driver.says("mse (scaled) against epoch") && !driver.says("being prepared")
        });
    }
    driver.settle();
}

/// Shows a view or a topic in a state of its own; returns false if the source has none.
fn show_place(opened: &mut Opened, source: SourceKind, place: &str) -> bool {
    let driver = &mut opened.driver;
    let is_topic = TOPICS.contains(&place);
    let view = if is_topic { "Study" } else { place };
    show(driver, view.split(',').next().unwrap());
    let button = match place {
        COLUMNS => "Columns…",
        topic if is_topic => topic,
        _ => "",
    };
    if !button.is_empty() {
        if !driver.has(button) {
            return false;
        }
        driver.click(button);
    }
    match (place, source) {
        (DECODED, _) => decode(driver, source, opened.folder.path()),
        (MEASURED, SourceKind::Array) => {
            trading::tiny(driver);
            trading::measure(driver);
        }
        _ => {}
    }
    driver.settle();
    true
}

#[test]
fn every_view_is_named_described_and_whole() {
    let mut faults = BTreeSet::new();
    for source in BOTH {
        let mut opened = open_small(source);
        opened.change(|settings| settings.starts = 2);
        opened.driver.train();
        opened.driver.wait_for_last_epoch();
        opened.driver.details();
        for view in VIEWS.into_iter().chain(TOPICS).chain([COLUMNS, DECODED]) {
            if !show_place(&mut opened, source, view) {
                continue;
            }
            let driver = &mut opened.driver;
            let place = format!("{view}, {}", name_of(source));
            for tab in tabs(driver) {
                driver.show_chart(&tab);
                driver.settle();
                faults.extend(
                    unnamed(driver)
                        .into_iter()
                        .map(|fault| format!("{place}, {tab}: {fault}")),
                );
            }
            faults.extend(unnamed(driver).into_iter().map(|fault| format!("{place}: {fault}")));
            for size in SIZES {
                for zoom_percent in ZOOMS_PERCENT {
                    driver.harness().set_size(size * 100.0 / zoom_percent);
                    driver.settle();
                    if zoom_percent == 100.0 {
                        let at = |fault| format!("{place}, {size}: {fault}");
                        faults.extend(misplaced(driver).into_iter().map(at));
                    }
                    let at = format!("{place}, {size}, {zoom_percent} %");
                    let cuts = cut_texts(driver).into_iter();
                    faults.extend(cuts.map(|text| format!("{at}: “{text}” is cut")));
                    if zoom_percent != 120.0 {
                        let name = format!("{view}-{}-{}x{}-{zoom_percent}", name_of(source), size.x, size.y);
                        take_pictures(driver, &name);
                    }
                }
            }
            driver.harness().set_size(SIZES[0]);
            driver.settle();
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

/// Decodes some frames of the source.
fn decode(driver: &mut Driver, source: SourceKind, folder: &Path) {
    if source == SourceKind::Recording {
        driver.type_into("File to replay", &folder.join("probe.csv").display().to_string());
        driver.settle();
    }
    driver.click("▶ Start");
    driver.wait("frames", |driver| number(driver, "Decoded: ") > 30.0);
    driver.click("■ Stop");
    driver.settle();
}

fn name_of(source: SourceKind) -> &'static str {
    match source {
        SourceKind::Array => "array",
        SourceKind::Recording => "recording",
    }
}

/// Returns the names of the tabs of the view.
fn tabs(driver: &mut Driver) -> Vec<String> {
    let tabs = driver.harness().query_all(By::new().role(Role::Tab));
    let mut tabs = Vec::from_iter(tabs.filter_map(|tab| tab.accesskit_node().label()));
    if driver.has("More charts") {
        tabs.extend(["Training state", "Histogram"].map(str::to_owned));
    }
    tabs
}

/// Returns the controls without a name or a value, and the pictures without a description.
fn unnamed(driver: &mut Driver) -> Vec<String> {
    let mut faults = Vec::new();
    for node in driver.harness().root().children_recursive() {
        let node = node.accesskit_node();
        let (role, name) = (node.role(), node.label().unwrap_or_default());
        if CONTROLS.contains(&role) && name.trim().is_empty() {
            faults.push(format!("a {role:?} at {:?} has no name", node.bounding_box()));
        }
        if matches!(role, Role::Slider | Role::SpinButton) && node.numeric_value().is_none() && node.value().is_none() {
            faults.push(format!("{name} has no value"));
        }
        if role == Role::Image {
            let sentence = node.description().or(node.value()).unwrap_or_default();
            if sentence.split_whitespace().count() <= 2 && name.split_whitespace().count() <= 6 {
                faults.push(format!("“{name}” is described only by “{sentence}”"));
            }
        }
    }
    faults
}

/// Places of the cells of tables, which scroll to the side.
fn cells(driver: &mut Driver) -> Vec<Rect> {
    let nodes = driver.harness().root().children_recursive();
    let of_tables = nodes.filter(|node| {
        let node = node.accesskit_node();
        let is_sorting = || node.label().is_some_and(|label| label.starts_with("Sort by "));
        let is_cell = matches!(node.role(), Role::Cell | Role::ColumnHeader) || is_sorting();
        is_cell && node.bounding_box().is_some()
    });
    Vec::from_iter(of_tables.map(|node| node.rect().expand(2.0)))
}

/// Returns the controls and pictures that reach past the side of the window, controls on one line that overlap, and
/// surfaces that are too small.
fn misplaced(driver: &mut Driver) -> Vec<String> {
    let width = driver.harness().ctx.content_rect().width();
    let cells = cells(driver);
    let nodes = driver.harness().root().children_recursive();
    let placed = nodes.filter_map(|node| {
        let inner = node.accesskit_node();
        inner.bounding_box()?;
        Some((inner.role(), inner.label().unwrap_or_default(), node.rect()))
    });
    let is_in_table = |place: &Rect| cells.iter().any(|cell| cell.contains(place.center()));
    let outside = placed.filter(|(_, _, place)| !is_in_table(place));
    let (mut faults, mut controls) = (Vec::new(), Vec::new());
    for (role, name, place) in outside {
        let is_control = CONTROLS.contains(&role);
        if (is_control || role == Role::Image) && (place.left() < -0.5 || place.right() > width + 0.5) {
            faults.push(format!("{name} is outside at {place}"));
        }
        let is_surface = name.ends_with(" surface") && !name.starts_with("Readings");
        if is_surface && (place.width() < 120.0 || place.height() < 90.0) {
            faults.push(format!("{name} is only {}", place.size()));
        }
        if is_control {
            controls.push((name, place));
        }
    }
    for (number, (name, place)) in controls.iter().enumerate() {
        for (other, at) in &controls[number + 1..] {
            let is_nested = place.contains_rect(*at) || at.contains_rect(*place);
            let is_on_its_line = (place.center().y - at.center().y).abs() < 1.0;
            if is_on_its_line && !is_nested && place.shrink(1.0).intersects(at.shrink(1.0)) {
                faults.push(format!("{name} at {place} and {other} at {at} overlap"));
            }
        }
    }
    faults
}

/// Returns the visible texts that reach past the side of what they are drawn in, or past the window.
fn cut_texts(driver: &mut Driver) -> BTreeSet<String> {
    let screen = driver.harness().ctx.content_rect();
    let cells = cells(driver);
    let mut cuts = BTreeSet::new();
    for ClippedShape { clip_rect, shape, .. } in &driver.harness().output().shapes {
        each_text(shape, &mut |text| {
            let place = text.galley.rect.translate(text.pos.to_vec2());
            let parent = clip_rect.intersect(screen);
            let is_visible = parent.intersects(place) && !text.galley.text().trim().is_empty();
            // Rounding to pixels is no cut; what a scroll bar hides above and below comes into sight.
            let is_cut = place.left() < parent.left() - 1.5 || place.right() > parent.right() + 1.5;
            let is_in_table = cells.iter().any(|cell| cell.contains(place.center()));
            if is_visible && is_cut && !is_in_table && text.angle == 0.0 {
                cuts.insert(text.galley.text().to_owned());
            }
        });
    }
    cuts
}

fn each_text(shape: &Shape, take: &mut impl FnMut(&TextShape)) {
    match shape {
        Shape::Text(text) => take(text),
        Shape::Vec(shapes) => shapes.iter().for_each(|shape| each_text(shape, take)),
        _ => {}
    }
}

/// Writes the window as it is, in both themes, where the environment names a folder for pictures.
fn take_pictures(driver: &mut Driver, name: &str) {
    let Some(folder) = env::var_os("PICTURES").map(PathBuf::from) else {
        return;
    };
    fs::create_dir_all(&folder).unwrap();
    for theme in ["Light theme", "Dark theme"] {
        driver.act(theme);
        let picture = driver.harness().render().unwrap();
        let theme = theme.split(' ').next().unwrap().to_lowercase();
        picture.save(folder.join(format!("{name}-{theme}.png"))).unwrap();
    }
}
