//! What a bundle contains, whatever its format.

use decoupler_core::{
    dataset::{GAP, MemoryConstants, Span},
    decoupling::{Function, NodeId, Operation, Precision},
    text::counted,
};
use ndarray::Array2;

use super::{
    BundlePrecision,
    exported_program::ExportedProgram,
    golden::Golden,
    meaning::{Meaning, comment, wrapped},
};
use crate::export::format_number;

/// The word for a precision, of those for single and double precision.
pub(super) fn word<T>(precision: Precision, [single, double]: [T; 2]) -> T {
    match precision {
        Precision::Single => single,
        Precision::Double => double,
    }
}

/// Everything that the printers of the formats need.
pub(super) struct Contents {
    /// Prefix of the names of functions and files.
    pub(super) name: String,
    /// Word for the decoder in sentences, and the name of its files: network or decoder.
    pub(super) noun: &'static str,
    pub(super) meaning: Meaning,
    pub(super) precision: BundlePrecision,
    pub(super) exported: ExportedProgram,
    /// A name for each node.
    pub(super) names: Vec<String>,
    /// Number of row-wires that are distinguished; 1 if the row is not an argument.
    pub(super) rows: usize,
    /// Range to which deviations of each target are relative: the widest of any in training for the coordinates of an array,
    /// and its own for a target of own data, as units differ.
    pub(super) scales: Vec<f64>,
    pub(super) golden: Golden,
    /// Facts as JSON for users and programs that have only the bundle.
    pub(super) metadata: serde_json::Value,
    /// Remarks for the user, with cause and cure.
    pub(super) notes: Vec<String>,
}

/// Constants as they are in a file.
pub(super) struct Constant<'a> {
    pub(super) name: &'a str,
    pub(super) precision: Precision,
    /// Shape of a matrix (weights and points, inputs × outputs) or vector, after the number of row-wires if they differ.
    pub(super) shape: Vec<usize>,
    /// One table for all row-wires, or one for each.
    pub(super) tables: &'a [Array2<f64>],
}

impl Constant<'_> {
    /// All values, row by row.
    pub(super) fn values(&self) -> impl Iterator<Item = f64> {
        self.tables.iter().flatten().copied()
    }
}

/// The past that a program takes, with its numbers.
pub(super) struct PrintedHistory {
    pub(super) constants: MemoryConstants,
    /// Pause in seconds after which it restarts, if the usual interval is known.
    pub(super) pause_s: f64,
}

impl PrintedHistory {
    /// Rows of the state in languages with matrices: whether it has started, the latest time, the latest readings (the newest
    /// first), and the averages.
    pub(super) fn state_rows(&self) -> usize {
        2 + self.constants.longest_lag() + self.constants.averages.len()
    }

    /// Rates of the averages: per second, and per reading; one of the two is 0.
    pub(super) fn rates(&self) -> (Vec<f64>, Vec<f64>) {
        let rates = self.constants.averages.iter().map(|average| match average {
            Span::Seconds(seconds) => (1.0 / seconds, 0.0),
            Span::Samples(samples) => (0.0, 1.0 / samples),
        });
        rates.unzip()
    }
}

/// An operation on these operands as languages with infix operators write it, with the sign of a division, and the prefix and
/// suffix of the names of functions.
pub(super) fn infix(operation: &Operation, [divided, before, after]: [&str; 3], operands: &[String]) -> String {
    match (operation, operands) {
        (Operation::Subtract(..), [one, other]) => format!("{one} - {other}"),
        (Operation::Divide(..), [one, other]) => format!("{one} {divided} {other}"),
        (Operation::Map(Function::Log1p, _), [x]) => format!("{before}log1p{after}({x})"),
        (Operation::Map(Function::Tanh, _), [x]) => format!("{before}tanh{after}({x})"),
        (Operation::Map(Function::Gaussian, _), [x]) => format!("{before}exp{after}(-{x})"),
        _ => unreachable!("given, not exported, or written by every language in its own way"),
    }
}

impl Contents {
    pub(super) fn name_of(&self, id: NodeId) -> &str {
        &self.names[id.index()]
    }

    /// Nodes that are computed, in order.
    pub(super) fn computed(&self) -> impl Iterator<Item = (NodeId, &Operation)> {
        let nodes = self.exported.program.nodes().iter().enumerate();
        // The last node joins the outputs, which have names of their own.
        let last = self.exported.program.nodes().len() - 1;
        nodes
            .filter(move |(index, node)| {
                let is_given = matches!(node.operation, Operation::Readings | Operation::Select { .. });
                !is_given && *index != last
            })
            .map(|(index, node)| (NodeId::at(index), &node.operation))
    }

    /// A statement for each node that is computed.
    pub(super) fn body(&self, statement: impl Fn(NodeId, &Operation) -> String) -> String {
        self.computed()
            .map(|(id, operation)| statement(id, operation))
            .collect()
    }

    /// Constants with their names.
    pub(super) fn constants(&self) -> impl Iterator<Item = Constant<'_>> {
        let nodes = self.exported.program.nodes().iter().enumerate();
        nodes.filter_map(|(index, node)| {
            let Operation::Select { tables, .. } = &node.operation else {
                return None;
            };
            let id = NodeId::at(index);
            let dimensions = if self.is_matrix(id) { 2 } else { 1 };
            let of_rows = (tables.len() > 1).then_some(tables.len());
            let shape = of_rows.iter().chain(&tables[0].shape()[2 - dimensions..]);
            Some(Constant {
                name: self.name_of(id),
                precision: node.precision,
                shape: shape.copied().collect(),
                tables,
            })
        })
    }

    /// `true` for weights and points, which are matrices.
    pub(super) fn is_matrix(&self, id: NodeId) -> bool {
        self.exported.program.nodes().iter().any(|node| match &node.operation {
            Operation::Affine { weights: of, .. } | Operation::SquaredDistances { points: of, .. } => *of == id,
            _ => false,
        })
    }

    /// `true` if the constants differ between row-wires.
    pub(super) fn is_of_row(&self, id: NodeId) -> bool {
        matches!(&self.exported.program.node(id).operation, Operation::Select { tables, .. } if tables.len() > 1)
    }

    /// Names of the parts of an answer.
    pub(super) fn parts(&self) -> Vec<&str> {
        self.exported.parts().map(|id| self.name_of(id)).collect()
    }

    /// The names of the channels, `more` and the notes as lines for a comment of any language.
    pub(super) fn legend(&self, more: &str) -> Vec<String> {
        let notes = self.notes.iter().map(|note| comment(&format!("Note: {note}.")));
        let notes = notes.flat_map(|note| wrapped(&note));
        let lines = self.meaning.legend().into_iter().chain(wrapped(more));
        lines.chain(notes).collect()
    }

    pub(super) fn size(&self, id: NodeId) -> usize {
        self.exported.program.node(id).size
    }

    pub(super) fn precision_of(&self, id: NodeId) -> Precision {
        self.exported.program.node(id).precision
    }

    /// Precision of readings and targets.
    pub(super) fn outer_precision(&self) -> Precision {
        match self.precision {
            BundlePrecision::Single => Precision::Single,
            BundlePrecision::Double | BundlePrecision::Fixed16 => Precision::Double,
        }
    }

    pub(super) fn channels(&self) -> usize {
        self.exported.program.channels()
    }

    pub(super) fn outputs(&self) -> usize {
        self.exported.outputs()
    }

    /// `true` if there is a decoder for each known row, which makes the row an argument.
    pub(super) fn takes_row(&self) -> bool {
        self.rows > 1
    }

    /// The history, if the program has one.
    pub(super) fn history(&self) -> Option<PrintedHistory> {
        let mut nodes = self.exported.program.nodes().iter();
        nodes.find_map(|node| match &node.operation {
            Operation::History { of, memory } => {
                let constants = MemoryConstants::of(memory, self.size(*of));
                let constants = constants.expect("checked when the program was built");
                Some(PrintedHistory {
                    constants,
                    pause_s: memory.interval_s.map_or(f64::INFINITY, |usual_s| GAP * usual_s),
                })
            }
            _ => None,
        })
    }

    /// A deviation relative to [`Self::scales`], in mm for an array, and in per cent of the range of a target of own data.
    pub(super) fn in_words(&self, relative: f64) -> String {
        match self.meaning.is_array {
            true => format!("{} mm", format_number(relative * self.scales[0])),
            false => format!("{} % of its range in training", format_number(100.0 * relative)),
        }
    }

    /// The targets with their number.
    pub(super) fn outputs_in_words(&self) -> String {
        counted(self.outputs(), self.meaning.output())
    }

    /// The further parts of an answer, in words.
    pub(super) fn parts_in_words(&self) -> &'static str {
        match (self.exported.half_widths.is_some(), self.exported.outside.is_some()) {
            (true, true) => {
                ", the half-widths of their 90 % prediction intervals, and the number of readings out of range"
            }
            (true, false) => ", and the half-widths of their 90 % prediction intervals",
            (false, true) => ", and the number of readings out of range",
            (false, false) => "",
        }
    }

    /// What `readings_outside` counts.
    pub(super) fn outside_in_words(&self) -> &'static str {
        if self.history().is_some() {
            "Number of features (readings and values of their past) beyond the range seen in training by more than a tenth of it"
        } else {
            "Number of readings beyond the range seen in training by more than a tenth of it"
        }
    }

    /// How the caller keeps the state of a history.
    pub(super) fn state_in_words(&self) -> Option<String> {
        let history = self.history()?;
        let pause = match history.pause_s {
            f64::INFINITY => String::new(),
            pause_s => format!(", and after a pause of more than {pause_s} s ({GAP} usual intervals)"),
        };
        Some(format!(
            "Keep one state for each series of readings that continue each other: for each sensor, group and row-wire. It \
             restarts by itself where the time steps back{pause}. Where the time is not known, give NaN: the reading then comes \
             {} s after the one before, as usual.",
            history.constants.interval_s
        ))
    }
}
