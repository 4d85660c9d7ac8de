use std::path::PathBuf;

use eframe::egui::{Sense, Ui};

use super::{
    columns_table::columns_ui,
    exports::own_data_exports,
    form::form_ui,
    judging::{decoders_ui, findings_ui},
    report::report_ui,
    results::results_ui,
    runs_table::runs_ui,
    state::{OwnDataView, Tab},
    status::status_ui,
    tools,
};
use crate::app::{
    shared::{Columns, Effect, Export, FileInUse, Look, Matter, Notice, Offers, Phase, Shared, Unfinished, View},
    theme::space,
    widgets::{card_ui, tabs_ui},
};

/// Width of the window from which on the report has a column of its own.
const WIDE: f32 = 1400.0;

impl View for OwnDataView {
    fn name(&self) -> &'static str {
        "Own data"
    }

    fn take_news(&mut self, shared: &Shared, effects: &mut Vec<Effect>) {
        self.take_chosen(effects);
        self.follow_keeping(shared, effects);
        self.follow(effects);
    }

    fn is_working(&self) -> bool {
        self.measuring.is_under_way() || matches!(self.phase, Phase::Preparing | Phase::Training)
    }

    fn unfinished(&self, _shared: &Shared) -> Vec<Unfinished> {
        let measuring = self.measuring.unfinished();
        self.unfinished_work().into_iter().chain(measuring).collect()
    }

    fn take_files(&mut self, paths: &[PathBuf], effects: &mut Vec<Effect>) -> bool {
        if self.phase.is_busy() {
            let text = "End the training of the Own data view before you open other files.";
            effects.push(Effect::Tell(Matter::OwnData, Notice::Failed(text.to_owned())));
        } else {
            self.open(paths.to_vec());
        }
        true
    }

    fn files_in_use(&self) -> Vec<FileInUse> {
        let mut used: Vec<FileInUse> = Vec::new();
        if let Some(draft) = &self.draft {
            let tests = draft.tests().map(|(_, test)| test.to_owned());
            let positions = draft.plan.import.positions.clone();
            let all = draft.paths().into_iter().chain(tests).chain(positions);
            used.extend(all.map(FileInUse::Recording));
        }
        // Its charts, its checkpoint and its decoders are of these.
        if let Some(shown) = &self.shown {
            used.extend(shown.file.plan.files().cloned().map(FileInUse::Recording));
        }
        used.extend(self.checkpoint.clone().map(FileInUse::Checkpoint));
        used.extend(self.keeping.folder.clone().map(FileInUse::Kept));
        used
    }

    fn offer_actions(&mut self, offers: &mut Offers<'_>, _shared: &Shared, effects: &mut Vec<Effect>) {
        tools::offer_actions(self, offers, effects);
    }

    fn columns(&self, window_width: f32) -> Columns {
        Columns {
            form_width: if window_width < WIDE { space(62) } else { space(68) },
            has_report: window_width >= WIDE,
        }
    }

    fn tools_ui(&mut self, ui: &mut Ui, _shared: &Shared, _effects: &mut Vec<Effect>) {
        tools::tools_ui(ui, self);
    }

    fn exports<'a>(&'a self, shared: &'a Shared) -> Vec<Export<'a>> {
        own_data_exports(self, shared.look)
    }

    fn form_ui(&mut self, ui: &mut Ui, _shared: &Shared, effects: &mut Vec<Effect>) {
        form_ui(ui, self, effects);
    }

    fn report_ui(&mut self, ui: &mut Ui, _shared: &Shared, _effects: &mut Vec<Effect>) {
        report_ui(ui, self);
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        let whole = ui.available_rect_before_wrap();
        let mut upper = whole;
        if ui.ctx().content_rect().width() < WIDE {
            let height = (0.42 * whole.height()).floor();
            let (cards, report) = whole.split_top_bottom_at_y(whole.bottom() - height);
            upper = cards.with_max_y(cards.bottom() - space(2));
            card_ui(ui, report, |ui| report_ui(ui, self));
        }
        card_ui(ui, upper, |ui| cards_ui(ui, self, shared.look, effects));
        ui.allocate_rect(whole, Sense::hover());
    }

    fn status_ui(&self, ui: &mut Ui, _shared: &Shared) {
        status_ui(ui, self);
    }
}

/// The card in the middle, with tabs for what it shows.
fn cards_ui(ui: &mut Ui, view: &mut OwnDataView, look: Look, effects: &mut Vec<Effect>) {
    let tabs = [
        (Tab::Columns, "Columns"),
        (Tab::Results, "Results"),
        (Tab::Findings, "Findings"),
        (Tab::Decoders, "Decoders"),
        (Tab::Runs, "Runs"),
    ];
    let shown = view.tab;
    if let Some(picked) = tabs_ui(ui, "Own data", &tabs, shown) {
        view.tab = picked;
        ui.request_repaint();
    }
    ui.add_space(space(1));
    match shown {
        Tab::Columns => columns_ui(ui, view, effects),
        Tab::Results => results_ui(ui, view, look, effects),
        Tab::Findings => findings_ui(ui, view),
        Tab::Decoders => decoders_ui(ui, view),
        Tab::Runs => runs_ui(ui, view),
    }
}
