//! Pictures on their way to the clipboard, drawn in the background, and what a right click copies.

use eframe::egui::{ColorImage, Id, Response, ScrollArea, Ui};

use super::DecouplerWindow;
use crate::{
    app::{
        job::{Job, JobError, Wake},
        shared::{Effect, Export, ExportGroup, Matter, Notice},
        theme::space,
        widgets::{dim_ui, take_claim, take_value_under},
    },
    figure::Figure,
};

type Drawn = Result<(ColorImage, String), String>;

/// The picture on its way to the clipboard; the newest wins.
#[derive(Debug)]
pub(super) struct Copying {
    job: Job<Result<Drawn, JobError>>,
}

impl Copying {
    pub(super) fn new(wake: Wake) -> Self {
        Self {
            job: Job::prompt("clipboard", wake),
        }
    }

    /// Draws the picture; `notice` tells that it is there.
    pub(super) fn start(&mut self, figure: Figure, notice: String) {
        self.job.abandon();
        self.job.start(
            move |_| {
                let (size, pixels) = figure.draw().pixels().map_err(|error| error.to_string())?;
                Ok((ColorImage::from_rgba_unmultiplied(size, &pixels), notice))
            },
            |drawn| drawn,
        );
    }
}

impl DecouplerWindow {
    /// Puts a picture that has been drawn on the clipboard.
    pub(super) fn take_picture(&mut self) {
        while let Some(drawn) = self.copying.job.next_event() {
            match drawn.unwrap_or_else(|error| Err(error.to_string())) {
                Ok((image, notice)) => {
                    self.ctx.copy_image(image);
                    self.notices.tell(Matter::Clipboard, Notice::Done(notice));
                }
                Err(reason) => self
                    .notices
                    .fail(Matter::Clipboard, format!("The picture was not copied: {reason}")),
            }
        }
    }
}

/// The menu at a right click on a part of the window: to copy the value under the pointer, and the pictures and tables of
/// the view on show.
pub(super) fn copy_menu_ui<'a>(part: &Response, exports: impl FnOnce() -> Vec<Export<'a>>, effects: &mut Vec<Effect>) {
    let id = Id::unique("value to copy");
    let is_asked = part.container_secondary_clicked();
    // A field inside the part may have a menu of its own.
    if is_asked && take_claim(&part.ctx) {
        return;
    }
    if is_asked {
        let value = take_value_under(&part.ctx);
        part.ctx.data_mut(|data| data.insert_temp(id, value));
    }
    part.container_context_menu(|ui| menu_ui(ui, id, exports(), effects));
}

fn menu_ui(ui: &mut Ui, id: Id, exports: Vec<Export<'_>>, effects: &mut Vec<Effect>) {
    ui.set_min_width(space(60));
    let mut is_empty = true;
    if let Some(value) = ui.data(|data| data.get_temp::<Option<String>>(id)).flatten() {
        is_empty = false;
        let shown = value.lines().next().unwrap_or_default();
        if ui.button(format!("Copy “{shown}”")).clicked() {
            let notice = format!("Copied {shown}");
            effects.push(Effect::Copy { text: value, notice });
            ui.close();
        }
        ui.separator();
    }
    ScrollArea::vertical().max_height(space(100)).show(ui, |ui| {
        for export in exports {
            let is_meant = export.is_copy() || export.group == ExportGroup::Figures;
            let label = export.label();
            let Some(ask) = export.ask.ok().filter(|_| is_meant) else {
                continue;
            };
            is_empty = false;
            let text = if label.starts_with("Copy") {
                label
            } else {
                format!("{label}…")
            };
            if ui.button(text).on_hover_text(export.description).clicked() {
                effects.push(ask());
                ui.close();
            }
        }
    });
    if is_empty {
        dim_ui(ui, "There is nothing to copy here yet.");
    }
}
