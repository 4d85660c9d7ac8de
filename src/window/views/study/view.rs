use decoupler_core::text::counted;
use decoupler_files::{
    export::{atomic_write, format_duration, sweep_specification},
    figure::{Figure, SequentialMap},
};
use eframe::egui::{Button, Key, Modifiers, Sense, Ui, vec2};

use super::{
    Form, Outcome, StudyView, Task, Topic,
    report::{Invitation, Wish, report_ui},
    speed::limits_ui,
};
use crate::window::{
    shared::{
        Ask, Contents, Effect, Export, ExportGroup, FileTask, FileWords, Offers, Shared, Unfinished, View, copy_exports,
        csv_export, decoder_export_ui, picture_exports,
    },
    theme::{Theme, space},
    widgets::{
        card_ui, dim_ui, ghost_button, note_ui, primary_button, progress_bar_ui, scrolled_ui, section_heading_ui,
        state_ui, with_shortcut,
    },
};

impl View for StudyView {
    fn name(&self) -> &'static str {
        "Study"
    }

    fn take_events(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        let others_compute = shared.working.iter().any(|name| *name != self.name());
        self.follow(shared, others_compute, effects);
    }

    fn is_working(&self) -> bool {
        self.running.is_some()
    }

    fn unfinished(&self, _shared: &Shared) -> Vec<Unfinished> {
        self.to_be_discarded()
    }

    fn offer_actions(&mut self, offers: &mut Offers<'_>, _shared: &Shared, effects: &mut Vec<Effect>) {
        let (can_begin, can_cancel) = (self.can_begin(), self.running.is_some());
        if offers.offer_keys("Begin study", Modifiers::COMMAND, Key::Enter, can_begin) {
            self.begin(effects);
        }
        if offers.offer_keys("Cancel study", Modifiers::COMMAND, Key::Period, can_cancel) {
            self.cancel();
        }
    }

    fn exports<'a>(&'a self, shared: &'a Shared) -> Vec<Export<'a>> {
        study_exports(self, shared.look.colours)
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        scrolled_ui(ui, "study form", |ui| form_ui(ui, self, shared, effects));
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        let wish = body_ui(ui, self, shared, effects);
        match wish {
            Some(Wish::Open(item)) => self.open(item, shared, effects),
            Some(Wish::Begin) => self.begin(effects),
            None => {}
        }
    }

    fn status_ui(&self, ui: &mut Ui, _shared: &Shared) {
        let palette = Theme::of(ui).palette;
        let folder = self.folder.shown.as_ref().filter(|_| self.topic == Topic::Sweep);
        let folder = folder.and_then(|folder| Some((folder, folder.pages.first()?)));
        let (colour, text) = match (self.progress(), folder, self.ending()) {
            (Some((_, text)), ..) => (palette.accent, text),
            (_, Some((folder, page)), _) => {
                let trials = counted(page.rows.len(), "trial");
                (palette.good, format!("{}: {trials} finished", folder.headline))
            }
            (.., Some((true, text))) => (palette.good, text),
            (.., Some((false, text))) => (palette.warning, text),
            _ => (palette.dim, format!("Ready: press {}", self.topic.words().verb)),
        };
        ui.horizontal_centered(|ui| state_ui(ui, colour, &text));
    }
}

/// Shows the list of topics, the fields of the topic, and the buttons.
fn form_ui(ui: &mut Ui, view: &mut StudyView, shared: &Shared, effects: &mut Vec<Effect>) {
    section_heading_ui(ui, "Study");
    let mut chosen = view.topic;
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing = vec2(space(1), space(1));
        for topic in Topic::ALL {
            ui.selectable_value(&mut chosen, topic, topic.words().name);
        }
    });
    if chosen != view.topic {
        view.choose(chosen, shared);
    }
    let topic = view.topic;
    dim_ui(ui, topic.words().meaning);
    let is_idle = view.running.is_none();
    let before = view.forms[&topic].clone();
    let mut form = before.clone();
    if let Some(train) = &view.train {
        ui.add_enabled_ui(is_idle, |ui| form.fields_ui(ui, &train.setup));
    }
    match &view.checked {
        Ok(task) => drop(dim_ui(ui, &task.size())),
        Err(problem) => drop(note_ui(ui, problem)),
    }
    ui.add_space(space(2));
    buttons_ui(ui, view, effects);
    if topic == Topic::Speed {
        let limits = view.limits;
        limits_ui(ui, &mut view.limits);
        if view.limits != limits {
            view.refresh(topic);
        }
    }
    let usual = Form::new(topic);
    if form != Form::Readings {
        ui.add_space(space(2));
        let text = match topic {
            Topic::Table(_) => "Reset to the paper's values",
            _ => "Reset to the default values",
        };
        if ui.add_enabled(is_idle && form != usual, Button::new(text)).clicked() {
            form = usual;
        }
    }
    if form != before {
        view.forms.insert(topic, form);
        view.check(shared);
    }
    if topic == Topic::Sweep {
        folder_ui(ui, view, effects);
    }
    ui.add_space(space(4));
}

/// Shows the buttons that begin and cancel, and the progress.
fn buttons_ui(ui: &mut Ui, view: &mut StudyView, effects: &mut Vec<Effect>) {
    let half = ((ui.available_width() - space(2)) / 2.0).floor();
    ui.horizontal(|ui| {
        let size = vec2(half, space(7));
        let begin = primary_button(format!("▶ {}", view.topic.words().verb)).min_size(size);
        let begin = ui.add_enabled(view.can_begin(), begin);
        let why_not = match &view.running {
            Some(running) => format!("{} is under way", running.topic.words().name),
            None => "The note above says what to change".to_owned(),
        };
        let hint = with_shortcut(ui, "Begins in the background", Key::Enter);
        if begin.on_hover_text(hint).on_disabled_hover_text(why_not).clicked() {
            view.begin(effects);
        }
        let cancel = ui.add_enabled(view.running.is_some(), ghost_button("■ Cancel").min_size(size));
        let hint = with_shortcut(ui, "Ends the work; what has finished is kept", Key::Period);
        if cancel.on_hover_text(hint).clicked() {
            view.cancel();
        }
    });
    let Some((share, text)) = view.progress() else { return };
    ui.add_space(space(1));
    progress_bar_ui(ui, "Study", share, &text);
    let left = view.running.as_ref().and_then(|running| running.time_left);
    if let Some(left) = left {
        dim_ui(ui, &format!("about {} left", format_duration(left)));
    }
    if view.is_waiting() {
        let text = "Waiting: a training or other work is under way and would distort the times.";
        note_ui(ui, text);
    }
}

/// Shows the report, or an invitation to begin.
fn body_ui(ui: &mut Ui, view: &mut StudyView, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Wish> {
    let words = view.topic.words();
    let button = format!("{} now", words.verb);
    let text = match &view.checked {
        _ if view.running.is_some() => "The results appear here when the work has finished.",
        Err(problem) => problem.as_str(),
        Ok(_) => words.invitation,
    };
    let invitation = Invitation {
        text,
        button: &button,
        is_possible: view.can_begin(),
    };
    let Some(report) = view.shown() else {
        let whole = ui.available_rect_before_wrap();
        let mut wish = None;
        card_ui(ui, whole, |ui| wish = invitation.ui(ui));
        ui.allocate_rect(whole, Sense::hover());
        return wish;
    };
    let is_folder = view.topic == Topic::Sweep && view.folder.shown.is_some();
    let has_begun = is_folder || view.studies.contains_key(&view.topic);
    let (mut look, mut is_closed, mut wish) = (view.look, false, None);
    let tools_ui = |ui: &mut Ui| {
        if is_folder {
            is_closed = ui.add(ghost_button("Close folder")).clicked();
            return;
        }
        wish = tools_ui(ui, view, shared, effects);
        if view.is_outdated() {
            dim_ui(ui, "The recording or the settings have changed since: begin again.");
        }
    };
    let invitation = (!has_begun).then_some(invitation);
    let asked = report_ui(ui, report, &mut look, shared.look.colours, invitation, tools_ui);
    view.look = look;
    if is_closed {
        view.folder.close();
    }
    asked.or(wish)
}

/// Shows the buttons that open the marked item in the Train view, and export the decoder of a marked point.
fn tools_ui(ui: &mut Ui, view: &StudyView, shared: &Shared, effects: &mut Vec<Effect>) -> Option<Wish> {
    if view.topic.is_of_recordings() {
        return None;
    }
    let marked = view.look.marked;
    let can_open = marked.is_some() && !shared.phase.is_busy();
    let why_not = match marked {
        Some(_) => "A training is running in the Train view: its settings cannot be changed now",
        None => "Click a row of the table or an item of the figure first",
    };
    let hint = "Shows the settings of the marked item in the Train view, with the network of its median trial if it was kept.";
    let open = ui.add_enabled(can_open, ghost_button("Open in Train view"));
    let open = open.on_hover_text(hint).on_disabled_hover_text(why_not);
    if let Some((kind, source)) = view.marked_decoder() {
        let task = decoder_export_ui(ui, ghost_button("Export this decoder…"), kind, &source);
        effects.extend(task.map(Effect::ChooseFile));
    }
    marked.filter(|_| open.clicked()).map(Wish::Open)
}

const SPECIFICATION: FileWords = FileWords {
    kind: "specification",
    description: "This sweep for the terminal, on one machine or many: decoupler sweep trains it, or a part of it, and \
                  fills a folder.",
    extensions: &["json"],
};

/// Sweeps on other machines: saves the sweep of the form as a specification, opens a folder that is being filled.
fn folder_ui(ui: &mut Ui, view: &StudyView, effects: &mut Vec<Effect>) {
    section_heading_ui(ui, "On many machines");
    let text = "The command decoupler sweep trains a specification on any number of machines and fills a folder, which is \
                shown here.";
    dim_ui(ui, text);
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().item_spacing.y = space(1);
        let save = ui.add_enabled(view.checked.is_ok(), ghost_button("Save specification…"));
        let save = save.on_hover_text(SPECIFICATION.description);
        if let (true, Ok(Task::Experiment(experiment, setup))) = (save.clicked(), &view.checked) {
            let specification = sweep_specification(experiment, setup.plan()).map_err(|gap| gap.to_string());
            let contents = Contents::new(move |path| {
                let specification = specification.clone()?;
                let written = atomic_write(path, |writer| {
                    serde_json::to_writer_pretty(&mut *writer, &specification)?;
                    writeln!(writer)
                });
                written.map_err(|error| error.to_string())
            });
            effects.push(Effect::ChooseFile(FileTask::save(SPECIFICATION, "sweep", contents)));
        }
        let open = ui.add(ghost_button("Open sweep folder…"));
        let open = open.on_hover_text("Shows the trials of a folder that decoupler sweep fills, as they finish.");
        if open.clicked() {
            effects.push(Effect::ChooseFile(view.folder.choose()));
        }
    });
}

const MARKDOWN: FileWords = FileWords {
    kind: "table",
    description: "The table as shown with the settings behind it, as Markdown.",
    extensions: &["md"],
};

fn csv_words(description: &'static str) -> FileWords {
    FileWords {
        kind: "table",
        description,
        extensions: &["csv"],
    }
}

/// Returns the exports of the topic: the figure and the table of the displayed page, and what is behind them.
fn study_exports(view: &StudyView, colours: SequentialMap) -> Vec<Export<'_>> {
    let words = view.topic.words();
    let stem = words.name.to_lowercase().replace(' ', "_");
    let study = view.studies.get(&view.topic).filter(|study| study.outcome.has_results());
    let study = study.ok_or_else(|| format!("Nothing has finished yet: press {} first.", words.verb));
    let page = study.clone().and_then(|study| study.report.pages.get(view.look.page).ok_or_else(String::new));
    let mut exports = Vec::new();
    if !view.topic.is_of_recordings() {
        let figure = page.clone().and_then(|page| page.figure.as_ref().ok_or_else(String::new));
        let figure = figure.map(|figure| {
            move || match figure.clone() {
                Figure::HeatMap(map) => map.coloured(colours).into(),
                figure => figure,
            }
        });
        exports.extend(picture_exports("Figure", stem.clone(), figure));
    }
    let table = page.map(|page| || page.table.clone());
    let words = csv_words("The table as shown, with every digit, as CSV.");
    exports.push(csv_export("Table", words, stem.clone(), table.clone()));
    for &(name, description, table) in view.topic.tables() {
        let table = study.clone().map(|study| move || table(&study.outcome));
        let stem = format!("{stem}_{}", name.to_lowercase().replace(' ', "_"));
        exports.push(csv_export(name, csv_words(description), stem, table));
    }
    if matches!(view.topic, Topic::Table(_) | Topic::Sweep) {
        exports.push(Export {
            group: ExportGroup::Tables,
            name: "Table with settings".to_owned(),
            form: "Markdown".to_owned(),
            description: MARKDOWN.description,
            ask: study.clone().map(|study| -> Ask<'_> {
                Box::new(move || {
                    let text = match &study.outcome {
                        Outcome::Experiment(outcome) => outcome.markdown(&study.report.headline),
                        _ => Vec::new(),
                    };
                    let contents = Contents::new(move |path| atomic_write(path, |writer| writer.write_all(&text)));
                    Effect::ChooseFile(FileTask::save(MARKDOWN, &stem, contents))
                })
            }),
        });
    }
    exports.extend(copy_exports("Table", table));
    match study {
        Ok(study) => exports.into_iter().map(|export| export.noting(&study.is_saved)).collect(),
        Err(_) => exports,
    }
}
