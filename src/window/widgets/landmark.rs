use eframe::egui::{Context, Id, Rect, Ui};

/// A place of the window that others point at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Landmark {
    /// The actual surface.
    ActualSurface,
    /// Array scale, hidden nodes and method.
    Choices,
    /// The button that begins a training.
    Train,
    /// The error table.
    Errors,
    /// The button of the Export menu.
    Export,
}

impl Landmark {
    fn id(self) -> Id {
        Id::unique(("landmark", self))
    }

    /// Takes note of where the landmark is drawn in this frame.
    pub fn stands_at(self, ui: &Ui, rect: Rect) {
        let seen = rect.intersect(ui.clip_rect());
        let frame = ui.ctx().cumulative_frame_nr();
        ui.data_mut(|data| data.insert_temp(self.id(), (frame, seen)));
    }

    /// Returns where the landmark is drawn in this frame; `None` if it is not in view.
    pub fn place(self, ctx: &Context) -> Option<Rect> {
        let (frame, rect) = ctx.data(|data| data.get_temp::<(u64, Rect)>(self.id()))?;
        (frame == ctx.cumulative_frame_nr() && rect.is_positive()).then_some(rect)
    }
}
