use std::sync::Arc;

use decoupler_core::{live::FaultyWire, sensor::ArrayScale};
use decoupler_files::{
    export::format_number,
    figure::{
        HeatMap, SequentialMap, readings_figure,
        surface::{Quantity, Surface, SurfaceFigure},
    },
    live::{ConverterEnd, Fault, FaultEffect, SourcePlan, Watched},
};
use eframe::egui::{Align, Layout, Rect, RichText, Ui, Vec2};

use super::{LiveView, engine::LiveFrame, source_form::SourceKind};
use crate::window::{
    plotting::cells_ui,
    shared::{Effect, Look, Shared, colour_scale_ui, follow_surface, view_mode_ui},
    surface_view::{ColourBar, SurfaceView},
    test_view::{Frame, HeightScale},
    theme::{Theme, semibold, space, type_size},
    widgets::{
        card_ui,
        fields::{count_ui, list_ui, options_ui, quantity_ui},
        ghost_button, note_ui, primary_button,
    },
};

/// Shows the decoupled surface, the actual one next to it if it is known, and their colour scale.
pub fn surfaces_ui(ui: &mut Ui, rect: Rect, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let Some(frame) = &view.shown.frame else { return };
    let figure = surface_figure(frame, view.node, shared.look);
    let gap = space(2);
    let (cards, scale) = rect.split_left_right_at_x(rect.right() - ColourBar::WIDTH);
    let count = figure.surfaces.len() as f32;
    let width = (cards.width() - gap * (count - 1.0)) / count;
    let mut node = view.node;
    for (index, surface) in figure.surfaces.iter().enumerate() {
        let left = cards.left() + (width + gap) * index as f32;
        let card = Rect::from_min_size([left, cards.top()].into(), Vec2::new(width, cards.height()));
        card_ui(ui, card, |ui| {
            ui.horizontal(|ui| {
                ui.set_min_height(space(7));
                ui.label(RichText::new(&surface.title).font(semibold(type_size().title)));
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    if index == 0 {
                        view_mode_ui(ui, shared.look, effects);
                    }
                });
            });
            surface_ui(ui, surface, frame, shared.look, &mut node, effects);
        });
    }
    if let [colours, ..] = &figure.scales()[..] {
        let slot = scale.shrink2(Vec2::new(0.0, space(4)));
        colour_scale_ui(ui, slot, colours, &figure.note(), shared.look, effects);
    }
    view.node = node;
}

/// Returns the surfaces of a frame on a common scale.
pub fn surface_figure(frame: &LiveFrame, marked_node: Option<usize>, look: Look) -> SurfaceFigure {
    let surface = |title: &str, heights: &Frame| Surface {
        title: title.to_owned(),
        map: Arc::clone(&frame.surface),
        values: Arc::clone(&heights.grid_mm),
        nodes: Arc::clone(&heights.nodes_mm),
        quantity: Quantity::Height,
        range: match look.heights {
            HeightScale::Stroke => frame.z_range_mm.clone(),
            HeightScale::Fitted => heights.range_mm().unwrap_or_else(|| frame.z_range_mm.clone()),
        },
        mode: look.mode,
        colours: look.colours,
    };
    let actual = frame.actual.as_ref().map(|actual| surface("Actual", actual));
    SurfaceFigure {
        surfaces: std::iter::once(surface("Decoupled", &frame.decoupled))
            .chain(actual)
            .collect(),
        camera: look.camera,
        marked_node,
        ..SurfaceFigure::default()
    }
    .with_common_scales()
}

fn surface_ui(
    ui: &mut Ui,
    surface: &Surface,
    frame: &LiveFrame,
    look: Look,
    node: &mut Option<usize>,
    effects: &mut Vec<Effect>,
) {
    let shown = SurfaceView {
        label: &format!("Live {} surface", surface.title.to_lowercase()),
        surface,
        marked_node: *node,
        lit_nodes: &[],
        section: None,
        theme: Theme::of(ui),
    }
    .show(ui, look.camera);
    follow_surface(&shown, look, node, effects);
    shown.node_tooltip_ui(|ui, node| {
        let per_row = frame.sensor.scale.nodes_per_row();
        let (Some(decoupled), Some(row)) = (frame.decoupled.nodes_mm.get(node), frame.rows.get(node / per_row)) else {
            return;
        };
        let name = format!("Row {}, node {}", row + 1, node % per_row + 1);
        ui.label(RichText::new(name).font(semibold(type_size().note)));
        let mut text = format!("decoupled z {} mm", format_number(decoupled.z));
        if let Some(actual) = frame.actual.as_ref().and_then(|actual| actual.nodes_mm.get(node)) {
            text += &format!(", actual {} mm", format_number(actual.z));
        }
        ui.label(RichText::new(text).size(type_size().note));
    });
}

/// Upper limit of the colour scale of the readings. It follows the largest drop in round steps and falls slowly, which
/// keeps colours comparable from frame to frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DropScale {
    peak_percent: f64,
    watched: Option<Watched>,
}

/// Minimum of the upper limit, in percent.
const MIN_PERCENT: f64 = 0.5;
/// Decay of the peak per frame.
const DECAY: f64 = 0.999;

impl DropScale {
    /// Updates the limit with a frame; faulty wires do not count.
    pub fn take(&mut self, frame: &LiveFrame) {
        let is_healthy = |row: usize, column: usize| !frame.watched.leaves_out(frame.rows[row], column);
        let drops = frame.drops_percent.indexed_iter();
        let drops = drops.filter(|((row, column), drop)| is_healthy(*row, *column) && drop.is_finite());
        let largest = drops.map(|(_, &drop)| drop).fold(0.0, f64::max);
        if self.watched.as_ref() != Some(&frame.watched) {
            // Discard the peak that a fault has caused.
            self.watched = Some(frame.watched.clone());
            self.peak_percent = 0.0;
        }
        self.peak_percent = largest.max(DECAY * self.peak_percent);
    }

    /// Returns the upper limit in percent: 1, 2 or 5 times a power of ten.
    pub fn largest_percent(&self) -> f64 {
        let peak = self.peak_percent.max(MIN_PERCENT);
        let decade = 10_f64.powf(peak.log10().floor());
        let steps = [1.0, 2.0, 5.0].map(|step| step * decade);
        steps
            .into_iter()
            .find(|step| *step >= peak * (1.0 - 1e-9))
            .unwrap_or(10.0 * decade)
    }
}

/// Shows the text of an empty view, and the button that starts decoding.
pub fn invitation_ui(ui: &mut Ui, view: &mut LiveView, shared: &Shared, effects: &mut Vec<Effect>) {
    let palette = Theme::of(ui).palette;
    ui.vertical_centered(|ui| {
        ui.add_space((0.5 * ui.available_height() - space(20)).max(0.0));
        ui.set_max_width(ui.available_width().min(space(105)));
        let (heading, text) = words(view, shared);
        ui.label(RichText::new(heading).font(semibold(type_size().title)));
        ui.add_space(space(1));
        ui.label(RichText::new(text).color(palette.dim));
        ui.add_space(space(4));
        if view.running.is_some() {
            return;
        }
        if view.network.network(&shared.runs).is_none() {
            let is_free = !shared.phase.is_busy();
            if is_free && ui.add(primary_button("Train a network now")).clicked() {
                effects.extend([Effect::ShowTraining, Effect::Train]);
            }
        } else if view.source.kind == SourceKind::Simulated && view.has_sensor(shared) {
            if ui.add(primary_button("Start the simulated source")).clicked() {
                view.start(shared, effects);
            }
        } else if view.obstacle(shared).is_none() && ui.add(primary_button("Start this source")).clicked() {
            view.start(shared, effects);
        }
        ui.add_space(space(2));
        let hint = "Four seconds of a ball that wanders over a simulated array, with a network that decodes them.";
        let sample = ui.add(ghost_button("Play the sample recording"));
        if sample.on_hover_text(hint).clicked() {
            view.ask_for_sample(shared);
        }
    });
}

fn words(view: &LiveView, shared: &Shared) -> (String, String) {
    let (counts, network) = (&view.shown.counts, view.network.network(&shared.runs));
    if let Some(running) = &view.running {
        let source = match &running.source {
            SourcePlan::Simulated(_) => "the simulated source".to_owned(),
            SourcePlan::Replay(path) => format!("'{}'", path.display()),
            SourcePlan::Stream(source) => source.to_string(),
        };
        let text = match &counts.last_bad {
            Some(reason) => format!("Malformed lines: {}. Last: {reason}.", counts.bad),
            None => "It appears here as soon as it arrives.".to_owned(),
        };
        return (format!("Waiting for the first frame from {source}"), text);
    }
    let Some((name, _)) = network else {
        let text = if shared.phase.is_busy() {
            "Live decoding needs a trained network. One is being trained in the Train view: it can be used here as soon \
             as it is finished."
        } else {
            "Live decoding needs a trained network. Train one with the settings of the Train view, which takes from \
             seconds to minutes, or open a network file."
        };
        return ("No network yet".to_owned(), text.to_owned());
    };
    let text = match view.source.kind {
        SourceKind::Simulated if view.has_sensor(shared) => format!(
            "An indenter wanders over a simulated array and the network '{name}' decodes its readings, without any \
             hardware. To decode your own, choose a replay, a serial port or a TCP address on the left."
        ),
        _ => match view.obstacle(shared) {
            Some(obstacle) => obstacle,
            None if view.has_sensor(shared) => format!("The network '{name}' decodes its frames as they arrive."),
            None => format!("The network '{name}' decodes its samples as they arrive, by the names of their columns."),
        },
    };
    ("Decode live readings".to_owned(), text)
}

/// Shows the readings of the frame as a map of rows and columns.
pub fn readings_ui(ui: &mut Ui, view: &LiveView, colours: SequentialMap) {
    let Some(frame) = &view.shown.frame else { return };
    ui.horizontal(|ui| {
        ui.set_min_height(space(7));
        ui.label(RichText::new("Readings").font(semibold(type_size().title)));
    });
    let map = figure_of(frame, view.drops.largest_percent()).coloured(colours);
    let (rows, columns) = marked(frame);
    let warning = Theme::of(ui).palette.warning;
    let marks = (&*rows, &*columns, warning);
    let Some(([row, column], cell)) = cells_ui(ui, "Live readings", &map, marks) else {
        return;
    };
    let value = format_number(map.values[[row, column]]);
    let row = frame.rows.get(row).map_or(0, |row| row + 1);
    cell.on_hover_text_at_pointer(format!(
        "Row-wire {row}, column-wire {}\ndrop from unloaded: {value} %",
        column + 1
    ));
}

/// Returns the map of the readings of a frame.
pub fn figure_of(frame: &LiveFrame, largest_percent: f64) -> HeatMap {
    readings_figure(frame.drops_percent.clone(), &frame.rows, largest_percent)
}

/// Returns the rows and columns of the map whose wires are faulty.
fn marked(frame: &LiveFrame) -> (Vec<usize>, Vec<usize>) {
    let Some(wire) = frame.watched.wire() else {
        return (Vec::new(), Vec::new());
    };
    let rows = frame.rows.iter().enumerate();
    let rows = rows
        .filter(|(_, row)| wire == FaultyWire::Row(**row))
        .map(|(place, _)| place);
    (rows.collect(), wire.columns().collect())
}

/// Form of the fault of the simulated wires.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultForm {
    kind: Option<FaultKind>,
    /// Row-wire or column-wire, from 1; the first of two shorted wires.
    wire: usize,
    /// Node before which a wire is broken, from 1.
    node: usize,
    gain_percent: f64,
    end: ConverterEnd,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FaultKind {
    BrokenRow,
    BrokenColumn,
    ShortedColumns,
    Gain,
    Saturated,
}

impl Default for FaultForm {
    fn default() -> Self {
        Self {
            kind: None,
            wire: 3,
            node: 1,
            gain_percent: 5.0,
            end: ConverterEnd::High,
        }
    }
}

impl FaultForm {
    /// Returns the fault in an array of this scale; the number of the wire is limited to that of the last wire.
    pub fn fault(&self, scale: ArrayScale) -> Option<Fault> {
        let last = self.kind?.wires(scale);
        let (wire, node) = (self.wire.clamp(1, last.max(1)) - 1, self.node.max(1) - 1);
        let column = FaultyWire::Column(wire);
        let (wire, effect) = match self.kind? {
            FaultKind::BrokenRow => (
                FaultyWire::Row(wire),
                FaultEffect::Open(node.min(scale.nodes_per_row() - 1)),
            ),
            FaultKind::BrokenColumn => (column, FaultEffect::Open(node.min(scale.nodes_per_column() - 1))),
            FaultKind::ShortedColumns => (FaultyWire::Columns(wire), FaultEffect::Shorted),
            FaultKind::Gain if self.gain_percent == 0.0 => return None,
            FaultKind::Gain => (column, FaultEffect::Gain(self.gain_percent / 100.0)),
            FaultKind::Saturated => (column, FaultEffect::Stuck(self.end)),
        };
        Some(Fault { wire, effect })
    }

    /// Shows the form for an array of this scale in which these row-wires are read.
    pub fn form_ui(&mut self, ui: &mut Ui, scale: ArrayScale, read: &[usize]) {
        let hint = "A fault of the simulated wires or electronics, which takes effect at once.";
        if let Some(kind) = list_ui(ui, "Wire fault", hint, &KINDS, self.kind) {
            self.kind = kind;
        }
        let Some(kind) = self.kind else { return };
        let (name, hint) = kind.wire_field();
        let last = kind.wires(scale).max(1);
        self.wire = self.wire.clamp(1, last);
        count_ui(ui, name, hint, &mut self.wire, 1..=last);
        match kind {
            FaultKind::BrokenRow | FaultKind::BrokenColumn => {
                let nodes = match kind {
                    FaultKind::BrokenRow => scale.nodes_per_row(),
                    _ => scale.nodes_per_column(),
                };
                self.node = self.node.clamp(1, nodes);
                let hint = "Node before which the wire is broken, counted from its connector: before node 1 it is \
                            broken at the connector.";
                count_ui(ui, "Before node", hint, &mut self.node, 1..=nodes);
            }
            FaultKind::Gain => {
                let hint = "Error of the amplifier's gain, in percent: all readings of the column-wire are too large by \
                            this much.";
                quantity_ui(ui, "Gain error", hint, &mut self.gain_percent, -90.0..=1000.0, "%");
            }
            FaultKind::Saturated => {
                let ends = [
                    (ConverterEnd::Low, "Low", "At its first step."),
                    (ConverterEnd::High, "High", "At its full scale."),
                ];
                let hint = "End of the converter's range at which it is stuck.";
                self.end = options_ui(ui, "Stuck at", hint, &ends, self.end).unwrap_or(self.end);
            }
            FaultKind::ShortedColumns => {}
        }
        if let Some(problem) = self.problem(scale, read) {
            note_ui(ui, &format!("This fault is not possible: {problem}."));
        }
    }

    /// Returns the reason why the array cannot have this fault, if there is one.
    pub fn problem(&self, scale: ArrayScale, read: &[usize]) -> Option<String> {
        let checked = self.fault(scale)?.check(scale, read);
        checked.err().map(|error| error.to_string())
    }
}

const KINDS: [(Option<FaultKind>, &str, &str); 6] = [
    (None, "None", "No wire is faulty."),
    (
        Some(FaultKind::BrokenRow),
        "Broken row-wire",
        "Its nodes beyond the break carry no current.",
    ),
    (
        Some(FaultKind::BrokenColumn),
        "Broken column-wire",
        "Its nodes beyond the break carry no current.",
    ),
    (
        Some(FaultKind::ShortedColumns),
        "Shorted column-wires",
        "Two neighbours touch, and read the same.",
    ),
    (
        Some(FaultKind::Gain),
        "Gain drift",
        "The amplifier of a column-wire has drifted.",
    ),
    (
        Some(FaultKind::Saturated),
        "Saturated converter",
        "The converter of a column-wire is stuck at an end of its range.",
    ),
];

impl FaultKind {
    /// Returns the number of wires that can have it.
    fn wires(self, scale: ArrayScale) -> usize {
        match self {
            Self::BrokenRow => scale.rows(),
            Self::ShortedColumns => scale.columns().saturating_sub(1),
            Self::BrokenColumn | Self::Gain | Self::Saturated => scale.columns(),
        }
    }

    fn wire_field(self) -> (&'static str, &'static str) {
        match self {
            Self::BrokenRow => ("Row-wire", "Number of the broken row-wire."),
            Self::ShortedColumns => ("First column-wire", "It touches the next one."),
            Self::BrokenColumn | Self::Gain | Self::Saturated => ("Column-wire", "Number of the column-wire."),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_ends_at_round_numbers() {
        for (peak_percent, expected) in [
            (0.0, 0.5),
            (0.6, 1.0),
            (1.0, 1.0),
            (1.3, 2.0),
            (4.9, 5.0),
            (73.0, 100.0),
        ] {
            let scale = DropScale {
                peak_percent,
                watched: None,
            };
            let found = scale.largest_percent();
            assert!((found / expected - 1.0).abs() < 1e-9, "{peak_percent}: {found}");
        }
    }
}
