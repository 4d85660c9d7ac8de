use std::{fmt, path::Path, sync::Arc, time::Duration};

use decoupler_core::{job::Job, text::counted};
use decoupler_files::{
    export::{KeptRun, NetworkFile, format_duration, format_percent},
    figure::surface::Surface,
    import::{Recorded, Setup},
};
use eframe::egui::{Button, Id, RichText, TextEdit, Ui, WidgetInfo, accesskit::Role};
use ndarray::Array2;

use super::view::differences_from_paper;
use crate::window::{
    job::{Background, Wake},
    shared::{Effect, PLACES, Phase, RightCard, RunList, Shared},
    test_view::{Frame, Positions, RecordedTest, TargetCharts, TestSet, TestView},
    theme::{space, type_size},
    widgets::{dim_ui, ghost_button, scrolled_ui, section_heading_ui},
};

/// The Compare view.
pub struct CompareView {
    /// The two sides, A and B.
    pub places: [Place; 2],
    /// Snapshot of both test sets.
    pub snapshot: usize,
    /// Surface shown for both networks.
    pub card: RightCard,
    /// Run whose removal awaits confirmation.
    pub removing: Option<u64>,
    /// Number of runs when empty sides were last filled; `None` once both are filled.
    pub(super) opened_with: Option<usize>,
    /// Node under the pointer, highlighted on both surfaces.
    pub node: Option<usize>,
    wake: Wake,
}

/// One side of the comparison.
#[derive(Debug, Default)]
pub struct Place {
    /// The run on this side.
    id: Option<u64>,
    /// Test set of the run and the answers of its network, once they are ready.
    pub compared: Option<Compared>,
    /// Reason why they are not available.
    pub problem: Option<String>,
    /// Target of a recording whose regression is shown.
    pub target: usize,
    /// Work that prepares them.
    job: Option<Background<Result<Box<Compared>, String>>>,
}

/// A run prepared for drawing.
#[derive(Clone, Debug)]
pub struct Compared {
    /// Its test set.
    pub test: TestSet,
    /// Answers of its network: samples × targets.
    pub answers: Arc<Array2<f64>>,
    /// Displayed part of them.
    pub drawn: Drawn,
}

/// Displayed part of a test set.
#[derive(Clone, Debug)]
pub enum Drawn {
    /// Nodes of an array at the displayed snapshot: actual, decoupled, difference.
    Frames(Box<[Frame; 3]>),
    /// Surfaces through the targets of a recording at the displayed sample: actual, decoded, difference.
    Surfaces(Box<[Surface; 3]>),
    /// Regression of each target of a recording, whose targets have no surface.
    Regression(Arc<TargetCharts>),
}

impl Place {
    /// Returns true if a surface is drawn in it.
    pub(super) fn has_surface(&self) -> bool {
        let compared = self.compared.as_ref();
        compared.is_some_and(|compared| !matches!(compared.drawn, Drawn::Regression(_)))
    }
}

impl Compared {
    /// Simulates the test set of a run again, or reads it from the files of its recording.
    fn new(file: &NetworkFile, job: &Job<'_>) -> Result<Self, String> {
        let test = match &file.recorded {
            None => TestSet::Array(TestView::draw(&file.settings).map_err(|error| error.to_string())?),
            Some(recorded) => TestSet::Recording(recorded_test(file, recorded, job)?),
        };
        let answers = Arc::new(file.decoder().answers_to(test.set()));
        let drawn = drawn(&test, &answers, 0);
        Ok(Self { test, answers, drawn })
    }

    /// Draws `snapshot`, or the last one if there are fewer.
    fn show(&mut self, snapshot: usize) {
        if !matches!(self.drawn, Drawn::Regression(_)) {
            self.drawn = drawn(&self.test, &self.answers, snapshot);
        }
    }
}

/// Reads the test samples of a network again.
fn recorded_test(file: &NetworkFile, recorded: &Recorded, job: &Job<'_>) -> Result<RecordedTest, String> {
    if let [missing, ..] = recorded.missing()[..] {
        return Err(format!(
            "The recording '{}' no longer exists, so its test samples cannot be shown. Put the file back to see them; \
             errors, loss and settings are kept with the run.",
            missing.display()
        ));
    }
    let sets = file.setup().sets(Path::new(""), job, &mut |_| ());
    let sets = sets.map_err(|error| error.to_string())?;
    let is_same = sets
        .recorded()
        .is_some_and(|now| now.samples_crc32 == recorded.samples_crc32);
    if !is_same {
        let data = recorded.plan.import.data.display();
        return Err(format!(
            "'{data}' has changed since this network was trained, so its samples are not shown. Restore the original \
             file, or train again."
        ));
    }
    Ok(RecordedTest::new(
        Arc::clone(&sets.sets.test),
        Arc::new(file.problem.clone()),
        recorded.plan.test_order(),
    ))
}

/// Draws `snapshot` of a test set, or the last one if there are fewer.
fn drawn(test: &TestSet, answers: &Array2<f64>, snapshot: usize) -> Drawn {
    match test {
        TestSet::Array(test) => {
            let snapshot = test.nearest_snapshot(snapshot);
            let actual = test.frame(test.set.targets(), snapshot);
            let decoupled = test.frame(answers.view(), snapshot);
            let error = actual.error_of(&decoupled);
            Drawn::Frames(Box::new([actual, decoupled, error]))
        }
        TestSet::Recording(test) => match &test.positions {
            Positions::Surface(through) => {
                let sample = snapshot.min(test.set.samples().saturating_sub(1));
                let actual = test.set.targets().row(sample).to_vec();
                let decoded = answers.row(sample).to_vec();
                let range = through.range_of(&test.ranges);
                Drawn::Surfaces(Box::new(through.surfaces(&actual, &decoded, range)))
            }
            Positions::None | Positions::NoSurface(_) => Drawn::Regression(Arc::new(test.charts(answers))),
        },
    }
}

impl CompareView {
    /// Creates the view with both sides empty; `wake` is called when there is something new to draw.
    pub fn new(wake: Wake) -> Self {
        Self {
            places: Default::default(),
            snapshot: 0,
            card: RightCard::default(),
            removing: None,
            opened_with: None,
            node: None,
            wake,
        }
    }

    /// Shows this snapshot of both test sets.
    pub(super) fn show_snapshot(&mut self, snapshot: usize) {
        self.snapshot = snapshot;
        for compared in self.places.iter_mut().filter_map(|place| place.compared.as_mut()) {
            compared.show(snapshot);
        }
    }

    /// Returns the number of snapshots of the larger of the two test sets.
    pub(super) fn snapshots(&self) -> usize {
        let drawn = self.places.iter().filter(|place| place.has_surface());
        drawn
            .filter_map(|place| place.compared.as_ref())
            .map(|compared| compared.test.snapshots())
            .max()
            .unwrap_or(0)
    }

    /// Fills empty sides with the newest runs as the view opens, the older one first, and as runs arrive until both are
    /// filled.
    pub(super) fn fill_places(&mut self, runs: &RunList, effects: &mut Vec<Effect>) {
        let count = runs.workspace.runs.len();
        if self.opened_with.is_none_or(|seen| seen == count) {
            return;
        }
        let pinned = runs.workspace.pinned;
        let empty: Vec<usize> = (0..pinned.len()).filter(|&place| pinned[place].is_none()).collect();
        let others = runs.workspace.runs.iter().rev().map(|run| run.id);
        let others = others.filter(|id| !pinned.contains(&Some(*id)));
        let mut newest: Vec<u64> = others.take(empty.len()).collect();
        self.opened_with = (newest.len() < empty.len()).then_some(count);
        newest.reverse();
        let filled = empty.into_iter().zip(newest);
        effects.extend(filled.map(|(place, id)| Effect::PinRun(place, Some(id))));
    }

    /// Starts background jobs that prepare the two sides, and takes their results.
    pub(super) fn follow(&mut self, runs: &RunList) {
        for (number, place) in self.places.iter_mut().enumerate() {
            let run = runs.pinned(number);
            if place.id != run.map(|run| run.id) {
                *place = Place::default();
                if let Some(run) = run {
                    (place.id, place.job) = (Some(run.id), Some(prepare(run.file, &self.wake)));
                }
            }
            let Some(prepared) = place.job.as_ref().and_then(Background::next_event) else {
                continue;
            };
            place.job = None;
            match prepared {
                Ok(mut compared) => {
                    if self.snapshot > 0 {
                        compared.show(self.snapshot);
                    }
                    place.compared = Some(*compared);
                }
                Err(reason) => place.problem = Some(reason),
            }
        }
    }
}

/// Prepares the test set of a run and the answers of its network in the background.
fn prepare(file: &Arc<NetworkFile>, wake: &Wake) -> Background<Result<Box<Compared>, String>> {
    let mut job = Background::new("compared run", Arc::clone(wake));
    let file = Arc::clone(file);
    job.start(
        move |report| Compared::new(&file, &Job::new(&|| report.is_cancelled())),
        |prepared| match prepared {
            Ok(Ok(compared)) => Ok(Box::new(compared)),
            Ok(Err(reason)) => Err(reason),
            Err(error) => Err(format!("The test samples of this run could not be prepared: {error}")),
        },
    );
    job
}

impl fmt::Debug for CompareView {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CompareView").finish_non_exhaustive()
    }
}

/// Shows the finished trainings, newest first; `removing` is the run whose removal awaits confirmation.
pub fn run_list_ui(ui: &mut Ui, shared: &Shared, removing: &mut Option<u64>, effects: &mut Vec<Effect>) {
    let runs = &shared.runs;
    scrolled_ui(ui, "runs", |ui| {
        section_heading_ui(ui, "Runs");
        if runs.workspace.runs.is_empty() {
            dim_ui(ui, "Every finished training is kept here, with its network.");
            ui.add_space(space(2));
            let can_train = !shared.phase.is_busy() && shared.phase != Phase::Died;
            if ui.add_enabled(can_train, ghost_button("Train a network now")).clicked() {
                effects.extend([Effect::ShowTraining, Effect::Train]);
            }
        } else {
            dim_ui(ui, "Choose one as A and one as B to see them side by side.");
        }
        for (position, run) in runs.workspace.runs.iter().enumerate().rev() {
            ui.add_space(space(2));
            ui.separator();
            ui.push_id(run.id, |ui| run_ui(ui, shared, position, run, removing, effects));
        }
        ui.add_space(space(2));
        match &runs.path {
            Some(path) => dim_ui(ui, "Kept from session to session.").on_hover_text(path.display().to_string()),
            None => dim_ui(ui, "Not kept after this session."),
        };
    });
}

fn run_ui(
    ui: &mut Ui,
    shared: &Shared,
    position: usize,
    run: &KeptRun,
    removing: &mut Option<u64>,
    effects: &mut Vec<Effect>,
) {
    let name = &run.name;
    name_ui(ui, position, run, effects);
    dim_ui(ui, &conditions(&run.summary.setup));
    let time = Duration::try_from_secs_f64(run.summary.seconds).unwrap_or_default();
    let text = format!(
        "{} {}, {} on one thread",
        if run.summary.has_nodes { "Z" } else { "Error" },
        format_percent(run.summary.percent),
        format_duration(time)
    );
    ui.label(RichText::new(text).size(type_size().note));
    if *removing == Some(run.id) {
        ui.horizontal(|ui| {
            ui.label("Remove this run?");
            if ui.button("Remove").clicked() {
                effects.push(Effect::RemoveRun(run.id));
                *removing = None;
            }
            if ui.button("Keep").clicked() {
                *removing = None;
            }
        });
        return;
    }
    ui.horizontal(|ui| {
        for (place, letter) in PLACES.into_iter().enumerate() {
            let is_pinned = shared.runs.workspace.pinned[place] == Some(run.id);
            let button = Button::selectable(is_pinned, letter)
                .frame_when_inactive(true)
                .min_size([space(6), space(6)].into());
            let response = ui.add(button);
            response.widget_info(|| WidgetInfo::selected(Role::Button, true, is_pinned, format!("{name} as {letter}")));
            let hint = if is_pinned { "Hide" } else { "Show on this side" };
            if response.on_hover_text(hint).clicked() {
                effects.push(Effect::PinRun(place, (!is_pinned).then_some(run.id)));
            }
        }
        let can_take = !shared.phase.is_busy();
        let take = ui.add_enabled(can_take, Button::new("Settings").min_size([0.0, space(6)].into()));
        take.widget_info(|| WidgetInfo::labeled(Role::Button, can_take, format!("Use the settings of {name}")));
        if take.on_hover_text("Uses its settings for the next training.").clicked() {
            let setup = Box::new(run.summary.setup.clone());
            effects.extend([Effect::TakeSetup(setup), Effect::ShowTraining]);
        }
        let remove = ui.add(Button::new("Remove…").min_size([0.0, space(6)].into()));
        remove.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Remove {name}")));
        if remove.clicked() {
            *removing = Some(run.id);
        }
    });
}

/// Shows the name in an editable field; a change takes effect when the field loses the focus.
fn name_ui(ui: &mut Ui, position: usize, run: &KeptRun, effects: &mut Vec<Effect>) {
    let id = Id::unique(("run name", run.id));
    let typed: Option<String> = ui.data(|data| data.get_temp(id));
    let mut name = typed.clone().unwrap_or_else(|| run.name.clone());
    let edit = ui.add(TextEdit::singleline(&mut name).id(id).desired_width(f32::INFINITY));
    ui.ctx()
        .accesskit_node_builder(edit.id, |node| node.set_label(format!("Name of run {}", position + 1)));
    if edit.changed() {
        ui.data_mut(|data| data.insert_temp(id, name.clone()));
    }
    // This includes a field that lost the focus while another view was displayed.
    if !edit.has_focus() && typed.is_some() {
        ui.data_mut(|data| data.remove::<String>(id));
        if name != run.name {
            effects.push(Effect::RenameRun(run.id, name));
        }
    }
}

/// Returns the settings of the run in one line.
fn conditions(setup: &Setup) -> String {
    let settings = setup.settings();
    let starts = match settings.starts {
        1 => String::new(),
        starts => format!(", {starts} starts"),
    };
    let samples = settings.simulation().map_or(String::new(), |simulation| {
        format!(", {}", counted(simulation.samples, "sample"))
    });
    let mut text = format!(
        "{}, {} hidden, {}{samples}, seed {}{starts}",
        setup.source_name(),
        settings.hidden,
        settings.training.method.short_name(),
        settings.seed
    );
    for words in differences_from_paper(settings) {
        text += &format!(", {words}");
    }
    text
}
