use decoupler_files::{
    export::atomic_write,
    figure::{Figure, SequentialMap},
};
use eframe::egui::{Align, Button, Label, Layout, RichText, Ui, vec2};

use super::{
    Form, Report, StudyView, Topic,
    report::{Look, figure_ui, notes_ui, table_ui},
    speed::limits_ui,
    sweep_folder::FOLDER,
};
use crate::window::{
    shared::{Command, Effect, FileTask, FileWords, Shared, Shown, ViewKind, command_button_ui},
    theme::{semibold, space, type_size},
    widgets::{card_ui, dim_ui, ghost_button, note_ui, primary_button, scrolled_ui, section_heading_ui, segmented_ui},
};

/// Begins the task of the form.
pub(super) const BEGIN: Command = Command::Begin("Begin the study");

/// Cancels the task under way.
pub(super) const CANCEL: Command = Command::Cancel("Cancel the study");

const SPECIFICATION: FileWords = FileWords {
    kind: "specification",
    description: "This sweep for the command decoupler sweep, which trains it, or a part of it, and fills a folder.",
    extensions: &["json"],
};

impl StudyView {
    /// Shows the list of topics, the fields of the topic, and the buttons.
    pub(super) fn fields_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        section_heading_ui(ui, "Study");
        let mut topic = self.topic;
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing = vec2(space(1), space(1));
            for option in Topic::ALL {
                ui.selectable_value(&mut topic, option, option.name());
            }
        });
        if topic != self.topic {
            self.choose(topic);
        }
        dim_ui(ui, topic.words()[1]);
        let is_idle = self.running.is_none();
        let mut form = self.forms[&topic].clone();
        ui.add_enabled_ui(is_idle, |ui| form.fields_ui(ui, &self.train));
        match &self.task {
            Ok(task) => dim_ui(ui, &task.study.size),
            Err(problem) => note_ui(ui, problem),
        };
        ui.add_space(space(2));
        Self::buttons_ui(ui, shared, effects);
        if topic == Topic::Speed {
            let limits = self.limits;
            limits_ui(ui, &mut self.limits);
            if self.limits != limits {
                self.refresh(topic);
            }
        }
        ui.add_space(space(2));
        let usual = Form::new(topic);
        let reset = || Button::new("Reset to the default values");
        if form != usual && ui.add_enabled(is_idle, reset()).clicked() {
            form = usual;
        }
        if form != self.forms[&topic] {
            self.edit(form);
        }
        if topic == Topic::Sweep {
            self.folder_ui(ui, effects);
        }
        ui.add_space(space(4));
    }

    /// Shows the buttons that begin and cancel.
    fn buttons_ui(ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        let half = ((ui.available_width() - space(2)) / 2.0).floor();
        ui.horizontal(|ui| {
            let size = vec2(half, space(7));
            let begin = |ui: &mut Ui| ui.add_sized(size, primary_button("▶ Run"));
            command_button_ui(ui, shared, BEGIN, begin, None, effects);
            let cancel = ghost_button("■ Cancel").min_size(size);
            command_button_ui(ui, shared, CANCEL, cancel, None, effects);
        });
    }

    /// Shows a page of a report: title, conditions and table above, figure and notes below.
    pub(super) fn page_ui(
        &self,
        ui: &mut Ui,
        report: &Report,
        look: &mut Look,
        shared: &Shared,
        effects: &mut Vec<Effect>,
    ) {
        look.page = look.page.min(report.pages.len() - 1);
        if self.is_outdated() {
            ui.multiply_opacity(0.6);
        }
        let page = &report.pages[look.page];
        let whole = ui.available_rect_before_wrap();
        let (has_table, has_notes) = (!page.table.columns.is_empty(), !page.notes.is_empty());
        // The conditions are text of about six points a letter.
        let lines = (6.0 * report.conditions.len() as f32 / whole.width()).ceil();
        let height = match (has_table, page.figure.is_some() || has_notes) {
            (true, true) => {
                (space(6) * (page.rows.len() + 1) as f32 + space(4) * lines + space(19)).min(0.53 * whole.height())
            }
            (false, true) => space(16) + space(4) * lines,
            (_, false) => whole.height(),
        };
        let (upper, lower) = whole.split_top_bottom_at_y(whole.top() + height.round());
        let lower = lower.with_min_y(lower.min.y + space(2));
        let share = match (page.figure.is_some(), has_notes) {
            (true, true) => 0.62,
            (true, false) => 1.0,
            (false, _) => 0.0,
        };
        let (left, right) = lower.split_left_right_at_x(lower.left() + (share * lower.width()).round());
        card_ui(ui, upper, |ui| {
            self.head_ui(ui, report, look, shared, effects);
            dim_ui(ui, &report.conditions);
            if has_table {
                table_ui(ui, page, look);
            }
        });
        if page.figure.is_some() {
            card_ui(ui, left, |ui| figure_ui(ui, page, look, shared.look.colours));
        }
        if has_notes {
            let gap = if share > 0.0 { space(2) } else { 0.0 };
            card_ui(ui, right.with_min_x(right.min.x + gap), |ui| {
                scrolled_ui(ui, "notes", |ui| notes_ui(ui, page));
            });
        }
    }

    /// Shows the title, the choice of the page, and what can be done with the marked item.
    fn head_ui(&self, ui: &mut Ui, report: &Report, look: &mut Look, shared: &Shared, effects: &mut Vec<Effect>) {
        ui.horizontal(|ui| {
            ui.set_min_height(space(7));
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                if self.is_outdated() {
                    dim_ui(ui, "Result of the previous settings: run again.");
                } else if self.study().is_none_or(|study| !study.outcome.parts().2.is_empty()) {
                    self.marked_ui(ui, *look, shared, effects);
                }
                let names = report.pages.iter().map(|page| page.name.as_str()).enumerate();
                let names = Vec::from_iter(names.filter(|(_, name)| !name.is_empty()));
                if !names.is_empty() {
                    let picked = segmented_ui(ui, "Displayed noise level", &names, look.page, false);
                    if let Some(page) = picked {
                        (look.page, look.marked) = (page, None);
                    }
                    dim_ui(ui, "Noise");
                }
                let heading = RichText::new(&report.headline).font(semibold(type_size().title));
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                    ui.add(Label::new(heading).truncate())
                });
            });
        });
    }

    /// Shows the buttons that open the marked item in the Train view, and export its decoder.
    fn marked_ui(&self, ui: &mut Ui, look: Look, shared: &Shared, effects: &mut Vec<Effect>) {
        let why_not = match look.marked {
            Some(_) => "A training is running in the Train view: its settings cannot be changed now",
            None => "Click a row of the table or an item of the figure first",
        };
        let hint = "Shows its settings in the Train view, with the network of its median trial if that was kept.";
        let marked = look.marked.zip(self.study());
        let can_open = marked.is_some() && !shared.phase.is_busy();
        let open = ui.add_enabled(can_open, ghost_button("Open in Train view"));
        let open = open.on_hover_text(hint).on_disabled_hover_text(why_not);
        let Some((item, study)) = marked else { return };
        if let Some(decoder) = study.outcome.decoder(look.page, item)
            && ui.add(ghost_button("Export this decoder…")).clicked()
        {
            effects.push(Effect::Export(Box::new(decoder)));
        }
        if open.clicked() {
            effects.extend(study.outcome.open(look.page, item));
            effects.push(Effect::Do(Command::Show(ViewKind::Train)));
        }
    }

    /// Sweeps on other machines: saves the sweep of the form as a specification, opens a folder that is being filled.
    fn folder_ui(&self, ui: &mut Ui, effects: &mut Vec<Effect>) {
        section_heading_ui(ui, "On many machines");
        dim_ui(
            ui,
            "The command decoupler sweep trains a specification anywhere and fills a folder, which is shown here.",
        );
        ui.horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.y = space(1);
            let save = ui.add_enabled(self.task.is_ok(), ghost_button("Save specification…"));
            if save.on_hover_text(SPECIFICATION.description).clicked()
                && let Form::Experiment(form) = &self.forms[&Topic::Sweep]
            {
                let specification = form.specification(&self.train);
                let task = FileTask::save(SPECIFICATION, "sweep", move |path| {
                    let text = format!("{:#}\n", specification.clone()?);
                    let written = atomic_write(path, |writer| writer.write_all(text.as_bytes()));
                    written.map_err(|error| error.to_string())
                });
                effects.push(Effect::ChooseFile(task));
            }
            let open = ui.add_enabled(self.running.is_none(), ghost_button("Open sweep folder…"));
            let open = open.on_hover_text("Shows the trials of a folder that decoupler sweep fills, as they finish.");
            if open.clicked() {
                let task = FileTask::choose(FOLDER, "", self.folders.0.clone());
                effects.push(Effect::ChooseFile(task));
            }
        });
    }

    /// Returns what the topic shows: the figure and the table of the displayed page, and what is behind them.
    pub(super) fn exports(&self, colours: SequentialMap) -> Vec<Shown<'_>> {
        let stem = self.topic.name().to_lowercase().replace(' ', "_");
        let missing = || "Nothing has finished yet: press Run first.".to_owned();
        let study = self.study().filter(|study| study.outcome.parts().0 > 0);
        let page = study.and_then(|study| study.report.pages.get(self.look.page));
        let figure = page.and_then(|page| page.figure.as_ref()).ok_or_else(missing);
        let figure = figure.map(|figure| {
            move || match figure.clone() {
                Figure::HeatMap(map) => map.coloured(colours).into(),
                figure => figure,
            }
        });
        let table = page.filter(|page| !page.table.columns.is_empty()).ok_or_else(missing);
        let mut shown = vec![
            Shown::figure("Figure", stem.clone(), figure),
            Shown::table("Table", stem.clone(), table.map(|page| || page.table.clone())),
        ];
        let Some(study) = study else { return shown };
        for (name, table) in study.outcome.tables() {
            let stem = format!("{stem}_{}", name.to_lowercase().replace(' ', "_"));
            shown.push(Shown::table(name, stem, Ok(table)));
        }
        shown.into_iter().map(|shown| shown.noting(&study.is_saved)).collect()
    }
}
