//! The surface plot: reachable by label and keyboard, robust to missing values, and pleasant to look at.

use std::sync::Arc;

use decoupler::window::surface_view::SurfaceView;
use decoupler::window::theme;
use decoupler_core::surface::SurfaceMap;
use decoupler_files::figure::SequentialMap;
use decoupler_files::figure::surface::{OrbitCamera, Quantity, Surface, SurfaceFigure, ViewMode};
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
