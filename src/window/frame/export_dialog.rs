//! What the views show, as the four lines of the Export menu, as the context menu of a card, and as the dialog in which the
//! user chooses the form of an export.

use decoupler_files::export::TableForm;
use eframe::egui::{Align, Layout, Response, RichText, Ui, containers::menu::MenuButton};

use super::modal::{Reply, card_ui, take_focus};
use crate::window::{
    shared::{Effect, ExportLine, Exporting, Format, Item, Shown},
    theme::{semibold, space, type_size},
    widgets::{dim_ui, fields::list_ui, ghost_button, primary_button},
};

/// The button that opens the menu. `shown` lists what the view shows; it is called only while the menu is open.
pub(super) fn export_menu_ui<'a>(ui: &mut Ui, shown: impl FnOnce() -> Vec<Shown<'a>>, effects: &mut Vec<Effect>) {
    let (button, _) = MenuButton::from_button(ghost_button("Export")).ui(ui, |ui| {
        ui.set_width(space(70));
        let shown = shown();
        let mut reason = "";
        for line in ExportLine::ALL {
            let of_line = || shown.iter().filter(|shown| shown.line == line);
            let (name, hint) = line.words();
            let first = of_line().find(|shown| shown.item.is_ok());
            let button = ui.add_enabled(first.is_some(), ghost_button(format!("{name}…")));
            let Some(first) = first else {
                let refusal = of_line().find_map(|shown| shown.item.as_ref().err());
                let refusal = refusal.map_or("This view has nothing of this kind.", |refusal| refusal);
                button.on_disabled_hover_text(refusal);
                if refusal != std::mem::replace(&mut reason, refusal) {
                    dim_ui(ui, refusal);
                }
                continue;
            };
            if button.on_hover_text(hint).clicked() {
                let is_only_one = of_line().nth(1).is_none() && first.formats().len() == 1;
                effects.extend(match first.formats()[..] {
                    [format] if is_only_one => export(first, format, &Exporting::new(line, "")),
                    _ => Some(first.ask()),
                });
            }
        }
    });
    button.on_hover_text("Networks, reports, figures and tables of this view, as files or to the clipboard.");
}

fn export(shown: &Shown<'_>, format: Format, exporting: &Exporting) -> Option<Effect> {
    shown.export(format, exporting.decoder, exporting.precision)
}

/// Context menu of a part of the window: copies or exports the figures and tables of the view.
pub(super) fn card_menu_ui<'a>(part: &Response, shown: impl FnOnce() -> Vec<Shown<'a>>, effects: &mut Vec<Effect>) {
    part.container_context_menu(|ui| {
        ui.set_min_width(space(60));
        let mut is_empty = true;
        for shown in shown() {
            let copy = match &shown.item {
                Ok(Item::Figure(..)) => Format::Picture,
                Ok(Item::Table(..)) => Format::Copy(TableForm::TabSeparated),
                _ => continue,
            };
            is_empty = false;
            let name = shown.name.to_lowercase();
            let description = copy.words().description;
            if ui.button(format!("Copy {name}")).on_hover_text(description).clicked() {
                effects.extend(export(&shown, copy, &Exporting::new(shown.line, "")));
            }
            if ui.button(format!("Export {name}…")).clicked() {
                effects.push(shown.ask());
            }
        }
        if is_empty {
            dim_ui(ui, "There is nothing to copy here yet.");
        }
    });
}

/// The dialog for one line of the menu: which thing, in which form.
pub(super) fn export_dialog_ui(ui: &Ui, exporting: &mut Exporting, shown: Vec<Shown<'_>>) -> Option<Reply> {
    let shown = match &exporting.given {
        Some(source) => Vec::from(Shown::network("", Ok(source.clone()), Vec::new())),
        None => shown,
    };
    let of_line: Vec<_> = shown.iter().filter(|shown| shown.line == exporting.line).collect();
    card_ui(ui, "export", space(110), |ui| {
        let (line, hint) = exporting.line.words();
        let title = format!("Export {}", line.to_lowercase());
        ui.label(RichText::new(title).font(semibold(type_size().title)));
        dim_ui(ui, hint);
        ui.add_space(space(2));
        let chosen = chosen_ui(ui, exporting, &of_line);
        ui.add_space(space(3));
        let buttons = ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let is_copy = chosen.is_some_and(|(_, format)| format.is_copy());
            let button = primary_button(if is_copy { "Copy" } else { "Save…" });
            let button = ui.add_enabled(chosen.is_some(), button);
            // Enter is enough; Tab still reaches the lists.
            take_focus(ui, &button);
            let is_left = ui.add(ghost_button("Cancel")).clicked();
            let chosen = chosen.filter(|_| button.clicked());
            let effect = chosen.and_then(|(shown, format)| export(shown, format, exporting));
            effect
                .map(|effect| Reply::Apply(Box::new(effect)))
                .or(is_left.then_some(Reply::Close))
        });
        buttons.inner
    })
}

/// The lists of the dialog, and the description of what is chosen in them. Returns it unless it cannot be exported.
fn chosen_ui<'s, 'a>(
    ui: &mut Ui,
    exporting: &mut Exporting,
    of_line: &[&'s Shown<'a>],
) -> Option<(&'s Shown<'a>, Format)> {
    let named = of_line.iter().find(|shown| shown.name == exporting.name);
    let mut shown = *named.or(of_line.first())?;
    if of_line.len() > 1 {
        let (line, _) = exporting.line.words();
        let mut place = of_line.iter().position(|other| other.name == shown.name)?;
        let names = of_line
            .iter()
            .enumerate()
            .map(|(place, shown)| (place, shown.name.clone()));
        choice_ui(ui, line, names, &mut place);
        shown = of_line[place];
        exporting.name.clone_from(&shown.name);
    }
    if let Err(reason) = &shown.item {
        dim_ui(ui, reason);
        return None;
    }
    let formats = shown.formats();
    let mut format = exporting.format.filter(|format| formats.contains(format));
    let format = format.get_or_insert(formats[0]);
    if let Ok(Item::Network(source)) = &shown.item {
        let decoders = source.decoders().map(|decoder| (decoder, decoder.name().to_owned()));
        choice_ui(ui, "Decoder", decoders, &mut exporting.decoder);
    }
    if formats.len() > 1 {
        let formats = formats.into_iter().map(|format| (format, format.name()));
        choice_ui(ui, "Format", formats, format);
    }
    exporting.format = Some(*format);
    let refusal = match *format {
        Format::Bundle(format) => {
            let decoder = exporting.decoder;
            let precisions = format.precisions().iter().copied();
            let precisions: Vec<_> = precisions
                .filter(|&with| format.check_for(decoder, with).is_ok())
                .collect();
            if let Some(first) = precisions
                .first()
                .filter(|_| !precisions.contains(&exporting.precision))
            {
                exporting.precision = *first;
            }
            let precisions = precisions.into_iter().map(|with| (with, with.to_string()));
            choice_ui(ui, "Precision", precisions, &mut exporting.precision);
            format
                .check_for(decoder, exporting.precision)
                .err()
                .map(|refusal| refusal.to_string())
        }
        Format::NetworkFile if !exporting.decoder.is_network() => {
            Some("Only the network is saved in a file of this program.".to_owned())
        }
        _ => None,
    };
    dim_ui(ui, refusal.as_deref().unwrap_or(format.words().description));
    refusal.is_none().then_some((shown, *format))
}

/// A list of options behind its name.
fn choice_ui<T: Copy + PartialEq>(ui: &mut Ui, name: &str, options: impl Iterator<Item = (T, String)>, chosen: &mut T) {
    let options = Vec::from_iter(options);
    let options = Vec::from_iter(options.iter().map(|(option, text)| (*option, &**text, "")));
    *chosen = list_ui(ui, name, "", &options, *chosen).unwrap_or(*chosen);
}
