use eframe::egui::{Context, Key, Modifiers, Ui};

use super::{
    TrainView,
    configuration::configuration_ui,
    exports::train_exports,
    report,
    run_buttons::run_buttons_ui,
    workbench::{WorkbenchLayout, workbench_ui},
};
use crate::app::{
    shared::{Columns, Effect, Export, Offers, Phase, Shared, View},
    theme::space,
    widgets::snapshot_ui,
};

impl View for TrainView {
    fn name(&self) -> &'static str {
        "Train"
    }

    fn take_news(&mut self, shared: &Shared, _effects: &mut Vec<Effect>) {
        self.measuring.follow(shared, &mut self.decoders);
    }

    fn offer_actions(&mut self, offers: &mut Offers<'_>, shared: &Shared, effects: &mut Vec<Effect>) {
        let phase = shared.phase;
        let is_idle = !phase.is_busy() && phase != Phase::Died;
        if offers.offer_keys("Train", Modifiers::COMMAND, Key::Enter, is_idle) {
            effects.push(Effect::Train);
        }
        if offers.offer("Continue training", shared.can_continue()) {
            effects.push(Effect::Continue);
        }
        let (name, effect) = if phase == Phase::Paused {
            ("Resume training", Effect::Resume)
        } else {
            ("Pause training", Effect::Pause)
        };
        let can_pause = matches!(phase, Phase::Training | Phase::Paused);
        if offers.offer_keys(name, Modifiers::COMMAND, Key::P, can_pause) {
            effects.push(effect);
        }
        if offers.offer_keys("Stop training", Modifiers::COMMAND, Key::Period, phase.is_busy()) {
            effects.push(Effect::Stop);
        }
        if offers.offer("Press the middle of the surface", shared.test().is_some())
            && let Some(test) = shared.test()
        {
            self.press.press_middle(test);
        }
        let snapshots = shared.test().map_or(0, |test| test.snapshots.len());
        let has_next = self.snapshot + 1 < snapshots;
        if offers.offer_keys("Next test snapshot", Modifiers::NONE, Key::PageDown, has_next) {
            self.show_snapshot(self.snapshot + 1);
        }
        if offers.offer_keys(
            "Previous test snapshot",
            Modifiers::NONE,
            Key::PageUp,
            self.snapshot > 0,
        ) {
            self.show_snapshot(self.snapshot - 1);
        }
        self.offer_charts(offers, shared);
    }

    fn take_pointer(&mut self, ctx: &Context, shared: &Shared) {
        let frames = self.frames().clone();
        self.press.take_pointer(ctx, shared.test(), &frames, self.lights.node);
        self.follow(shared);
    }

    fn columns(&self, window_width: f32) -> Columns {
        let has_report = WorkbenchLayout::of_width(window_width) == WorkbenchLayout::ReportBeside;
        Columns {
            form_width: if has_report { space(68) } else { space(62) },
            has_report,
        }
    }

    fn tools_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        run_buttons_ui(ui, shared, effects);
        ui.add_space(space(4));
        let snapshots = shared.test().map_or(0, |test| test.snapshots.len());
        if let Some(snapshot) = snapshot_ui(ui, self.snapshot, snapshots) {
            self.show_snapshot(snapshot);
        }
    }

    fn exports<'a>(&'a self, shared: &'a Shared) -> Vec<Export<'a>> {
        train_exports(self, shared)
    }

    fn form_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        if let Some(figure) = configuration_ui(ui, shared, effects) {
            self.show_paper_figure(figure, shared, effects);
        }
    }

    fn report_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        self.follow(shared);
        report::report_ui(ui, self, shared, effects);
    }

    fn body_ui(&mut self, ui: &mut Ui, shared: &Shared, effects: &mut Vec<Effect>) {
        self.follow(shared);
        if self.watched != self.snapshot {
            self.watched = self.snapshot;
            effects.push(Effect::Watch(self.snapshot));
        }
        workbench_ui(ui, self, shared, effects);
    }
}
