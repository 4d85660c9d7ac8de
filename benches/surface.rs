//! What a frame with two surfaces costs: the interpolation, the window's pass, and the tessellation.

use std::sync::Arc;

use decoupler::window::surface_view::SurfaceView;
use decoupler::window::theme;
use decoupler_core::surface::SurfaceMap;
use decoupler_files::figure::SequentialMap;
use decoupler_files::figure::surface::{OrbitCamera, Quantity, Surface, SurfaceFigure, ViewMode};
use divan::{Bencher, black_box};
use eframe::egui::{Context, RawInput, Rect, Vec2, pos2, vec2};
use glam::DVec3;

fn main() {
    divan::main();
}

fn map(side: usize) -> (SurfaceMap, Vec<DVec3>) {
    let x: Vec<f64> = (0..side).map(|row| 8.0 + row as f64).collect();
    let y: Vec<f64> = (0..side).map(|node| 6.5 + 2.0 * node as f64).collect();
    let height = |n: usize| 4.5 + 0.5 * (1.7 * n as f64).sin();
    let nodes = (0..side * side)
        .map(|n| DVec3::new(x[n / side], y[n % side], height(n)))
        .collect();
    (SurfaceMap::new(&x, &y).expect("a lattice"), nodes)
}

#[divan::bench(args = [10, 20, 30, 40])]
fn factorise(side: usize) -> SurfaceMap {
    map(side).0
}

#[divan::bench(args = [10, 20, 30, 40])]
fn interpolate(bencher: Bencher<'_, '_>, side: usize) {
    let (map, nodes) = map(side);
    let values: Vec<f64> = nodes.iter().map(|node| node.z).collect();
    bencher.bench_local(|| map.evaluate(black_box(&values)));
}

/// Nothing changes from frame to frame.
#[divan::bench(args = [ViewMode::ThreeD, ViewMode::Top])]
fn two_views(bencher: Bencher<'_, '_>, mode: ViewMode) {
    frames(bencher, mode, |camera| camera);
}

/// Every frame is drawn again.
#[divan::bench(args = [ViewMode::ThreeD, ViewMode::Top])]
fn two_views_turned(bencher: Bencher<'_, '_>, mode: ViewMode) {
    frames(bencher, mode, |camera| camera.dragged(1.0, 0.0));
}

fn frames(bencher: Bencher<'_, '_>, mode: ViewMode, turn: impl Fn(OrbitCamera) -> OrbitCamera) {
    let (map, nodes) = map(10);
    let values = map.evaluate(&nodes.iter().map(|node| node.z).collect::<Vec<_>>());
    let surface = Surface {
        title: "Actual".to_owned(),
        values: values.into(),
        nodes: nodes.into(),
        map: Arc::new(map),
        quantity: Quantity::Height,
        range: 4.0..=5.0,
        mode,
        colours: SequentialMap::default(),
    };
    let ctx = Context::default();
    theme::install(&ctx, true);
    let size = vec2(700.0, 540.0);
    let input = RawInput {
        screen_rect: Some(Rect::from_min_size(pos2(0.0, 0.0), size)),
        ..RawInput::default()
    };
    let mut figure = SurfaceFigure::default();
    bencher.bench_local(|| {
        figure.camera = turn(figure.camera);
        let mut output = ctx.run_ui(input.clone(), |ui| {
            ui.spacing_mut().item_spacing = Vec2::ZERO;
            ui.horizontal_top(|ui| {
                for label in ["Actual", "Decoupled"] {
                    ui.allocate_ui(vec2(340.0, 500.0), |ui| {
                        let view = SurfaceView {
                            label,
                            surface: &surface,
                            figure: &figure,
                            is_touched: false,
                        };
                        view.show(ui);
                    });
                }
            });
        });
        let shapes = std::mem::take(&mut output.shapes);
        let primitives = ctx.tessellate(shapes, output.pixels_per_point);
        output.drop_without_applying_deltas();
        primitives.len()
    });
}
