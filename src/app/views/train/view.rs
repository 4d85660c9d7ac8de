use eframe::egui::{Context, Key, Modifiers, Ui};

use super::{
    TrainView,
    configuration::configuration_ui,
    report,
    run_buttons::run_buttons_ui,
    workbench::{WorkbenchLayout, workbench_ui},
};
use crate::app::{
    shared::{Columns, Effect, Phase, Shared, View},
    theme::space,
    widgets::{pressed, snapshot_ui},
};

impl View for TrainView {
    fn name(&self) -> &'static str {
        "Train"
    }

    fn take_news(&mut self, shared: &Shared, _effects: &mut Vec<Effect>) {
        self.measuring.follow(shared, &mut self.decoders);
    }

    fn take_shortcuts(&mut self, ctx: &Context, shared: &Shared, effects: &mut Vec<Effect>) {
        let phase = shared.phase;
        if pressed(ctx, Modifiers::COMMAND, Key::Enter) && !phase.is_busy() && phase != Phase::Died {
            effects.push(Effect::Train);
        }
        if pressed(ctx, Modifiers::COMMAND, Key::P) {
            match phase {
                Phase::Training => effects.push(Effect::Pause),
                Phase::Paused => effects.push(Effect::Resume),
                _ => {}
            }
        }
        if pressed(ctx, Modifiers::COMMAND, Key::Period) && phase.is_busy() {
            effects.push(Effect::Stop);
        }
        let snapshots = shared.test().map_or(0, |test| test.snapshots.len());
        if pressed(ctx, Modifiers::NONE, Key::PageDown) && self.snapshot + 1 < snapshots {
            self.show_snapshot(self.snapshot + 1);
        }
        if pressed(ctx, Modifiers::NONE, Key::PageUp) && self.snapshot > 0 {
            self.show_snapshot(self.snapshot - 1);
        }
        // Before anything is drawn, so that all of the window shows what the finger does in the same frame.
        let frames = self.frames().clone();
        self.press.take_pointer(ctx, shared.test(), &frames, self.node);
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
        workbench_ui(ui, self, shared, effects);
    }
}
