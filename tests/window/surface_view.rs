//! The surface plot: reachable by label and keyboard, robust to missing values, and pleasant to look at.

use std::sync::Arc;

use decoupler::window::surface_view::{SurfaceView, colour_bar_ui};
use decoupler::window::theme::{self, Theme};
use decoupler_core::surface::SurfaceMap;
use decoupler_files::figure::surface::{OrbitCamera, Quantity, Surface, SurfaceFigure, ViewMode};
use decoupler_files::figure::{Figure, SequentialMap};
use eframe::egui::{self, Key, Modifiers, Vec2, vec2};
use egui_kittest::{
    Harness,
    kittest::{NodeT as _, Queryable as _},
};
use glam::DVec3;

use crate::rasterise::Rasteriser;

/// A pressed skin of `rows × per_row` nodes, in the places of the usual arrays.
struct Skin {
    map: Arc<SurfaceMap>,
    nodes: Arc<[DVec3]>,
    values: Arc<[f64]>,
}

impl Skin {
    fn new(rows: usize, per_row: usize, value: impl Fn(f64, f64, usize) -> f64) -> Self {
        let x: Vec<f64> = (0..rows).map(|row| 8.0 + row as f64).collect();
        let middle = (3.0 * per_row as f64 + 1.0) / 2.0;
        let y: Vec<f64> = (0..per_row)
            .map(|i| middle + 2.0 * (i as f64 - (per_row as f64 - 1.0) / 2.0))
            .collect();
        let part = |at: usize, count: usize| at as f64 / (count - 1).max(1) as f64;
        let nodes: Arc<[DVec3]> = (0..rows * per_row)
            .map(|n| (n / per_row, n % per_row, n))
            .map(|(row, i, n)| DVec3::new(x[row], y[i], value(part(row, rows), part(i, per_row), n)))
            .collect();
        let map = Arc::new(SurfaceMap::new(&x, &y).unwrap());
        let values = map.evaluate(&nodes.iter().map(|node| node.z).collect::<Vec<_>>());
        let values = values.into();
        Self { map, nodes, values }
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

    /// Nodes that move sideways as well, some beyond the edge of the axes.
    fn sideways(rows: usize, per_row: usize) -> Self {
        let mut skin = Self::pressed(rows, per_row);
        for (index, node) in Arc::make_mut(&mut skin.nodes).iter_mut().enumerate() {
            *node += DVec3::new((1.3 * index as f64).sin(), (2.1 * index as f64).cos(), 0.0) * 0.8;
        }
        skin
    }

    fn surface(&self, title: &str, quantity: Quantity, mode: ViewMode) -> Surface {
        let range = match quantity {
            Quantity::Height => 4.0..=5.0,
            _ => -0.25..=0.25,
        };
        Surface {
            title: title.to_owned(),
            map: Arc::clone(&self.map),
            values: Arc::clone(&self.values),
            nodes: Arc::clone(&self.nodes),
            quantity,
            range,
            mode,
            colours: SequentialMap::default(),
        }
    }
}

/// A figure without surfaces of its own, seen by `camera`.
fn seen_by(camera: OrbitCamera) -> SurfaceFigure {
    SurfaceFigure {
        camera,
        ..SurfaceFigure::default()
    }
}

fn view<'a>(surface: &'a Surface, figure: &'a SurfaceFigure) -> SurfaceView<'a> {
    SurfaceView {
        label: "Actual surface",
        surface,
        figure,
        is_touched: false,
    }
}

fn theme_of(is_dark: bool) -> &'static Theme {
    Theme::get(is_dark)
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
    let surface = Skin::pressed(10, 10).surface("Actual", Quantity::Height, ViewMode::ThreeD);
    let camera = std::cell::Cell::new(OrbitCamera::default());
    let mut harness = harness(vec2(350.0, 540.0), true, |ui| {
        camera.set(view(&surface, &seen_by(camera.get())).show(ui).camera);
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
    let surface = Skin::pressed(10, 10).surface("Actual", Quantity::Height, ViewMode::ThreeD);
    let camera = std::cell::Cell::new(OrbitCamera::default());
    let hovered = std::cell::Cell::new(None);
    let mut harness = harness(vec2(480.0, 420.0), true, |ui| {
        let shown = view(&surface, &seen_by(camera.get())).show(ui);
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
    Arc::make_mut(&mut gap.values)[5000] = f64::NAN;
    Arc::make_mut(&mut gap.nodes)[45].z = f64::NAN;
    let mut empty = Skin::pressed(10, 6);
    empty.values = Arc::new([]);
    let skins = [
        gap,
        empty,
        Skin::pressed(1, 1),
        Skin::pressed(1, 10),
        Skin::new(2, 2, |_, _, _| f64::NAN),
    ];
    for skin in &skins {
        for mode in [ViewMode::ThreeD, ViewMode::Top] {
            for range in [4.0..=5.0, 5.0..=5.0, f64::NAN..=f64::NAN, 5.0..=4.0] {
                let surface = Surface {
                    range,
                    ..skin.surface("Actual", Quantity::Height, mode)
                };
                for size in [vec2(350.0, 540.0), vec2(70.0, 70.0), vec2(10.0, 10.0)] {
                    let mut harness = harness(size, false, |ui| {
                        view(&surface, &SurfaceFigure::default()).show(ui);
                    });
                    harness.run();
                }
            }
        }
    }
}

#[test]
fn nothing_is_repainted_while_nothing_changes() {
    let surface = Skin::pressed(10, 10).surface("Actual", Quantity::Height, ViewMode::ThreeD);
    let mut harness = harness(vec2(350.0, 540.0), true, |ui| {
        view(&surface, &SurfaceFigure::default()).show(ui);
    });
    assert!(harness.run() <= 2);
}

/// Pictures to look at, on screen and in print: `cargo test --test window gallery -- --ignored`, then open
/// `target/gallery`.
#[test]
#[ignore = "writes pictures"]
fn gallery() {
    std::fs::create_dir_all("target/gallery").unwrap();
    let turned = OrbitCamera::default().dragged(-120.0, 25.0);
    let near = turned.zoomed(1.8).panned(0.1, 0.0);
    for (name, figure) in [
        (
            "actual-decoupled",
            shown(&Skin::pressed(10, 10), None, OrbitCamera::default()),
        ),
        ("actual-error-turned", shown(&Skin::pressed(10, 6), Some(23), turned)),
        ("zoomed", shown(&Skin::pressed(10, 10), Some(45), near)),
        (
            "light-load",
            shown(&Skin::lightly_pressed(10, 10), None, OrbitCamera::default()),
        ),
        ("sideways", shown(&Skin::sideways(10, 10), None, OrbitCamera::default())),
        ("row", shown(&Skin::pressed(1, 10), None, OrbitCamera::default())),
        (
            "2x2",
            shown(&Skin::new(2, 2, |_, _, _| 4.7), None, OrbitCamera::default()),
        ),
        ("1x1", shown(&Skin::pressed(1, 1), None, OrbitCamera::default())),
        ("40x40", shown(&Skin::pressed(40, 40), None, OrbitCamera::default())),
    ] {
        for (mode, mode_name) in [(ViewMode::ThreeD, "3d"), (ViewMode::Top, "top")] {
            let mut figure = figure.clone();
            figure.surfaces.iter_mut().for_each(|surface| surface.mode = mode);
            let path = |renderer: &str| format!("target/gallery/{name}-{mode_name}-{renderer}.png");
            Figure::from(figure.clone())
                .draw()
                .save(path("print").as_ref())
                .unwrap();
            for is_dark in [true, false] {
                let theme = theme_of(is_dark);
                let mut harness = harness(vec2(860.0, 360.0), is_dark, |ui| {
                    let filled = egui::Frame::new().fill(theme.palette.panel);
                    filled.show(ui, |ui| show_figure(ui, &figure));
                });
                harness.run();
                let renderer = if is_dark { "dark" } else { "light" };
                harness.render().unwrap().save(path(renderer)).unwrap();
            }
        }
    }
}

/// A skin and a possible result of a network; its error if a node is marked.
fn shown(skin: &Skin, marked_node: Option<usize>, camera: OrbitCamera) -> SurfaceFigure {
    let actual = skin.surface("Actual", Quantity::Height, ViewMode::ThreeD);
    let numbered = skin.nodes.iter().enumerate();
    let errors = numbered.map(|(index, node)| node.with_z(0.2 * (0.7 * index as f64).sin() * (6.0 - node.z)));
    let errors: Arc<[DVec3]> = errors.collect();
    let values = |nodes: &[DVec3]| {
        skin.map
            .evaluate(&nodes.iter().map(|node| node.z).collect::<Vec<_>>())
            .into()
    };
    let right = if marked_node.is_some() {
        Surface {
            title: "Error".to_owned(),
            values: values(&errors),
            nodes: errors,
            quantity: Quantity::Error,
            range: -0.4..=0.4,
            ..actual.clone()
        }
    } else {
        let pairs = skin.nodes.iter().zip(&*errors);
        let nodes: Arc<[DVec3]> = pairs.map(|(node, error)| node.with_z(node.z + error.z)).collect();
        Surface {
            title: "Decoupled".to_owned(),
            values: values(&nodes),
            nodes,
            ..actual.clone()
        }
    };
    SurfaceFigure {
        surfaces: vec![actual, right],
        camera,
        marked_node,
        ..SurfaceFigure::default()
    }
}

fn show_figure(ui: &mut egui::Ui, figure: &SurfaceFigure) {
    ui.spacing_mut().item_spacing = Vec2::ZERO;
    ui.horizontal_top(|ui| {
        for surface in &figure.surfaces {
            ui.allocate_ui(vec2(350.0, 350.0), |ui| {
                let label = surface.title.as_str();
                SurfaceView {
                    label,
                    ..view(surface, figure)
                }
                .show(ui);
            });
        }
        for scale in &figure.scales() {
            colour_bar_ui(ui, scale, 300.0);
        }
    });
}
