//! The body, and the figures of the Compare view.

use std::{sync::Arc, time::Duration};

use decoupler_core::{
    dataset::Simulation,
    evaluation::{Errors, RunSettings, TargetErrors},
    network::{InputChoice, Quantity, ScalingChoice},
    problem::Channel,
    scene::{Loading, Movement, Noise, NoisySets, Rows, Scene},
};
use decoupler_files::{
    export::{Table, TableColumn, format_duration, format_number, format_r2},
    figure::{
        Decoded, PlotFigure, compared_losses_figure, regression_figure,
        surface::{Surface, SurfaceFigure},
    },
    import::Plan,
};
use eframe::egui::{Align, Layout, Rect, RichText, Sense, Ui, Vec2};

use super::{
    CompareView, Compared,
    state::{Drawn, run_list_ui},
};
use crate::window::{
    plotting::{Pointer, plots_ui, titled_plots_ui},
    shared::{
        Effect, LoadedRun, Look, NetworkSource, PLACES, RightCard, RunList, Shared, Shown, Status, View, ViewKind,
        colour_scale_ui, follow_surface, target_choice_ui, view_mode_ui,
    },
    surface_view::{ColourBar, SurfaceView},
    test_view::TestSet,
    theme::{Theme, semibold, space, type_size},
    widgets::{
        TableColumn as Column, TableRow, TableView, card_ui,
        fields::{capitalised, input_text},
        note_ui, placeholder_ui, scrolled_ui, section_heading_ui, segmented_ui, snapshot_ui,
    },
};

impl View for CompareView {
    fn take_events(&mut self, shared: &Shared, _effects: &mut Vec<Effect>) {
        if shared.shown != ViewKind::Compare {
            self.opened_with = Some(0);
        }
        self.follow(&shared.runs);
    }

    fn tools_ui(&mut self, ui: &mut Ui, _shared: &Shared, _effects: &mut Vec<Effect>) {
        if let Some(snapshot) = snapshot_ui(ui, "snapshot", self.snapshot, self.snapshots()) {
            self.show_snapshot(snapshot);
        }
    }

    fn shown<'a>(&'a self, shared: &'a Shared) -> Vec<Shown<'a>> {
        compared(self, shared)
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        self.fill_places(&shared.runs, effects);
        run_list_ui(ui, shared, &mut self.removing, effects);
    }

    /// Shows the surfaces of both runs above, their curves and figures below.
    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Status> {
        let whole = ui.available_rect_before_wrap();
        let gap = space(2);
        let lower_height = (0.42 * whole.height()).clamp(space(50), space(96));
        let (upper, lower) = whole.split_top_bottom_at_y(whole.bottom() - lower_height);
        let upper = upper.with_max_y(upper.max.y - gap);
        let (cards, scale) = upper.split_left_right_at_x(upper.right() - ColourBar::WIDTH);
        let width = 0.5 * (cards.width() - gap);
        let figure = self.figure(shared);
        let mut surfaces = figure.surfaces.iter();
        for place in 0..2 {
            let surface = self.places[place].has_surface().then(|| surfaces.next()).flatten();
            let left = cards.left() + (width + gap) * place as f32;
            let card = Rect::from_min_size([left, cards.top()].into(), Vec2::new(width, cards.height()));
            card_ui(ui, card, |ui| self.side_ui(ui, shared, place, surface, effects));
        }
        if let [colours, ..] = &figure.scales()[..] {
            let slot = scale.shrink2(Vec2::new(0.0, space(4)));
            colour_scale_ui(ui, slot, colours, &figure.note(), shared.look, effects);
        }
        let figures_width = (0.42 * lower.width()).clamp(space(80), space(120));
        let (left, right) = lower.split_left_right_at_x(lower.right() - figures_width);
        let losses = losses(&shared.runs);
        card_ui(ui, left.with_max_x(left.max.x - gap), |ui| match &losses {
            Some(losses) => titled_plots_ui(ui, "Loss", losses),
            None => placeholder_ui(ui, "The errors of each epoch of both runs appear here, in one chart."),
        });
        card_ui(ui, right, |ui| {
            scrolled_ui(ui, "compared figures", |ui| {
                section_heading_ui(ui, "Errors on the test sets");
                figures_ui(ui, &shared.runs);
            });
        });
        ui.allocate_rect(whole, Sense::hover());
        None
    }
}

impl CompareView {
    /// Returns the plot of decoded against actual values of the displayed target on this side, if it has no surface.
    pub(super) fn regression(&self, place: usize) -> Option<PlotFigure> {
        let place = &self.places[place];
        let Compared { test, answers, drawn } = place.compared.as_ref()?;
        let (Drawn::Regression(charts), Some(test)) = (drawn, test.recording()) else {
            return None;
        };
        let target = place.target.min(charts.lines.len().checked_sub(1)?);
        let channel = test.problem.targets.get(target)?;
        let pair = |sample| (test.set.targets()[[sample, target]], answers[[sample, target]]);
        let samples: (usize, &dyn Fn(usize) -> (f64, f64)) = (test.set.samples(), &pair);
        Some(regression_figure(
            samples,
            &charts.lines[target],
            Decoded::Target(channel),
        ))
    }

    /// Returns the surfaces of the runs that are ready, on a common scale.
    pub(super) fn figure(&self, shared: &Shared) -> SurfaceFigure {
        let look = shared.look;
        let surface = |place: usize| {
            let Compared { test, drawn, .. } = self.places[place].compared.as_ref()?;
            let name = shared.runs.pinned(place).map_or("", |run| run.name);
            let (letter, style) = (PLACES[place], look.style());
            match (drawn, test) {
                (Drawn::Frames(frames), TestSet::Array(test)) => {
                    let [_, decoupled, error] = &**frames;
                    Some(match self.card {
                        RightCard::Decoupled => test.heights(format!("{letter}: {name}, decoupled"), decoupled, style),
                        RightCard::Error => test.errors(format!("{letter}: {name}, error"), error, style),
                    })
                }
                (Drawn::Surfaces(surfaces), _) => {
                    let [_, decoded, error] = &**surfaces;
                    let (surface, what) = match self.card {
                        RightCard::Decoupled => (decoded, "decoded"),
                        RightCard::Error => (error, "error"),
                    };
                    Some(Surface {
                        title: format!("{letter}: {name}, {what}"),
                        mode: look.mode,
                        colours: look.colours,
                        ..surface.clone()
                    })
                }
                _ => None,
            }
        };
        SurfaceFigure {
            surfaces: (0..self.places.len()).filter_map(surface).collect(),
            camera: look.camera,
            marked_node: self.node,
            ..SurfaceFigure::default()
        }
        .with_common_scales()
    }

    fn side_ui(
        &mut self,
        ui: &mut Ui,
        shared: &Shared,
        place: usize,
        surface: Option<&Surface>,
        effects: &mut Vec<Effect>,
    ) {
        let theme = Theme::of(ui);
        let (runs, look) = (&shared.runs, shared.look);
        ui.horizontal(|ui| {
            ui.set_min_height(space(7));
            let colour = [theme.palette.accent, theme.palette.warning][place];
            ui.label(
                RichText::new(PLACES[place])
                    .font(semibold(type_size().title))
                    .color(colour),
            );
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                // Choices common to both sides are shown once.
                match place {
                    0 => view_mode_ui(ui, look, effects),
                    _ => {
                        let cards = [(RightCard::Decoupled, "Decoupled"), (RightCard::Error, "Error")];
                        let picked = segmented_ui(ui, "Displayed surface", &cards, self.card, false);
                        self.card = picked.unwrap_or(self.card);
                    }
                }
                if let Some(run) = runs.pinned(place) {
                    ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                        let name = RichText::new(run.name).font(semibold(type_size().title));
                        ui.add(eframe::egui::Label::new(name).truncate());
                    });
                }
            });
        });
        let regression = self.regression(place);
        let of_place = &mut self.places[place];
        match (surface, regression, &of_place.problem) {
            (Some(surface), ..) => surface_ui(ui, place, surface, look, &mut self.node, effects),
            (None, Some(regression), _) => {
                let test = of_place
                    .compared
                    .as_ref()
                    .and_then(|compared| compared.test.recording());
                if let Some(test) = test {
                    let id = ["target of A", "target of B"][place];
                    target_choice_ui(ui, "Target", id, &test.problem.targets, &mut of_place.target);
                }
                plots_ui(
                    ui,
                    ["Regression of A", "Regression of B"][place],
                    &regression,
                    Pointer::Moves,
                );
            }
            (None, None, Some(problem)) => {
                note_ui(ui, problem);
            }
            _ if runs.workspace.pinned[place].is_some() => placeholder_ui(ui, "Its test samples are being prepared."),
            _ => {
                let text = match runs.workspace.runs.len() {
                    0 => "Two finished trainings appear here side by side.".to_owned(),
                    1 => "Train a second network to compare it with the first.".to_owned(),
                    _ => format!("Press {} next to a run in the list to show it here.", PLACES[place]),
                };
                placeholder_ui(ui, &text);
            }
        }
    }
}

fn surface_ui(
    ui: &mut Ui,
    place: usize,
    surface: &Surface,
    look: Look,
    node: &mut Option<usize>,
    effects: &mut Vec<Effect>,
) {
    let view = SurfaceView {
        label: ["Surface of A", "Surface of B"][place],
        surface,
        marked_node: *node,
        lit_nodes: &[],
        section: None,
        theme: Theme::of(ui),
    };
    let shown = view.show(ui, look.camera);
    // The node with the same number is highlighted on the other surface.
    follow_surface(&shown, look, node, effects);
}

/// Returns the loss curves of the chosen runs.
pub(super) fn losses(runs: &RunList) -> Option<PlotFigure> {
    let [a, b] = [0, 1].map(|place| {
        let run = runs.pinned(place)?;
        Some((format!("{}: {}", PLACES[place], run.name), &*run.file.training.history))
    });
    let runs = [&a, &b].map(|run| run.as_ref().map(|(name, history)| (&**name, *history)));
    (a.is_some() || b.is_some()).then(|| compared_losses_figure(runs))
}

/// Returns what the view shows: networks of both runs, pictures and table.
pub(super) fn compared<'a>(view: &'a CompareView, shared: &'a Shared) -> Vec<Shown<'a>> {
    let runs = &shared.runs;
    let mut shown = Vec::new();
    for (place, letter) in PLACES.into_iter().enumerate() {
        let run = runs.pinned(place);
        let name = run
            .as_ref()
            .map_or_else(|| letter.to_owned(), |run| format!("{letter}: {}", run.name));
        let source = run.map(|run| NetworkSource::Kept(run.name.to_owned(), Arc::clone(run.file)));
        let source = source.ok_or_else(|| format!("No run is chosen as {letter}: choose one in the list."));
        shown.extend(Shown::network(&name, source, Vec::new()));
    }
    let is_any = (0..PLACES.len()).any(|place| runs.pinned(place).is_some());
    let any = || {
        is_any
            .then_some(())
            .ok_or_else(|| "No run is chosen: choose one in the list.".to_owned())
    };
    let surfaces = any().map(|()| || view.figure(shared).into());
    shown.push(Shown::figure("Surfaces", "compared-surfaces".to_owned(), surfaces));
    for (place, letter) in PLACES.into_iter().enumerate() {
        if let Some(regression) = view.regression(place) {
            let stem = format!("regression-{}", letter.to_lowercase());
            let regression = Ok(move || regression.clone().into());
            shown.push(Shown::figure(&format!("Regression of {letter}"), stem, regression));
        }
    }
    let losses = losses(runs).ok_or_else(|| "No run is chosen: choose one in the list.".to_owned());
    let losses = losses.map(|losses| move || losses.clone().into());
    shown.push(Shown::figure("Loss chart", "compared-loss".to_owned(), losses));
    let table = any().map(|()| || compared_table(runs));
    shown.push(Shown::table("Table of both runs", "compared".to_owned(), table));
    shown
}

/// Describes the differences between a run on an array and the paper's scene and inputs; empty if there are none.
pub fn differences_from_paper(settings: &RunSettings) -> Vec<String> {
    let Some(Simulation { scene, .. }) = settings.simulation() else {
        return Vec::new();
    };
    let of_paper = Scene::default();
    let words = [
        (scene.rows != of_paper.rows).then(|| describe_rows(scene.rows)),
        (scene.movement != of_paper.movement).then(|| describe_movement(scene.movement)),
        (scene.loading != of_paper.loading).then(|| describe_loading(scene)),
        (!scene.noise.is_none()).then(|| format!("noise {}", describe_noise(&scene.noise))),
        (settings.inputs != InputChoice::PAPER).then(|| describe_inputs(settings.inputs)),
    ];
    words.into_iter().flatten().collect()
}

pub fn describe_rows(rows: Rows) -> String {
    match rows {
        Rows::All => "all rows".to_owned(),
        Rows::Known => "known rows".to_owned(),
        Rows::One(row) => format!("row {} alone", row + 1),
    }
}

pub fn describe_movement(movement: Movement) -> String {
    match movement {
        Movement::Z => "z".to_owned(),
        Movement::Xyz { .. } => "x, y, z".to_owned(),
    }
}

pub fn describe_loading(scene: &Scene) -> String {
    match scene.loading {
        Loading::RandomNodes => "random nodes".to_owned(),
        Loading::SmoothField { correlation_length_mm } => {
            format!("smooth field, {} mm", input_text(correlation_length_mm))
        }
        Loading::Indenter(indenter) => indenter.name().to_owned(),
    }
}

pub fn describe_noise(noise: &Noise) -> String {
    if noise.is_none() {
        return "none".to_owned();
    }
    let parts = [
        (noise.relative > 0.0).then(|| input_text(noise.relative)),
        (noise.additive_ohm > 0.0).then(|| format!("{} ohm", input_text(noise.additive_ohm))),
        noise.converter_bits.map(|bits| format!("{bits} bits")),
        (noise.drift > 0.0).then(|| format!("drift {}", input_text(noise.drift))),
        match noise.sets {
            NoisySets::Both => None,
            NoisySets::Training => Some("in training".to_owned()),
            NoisySets::Test => Some("in test".to_owned()),
        },
    ];
    parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

pub fn describe_inputs(inputs: InputChoice) -> String {
    let quantity = match inputs.quantity {
        Quantity::Resistance => "resistance",
        Quantity::Conductance => "conductance",
        Quantity::LogResistance => "log-resistance",
        Quantity::Raw => "readings",
    };
    match inputs.scaling {
        ScalingChoice::MinMax => quantity.to_owned(),
        ScalingChoice::Whitening => format!("{quantity}, whitened"),
    }
}

const COLUMNS: [Column<'_>; 3] = [
    Column::text(""),
    Column::figure("A").meaning("The run chosen as A"),
    Column::figure("B").meaning("The run chosen as B"),
];

const OTHER_SAMPLES: &str =
    "These networks were tested on different samples, so their errors are not directly comparable.";

/// Formats a figure of a run; returns `None` if it does not apply to the source of the run.
type FigureOf = fn(&LoadedRun<'_>) -> Option<String>;

fn of_nodes(run: &LoadedRun<'_>, figure: fn(&Errors) -> Option<f64>) -> Option<String> {
    run.file
        .scores
        .network
        .nodes()
        .map(|errors| format_number(figure(errors)))
}

fn of_array(run: &LoadedRun<'_>, figure: fn(&Simulation) -> String) -> Option<String> {
    run.file.settings.simulation().map(figure)
}

const FIGURES: [(&str, FigureOf); 20] = [
    ("Z error, %", |run| of_nodes(run, |errors| errors.z_percent)),
    ("X error, %", |run| of_nodes(run, |errors| errors.x_percent)),
    ("Y error, %", |run| of_nodes(run, |errors| errors.y_percent)),
    ("Z error, mm", |run| of_nodes(run, |errors| Some(errors.z_mm))),
    ("Z error, % of the stroke", |run| {
        of_nodes(run, |errors| Some(errors.z_full_scale_percent))
    }),
    ("worst node, mm", |run| of_nodes(run, |errors| Some(errors.worst_mm))),
    ("error, % of the range", |run| {
        let errors = &run.file.scores.network;
        errors.nodes().is_none().then(|| format_number(errors.percent()))
    }),
    ("linear map, %", |run| {
        Some(format_number(run.file.scores.baselines.linear.percent()))
    }),
    ("training mean, %", |run| {
        Some(format_number(run.file.scores.baselines.mean.percent()))
    }),
    ("source", |run| Some(run.file.source_name())),
    ("split", |run| Some(describe_split(&run.file.recorded.as_ref()?.plan))),
    ("rows", |run| of_array(run, |array| describe_rows(array.scene.rows))),
    ("axes", |run| {
        of_array(run, |array| describe_movement(array.scene.movement))
    }),
    ("loading", |run| of_array(run, |array| describe_loading(&array.scene))),
    ("noise", |run| of_array(run, |array| describe_noise(&array.scene.noise))),
    ("inputs", |run| Some(describe_inputs(run.file.settings.inputs))),
    ("hidden nodes", |run| Some(run.file.settings.hidden.to_string())),
    ("method", |run| {
        Some(run.file.settings.training.method.short_name().to_owned())
    }),
    ("best epoch", |run| {
        let training = &run.file.training;
        Some(format!("{} of {}", training.best_epoch, training.epochs))
    }),
    ("training time, one thread", |run| {
        let time = Duration::try_from_secs_f64(run.file.training.seconds);
        Some(time.map_or_else(|_| format_number(None), format_duration))
    }),
];

/// Returns the figures that apply to at least one of the compared runs, formatted for each run.
fn figures(runs: &RunList) -> impl Iterator<Item = (&'static str, [Option<String>; 2])> {
    let figure = |(name, figure): &(&'static str, FigureOf)| {
        let of = |place| runs.pinned(place).as_ref().and_then(figure);
        (*name, [of(0), of(1)])
    };
    let figures = Vec::from_iter(FIGURES.iter().map(figure));
    let is_empty = (0..2).all(|place| runs.pinned(place).is_none());
    figures
        .into_iter()
        .filter(move |(_, words)| is_empty || words.iter().any(Option::is_some))
}

/// Returns RMSE and R² of each target of the compared recordings, formatted for each run.
fn target_figures(runs: &RunList) -> Vec<(String, [Option<String>; 2])> {
    let pinned = [0, 1].map(|place| runs.pinned(place));
    let mut targets: Vec<&Channel> = Vec::new();
    let recorded = pinned.into_iter().flatten().filter(|run| run.file.recorded.is_some());
    for target in recorded.flat_map(|run| &run.file.problem.targets) {
        if !targets.contains(&target) {
            targets.push(target);
        }
    }
    let errors = |run: &LoadedRun<'_>, target: &Channel| {
        let index = run.file.problem.targets.iter().position(|other| other == target)?;
        run.file.scores.network.targets().get(index).copied()
    };
    let figures = |target: &Channel| {
        let of = |figure: fn(&TargetErrors) -> String| {
            pinned.map(|run| run.and_then(|run| errors(&run, target)).map(|errors| figure(&errors)))
        };
        let title = target.title();
        [
            (format!("RMSE of {title}"), of(|errors| format_number(errors.rmse))),
            (format!("R² of {title}"), of(|errors| format_r2(errors.r2))),
        ]
    };
    targets.into_iter().flat_map(figures).collect()
}

/// Returns true if the two runs were tested on different samples.
fn are_other_samples(runs: &RunList) -> bool {
    // The channels of the readings may differ.
    let samples = |run: &LoadedRun<'_>| {
        let mut plan = run.file.recorded.as_ref()?.plan.clone();
        plan.import.inputs.clear();
        plan.import.units.clear();
        Some((plan, run.file.settings.seed))
    };
    match [0, 1].map(|place| runs.pinned(place)) {
        [Some(a), Some(b)] => samples(&a) != samples(&b),
        _ => false,
    }
}

fn describe_split(plan: &Plan) -> String {
    match plan.test {
        Some(_) => "test file".to_owned(),
        None => plan.division.by.to_string(),
    }
}

/// Returns the figures of both runs, with their names as headings.
pub fn compared_table(runs: &RunList) -> Table {
    let name = |place: usize| {
        let run = runs.pinned(place).map_or("", |run| run.name);
        TableColumn::field(format!("{}: {run}", PLACES[place]))
    };
    let cell = |words: Option<String>| words.unwrap_or_else(|| format_number(None)).into();
    let row = |(name, [a, b]): (String, [Option<String>; 2])| vec![capitalised(&name).into(), cell(a), cell(b)];
    let of_runs = figures(runs).map(|(name, words)| (name.to_owned(), words));
    Table {
        columns: vec![TableColumn::field("Figure"), name(0), name(1)],
        rows: of_runs.chain(target_figures(runs)).map(row).collect(),
    }
}

/// Shows errors, configuration and cost of both runs.
pub fn figures_ui(ui: &mut Ui, runs: &RunList) {
    if are_other_samples(runs) {
        note_ui(ui, OTHER_SAMPLES);
    }
    TableView::new("compared", &COLUMNS).show_all(ui, TableRow::of_table(&compared_table(runs)));
}

#[cfg(test)]
mod tests {
    use decoupler_core::{evaluation::Preset, scene::Indenter};

    use super::*;

    #[test]
    fn only_differences_from_the_paper_are_listed() {
        assert!(differences_from_paper(&RunSettings::default()).is_empty());
        let mut best = Preset::Best.settings_in(Noise {
            relative: 1e-3,
            converter_bits: Some(12),
            sets: NoisySets::Test,
            ..Noise::default()
        });
        let words = ["known rows", "noise 0.001, 12 bits, in test", "conductance, whitened"];
        assert_eq!(differences_from_paper(&best), words);
        best = RunSettings::default();
        best.simulation_mut().unwrap().scene.rows = Rows::One(2);
        best.simulation_mut().unwrap().scene.loading = Loading::Indenter(Indenter::all()[1]);
        assert_eq!(differences_from_paper(&best), ["row 3 alone", "flat punch"]);
    }
}
