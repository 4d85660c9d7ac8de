use eframe::egui::Ui;

use crate::window::widgets::{
    fields::{count_ui, list_ui, options_ui, quantity_ui},
    note_ui,
};
use decoupler_core::{
    scene::{ConverterEnd, Fault},
    sensor::ArrayScale,
};

/// The fault of the simulated wires, as the user sets it up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultForm {
    kind: Option<FaultKind>,
    /// Row-wire or column-wire, from 1; the first of two that touch.
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
    ShortedRows,
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
    /// The fault in an array of this scale; a wire that it does not have counts as its last.
    pub fn fault(&self, scale: ArrayScale) -> Option<Fault> {
        let last = self.kind?.wires(scale);
        let (wire, node) = (self.wire.clamp(1, last.max(1)) - 1, self.node.max(1) - 1);
        Some(match self.kind? {
            FaultKind::BrokenRow => Fault::OpenRow {
                row: wire,
                before_node: node.min(scale.nodes_per_row() - 1),
            },
            FaultKind::BrokenColumn => Fault::OpenColumn {
                column: wire,
                before_node: node.min(scale.nodes_per_column() - 1),
            },
            FaultKind::ShortedRows => Fault::ShortedRows { row: wire },
            FaultKind::ShortedColumns => Fault::ShortedColumns { column: wire },
            FaultKind::Gain if self.gain_percent == 0.0 => return None,
            FaultKind::Gain => Fault::Gain {
                column: wire,
                relative: self.gain_percent / 100.0,
            },
            FaultKind::Saturated => Fault::Stuck {
                column: wire,
                end: self.end,
            },
        })
    }

    /// Shows the form for an array of this scale, of which these row-wires are read.
    pub fn form_ui(&mut self, ui: &mut Ui, scale: ArrayScale, read: &[usize]) {
        let hint = "A fault of the simulated wires or electronics, which takes effect at once.";
        if let Some(kind) = list_ui(ui, "Wire fault", hint, &KINDS, self.kind) {
            self.kind = kind;
        }
        let Some(kind) = self.kind else { return };
        let (name, hint) = kind.wire_words();
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
                            as much.";
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
            FaultKind::ShortedRows | FaultKind::ShortedColumns => {}
        }
        if let Some(problem) = self.problem(scale, read) {
            note_ui(ui, &format!("No such fault here: {problem}."));
        }
    }

    /// Reason for which the array cannot have this fault.
    pub fn problem(&self, scale: ArrayScale, read: &[usize]) -> Option<String> {
        let checked = self.fault(scale)?.check(scale, read);
        checked.err().map(|error| error.to_string())
    }
}

const KINDS: [(Option<FaultKind>, &str, &str); 7] = [
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
        Some(FaultKind::ShortedRows),
        "Shorted row-wires",
        "Two neighbours touch, and read the same.",
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
    /// Number of wires that can have it.
    fn wires(self, scale: ArrayScale) -> usize {
        match self {
            Self::BrokenRow => scale.rows(),
            Self::ShortedRows => scale.rows().saturating_sub(1),
            Self::ShortedColumns => scale.columns().saturating_sub(1),
            Self::BrokenColumn | Self::Gain | Self::Saturated => scale.columns(),
        }
    }

    fn wire_words(self) -> (&'static str, &'static str) {
        match self {
            Self::BrokenRow => ("Row-wire", "Number of the broken row-wire."),
            Self::ShortedRows => ("First row-wire", "It touches the next one."),
            Self::ShortedColumns => ("First column-wire", "It touches the next one."),
            Self::BrokenColumn | Self::Gain | Self::Saturated => ("Column-wire", "Number of the column-wire."),
        }
    }
}
