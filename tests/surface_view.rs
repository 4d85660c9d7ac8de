//! The surface plot: reachable by label and keyboard, unharmed by missing values, and worth looking at.
#![cfg(feature = "gui")]
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use decoupler::app::surface_view::{ColourBar, Colours, OrbitCamera, SurfaceView, ViewMode};
use decoupler::app::theme::{self, Theme};
use decoupler::surface::SurfaceMap;
use eframe::egui::{self, Key, Modifiers, Vec2, vec2};
use egui_kittest::{
    Harness,
    kittest::{NodeT as _, Queryable as _},
};
use glam::DVec3;
use support::rasterise::Rasteriser;

/// A pressed skin of `rows × per_row` nodes, in the places of the usual arrays.
struct Skin {
    map: SurfaceMap,
    nodes: Vec<DVec3>,
    surface: Vec<f64>,
}

impl Skin {
    fn new(rows: usize, per_row: usize, value: impl Fn(f64, f64, usize) -> f64) -> Self {
        let x: Vec<f64> = (0..rows).map(|row| 8.0 + row as f64).collect();
        let middle = (3.0 * per_row as f64 + 1.0) / 2.0;
        let y: Vec<f64> = (0..per_row)
            .map(|i| middle + 2.0 * (i as f64 - (per_row as f64 - 1.0) / 2.0))
            .collect();
        let part = |at: usize, count: usize| at as f64 / (count - 1).max(1) as f64;
        let nodes: Vec<DVec3> = (0..rows * per_row)
            .map(|n| (n / per_row, n % per_row, n))
            .map(|(row, i, n)| DVec3::new(x[row], y[i], value(part(row, rows), part(i, per_row), n)))
            .collect();
        let map = SurfaceMap::new(&x, &y).unwrap();
        let surface = map.evaluate(&nodes.iter().map(|node| node.z).collect::<Vec<_>>());
        Self { map, nodes, surface }
    }

    fn pressed(rows: usize, per_row: usize) -> Self {
        let dent = |x: f64, y: f64, cx: f64, cy: f64| (-((x - cx).powi(2) + (y - cy).powi(2)) / 0.03).exp();
        Self::new(rows, per_row, |x, y, _| {
            let load = dent(x, y, 0.3, 0.25) + 0.75 * dent(x, y, 0.72, 0.6) + 0.3 * (6.0 * x + 4.0 * y).sin().powi(2);
            5.0 - load.min(1.0)
        })
    }

    /// A dent of a tenth of the stroke on a sensor that is level otherwise.
    fn lightly_pressed(rows: usize, per_row: usize) -> Self {
        Self::new(rows, per_row, |x, y, _| {
            5.0 - 0.1 * (-((x - 0.3).powi(2) + (y - 0.4).powi(2)) / 0.03).exp()
        })
    }

    fn noise(rows: usize, per_row: usize, low: f64, high: f64) -> Self {
        Self::new(rows, per_row, |_, _, n| {
            low + (high - low) * ((n as f64 * 12.9898).sin() * 43758.5453).rem_euclid(1.0)
        })
    }

    fn view<'a>(&'a self, theme: &'a Theme, colours: Colours, mode: ViewMode) -> SurfaceView<'a> {
        let range_mm = match colours {
            Colours::Height => 4.0..=5.0,
            _ => -0.25..=0.25,
        };
        SurfaceView {
            label: "Actual surface",
            grid: self.map.grid(),
            values_mm: &self.surface,
            nodes_mm: &self.nodes,
            range_mm,
            colours,
            mode,
            highlight: None,
            theme,
        }
    }
}

fn theme_of(is_dark: bool) -> &'static Theme {
    if is_dark { Theme::dark() } else { Theme::light() }
}

fn harness<'a>(size: Vec2, is_dark: bool, app: impl FnMut(&mut egui::Ui) + 'a) -> Harness<'a> {
    Harness::builder()
        .with_size(size)
        .with_context_setup(move |ctx| theme::install(ctx, is_dark))
        .renderer(Rasteriser::default())
        .build_ui(app)
}

#[test]
fn the_surface_is_found_by_its_label_and_turned_by_keys() {
    let skin = Skin::pressed(10, 10);
    let camera = std::cell::Cell::new(OrbitCamera::default());
    let mut harness = harness(vec2(350.0, 540.0), true, |ui| {
        let view = skin.view(Theme::dark(), Colours::Height, ViewMode::ThreeD);
        camera.set(view.show(ui, camera.get()).camera);
    });
    harness.get_by_label("Actual surface").focus();
    harness.run();
    let summary = harness.get_by_label("Actual surface").accesskit_node().value().unwrap();
    assert!(summary.starts_with("z 4.") && summary.ends_with(" mm"), "{summary}");

    harness.key_press(Key::ArrowLeft);
    harness.key_press_modifiers(Modifiers::SHIFT, Key::Plus);
    harness.run();
    let turned = camera.get();
    assert!(
        turned.yaw > OrbitCamera::default().yaw && turned.zoom > 1.0,
        "{turned:?}"
    );
    harness.key_press(Key::Home);
    harness.run();
    assert_eq!(camera.get(), OrbitCamera::default());
}

#[test]
fn dragging_turns_and_hovering_finds_a_node() {
    let skin = Skin::pressed(10, 10);
    let camera = std::cell::Cell::new(OrbitCamera::default());
    let hovered = std::cell::Cell::new(None);
    let mut harness = harness(vec2(480.0, 420.0), true, |ui| {
        let view = skin.view(Theme::dark(), Colours::Height, ViewMode::ThreeD);
        let shown = view.show(ui, camera.get());
        shown.node_tooltip_ui(|ui, node| {
            ui.label(format!("node {node}"));
        });
        camera.set(shown.camera);
        hovered.set(shown.hovered_node.or(hovered.get()));
    });
    for step in 0..12 {
        harness.hover_at(egui::pos2(180.0 + 10.0 * step as f32, 210.0));
        harness.run();
    }
    assert!(hovered.get().is_some());

    harness.drag_at(egui::pos2(240.0, 200.0));
    harness.run();
    harness.hover_at(egui::pos2(300.0, 220.0));
    harness.run();
    harness.drop_at(egui::pos2(300.0, 220.0));
    harness.run();
    assert!(camera.get().yaw < OrbitCamera::default().yaw && camera.get().pitch > OrbitCamera::default().pitch);
}

#[test]
fn odd_inputs_are_drawn() {
    let mut gap = Skin::pressed(10, 10);
    gap.surface[5000] = f64::NAN;
    gap.nodes[45].z = f64::NAN;
    let mut empty = Skin::pressed(10, 6);
    empty.surface.clear();
    let skins = [
        gap,
        empty,
        Skin::pressed(1, 1),
        Skin::pressed(1, 10),
        Skin::new(2, 2, |_, _, _| f64::NAN),
    ];
    for skin in &skins {
        for mode in [ViewMode::ThreeD, ViewMode::Top] {
            for range_mm in [4.0..=5.0, 5.0..=5.0, f64::NAN..=f64::NAN, 5.0..=4.0] {
                for size in [vec2(350.0, 540.0), vec2(70.0, 70.0), vec2(10.0, 10.0)] {
                    let mut harness = harness(size, false, |ui| {
                        let view = skin.view(Theme::light(), Colours::Height, mode);
                        SurfaceView {
                            range_mm: range_mm.clone(),
                            ..view
                        }
                        .show(ui, OrbitCamera::default());
                    });
                    harness.run();
                }
            }
        }
    }
}

#[test]
fn nothing_is_repainted_while_nothing_changes() {
    let skin = Skin::pressed(10, 10);
    let mut harness = harness(vec2(350.0, 540.0), true, |ui| {
        skin.view(Theme::dark(), Colours::Height, ViewMode::ThreeD)
            .show(ui, OrbitCamera::default());
    });
    assert!(harness.run() <= 2);
}

/// Pictures to look at: `cargo test --test surface_view gallery -- --ignored`, then open `target/gallery`.
#[test]
#[ignore = "writes pictures"]
fn gallery() {
    std::fs::create_dir_all("target/gallery").unwrap();
    let skins = [
        ("10x10", Skin::pressed(10, 10), 4.0..=5.0),
        ("10x10noise", Skin::noise(10, 10, 4.0, 5.0), 4.0..=5.0),
        ("10x10light", Skin::lightly_pressed(10, 10), 4.0..=5.0),
        ("10x6", Skin::pressed(10, 6), 4.0..=5.0),
        ("1x10", Skin::pressed(1, 10), 4.0..=5.0),
        ("2x2level", Skin::new(2, 2, |_, _, _| 4.7), 4.0..=5.0),
        ("2x3", Skin::pressed(2, 3), 4.0..=5.0),
        ("1x1", Skin::pressed(1, 1), 4.0..=5.0),
        ("40x40", Skin::pressed(40, 40), 4.0..=5.0),
        ("error", Skin::noise(10, 10, -0.2, 0.25), -0.25..=0.25),
    ];
    for is_dark in [true, false] {
        let theme = theme_of(is_dark);
        for (name, skin, range) in &skins {
            let colours = if *name == "error" {
                Colours::Error
            } else {
                Colours::Height
            };
            for (mode, mode_name) in [(ViewMode::ThreeD, "3d"), (ViewMode::Top, "top")] {
                for size in [vec2(350.0, 540.0), vec2(480.0, 420.0)] {
                    let mut harness = harness(size + vec2(ColourBar::WIDTH, 0.0), is_dark, |ui| {
                        egui::Frame::new().fill(theme.palette.panel).show(ui, |ui| {
                            ui.spacing_mut().item_spacing = Vec2::ZERO;
                            ui.horizontal_top(|ui| {
                                ui.allocate_ui(size - vec2(20.0, 20.0), |ui| {
                                    skin.view(theme, colours, mode).show(ui, OrbitCamera::default());
                                });
                                let title = colours.title();
                                ColourBar {
                                    title,
                                    range: range.clone(),
                                    colours,
                                    theme,
                                }
                                .show(ui, 0.6 * size.y);
                            });
                        });
                    });
                    harness.run();
                    let theme_name = if is_dark { "dark" } else { "light" };
                    let path = format!("target/gallery/{name}_{mode_name}_{theme_name}_{}.png", size.x);
                    harness.render().unwrap().save(path).unwrap();
                }
            }
        }
    }
}
