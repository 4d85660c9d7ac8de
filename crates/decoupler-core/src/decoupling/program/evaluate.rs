use ndarray::{Array2, ArrayView2};
use pulp::{Simd, WithSimd};

use super::{
    Node, NodeId, Operation, Program,
    kernel::{self, LANES, Placement, Table},
};
use crate::{
    dataset::{Dataset, MemoryStream, PerRow, Series},
    decoupling::{DecodeError, Decoder, Precision},
};

/// Decoder that evaluates a [`Program`], many rows at a time and without allocation.
///
/// The answer to a row is the same to the last bit, whichever rows are evaluated with it. A program with
/// [history](Operation::History) takes the rows in their order, each one usual interval after the previous row of its
/// row-wire; [`Self::step`] takes the time and the group.
#[derive(Clone, Debug)]
pub struct ProgramDecoder {
    program: Program,
    nodes: Vec<Prepared>,
    /// Number of rows that are evaluated together.
    chunk: usize,
    /// Group and time of the current row.
    moment: (u64, Option<f64>),
}

/// A node prepared for evaluation.
#[derive(Clone, Debug)]
struct Prepared {
    work: Work,
    /// Number of values of a row.
    size: usize,
    /// Chunk × size, with room for the padding of the last row of a table.
    values: Vec<f64>,
}

/// Way in which a node is evaluated.
#[derive(Clone, Debug)]
enum Work {
    /// As the operation says, value by value.
    Plain,
    /// The readings, or those that were checked.
    Readings,
    /// Constants for all row-wires, repeated for each row of a chunk.
    Shared(Vec<f64>),
    /// Constants of each row-wire, one after the other.
    OfRow(Vec<f64>),
    /// Weights with biases, or points.
    Table(PerRow<Table>),
    Placement(PerRow<Placement>),
    /// A division whose dividend is the difference of these nodes.
    OfDifference(NodeId, NodeId),
    /// Not at all: no node takes its values.
    Skipped,
    /// Scratch for the shares of a blend.
    Blend(Vec<f64>),
    History(Box<MemoryStream>),
}

/// Maximum number of rows, and of values of a node, that are evaluated together: several rows fill the vector registers of
/// functions, and their values stay in the first-level cache.
const CHUNK_ROWS: usize = 16;
const CHUNK_VALUES: usize = 4096;

impl ProgramDecoder {
    /// Prepares a program for evaluation.
    pub fn new(program: Program) -> Self {
        let mut is_taken = vec![false; program.nodes().len()];
        is_taken[program.output().index()] = true;
        let mut works: Vec<Work> = program.nodes().iter().map(|node| Work::of(node, &program)).collect();
        for (node, work) in program.nodes().iter().zip(&works) {
            let values = match (&node.operation, work) {
                (Operation::Affine { of, biases, .. }, Work::Placement(_)) => vec![*of, *biases],
                (Operation::Affine { of, .. } | Operation::SquaredDistances { of, .. }, _) => vec![*of],
                (Operation::Divide(_, divisor), Work::OfDifference(one, other)) => vec![*one, *other, *divisor],
                (operation, _) => operation.operands(),
            };
            values.iter().for_each(|id| is_taken[id.index()] = true);
        }
        for (work, _) in works.iter_mut().zip(&is_taken).filter(|(_, is_taken)| !**is_taken) {
            *work = Work::Skipped;
        }
        let sizes = program.nodes().iter().zip(&is_taken);
        let widest = sizes
            .map(|(node, &is_taken)| if is_taken { node.size } else { 0 })
            .max();
        let chunk = (CHUNK_VALUES / widest.unwrap_or(0).max(1)).clamp(1, CHUNK_ROWS);
        let prepared = |(work, node): (Work, &Node)| {
            let length = chunk * node.size;
            let (work, length) = match work {
                Work::Readings | Work::Skipped => (work, 0),
                Work::Shared(values) => (Work::Shared(values.repeat(chunk)), 0),
                Work::Table(_) => (work, length + LANES),
                _ => (work, length),
            };
            Prepared {
                work,
                size: node.size,
                values: vec![0.0; length],
            }
        };
        let nodes = works.into_iter().zip(program.nodes()).map(prepared).collect();
        Self {
            program,
            nodes,
            chunk,
            moment: (0, None),
        }
    }

    /// The program.
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// Decodes the next row of a row-wire in a group of rows that continue each other, at a time in seconds if it is known.
    ///
    /// # Errors
    /// If a reading cannot be decoded.
    ///
    /// # Panics
    /// As [`Decoder::decode_row`].
    pub fn step(
        &mut self,
        (group, time_s): (u64, Option<f64>),
        row_index: usize,
        readings: &[f64],
        targets: &mut [f64],
    ) -> Result<(), DecodeError> {
        self.moment = (group, time_s);
        let decoded = self.decode_row(row_index, readings, targets);
        self.moment = (0, None);
        decoded
    }

    /// Forgets the past of all groups and row-wires.
    pub fn restart(&mut self) {
        for node in &mut self.nodes {
            if let Work::History(stream) = &mut node.work {
                stream.restart();
            }
        }
    }

    /// Answers to all samples of a set, each with the index of its row-wire: samples × outputs. NaN where a reading cannot be
    /// decoded.
    ///
    /// # Panics
    /// As [`Self::answers`].
    pub fn answers_to(&mut self, set: &Dataset) -> Array2<f64> {
        let row_indices = Vec::from_iter((0..set.samples()).map(|sample| set.row_index(sample)));
        self.answers(&row_indices, set.readings())
    }

    /// Answers to `readings` (samples × channels), each with the index of its row-wire: samples × outputs. NaN where a
    /// reading cannot be decoded.
    ///
    /// # Panics
    /// If the numbers of samples differ, or there is no such row-wire.
    pub fn answers(&mut self, row_indices: &[usize], readings: ArrayView2<'_, f64>) -> Array2<f64> {
        let (channels, outputs) = (self.channels(), self.outputs());
        assert_eq!(readings.dim(), (row_indices.len(), channels));
        let mut answers = Array2::from_elem((row_indices.len(), outputs), f64::NAN);
        let readings = readings.as_standard_layout();
        let readings = readings.as_slice().expect("in standard layout");
        let mut targets = answers.as_slice_mut().expect("in standard layout");
        let (mut row_indices, mut readings) = (row_indices, readings);
        // After an invalid sample, those before it are decoded once more, and then those after it.
        while let Err(DecodeError { row_index, .. }) = self.decode_rows(row_indices, readings, targets) {
            let valid = &mut targets[..row_index * outputs];
            let before = self.decode_rows(&row_indices[..row_index], &readings[..row_index * channels], valid);
            debug_assert_eq!(before, Ok(()));
            targets[row_index * outputs..(row_index + 1) * outputs].fill(f64::NAN);
            row_indices = &row_indices[row_index + 1..];
            readings = &readings[(row_index + 1) * channels..];
            targets = &mut targets[(row_index + 1) * outputs..];
        }
        answers
    }
}

impl Decoder for ProgramDecoder {
    fn channels(&self) -> usize {
        self.program.channels()
    }

    fn outputs(&self) -> usize {
        self.program.outputs()
    }

    fn decode_rows(&mut self, row_indices: &[usize], readings: &[f64], targets: &mut [f64]) -> Result<(), DecodeError> {
        let sizes = (row_indices.len() * self.channels(), row_indices.len() * self.outputs());
        assert_eq!((readings.len(), targets.len()), sizes, "whole rows");
        pulp::Arch::new().dispatch(Evaluation {
            decoder: self,
            row_indices,
            readings,
            targets,
        })
    }

    fn program(&self) -> Option<Program> {
        let is_blend = |node: &Node| matches!(node.operation, Operation::Blend { .. });
        let has_rules = self.program.nodes().iter().any(is_blend);
        (!has_rules).then(|| self.program.clone())
    }
}

impl Work {
    fn of(node: &Node, program: &Program) -> Self {
        let tables = |id: &NodeId| match &program.node(*id).operation {
            Operation::Select { tables, .. } => PerRow::each(tables.clone()),
            _ => panic!("the tables of an operation are constants"),
        };
        match &node.operation {
            Operation::Readings => Self::Readings,
            Operation::Valid { of, .. } if matches!(program.node(*of).operation, Operation::Readings) => Self::Readings,
            Operation::Select { tables, .. } => {
                let rounded = |&value: &f64| match node.precision {
                    Precision::Double => value,
                    Precision::Single => f64::from(value as f32),
                };
                let values = tables.iter().flatten().map(rounded).collect();
                if tables.len() == 1 {
                    Self::Shared(values)
                } else {
                    Self::OfRow(values)
                }
            }
            Operation::Affine { weights, biases, .. } => {
                let (weights, biases) = (tables(weights), tables(biases));
                let rows = weights.values().len().max(biases.values().len());
                let rows = || (0..rows).map(|row| (weights.at(row), biases.at(row)));
                let placements = rows().map(|(weights, _)| Placement::new(weights));
                match placements.collect() {
                    Some(placements) if node.precision == Precision::Double => {
                        Self::Placement(PerRow::each(placements))
                    }
                    _ => {
                        let stacked = rows().map(|(weights, biases)| Table::of_affine(node.precision, weights, biases));
                        Self::Table(PerRow::each(stacked.collect()))
                    }
                }
            }
            Operation::SquaredDistances { points, .. } => {
                Self::Table(tables(points).map(|points| Table::of_points(node.precision, points)))
            }
            Operation::Divide(dividend, _) => match program.node(*dividend) {
                Node {
                    operation: Operation::Subtract(one, other),
                    precision: Precision::Double,
                    ..
                } if program.uses(*dividend) == 1 => Self::OfDifference(*one, *other),
                _ => Self::Plain,
            },
            Operation::Blend { logits, .. } => Self::Blend(vec![0.0; program.node(*logits).size]),
            Operation::History { of, memory } => {
                let stream = MemoryStream::new(memory, program.node(*of).size);
                Self::History(Box::new(stream.expect("checked when the program was built")))
            }
            _ => Self::Plain,
        }
    }
}

/// A struct instead of a closure so that the body is inlined into the SIMD-dispatched function.
struct Evaluation<'a> {
    decoder: &'a mut ProgramDecoder,
    row_indices: &'a [usize],
    readings: &'a [f64],
    targets: &'a mut [f64],
}

impl WithSimd for Evaluation<'_> {
    type Output = Result<(), DecodeError>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self {
            decoder,
            row_indices,
            readings,
            targets,
        } = self;
        let (channels, outputs) = (decoder.channels(), decoder.outputs());
        for first in (0..row_indices.len()).step_by(decoder.chunk) {
            let end = row_indices.len().min(first + decoder.chunk);
            let indices = &row_indices[first..end];
            let rows = Rows {
                indices,
                is_run: indices.windows(2).all(|pair| pair[1] == pair[0] + 1),
                readings: &readings[first * channels..end * channels],
            };
            let targets = &mut targets[first * outputs..end * outputs];
            decoder
                .evaluate_chunk(&rows, targets)
                .map_err(|error| error.after(first))?;
        }
        Ok(())
    }
}

/// Rows that are evaluated together.
struct Rows<'a> {
    /// Index of the row-wire of each.
    indices: &'a [usize],
    /// Whether these are consecutive row-wires, as in a frame.
    is_run: bool,
    /// Rows × channels.
    readings: &'a [f64],
}

impl Rows<'_> {
    /// Values of a node that was evaluated, rows × size.
    #[inline(always)]
    fn values<'a>(&'a self, node: &'a Prepared) -> &'a [f64] {
        let length = self.indices.len() * node.size;
        match &node.work {
            Work::Readings => self.readings,
            Work::Shared(constants) => &constants[..length],
            Work::OfRow(constants) if self.is_run => {
                let first = self.indices[0] * node.size;
                &constants[first..first + length]
            }
            _ => &node.values[..length],
        }
    }
}

impl ProgramDecoder {
    #[inline(always)]
    fn evaluate_chunk(&mut self, rows: &Rows<'_>, targets: &mut [f64]) -> Result<(), DecodeError> {
        let Self {
            program, nodes, moment, ..
        } = self;
        let output = program.output().index();
        // The last values are written where they are wanted, unless their padding would be too.
        let is_padded = |node: &Prepared| matches!(node.work, Work::Table(_)) && !node.size.is_multiple_of(LANES);
        let is_direct = !is_padded(&nodes[output]);
        for (index, node) in program.nodes().iter().enumerate() {
            let (before, rest) = nodes.split_at_mut(index);
            let Prepared { work, size, values } = &mut rest[0];
            let (size, precision) = (*size, node.precision);
            let values = if index == output && is_direct {
                &mut *targets
            } else {
                &mut values[..]
            };
            let all = |id: NodeId| rows.values(&before[id.index()]);
            let by_row = |id: NodeId| {
                let (size, values) = (before[id.index()].size, all(id));
                move |row: usize| &values[row * size..(row + 1) * size]
            };
            let of_rows = rows.indices.iter().copied().enumerate();
            match (&node.operation, work) {
                (_, Work::Skipped | Work::Shared(_)) | (Operation::Readings, _) => {}
                (_, Work::OfRow(constants)) => {
                    if !rows.is_run {
                        for (r, row_index) in of_rows {
                            let constants = &constants[row_index * size..(row_index + 1) * size];
                            values[r * size..(r + 1) * size].copy_from_slice(constants);
                        }
                    }
                }
                (Operation::Valid { of, domain }, work) => {
                    let checked = all(*of);
                    // Invalid readings are rare: one vectorised pass finds whether there may be any.
                    if !checked.iter().fold(true, |all, &value| all & domain.contains(value))
                        && let Some(place) = checked.iter().position(|&value| !domain.contains(value))
                    {
                        return Err(DecodeError {
                            row_index: place / size,
                            channel: place % size,
                            value: checked[place],
                        });
                    }
                    if !matches!(work, Work::Readings) {
                        values[..checked.len()].copy_from_slice(checked);
                    }
                }
                (Operation::Subtract(one, other), _) => kernel::subtract(precision, all(*one), all(*other), values),
                (Operation::Divide(_, divisor), Work::OfDifference(one, other)) => {
                    kernel::subtract_and_divide(precision, [all(*one), all(*other), all(*divisor)], values);
                }
                (Operation::Divide(one, other), _) => kernel::divide(precision, all(*one), all(*other), values),
                (Operation::Map(function, of), _) => kernel::map(precision, *function, all(*of), values),
                (Operation::Affine { of, biases, .. }, Work::Placement(placements)) => {
                    let (of, biases) = (by_row(*of), all(*biases));
                    values[..biases.len()].copy_from_slice(biases);
                    for (r, row_index) in of_rows {
                        placements
                            .at(row_index)
                            .add(of(r), &mut values[r * size..(r + 1) * size]);
                    }
                }
                (Operation::Affine { of, .. }, Work::Table(tables)) => {
                    let of = by_row(*of);
                    for (r, row_index) in of_rows {
                        tables.at_mut(row_index).affine(of(r), &mut values[r * size..]);
                    }
                }
                (Operation::SquaredDistances { of, .. }, Work::Table(tables)) => {
                    let of = by_row(*of);
                    for (r, row_index) in of_rows {
                        tables
                            .at_mut(row_index)
                            .squared_distances(of(r), &mut values[r * size..]);
                    }
                }
                (Operation::Clip { of, low, high }, _) => {
                    kernel::clip(precision, all(*of), [all(*low), all(*high)], values);
                }
                (Operation::Concatenate(parts), _) => {
                    let mut first = 0;
                    for part in parts {
                        let (part, of) = (before[part.index()].size, by_row(*part));
                        for (r, _) in of_rows.clone() {
                            values[r * size + first..r * size + first + part].copy_from_slice(of(r));
                        }
                        first += part;
                    }
                }
                (Operation::Blend { logits, of }, Work::Blend(shares)) => {
                    let (logits, of) = (by_row(*logits), by_row(*of));
                    for (r, _) in of_rows {
                        kernel::blend(logits(r), of(r), shares, &mut values[r * size..(r + 1) * size]);
                    }
                }
                (Operation::History { of, .. }, Work::History(stream)) => {
                    let ((group, time_s), of) = (*moment, by_row(*of));
                    for (r, row_wire) in of_rows {
                        let (past, _) = stream.step(Series { group, row_wire }, of(r), time_s);
                        values[r * size..(r + 1) * size].copy_from_slice(past);
                    }
                }
                (Operation::CountOutside { of, low, high }, _) => {
                    let [of, low, high] = [of, low, high].map(|id| by_row(*id));
                    for (r, _) in of_rows {
                        let limits = low(r).iter().zip(high(r));
                        let outside = limits
                            .zip(of(r))
                            .filter(|((low, high), value)| !(*low..=*high).contains(value));
                        values[r] = outside.count() as f64;
                    }
                }
                _ => unreachable!("every operation is prepared as such"),
            }
        }
        let last = &nodes[output];
        if !is_direct || matches!(last.work, Work::Readings | Work::Shared(_) | Work::OfRow(_)) {
            targets.copy_from_slice(rows.values(last));
        }
        Ok(())
    }
}
