use eframe::egui::{
    Align, Area, Context, Frame, Id, Layout, Margin, Order, Pos2, Rect, RichText, Stroke, StrokeKind, Ui, Vec2,
    WidgetInfo, accesskit::Role, pos2, vec2,
};

use crate::window::{
    shared::Action,
    theme::{Theme, radius, semibold, space, type_size},
    widgets::{Landmark, dim_ui, ghost_button, primary_button},
};

/// A step of the tour.
struct Step {
    title: &'static str,
    text: &'static str,
    /// Its subject, which is outlined.
    landmark: Landmark,
    /// Name of the action that a button does.
    action: Option<&'static str>,
}

const STEPS: [Step; 5] = [
    Step {
        title: "Press the sensor",
        text: "Drag on the surface with the mouse: a ball presses it, and the wheel sets its depth. The readings follow, \
               and a small network on the right decodes the touch from them.",
        landmark: Landmark::ActualSurface,
        action: Some("Press the middle of the surface"),
    },
    Step {
        title: "Choose an array and a network",
        text: "Array scale, hidden nodes and method define a training. Everything else is folded below and has default \
               values. Rest the pointer on a term to read what it means.",
        landmark: Landmark::Choices,
        action: None,
    },
    Step {
        title: "Train",
        text: "Train draws the samples and fits the network in the background, in a few seconds. The slider under the \
               loss curves then brings back the network of any epoch.",
        landmark: Landmark::Train,
        action: Some("Train"),
    },
    Step {
        title: "Read the errors",
        text: "A network is worth its training if it beats the training mean and the linear map. Where it does not, a \
               mark in the table says so, and a note suggests a remedy.",
        landmark: Landmark::Errors,
        action: None,
    },
    Step {
        title: "Take the network with you",
        text: "Export saves it as ONNX, C99, MATLAB or NumPy, with golden readings and answers for a test of your \
               network before you get it.",
        landmark: Landmark::Export,
        action: None,
    },
];

/// Width of the card, in points.
const WIDTH: f32 = space(85);

/// The tour, at one of its steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tour {
    step: usize,
}

/// Answer of the user to a step.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Reply {
    /// Show this step.
    Show(Tour),
    /// Do the action of this name.
    Do(&'static str),
    /// End the tour.
    End,
}

/// Shows the card of the step next to its subject, which is outlined; nothing while the subject is out of view.
pub(super) fn tour_ui(ui: &Ui, tour: Tour, actions: &[Action]) -> Option<Reply> {
    let step = STEPS.get(tour.step)?;
    let place = step.landmark.place(ui.ctx())?;
    let palette = Theme::of(ui).palette;
    let id = Id::unique("tour");
    let size = size_of(ui.ctx(), id);
    let at = corner_near(place, size, ui.ctx().content_rect());
    let mut reply = None;
    let card = Area::new(id).order(Order::Foreground).fixed_pos(at).constrain(true);
    let card = card.show(ui.ctx(), |ui| {
        // Around the subject, not within the card.
        let ring = Stroke::new(2.0, palette.accent);
        let painter = ui.painter().with_clip_rect(ui.ctx().content_rect());
        painter.rect_stroke(place.expand(2.0), f32::from(radius()), ring, StrokeKind::Inside);
        let frame = Frame::popup(ui.style()).inner_margin(Margin::same(12));
        frame.stroke(Stroke::new(1.0, palette.accent)).show(ui, |ui| {
            ui.set_width(WIDTH);
            reply = step_ui(ui, tour, step, actions);
        });
    });
    let label = format!("Tour, step {} of {}: {}", tour.step + 1, STEPS.len(), step.title);
    ui.ctx().accesskit_node_builder(card.response.id, |node| {
        node.set_role(Role::Dialog);
        node.set_label(label);
    });
    let drawn = card.response.rect.size();
    if drawn != size {
        ui.ctx().data_mut(|data| data.insert_temp(id, drawn));
        ui.ctx().request_repaint();
    }
    reply
}

fn step_ui(ui: &mut Ui, tour: Tour, step: &Step, actions: &[Action]) -> Option<Reply> {
    let mut reply = None;
    ui.horizontal(|ui| {
        ui.label(RichText::new(step.title).font(semibold(type_size().title)));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            dim_ui(ui, &format!("{} of {}", tour.step + 1, STEPS.len()));
        });
    });
    ui.add_space(space(1));
    ui.label(step.text);
    ui.add_space(space(3));
    ui.horizontal(|ui| {
        let skip = ui.add(ghost_button("Skip").frame_when_inactive(false));
        skip.widget_info(|| WidgetInfo::labeled(Role::Button, true, "Skip the tour"));
        if skip
            .on_hover_text("The list of keys (?) offers the tour again.")
            .clicked()
        {
            reply = Some(Reply::End);
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let is_last = tour.step + 1 == STEPS.len();
            if ui.add(primary_button(if is_last { "Done" } else { "Next" })).clicked() {
                let next = Tour { step: tour.step + 1 };
                reply = Some(if is_last { Reply::End } else { Reply::Show(next) });
            }
            if let Some(step) = tour.step.checked_sub(1)
                && ui.add(ghost_button("Back")).clicked()
            {
                reply = Some(Reply::Show(Tour { step }));
            }
            if let Some(name) = step.action {
                let is_possible = actions.iter().any(|action| action.name == name && action.is_possible);
                let button = ui.add_enabled(is_possible, ghost_button("Do it"));
                button.widget_info(|| WidgetInfo::labeled(Role::Button, is_possible, format!("Do it: {name}")));
                if button.on_hover_text(format!("{name}.")).clicked() {
                    reply = Some(Reply::Do(name));
                }
            }
        });
    });
    reply
}

/// Returns the size of the card when last drawn, or an estimate before that.
fn size_of(ctx: &Context, id: Id) -> Vec2 {
    let known = ctx.data(|data| data.get_temp(id));
    known.unwrap_or(vec2(WIDTH + space(6), space(40)))
}

/// Returns the corner of a card of this size below, next to or above `place`: the first position in the window that does
/// not cover it.
fn corner_near(place: Rect, size: Vec2, window: Rect) -> Pos2 {
    const GAP: f32 = space(3);
    let window = window.shrink(space(1));
    let within = |at: Pos2| {
        pos2(
            at.x.clamp(window.left(), (window.right() - size.x).max(window.left())),
            at.y.clamp(window.top(), (window.bottom() - size.y).max(window.top())),
        )
    };
    let middle = place.center() - 0.5 * size;
    let corners = [
        pos2(middle.x, place.bottom() + GAP),
        pos2(place.right() + GAP, middle.y),
        pos2(place.left() - GAP - size.x, middle.y),
        pos2(middle.x, place.top() - GAP - size.y),
    ];
    let corners = corners.map(within);
    let is_clear = |at: &Pos2| !Rect::from_min_size(*at, size).intersects(place);
    corners.into_iter().find(is_clear).unwrap_or(corners[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_card_does_not_cover_its_subject() {
        let window = Rect::from_min_size(Pos2::ZERO, vec2(1024.0, 700.0));
        let size = vec2(364.0, 160.0);
        let places = [
            Rect::from_min_size(pos2(256.0, 60.0), vec2(350.0, 330.0)),
            Rect::from_min_size(pos2(8.0, 60.0), vec2(240.0, 260.0)),
            Rect::from_min_size(pos2(700.0, 8.0), vec2(70.0, 28.0)),
            Rect::from_min_size(pos2(620.0, 430.0), vec2(390.0, 230.0)),
            Rect::from_min_size(pos2(0.0, 0.0), vec2(600.0, 690.0)),
        ];
        for place in places {
            let card = Rect::from_min_size(corner_near(place, size, window), size);
            assert!(!card.intersects(place) && window.contains_rect(card), "{place}: {card}");
        }
        // There is no room anywhere: the card stays in the window.
        assert!(window.contains_rect(Rect::from_min_size(corner_near(window, size, window), size)));
    }
}
