use eframe::egui::{Id, Pos2, Rect, RichText, Ui, UiBuilder, Vec2};
use egui_plot::{PlotPoint as Place, PlotTransform};

use super::{legend_ui, legend_width, plot::plot_ui};
use crate::window::{
    theme::{semibold, space, type_size},
    widgets::dim_ui,
};
use decoupler_files::figure::{Key, Plot, PlotFigure};

/// Response of a plot to the pointer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pointer {
    /// It moves and zooms, and shows the words of the point under it.
    Moves,
    /// The marks on the plot respond to it.
    Picks,
}

/// A plot as it is on the screen.
pub struct DrawnPlot<'a> {
    /// Plot that is drawn.
    pub plot: &'a Plot,
    /// True while the pointer is over it.
    pub has_pointer: bool,
    /// Meaning of the point or bar under the pointer.
    pub hovered: Option<usize>,
    /// Meaning of a point or bar that was just clicked.
    pub clicked: Option<usize>,
    transform: PlotTransform,
}

impl DrawnPlot<'_> {
    /// Position of a point on the screen; `None` if an axis has no place for it.
    pub fn position(&self, x: f64, y: f64) -> Option<Pos2> {
        let [x, y] = self.plot.place(x, y)?;
        Some(self.transform.position_from_point(&Place::new(x, y)))
    }

    /// Meaning of a point of the screen: the bar over it, or the nearest point in reach.
    fn item_at(&self, at: Pos2) -> Option<usize> {
        /// Distance within which the pointer is at a point.
        const REACH: f32 = 12.0;
        let value = self.transform.value_from_position(at);
        let mut nearest: Option<(f32, usize)> = None;
        for series in &self.plot.series {
            for (point, [x, y]) in self.plot.placed(series) {
                let Some(item) = point.item else { continue };
                let distance = match series.bar_width {
                    // However low the bar, it is meant anywhere above its foot.
                    Some(width) if (x - value.x).abs() <= 0.5 * width => 0.0,
                    Some(_) => continue,
                    None => self.transform.position_from_point(&Place::new(x, y)).distance(at),
                };
                if distance <= REACH && nearest.is_none_or(|(least, _)| distance < least) {
                    nearest = Some((distance, item));
                }
            }
        }
        nearest.map(|(_, item)| item)
    }
}

/// A title, the legend behind it or below where there is no room, and the plots.
pub fn titled_plots_ui(ui: &mut Ui, title: &str, figure: &PlotFigure) {
    let has_room = ui.horizontal(|ui| {
        ui.label(RichText::new(title).font(semibold(type_size().title)));
        legend_behind_ui(ui, &figure.keys)
    });
    if !has_room.inner {
        legend_ui(ui, &figure.keys);
    }
    plots_ui(ui, title, figure, Pointer::Moves);
}

/// The legend at the right end of a row, if there is room for it; returns whether there is.
pub fn legend_behind_ui(ui: &mut Ui, keys: &[Key]) -> bool {
    let spare = ui.available_width() - ui.spacing().item_spacing.x - legend_width(ui, keys);
    let has_room = spare >= space(3);
    if has_room {
        ui.add_space(spare);
        legend_ui(ui, keys);
    }
    has_room
}

/// Least width of the notes next to a square plot.
const NOTES_WIDTH: f32 = space(36);

/// The plots side by side over the space that is left, and the notes: next to a square plot that leaves room for them, else
/// above.
pub fn plots_ui<'a>(ui: &mut Ui, id: &str, figure: &'a PlotFigure, pointer: Pointer) -> Vec<DrawnPlot<'a>> {
    let is_square = matches!(&figure.plots[..], [plot] if plot.has_equal_scales);
    let left_by_square = ui.available_width() - ui.available_height() - 2.0 * space(3);
    let are_notes_beside = is_square && left_by_square >= NOTES_WIDTH;
    if !are_notes_beside {
        notes_ui(ui, figure);
    }
    let whole = ui.available_rect_before_wrap();
    let count = figure.plots.len().max(1) as f32;
    let width = (whole.width() - (count - 1.0) * space(3)) / count;
    // Square except for the numbers next to the axes.
    let width = if is_square {
        width.min(whole.height() + space(3))
    } else {
        width
    };
    let slot = |index: usize| {
        let left = whole.left() + (width + space(3)) * index as f32;
        Rect::from_min_size([left, whole.top()].into(), Vec2::new(width, whole.height()))
    };
    let plots = figure.plots.iter().enumerate().map(|(index, plot)| {
        let mut slot = ui.new_child(UiBuilder::new().max_rect(slot(index)));
        let (transform, response) = plot_ui(&mut slot, Id::unique((id, index)), plot, pointer);
        let mut drawn = DrawnPlot {
            plot,
            has_pointer: response.contains_pointer(),
            hovered: None,
            clicked: None,
            transform,
        };
        drawn.hovered = response.hover_pos().and_then(|at| drawn.item_at(at));
        drawn.clicked = drawn.hovered.filter(|_| response.clicked());
        drawn
    });
    let plots = plots.collect();
    if are_notes_beside {
        let beside = whole.with_min_x(slot(1).left()).with_min_y(whole.top() + space(4));
        notes_ui(&mut ui.new_child(UiBuilder::new().max_rect(beside)), figure);
    }
    ui.allocate_rect(whole, eframe::egui::Sense::hover());
    plots
}

fn notes_ui(ui: &mut Ui, figure: &PlotFigure) {
    for note in &figure.notes {
        dim_ui(ui, note);
    }
}
