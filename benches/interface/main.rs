//! Time of the interface thread for each frame of the window, without a GPU: layout and tessellation, at rest, under a
//! moving pointer and while a network trains; and the first frame. Drawing the triangles is the renderer's work and is
//! not counted.
//!
//! `cargo bench --bench interface`, or with `-- own-data` for the recordings alone.

#![allow(clippy::print_stdout, reason = "a bench prints its table")]

mod clock;
mod own_data;

use std::{
    path::PathBuf,
    thread::sleep,
    time::{Duration, Instant},
};

use decoupler::window::{Command, DecouplerWindow, Desktop, Effect, Phase, Shared};
use decoupler_core::{
    dataset::Simulation,
    evaluation::RunSettings,
    training::{EpochRecord, Method},
};
use decoupler_files::figure::{EpochOutline, loss_figure};
use eframe::egui::{Context, Event, Modifiers, PointerButton, RawInput, Rect, accesskit::TreeUpdate, pos2, vec2};

/// Time between two frames of a screen.
const FRAME: Duration = Duration::from_millis(16);
/// Number of frames measured for each row of the table.
const FRAMES: usize = 240;

/// The window as eframe runs it, without a screen.
struct Bench {
    ctx: Context,
    window: DecouplerWindow,
    begun: Instant,
    /// Files dropped on the window in the next frame.
    dropped: Vec<PathBuf>,
    /// Output of the last frame for assistive technology, if it was requested.
    nodes: Option<TreeUpdate>,
}

impl Bench {
    fn open() -> Self {
        let ctx = Context::default();
        let window = DecouplerWindow::new(&ctx, Desktop::None, None);
        let begun = Instant::now();
        Self {
            ctx,
            window,
            begun,
            dropped: Vec::new(),
            nodes: None,
        }
    }

    fn state(&self) -> &Shared {
        self.window.shared()
    }

    /// Lays out and tessellates a frame.
    fn frame(&mut self, events: Vec<Event>) -> Duration {
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(pos2(0.0, 0.0), vec2(1440.0, 900.0))),
            time: Some(self.begun.elapsed().as_secs_f64()),
            events,
            dropped_files: self.dropped.drain(..).map(own_data::dropped).collect(),
            ..RawInput::default()
        };
        let begun = Instant::now();
        let (ctx, window) = (&self.ctx, &mut self.window);
        window.take_events();
        let mut output = ctx.run_ui(input, |ui| window.show_ui(ui));
        let shapes = std::mem::take(&mut output.shapes);
        let primitives = ctx.tessellate(shapes, output.pixels_per_point);
        let taken = begun.elapsed();
        std::hint::black_box(primitives);
        self.nodes = output.platform_output.accesskit_update.take();
        output.drop_without_applying_deltas();
        taken
    }

    fn wait(&mut self, holds: impl Fn(&Shared) -> bool) {
        let latest = Instant::now() + Duration::from_secs(60);
        while !holds(self.state()) && Instant::now() < latest {
            self.frame(Vec::new());
            sleep(FRAME);
        }
    }

    /// Measures frames at the rate of a screen.
    fn measure(&mut self, name: &str, mut events: impl FnMut(usize) -> Vec<Event>) {
        let mut frames = Vec::with_capacity(FRAMES);
        sleep(FRAME);
        let before = clock::on_processor();
        for number in 0..FRAMES {
            let begun = Instant::now();
            frames.push(self.frame(events(number)));
            sleep(FRAME.saturating_sub(begun.elapsed()));
        }
        sleep(FRAME);
        let processor = clock::on_processor().zip(before).map(|(after, before)| after - before);
        clock::print_row(name, frames, processor);
    }

    /// Shows a chart by the list of actions.
    fn show_chart(&mut self, chart: &str) {
        let events = |text: &str| -> Vec<Vec<Event>> {
            let key = |key, modifiers| Event::Key {
                key,
                physical_key: None,
                pressed: true,
                repeat: false,
                modifiers,
            };
            vec![
                vec![key(eframe::egui::Key::K, Modifiers::COMMAND)],
                Vec::new(),
                vec![Event::Text(text.to_owned())],
                vec![key(eframe::egui::Key::Enter, Modifiers::NONE)],
                Vec::new(),
                Vec::new(),
            ]
        };
        for frame in events(&format!("Chart: {chart}")) {
            self.frame(frame);
        }
    }
}

/// 8000 nodes.
const LARGE: &str = "100x80_40x240";

/// Returns the settings of a training that does not end while it is measured.
fn endless(scale: &str) -> RunSettings {
    let mut simulation = Simulation::default();
    simulation.sensor.scale = scale.parse().expect("a scale");
    let mut settings = RunSettings::from(simulation);
    if scale == LARGE {
        // Its epochs last long enough with any method.
        settings.training.method = Method::scaled_conjugate_gradient(0.0);
    }
    settings.training.stopping.epochs = 1_000_000;
    settings.training.stopping.min_gradient = 0.0;
    settings.training.stopping.goal_mse = 0.0;
    settings
}

fn over_the_surfaces(number: usize) -> Vec<Event> {
    let turn = number as f32 * 0.05;
    vec![Event::PointerMoved(pos2(
        500.0 + 120.0 * turn.cos(),
        300.0 + 90.0 * turn.sin(),
    ))]
}

/// Prints the time per frame that the loss chart of a long training takes before it is painted.
fn long_training() {
    const EPOCHS: usize = 1_000_000;
    let mut outline = EpochOutline::default();
    let epochs: Vec<EpochRecord> = (0..EPOCHS)
        .map(|epoch| EpochRecord {
            epoch,
            training_mse: 1.0 / (1.0 + epoch as f64) + 0.1 * (epoch as f64 * 0.37).sin().abs(),
            validation_mse: Some(0.5),
            test_mse: Some(0.6 + 0.1 * (epoch as f64 * 0.11).cos()),
            gradient_norm: 1.0 / (1.0 + epoch as f64),
            parameter: 1e-3,
            effective_parameters: None,
            validation_failures: epoch % 6,
        })
        .collect();
    epochs.chunks(100).for_each(|chunk| outline.extend(chunk));
    let mut figures = Vec::new();
    let mut points = 0;
    for _ in 0..FRAMES {
        let begun = Instant::now();
        let figure = loss_figure(outline.records(), &[], 0);
        figures.push(begun.elapsed());
        points = figure.plots[0].series.iter().map(|series| series.points.len()).sum();
    }
    let kept = outline.records().len();
    clock::print_row(
        &format!("loss chart of {EPOCHS} epochs: {kept} kept, {points} points"),
        figures,
        None,
    );
}

fn main() {
    if std::env::args().any(|argument| argument == "own-data") {
        clock::print_head();
        return own_data::measure();
    }
    let begun = Instant::now();
    let mut bench = Bench::open();
    let first = bench.frame(Vec::new());
    println!(
        "first frame: {:.1} ms from the start of the program, of which layout and tessellation {:.1} ms\n",
        1e3 * begun.elapsed().as_secs_f64(),
        1e3 * first.as_secs_f64()
    );
    bench.wait(|state| state.test().is_some());
    clock::print_head();
    for scale in ["10x10_5x30", "20x20_5x60", LARGE] {
        let settings = endless(scale);
        bench.window.apply(Effect::Configure(Box::new(settings)));
        bench.wait(|state| {
            let shown = state.skin().map(|skin| skin.sensor.scale);
            shown.is_some() && shown == settings.simulation().map(|simulation| simulation.sensor.scale)
        });
        let points = bench.state().skin().map_or([0, 0], |skin| {
            let grid = skin.map.grid();
            [grid.x_mm().len(), grid.y_mm().len()]
        });
        let name = |what: &str| format!("{scale}, surfaces of {}×{}: {what}", points[0], points[1]);
        bench.measure(&name("at rest, drawn again"), |_| Vec::new());
        bench.measure(&name("pointer moves"), over_the_surfaces);
        bench.window.apply(Effect::Do(Command::Train));
        bench.wait(|state| state.result().is_some());
        for chart in ["Loss", "Histogram", "Nodes", "Section"] {
            bench.show_chart(chart);
            bench.measure(&name(&format!("training, {}", chart.to_lowercase())), over_the_surfaces);
        }
        let turned = |number: usize| {
            let button = |pressed| Event::PointerButton {
                pos: pos2(850.0, 300.0),
                button: PointerButton::Primary,
                pressed,
                modifiers: Modifiers::NONE,
            };
            match number {
                0 => vec![Event::PointerMoved(pos2(850.0, 300.0)), button(true)],
                _ if number + 1 == FRAMES => vec![button(false)],
                _ => vec![Event::PointerMoved(pos2(850.0 + (number % 90) as f32, 300.0))],
            }
        };
        bench.measure(&name("training, turned by hand"), turned);
        bench.window.apply(Effect::Do(Command::StopTraining));
        bench.wait(|state| matches!(state.phase, Phase::Ended(_)));
    }
    long_training();
    own_data::measure();
}
