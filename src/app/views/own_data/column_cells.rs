//! Cells of the table of columns.

use eframe::egui::{
    Align2, Color32, ComboBox, FontId, Rect, Response, RichText, Sense, TextEdit, Ui, WidgetInfo, accesskit::Role, vec2,
};

use crate::{
    app::theme::{Theme, space, type_size},
    export::format_number,
    figure::ticks::tick_text,
    import::{ColumnKind, ColumnSummary, Meaning},
};

/// The choice of a meaning. Returns the one newly picked.
pub(super) fn meaning_ui(ui: &mut Ui, name: &str, meaning: Meaning, width: f32) -> Option<Meaning> {
    let mut picked = None;
    let palette = Theme::of(ui).palette;
    let text = RichText::new(meaning.to_string()).color(if meaning == Meaning::Unused {
        palette.dim
    } else {
        palette.text
    });
    let combo = ComboBox::from_id_salt(name).selected_text(text).width(width);
    let shown = combo.show_ui(ui, |ui| {
        for option in Meaning::ALL {
            let choice = ui.selectable_label(option == meaning, option.to_string());
            if choice.on_hover_text(explanation(option)).clicked() && option != meaning {
                picked = Some(option);
            }
        }
    });
    let label = format!("Meaning of {name}");
    let value = meaning.to_string();
    shown
        .response
        .widget_info(|| WidgetInfo::labeled(Role::ComboBox, true, &label));
    ui.ctx()
        .accesskit_node_builder(shown.response.id, |node| node.set_value(value));
    picked
}

fn explanation(meaning: Meaning) -> &'static str {
    match meaning {
        Meaning::Input => "The sensor gives it: the network reads it.",
        Meaning::Target => "The network learns to tell it from the inputs.",
        Meaning::Time => "Time of the row, by which files are joined and samples are put in order.",
        Meaning::Group => "Equal values belong together, such as one press or one session, and are never divided.",
        Meaning::RowWire => "Number of the row-wire that was read, from 1.",
        Meaning::Unused => "It is left out.",
    }
}

/// The unit, to be changed in place; what is typed counts when the field is left.
pub(super) fn unit_ui(ui: &mut Ui, name: &str, unit: &str, width: f32) -> Option<String> {
    let id = ui.scope_id().with(("unit", name));
    let mut typed: String = ui.data(|data| data.get_temp(id)).unwrap_or_else(|| unit.to_owned());
    let edit = ui.add(TextEdit::singleline(&mut typed).id(id).desired_width(width));
    let label = format!("Unit of {name}");
    ui.ctx().accesskit_node_builder(edit.id, |node| node.set_label(label));
    if edit.changed() {
        ui.data_mut(|data| data.insert_temp(id, typed.clone()));
    }
    if edit.lost_focus() {
        ui.data_mut(|data| data.remove::<String>(id));
        return (typed.trim() != unit).then_some(typed);
    }
    None
}

/// A figure at the right of its cell.
pub(super) fn figure_ui(ui: &mut Ui, text: &str, label: &str, colour: Color32) -> Response {
    let rect: Rect = ui.max_rect();
    let response = ui.interact(rect, ui.scope_id().with("figure"), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, label));
    let font = FontId::proportional(type_size().note);
    ui.painter().text(
        rect.right_center() - vec2(space(1), 0.0),
        Align2::RIGHT_CENTER,
        text,
        font,
        colour,
    );
    response
}

/// The ends of a range, with as many decimals as tell them apart.
pub(super) fn range_text(min: f64, max: f64) -> String {
    let span = max - min;
    let largest = min.abs().max(max.abs());
    let has_decimals = (1e-6..1e12).contains(&span) && largest < 1e12;
    let text = |value: f64| match has_decimals {
        true => tick_text(value, span / 100.0),
        false => format_number(value),
    };
    if min == max {
        text(min)
    } else {
        format!("{} – {}", text(min), text(max))
    }
}

/// A remark on what is unusual about a column, and whether it hinders its use.
pub(super) fn remark(summary: &ColumnSummary, column: usize) -> Option<(String, bool)> {
    if let Some((line, text)) = &summary.first_text {
        let others = match summary.texts {
            1 => String::new(),
            texts => format!(", and {} other cells", texts - 1),
        };
        return Some((
            format!("line {line}, column {}: '{text}' is no number{others}", column + 1),
            true,
        ));
    }
    if summary.kind == ColumnKind::Empty {
        return Some(("empty".to_owned(), true));
    }
    if summary.is_constant {
        return Some(("constant: it tells nothing".to_owned(), true));
    }
    summary
        .duplicate_of
        .as_ref()
        .map(|other| (format!("same as {other}"), true))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_a_range_differ_where_its_numbers_do() {
        for (min, max, text) in [
            (-108.0, 288.4, "−108 – 288"),
            (142.95, 143.0, "142.9500 – 143.0000"),
            (1_742_233_313.2, 1_742_253_720.9, "1742233313 – 1742253721"),
            (-1.0, 1.0, "−1.00 – 1.00"),
            (4.0, 4.0, "4.00"),
            (0.0, 1e-9, "0 – 1.00e-9"),
            (-1e300, 1e300, "-1.00e300 – 1.00e300"),
        ] {
            assert_eq!(range_text(min, max), text);
        }
    }
}
