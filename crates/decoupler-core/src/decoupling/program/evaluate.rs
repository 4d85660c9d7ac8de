use ndarray::{Array2, ArrayView2};
use pulp::{Simd, WithSimd};

use super::{
    Node, NodeId, Operation, Program,
    kernel::{self, LANES, Placement, Table},
};
use crate::{
    dataset::{MemoryStream, PerRow, Series},
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
    /// Distance between the values of consecutive rows: the size with padding, whose values are unspecified.
    stride: usize,
    /// Chunk × stride.
    values: Vec<f64>,
}

/// Way in which a node is evaluated.
#[derive(Clone, Debug)]
enum Work {
    /// As the operation says, value by value.
    Plain,
    /// The readings, or those that were checked.
    Readings,
    Constants(PerRow<Vec<f64>>),
    /// Weights with biases, or points.
    Table(PerRow<Table>),
    Placement(PerRow<Placement>),
    /// A division whose dividend is the difference of these nodes.
    OfDifference(NodeId, NodeId),
    /// Not at all: the only node that takes it does without.
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
        let mut nodes: Vec<Prepared> = Vec::with_capacity(program.nodes().len());
        for node in program.nodes() {
            let work = Work::of(node, &program);
            let stride = match (&work, &node.operation) {
                (Work::Table(_), _) => node.size.next_multiple_of(LANES),
                (_, Operation::Map(_, of) | Operation::Valid { of, .. }) => nodes[of.index()].stride,
                _ => node.size,
            };
            nodes.push(Prepared {
                work,
                stride,
                values: Vec::new(),
            });
        }
        // A relative change takes one pass over the readings, not two.
        let differences =
            nodes
                .iter()
                .zip(program.nodes())
                .filter_map(|(prepared, node)| match (&prepared.work, &node.operation) {
                    (Work::OfDifference(..), Operation::Divide(difference, _)) => Some(difference.index()),
                    _ => None,
                });
        for difference in Vec::from_iter(differences) {
            nodes[difference].work = Work::Skipped;
        }
        let widest = nodes.iter().map(|node| node.stride).max().unwrap_or(0);
        let chunk = (CHUNK_VALUES / widest.max(1)).clamp(1, CHUNK_ROWS);
        for node in &mut nodes {
            if !matches!(node.work, Work::Readings | Work::Constants(_) | Work::Skipped) {
                node.values = vec![0.0; chunk * node.stride];
            }
        }
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
                let of_row = |table: &Array2<f64>| table.iter().map(rounded).collect();
                Self::Constants(PerRow::each(tables.iter().map(of_row).collect()))
            }
            Operation::Affine { of, weights, biases } => {
                let inputs = program.node(*of).size;
                let (weights, biases) = (tables(weights), tables(biases));
                let rows = weights.values().len().max(biases.values().len());
                let rows = || (0..rows).map(|row| (weights.at(row), biases.at(row)));
                let placements = rows().map(|(weights, biases)| Placement::new(weights, biases));
                match placements.collect() {
                    Some(placements) if node.precision == Precision::Double => {
                        Self::Placement(PerRow::each(placements))
                    }
                    _ => {
                        let stacked =
                            rows().map(|(weights, biases)| Table::new(node.precision, inputs, &[weights, biases]));
                        Self::Table(PerRow::each(stacked.collect()))
                    }
                }
            }
            Operation::SquaredDistances { of, points } => {
                let inputs = program.node(*of).size;
                Self::Table(tables(points).map(|points| Table::new(node.precision, inputs, &[points])))
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
            let rows = Rows {
                indices: &row_indices[first..end],
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
    /// Rows × channels.
    readings: &'a [f64],
}

impl Rows<'_> {
    /// Values of all rows with the padding of each; `None` for constants.
    #[inline(always)]
    fn block<'a>(&'a self, node: &'a Prepared) -> Option<&'a [f64]> {
        match node.work {
            Work::Readings => Some(self.readings),
            Work::Constants(_) => None,
            _ => Some(&node.values[..self.indices.len() * node.stride]),
        }
    }

    /// Values of a row with padding.
    #[inline(always)]
    fn row<'a>(&'a self, node: &'a Prepared, row: usize) -> &'a [f64] {
        match &node.work {
            Work::Constants(constants) => constants.at(self.indices[row]),
            Work::Readings => &self.readings[row * node.stride..(row + 1) * node.stride],
            _ => &node.values[row * node.stride..(row + 1) * node.stride],
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
        let outputs = program.outputs();
        for (index, node) in program.nodes().iter().enumerate() {
            let (before, rest) = nodes.split_at_mut(index);
            let Prepared { work, stride, values } = &mut rest[0];
            let (stride, precision) = (*stride, node.precision);
            // The last values are written where they are wanted, unless they have padding.
            let values = if index == output && stride == outputs {
                &mut *targets
            } else {
                &mut values[..]
            };
            let operand = |id: NodeId| &before[id.index()];
            let row = |id: NodeId, row: usize| rows.row(operand(id), row);
            macro_rules! of_rows {
                (|$row:ident, $results:ident| $body:expr) => {
                    for $row in 0..rows.indices.len() {
                        let $results = &mut values[$row * stride..($row + 1) * stride];
                        $body
                    }
                };
            }
            match (&node.operation, work) {
                (Operation::Readings | Operation::Select { .. }, _) | (_, Work::Skipped) => {}
                (Operation::Valid { of, domain }, work) => {
                    let block = rows.block(operand(*of)).expect("constants need no check");
                    // Invalid readings are rare: one vectorised pass finds whether there may be any.
                    if !block.iter().fold(true, |all, &value| all & domain.contains(value)) {
                        for row_index in 0..rows.indices.len() {
                            let values = &row(*of, row_index)[..node.size];
                            if let Some(channel) = values.iter().position(|&value| !domain.contains(value)) {
                                let value = values[channel];
                                return Err(DecodeError {
                                    row_index,
                                    channel,
                                    value,
                                });
                            }
                        }
                    }
                    if !matches!(work, Work::Readings) {
                        values[..block.len()].copy_from_slice(block);
                    }
                }
                (Operation::Subtract(one, other), _) => {
                    of_rows!(|r, results| kernel::subtract(precision, row(*one, r), row(*other, r), results));
                }
                (Operation::Divide(_, divisor), Work::OfDifference(one, other)) => {
                    of_rows!(|r, results| {
                        let operands = [row(*one, r), row(*other, r), row(*divisor, r)];
                        kernel::subtract_and_divide(precision, operands, results);
                    });
                }
                (Operation::Divide(one, other), _) => {
                    of_rows!(|r, results| kernel::divide(precision, row(*one, r), row(*other, r), results));
                }
                (Operation::Map(function, of), _) => match rows.block(operand(*of)) {
                    Some(block) => kernel::map(precision, *function, block, values),
                    None => of_rows!(|r, results| kernel::map(precision, *function, row(*of, r), results)),
                },
                (Operation::Affine { of, .. }, Work::Placement(placements)) => {
                    of_rows!(|r, results| placements.at(rows.indices[r]).apply(row(*of, r), results));
                }
                (Operation::Affine { of, .. }, Work::Table(tables)) => {
                    let inputs = program.node(*of).size;
                    of_rows!(|r, results| tables.at_mut(rows.indices[r]).affine(&row(*of, r)[..inputs], results));
                }
                (Operation::SquaredDistances { of, .. }, Work::Table(tables)) => {
                    let inputs = program.node(*of).size;
                    of_rows!(|r, results| {
                        let points = tables.at_mut(rows.indices[r]);
                        points.squared_distances(&row(*of, r)[..inputs], results);
                    });
                }
                (Operation::Clip { of, low, high }, _) => of_rows!(|r, results| {
                    let limits = row(*low, r).iter().zip(row(*high, r));
                    for ((result, &value), (&low, &high)) in results.iter_mut().zip(row(*of, r)).zip(limits) {
                        // Written so that NaN passes through.
                        let above = if value < low { low } else { value };
                        let clipped = if above > high { high } else { above };
                        *result = match precision {
                            Precision::Double => clipped,
                            Precision::Single => f64::from(clipped as f32),
                        };
                    }
                }),
                (Operation::Concatenate(parts), _) => of_rows!(|r, results| {
                    let mut first = 0;
                    for part in parts {
                        let size = program.node(*part).size;
                        results[first..first + size].copy_from_slice(&row(*part, r)[..size]);
                        first += size;
                    }
                }),
                (Operation::Blend { logits, of }, Work::Blend(shares)) => {
                    let count = shares.len();
                    of_rows!(|r, results| kernel::blend(&row(*logits, r)[..count], row(*of, r), shares, results));
                }
                (Operation::History { of, .. }, Work::History(stream)) => {
                    let channels = program.node(*of).size;
                    let (group, time_s) = *moment;
                    of_rows!(|r, results| {
                        let series = Series {
                            group,
                            row_wire: rows.indices[r],
                        };
                        results.copy_from_slice(stream.step(series, &row(*of, r)[..channels], time_s).0);
                    });
                }
                (Operation::CountOutside { of, low, high }, _) => of_rows!(|r, results| {
                    let limits = row(*low, r).iter().zip(row(*high, r));
                    let outside = limits
                        .zip(row(*of, r))
                        .filter(|((low, high), value)| !(*low..=*high).contains(value));
                    results[0] = outside.count() as f64;
                }),
                _ => unreachable!("every operation is prepared as such"),
            }
        }
        let last = &nodes[output];
        if last.stride != outputs || matches!(last.work, Work::Readings | Work::Constants(_)) {
            for row in 0..rows.indices.len() {
                targets[row * outputs..(row + 1) * outputs].copy_from_slice(&rows.row(last, row)[..outputs]);
            }
        }
        Ok(())
    }
}
