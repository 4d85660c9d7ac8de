//! The Compare view: the run list, and two of its runs side by side.

mod figures;
mod run_list;
mod side;

use std::sync::Arc;

use decoupler_files::figure::{Figure, PlotFigure, compared_losses_figure, surface::SurfaceFigure};
use eframe::egui::{Align, Label, Layout, RichText, Ui};

use self::{
    figures::{compared_table, figures_ui},
    run_list::run_list_ui,
    side::Side,
};
use crate::window::{
    job::Jobs,
    plotting::{plots_ui, titled_plots_ui},
    shared::{
        Effect, NetworkSource, Offers, PLACES, RightCard, RunList, RunsRequest, Shared, Shown, Status, View,
        surface_cards_ui, surface_ui, surfaces_above_ui, target_choice_ui, view_mode_ui,
    },
    surface_view::SurfaceView,
    theme::{Theme, semibold, space, type_size},
    widgets::{card_ui, note_ui, placeholder_ui, scrolled_ui, section_heading_ui, segmented_ui, snapshot_ui},
};

/// The Compare view.
#[derive(Debug)]
pub struct CompareView {
    /// A and B.
    sides: [Side; 2],
    /// Snapshot of both test sets.
    snapshot: usize,
    /// Surface shown for both networks.
    card: RightCard,
    /// Run whose removal awaits confirmation.
    removing: Option<u64>,
    /// Number of runs when empty sides were last filled.
    seen: usize,
    /// Node under the pointer, highlighted on both surfaces.
    node: Option<usize>,
}

impl View for CompareView {
    fn take_events(&mut self, shared: &Shared, _effects: &mut Vec<Effect>) {
        for (place, side) in self.sides.iter_mut().enumerate() {
            side.follow(shared.runs.pinned(place), self.snapshot);
        }
    }

    fn take_commands(&mut self, offers: &mut Offers<'_>, _shared: &Shared, _effects: &mut Vec<Effect>) {
        self.show(offers.offer_samples(self.snapshot, self.snapshots()));
    }

    fn tools_ui(&mut self, ui: &mut Ui, _shared: &Shared, _effects: &mut Vec<Effect>) {
        self.show(snapshot_ui(ui, "snapshot", self.snapshot, self.snapshots()));
    }

    fn shown<'a>(&'a self, shared: &'a Shared) -> Vec<Shown<'a>> {
        compared(self, shared)
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        run_list_ui(ui, shared, &mut self.removing, effects);
    }

    /// Shows the surfaces of both runs above, their curves and figures below.
    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Status> {
        self.fill_sides(&shared.runs, effects);
        surfaces_above_ui(ui, |ui, [upper, left, right]| {
            let (figure, look) = (self.figure(shared), shared.look);
            surface_cards_ui(
                ui,
                (upper, PLACES.len()),
                &figure,
                look,
                effects,
                |ui, place, effects| {
                    self.head_ui(ui, shared, place, effects);
                    self.side_ui(ui, shared, place, &figure, effects);
                },
            );
            card_ui(ui, left, |ui| match &losses(&shared.runs) {
                Some(losses) => titled_plots_ui(ui, "Loss", losses),
                None => placeholder_ui(ui, "The errors of each epoch of both runs appear here, in one chart."),
            });
            card_ui(ui, right, |ui| {
                scrolled_ui(ui, "compared figures", |ui| {
                    section_heading_ui(ui, "Errors on the test sets");
                    figures_ui(ui, &shared.runs);
                });
            });
        });
        None
    }
}

impl CompareView {
    /// Creates the view with both sides empty.
    pub fn new(jobs: &Jobs) -> Self {
        Self {
            sides: [Side::new(jobs), Side::new(jobs)],
            snapshot: 0,
            card: RightCard::default(),
            removing: None,
            seen: 0,
            node: None,
        }
    }

    /// Returns the number of snapshots of the larger test set.
    fn snapshots(&self) -> usize {
        self.sides.iter().map(Side::snapshots).max().unwrap_or(0)
    }

    /// Shows a snapshot, if one was asked for.
    fn show(&mut self, snapshot: Option<usize>) {
        let Some(snapshot) = snapshot else { return };
        self.snapshot = snapshot;
        self.sides.iter_mut().for_each(|side| side.show(snapshot));
    }

    /// Fills empty sides with the newest runs, the older one first, once there are more runs than before.
    fn fill_sides(&mut self, runs: &RunList, effects: &mut Vec<Effect>) {
        let (pinned, count) = (runs.workspace.pinned, runs.workspace.runs.len());
        if count > self.seen {
            let empty = (0..pinned.len()).filter(|&place| pinned[place].is_none());
            let ids = runs.workspace.runs.iter().rev().map(|run| run.id);
            let others = ids.filter(|id| !pinned.contains(&Some(*id)));
            let mut newest = Vec::from_iter(others.take(empty.clone().count()));
            newest.reverse();
            effects.extend(
                empty
                    .zip(newest)
                    .map(|(place, id)| Effect::ChangeRuns(RunsRequest::Pin(place, Some(id)))),
            );
        }
        self.seen = count;
    }

    /// Returns the surfaces of the runs that are ready, on a common scale.
    fn figure(&self, shared: &Shared) -> SurfaceFigure {
        let look = shared.look;
        let surface = |place: usize| {
            let [decoded, error] = self.sides[place].ready()?.surfaces.as_ref()?;
            let (surface, what) = match self.card {
                RightCard::Decoupled => (decoded, "decoded"),
                RightCard::Error => (error, "error"),
            };
            Some(look.dressed(surface, format!("{}, {what}", name_of(&shared.runs, place))))
        };
        SurfaceFigure {
            surfaces: (0..self.sides.len()).filter_map(surface).collect(),
            camera: look.camera,
            marked_node: self.node,
            ..SurfaceFigure::default()
        }
        .with_common_scales()
    }

    /// The letter and the run, and a choice common to both sides.
    fn head_ui(&mut self, ui: &mut Ui, shared: &Shared, place: usize, effects: &mut Vec<Effect>) {
        let palette = Theme::of(ui).palette;
        ui.horizontal(|ui| {
            ui.set_min_height(space(7));
            let font = semibold(type_size().title);
            let colour = [palette.accent, palette.warning][place];
            ui.label(RichText::new(PLACES[place]).font(font.clone()).color(colour));
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                if place == 0 {
                    view_mode_ui(ui, shared.look, effects);
                } else {
                    let cards = [(RightCard::Decoupled, "Decoded"), (RightCard::Error, "Error")];
                    let picked = segmented_ui(ui, "Displayed surface", &cards, self.card, false);
                    self.card = picked.unwrap_or(self.card);
                }
                if let Some(run) = shared.runs.pinned(place) {
                    ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                        ui.add(Label::new(RichText::new(run.name).font(font)).truncate());
                    });
                }
            });
        });
    }

    /// The surface or the chart of a run, or why there is none.
    fn side_ui(
        &mut self,
        ui: &mut Ui,
        shared: &Shared,
        place: usize,
        figure: &SurfaceFigure,
        effects: &mut Vec<Effect>,
    ) {
        let (runs, letter) = (&shared.runs, PLACES[place]);
        // Sides without a surface have none in the figure.
        let before = self.sides[..place].iter().filter(|side| side.snapshots() > 0).count();
        let side = &mut self.sides[place];
        let surface = figure.surfaces.get(before).filter(|_| side.snapshots() > 0);
        let chart = side.chart();
        match (&side.compared, surface) {
            (_, Some(surface)) => {
                let view = SurfaceView {
                    label: &format!("Surface of {letter}"),
                    surface,
                    figure,
                    is_touched: false,
                };
                // The node with the same number is highlighted on the other surface.
                surface_ui(ui, view, shared.look, &mut self.node, effects);
            }
            (Some(Ok(compared)), None) => {
                let targets = &compared.test.problem.targets;
                target_choice_ui(ui, "Target", &format!("target of {letter}"), targets, &mut side.target);
                if let Some(chart) = &chart {
                    plots_ui(ui, &format!("Regression of {letter}"), chart);
                }
            }
            (Some(Err(reason)), None) => {
                note_ui(ui, reason);
            }
            (None, None) if runs.workspace.pinned[place].is_some() => {
                placeholder_ui(ui, "Its test samples are being prepared.");
            }
            (None, None) => {
                let text = match runs.workspace.runs.len() {
                    0 => "Two finished trainings appear here side by side.".to_owned(),
                    1 => "Train a second network to compare it with the first.".to_owned(),
                    _ => format!("Press {letter} next to a run in the list to show it here."),
                };
                placeholder_ui(ui, &text);
            }
        }
    }
}

/// Returns the letter of a side with the name of its run.
fn name_of(runs: &RunList, place: usize) -> String {
    let name = runs.pinned(place).map_or("", |run| run.name);
    format!("{}: {name}", PLACES[place])
}

/// Returns the loss curves of the chosen runs.
fn losses(runs: &RunList) -> Option<PlotFigure> {
    let named = [0, 1].map(|place| {
        let run = runs.pinned(place)?;
        Some((name_of(runs, place), &*run.file.training.history))
    });
    let curves = named
        .each_ref()
        .map(|run| run.as_ref().map(|(name, history)| (&**name, *history)));
    named
        .iter()
        .any(Option::is_some)
        .then(|| compared_losses_figure(curves))
}

/// Returns what can be exported: networks of both runs, pictures and table.
fn compared<'a>(view: &'a CompareView, shared: &'a Shared) -> Vec<Shown<'a>> {
    const NOTHING: &str = "No run is chosen: choose one in the list.";
    let runs = &shared.runs;
    let mut shown = Vec::new();
    for (place, letter) in PLACES.into_iter().enumerate() {
        let run = runs.pinned(place);
        let name = run.map_or_else(|| letter.to_owned(), |_| name_of(runs, place));
        let source = run.map(|run| NetworkSource::Kept(run.name.to_owned(), Arc::clone(run.file)));
        let source = source.ok_or_else(|| format!("No run is chosen as {letter}: choose one in the list."));
        shown.extend(Shown::network(&name, source, Vec::new()));
    }
    let mut picture = |name: &str, stem: &str, figure: Option<Figure>| {
        let figure = figure
            .ok_or_else(|| NOTHING.to_owned())
            .map(|figure| move || figure.clone());
        shown.push(Shown::figure(name, stem.to_owned(), figure));
    };
    let surfaces = Some(view.figure(shared)).filter(|figure| !figure.surfaces.is_empty());
    picture("Surfaces", "compared-surfaces", surfaces.map(Figure::from));
    for (side, letter) in view.sides.iter().zip(PLACES) {
        if let Some(chart) = side.chart() {
            let stem = format!("regression-{}", letter.to_lowercase());
            picture(&format!("Regression of {letter}"), &stem, Some(chart.into()));
        }
    }
    let losses = losses(runs).map(Figure::from);
    let table = losses
        .as_ref()
        .map(|_| || compared_table(runs))
        .ok_or_else(|| NOTHING.to_owned());
    picture("Loss chart", "compared-loss", losses);
    shown.push(Shown::table("Table of both runs", "compared".to_owned(), table));
    shown
}
