//! Components that egui lacks, each accessible by its label, and the reason why text typed into a field was refused.

use eframe::egui::{
    Align, Button, CollapsingHeader, Color32, DragValue, Frame, Id, Key, Label, Layout, Margin, ProgressBar, Rect,
    Response, RichText, ScrollArea, Stroke, StrokeKind, TextStyle, Ui, UiBuilder, Vec2, Widget, WidgetInfo, WidgetText,
    accesskit::{Invalid, Role},
    vec2,
};

use crate::window::theme::{Theme, radius, semibold, space, type_size};

/// Heading of a section, in small capitals: "SENSOR ARRAY".
pub fn section_heading_ui(ui: &mut Ui, text: &str) -> Response {
    ui.add_space(space(2));
    let text = RichText::new(text.to_uppercase())
        .font(semibold(type_size().small))
        .extra_letter_spacing(0.6);
    let response = Label::new(text.color(Theme::of(ui).palette.dim))
        .selectable(false)
        .ui(ui);
    ui.add_space(space(1));
    response
}

/// Shows contents that scroll vertically if they are higher than the available space; the scroll bar does not cover them.
pub fn scrolled_ui(ui: &mut Ui, id: &str, contents: impl FnOnce(&mut Ui)) {
    let strip = Margin {
        right: 10,
        ..Margin::ZERO
    };
    ScrollArea::vertical().id_salt(id).auto_shrink(false).show(ui, |ui| {
        Frame::new().inner_margin(strip).show(ui, |ui| {
            contents(ui);
            follow_focus(ui);
        });
    });
}

/// Scrolls a widget that has just received the focus into view.
fn follow_focus(ui: &Ui) {
    let focused = ui.memory(|memory| memory.focused());
    let response = focused.and_then(|id| ui.ctx().read_response(id));
    if let Some(response) = response.filter(Response::gained_focus)
        && response.layer_id == ui.layer_id()
        && ui.min_rect().contains_rect(response.rect)
    {
        ui.scroll_to_rect(response.rect, None);
    }
}

/// Shows a card that fills `rect`.
pub fn card_ui(ui: &mut Ui, rect: Rect, contents: impl FnOnce(&mut Ui)) {
    let mut card = ui.new_child(UiBuilder::new().max_rect(rect).layout(Layout::top_down(Align::Min)));
    card.set_clip_rect(rect.intersect(ui.clip_rect()));
    let frame = Frame::new()
        .fill(Theme::of(ui).palette.panel)
        .corner_radius(radius())
        .inner_margin(Margin::same(12));
    frame.show(&mut card, |ui| {
        ui.set_min_size(ui.available_size());
        contents(ui);
    });
}

/// Primary button.
pub fn primary_button(text: impl Into<String>) -> impl Widget {
    let text = RichText::new(text).font(semibold(type_size().body));
    move |ui: &mut Ui| {
        let palette = Theme::of(ui).palette;
        let coloured = |ui: &mut Ui| {
            let widgets = &mut ui.visuals_mut().widgets;
            widgets.inactive.weak_bg_fill = palette.accent;
            widgets.hovered.weak_bg_fill = palette.accent_hovered;
            widgets.active.weak_bg_fill = palette.accent_hovered;
            // On the accent colour, a ring of the same colour would be invisible.
            widgets.active.bg_stroke.color = palette.text;
            ui.add(Button::new(text.color(palette.on_accent)).min_size(vec2(0.0, space(7))))
        };
        ui.scope(coloured).inner
    }
}

/// Button as high as [`primary_button`], in the colour of controls.
pub fn ghost_button(text: impl Into<WidgetText>) -> Button<'static> {
    Button::new(text.into()).min_size(vec2(0.0, space(7)))
}

/// Shows a tinted note, for a warning.
pub fn note_ui(ui: &mut Ui, text: &str) -> Response {
    let palette = &Theme::of(ui).palette;
    Frame::new()
        .fill(palette.warning_tint)
        .stroke(Stroke::new(1.0, palette.warning.gamma_multiply(0.3)))
        .corner_radius(radius())
        .inner_margin(Margin::symmetric(8, 8))
        .show(ui, |ui| {
            ui.set_width(ui.available_width());
            ui.label(RichText::new(text).size(type_size().note).color(palette.warning));
        })
        .response
}

/// Shows a row of options, one of them selected; it fills the available width if `fill_width`. Returns the option that the
/// user has just selected. `label` names the group for assistive technology; each option is labelled with its own text.
pub fn segmented_ui<T: Copy + PartialEq>(
    ui: &mut Ui,
    label: &str,
    options: &[(T, &str)],
    selected: T,
    fill_width: bool,
) -> Option<T> {
    let options: Vec<_> = options.iter().map(|&(option, text)| (option, text, "")).collect();
    explained_options_ui(ui, label, &options, selected, fill_width)
}

/// As [`segmented_ui`], each option with a tooltip.
pub fn explained_options_ui<T: Copy + PartialEq>(
    ui: &mut Ui,
    label: &str,
    options: &[(T, &str, &str)],
    selected: T,
    fill_width: bool,
) -> Option<T> {
    let palette = Theme::of(ui).palette;
    let padding = 2.0;
    // Texts of different lengths share what they leave of the width.
    let font = TextStyle::Button.resolve(ui.style());
    let text_width = |text: &str| {
        let galley = ui.painter().layout_no_wrap(text.to_owned(), font.clone(), palette.text);
        galley.size().x + 6.0
    };
    let least: f32 = options.iter().map(|(_, text, _)| text_width(text)).sum();
    let spare = (ui.available_width() - 2.0 * padding - least) / options.len().max(1) as f32;
    let widths = Vec::from_iter(reading_order(ui, options).iter().map(|(_, text, _)| text_width(text)));
    let mut picked = None;
    let group = Frame::new()
        .fill(palette.raised)
        .corner_radius(radius())
        .inner_margin(Margin::same(padding as i8));
    let response = group
        .show(ui, |ui| {
            ui.spacing_mut().item_spacing.x = 0.0;
            if fill_width {
                ui.spacing_mut().button_padding.x = 3.0;
            }
            // Options are flat until the pointer is over them.
            ui.visuals_mut().widgets.inactive.weak_bg_fill = Color32::TRANSPARENT;
            ui.visuals_mut().widgets.inactive.fg_stroke.color = palette.dim;
            ui.horizontal(|ui| {
                for (&(option, text, meaning), width) in reading_order(ui, options).into_iter().zip(widths) {
                    let is_selected = option == selected;
                    let min_width = if fill_width { (width + spare).floor() } else { 0.0 };
                    let button = Button::selectable(is_selected, text)
                        .frame_when_inactive(true)
                        .corner_radius(radius() - 1)
                        .min_size(vec2(min_width, space(6)));
                    if hinted(ui.add(button), meaning).clicked() && !is_selected {
                        picked = Some(option);
                    }
                }
            });
        })
        .response;
    name_group(ui, response.id, label);
    picked
}

/// Adds a tooltip; nothing if it is empty.
pub fn hinted(response: Response, hint: &str) -> Response {
    match hint {
        "" => response,
        _ => response.on_hover_text(hint),
    }
}

/// Shows tabs, with the selected one underlined. Returns the tab that the user has just selected.
pub fn tabs_ui<T: Copy + PartialEq>(ui: &mut Ui, label: &str, tabs: &[(T, &str)], selected: T) -> Option<T> {
    let palette = Theme::of(ui).palette;
    let mut picked = None;
    let response = ui
        .horizontal_wrapped(|ui| {
            ui.spacing_mut().item_spacing.x = 0.0;
            for &(tab, text) in tabs {
                let is_selected = tab == selected;
                let colour = if is_selected { palette.text } else { palette.dim };
                let button = Button::new(RichText::new(text).color(colour)).fill(Color32::TRANSPARENT);
                let tab_response = ui.add(button.stroke(Stroke::NONE));
                tab_response.widget_info(|| WidgetInfo::selected(Role::Tab, true, is_selected, text));
                if is_selected || tab_response.hovered() {
                    let line = tab_response.rect.x_range().shrink(space(2));
                    let colour = if is_selected { palette.accent } else { palette.line };
                    let below = tab_response.rect.bottom() + 1.0;
                    ui.painter().hline(line, below, Stroke::new(2.0, colour));
                }
                if tab_response.clicked() && !is_selected {
                    picked = Some(tab);
                }
            }
        })
        .response;
    name_group(ui, response.id, label);
    picked
}

/// Returns the options in the order of the layout, so that they read from left to right also in a right-to-left layout, as
/// at the right end of a title.
fn reading_order<'a, T>(ui: &Ui, options: &'a [T]) -> Vec<&'a T> {
    if ui.layout().prefer_right_to_left() {
        options.iter().rev().collect()
    } else {
        options.iter().collect()
    }
}

fn name_group(ui: &Ui, id: Id, label: &str) {
    ui.ctx().accesskit_node_builder(id, |node| {
        node.set_role(Role::Group);
        node.set_label(label);
    });
}

/// Shows secondary text, in the size of notes.
pub fn dim_ui(ui: &mut Ui, text: &str) -> Response {
    let dim = Theme::of(ui).palette.dim;
    ui.label(RichText::new(text).size(type_size().note).color(dim))
}

/// Shows a progress bar over the available width: `name` is the name of the work, `text` is shown inside the bar.
pub fn progress_bar_ui(ui: &mut Ui, name: &str, share: f32, text: &str) -> Response {
    let palette = &Theme::of(ui).palette;
    let label = format!("{name}: {text}");
    let text = RichText::new(text).size(type_size().small).color(palette.text);
    let bar = ProgressBar::new(share)
        .desired_height(space(4))
        .corner_radius(radius() - 2)
        .fill(palette.selected)
        .text(text);
    let response = ui
        .scope(|ui| {
            ui.visuals_mut().extreme_bg_color = palette.raised;
            ui.add(bar)
        })
        .inner;
    response.widget_info(|| {
        let mut info = WidgetInfo::labeled(Role::ProgressIndicator, true, &label);
        info.value = Some(f64::from(100.0 * share.clamp(0.0, 1.0)).floor());
        info
    });
    response
}

/// Shows a sentence in the middle of an empty card: the reason why it is empty, and what to do.
pub fn placeholder_ui(ui: &mut Ui, text: &str) {
    in_the_middle_ui(ui, 3.0 * type_size().body, text, |_| ());
}

/// Shows a sentence in the middle of an empty card, and a button that fills it. Returns true if the button was clicked.
pub fn invitation_ui(ui: &mut Ui, text: &str, button: &str, is_possible: bool) -> bool {
    in_the_middle_ui(ui, 3.0 * type_size().body + space(10), text, |ui| {
        ui.add_space(space(2));
        ui.add_enabled(is_possible, ghost_button(button)).clicked()
    })
}

fn in_the_middle_ui<T>(ui: &mut Ui, height: f32, text: &str, below_ui: impl FnOnce(&mut Ui) -> T) -> T {
    let dim = Theme::of(ui).palette.dim;
    let width = ui.available_width().min(space(80));
    let centred = ui.vertical_centered(|ui| {
        ui.add_space((0.5 * (ui.available_height() - height)).max(0.0));
        ui.set_max_width(width);
        ui.label(RichText::new(text).color(dim));
        below_ui(ui)
    });
    centred.inner
}

/// Shows a figure with its name, and its meaning as a tooltip.
pub fn fact_ui(ui: &mut Ui, name: &str, meaning: &str, value: &str) {
    let text = Theme::of(ui).palette.text;
    coloured_fact_ui(ui, name, meaning, value, text);
}

/// As [`fact_ui`], in a given colour.
pub fn coloured_fact_ui(ui: &mut Ui, name: &str, meaning: &str, value: &str, colour: Color32) {
    let dim = Theme::of(ui).palette.dim;
    let text = |text: &str| RichText::new(text).size(type_size().note);
    let name_ui = |ui: &mut Ui| {
        let label = ui.label(text(name).color(dim)).on_hover_text(meaning);
        // The value is read with its name.
        ui.ctx().accesskit_node_builder(label.id, |node| node.set_hidden());
    };
    let value_ui = |ui: &mut Ui| {
        let response = ui.add(Label::new(text(value).color(colour)).wrap());
        let label = format!("{name}: {value}");
        response.widget_info(|| WidgetInfo::labeled(Role::Label, true, &label));
        response.on_hover_text(meaning);
    };
    if ui.available_width() < space(56) {
        name_ui(ui);
        value_ui(ui);
    } else {
        ui.horizontal(|ui| {
            name_ui(ui);
            ui.with_layout(Layout::right_to_left(Align::Center), value_ui);
        });
    }
}

/// Draws a focus ring around a widget that does not show the focus otherwise.
pub fn focus_ring_ui(ui: &Ui, response: &Response) {
    if response.has_focus() {
        let stroke = Stroke::new(1.0, Theme::of(ui).palette.accent);
        let corner = f32::from(radius());
        ui.painter()
            .rect_stroke(response.rect, corner, stroke, StrokeKind::Inside);
    }
}

/// Shows a collapsible section of a form, with a `summary` of its status next to its name. `contents` is added only while
/// the section is open.
pub fn fold_ui(ui: &mut Ui, name: &str, summary: &str, contents: impl FnOnce(&mut Ui)) {
    let dim = Theme::of(ui).palette.dim;
    // Ids do not depend on the widgets above, so a field keeps the focus when those change.
    let scope = UiBuilder::new().scope_id(ui.scope_id().with(name));
    let header = ui
        .scope_builder(scope, |ui| {
            let visuals = ui.visuals_mut();
            // The whole line can be clicked, and is highlighted under the pointer.
            visuals.collapsing_header_frame = true;
            visuals.widgets.inactive.weak_bg_fill = Color32::TRANSPARENT;
            let shown = CollapsingHeader::new(name).id_salt(name).show_unindented(ui, |ui| {
                let raised = Theme::of(ui).palette.raised;
                let visuals = ui.visuals_mut();
                visuals.collapsing_header_frame = false;
                visuals.widgets.inactive.weak_bg_fill = raised;
                contents(ui);
                ui.add_space(space(2));
            });
            shown.header_response
        })
        .inner;
    focus_ring_ui(ui, &header);
    let text_width = ui
        .painter()
        .layout_no_wrap(name.to_owned(), TextStyle::Body.resolve(ui.style()), dim);
    let mut place = header.rect;
    place.min.x += space(7) + text_width.size().x + space(2);
    place.max.x -= space(1);
    let layout = Layout::right_to_left(Align::Center);
    let mut summary_ui = ui.new_child(UiBuilder::new().max_rect(place).layout(layout));
    let text = RichText::new(summary).size(type_size().note).color(dim);
    summary_ui.add(Label::new(text).truncate().selectable(false));
}

/// Typed text that was refused, with the reason.
#[derive(Clone, Debug, PartialEq)]
struct Refusal {
    reason: String,
    /// Value that was kept; the refusal is cleared when it changes.
    kept: String,
}

fn refusal_id(field: Id) -> Id {
    field.with("refusal")
}

/// Marks a field while the last input is refused; `tried` is the result of an input in this frame, `value` the text of the
/// value.
pub(super) fn take_refusal(ui: &Ui, response: &Response, tried: Option<Result<(), String>>, value: &str) {
    let id = refusal_id(response.id);
    match tried {
        Some(Err(reason)) => {
            let kept = value.to_owned();
            ui.data_mut(|data| data.insert_temp(id, Refusal { reason, kept }));
        }
        Some(Ok(())) => ui.data_mut(|data| data.remove::<Refusal>(id)),
        None => {}
    }
    let Some(refusal) = ui.data(|data| data.get_temp::<Refusal>(id)) else {
        return;
    };
    let is_dismissed = response.has_focus() && ui.input(|input| input.key_pressed(Key::Escape));
    if refusal.kept != value || is_dismissed {
        ui.data_mut(|data| data.remove::<Refusal>(id));
        return;
    }
    let stroke = Stroke::new(1.0, Theme::of(ui).palette.bad);
    let corner = f32::from(radius());
    ui.painter()
        .rect_stroke(response.rect, corner, stroke, StrokeKind::Inside);
    ui.ctx().accesskit_node_builder(response.id, |node| {
        node.set_invalid(Invalid::True);
        node.set_description(refusal.reason.as_str());
    });
}

/// Shows the reason why the typed value was refused, below the field.
pub fn refusal_ui(ui: &mut Ui, field: &Response) {
    let refusal = ui.data(|data| data.get_temp::<Refusal>(refusal_id(field.id)));
    if let Some(refusal) = refusal {
        let bad = Theme::of(ui).palette.bad;
        ui.label(RichText::new(refusal.reason).size(type_size().note).color(bad));
    }
}

/// Returns the snapshots before and after the displayed one, where there is one.
pub fn neighbours(shown: usize, snapshots: usize) -> [Option<usize>; 2] {
    [shown.checked_sub(1), Some(shown + 1).filter(|next| *next < snapshots)]
}

/// Shows the number of the displayed snapshot or sample (`what`), which can be typed or dragged, with arrows to the previous
/// and next one; returns a newly selected one.
pub fn snapshot_ui(ui: &mut Ui, what: &str, shown: usize, snapshots: usize) -> Option<usize> {
    let mut picked = None;
    let mut arrow_ui = |ui: &mut Ui, sign: &str, to: Option<usize>, name: &str, key: &str| {
        let arrow = ui.add_enabled(to.is_some(), Button::new(sign).min_size(Vec2::splat(space(6))));
        let label = format!("{name} {what}");
        arrow.widget_info(|| WidgetInfo::labeled(Role::Button, to.is_some(), &label));
        if arrow
            .on_hover_text(format!("{label} of the test set ({key})"))
            .clicked()
        {
            picked = to;
        }
    };
    let (title, window) = (format!("Test {what}"), ui.ctx().content_rect().width());
    let dim = Theme::of(ui).palette.dim;
    let label = (window >= 1200.0).then(|| ui.label(RichText::new(&title).color(dim)));
    let [previous, next] = neighbours(shown, snapshots);
    arrow_ui(ui, "‹", previous, "Previous", "Page up");
    let mut number = shown + 1;
    let suffix = format!(" of {}", snapshots.max(1));
    let field = DragValue::new(&mut number).range(1..=snapshots.max(1)).suffix(suffix);
    let field = ui
        .add_enabled(snapshots > 0, field)
        .on_hover_text("Type a number, or drag.");
    if let Some(label) = label {
        field.labelled_by(label.id);
    } else {
        ui.ctx().accesskit_node_builder(field.id, |node| node.set_label(title));
    }
    arrow_ui(ui, "›", next, "Next", "Page down");
    if number != shown + 1 && snapshots > 0 {
        Some(number - 1)
    } else {
        picked
    }
}
