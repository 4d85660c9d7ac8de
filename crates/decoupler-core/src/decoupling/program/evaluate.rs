use ndarray::{Array2, ArrayView2};
use pulp::{Simd, WithSimd};

use super::{
    Node, NodeId, Operation, Program,
    kernel::{self, LANES, Padded, Placement, Real},
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
    /// Nodes that are evaluated for each chunk, in their order.
    steps: Vec<usize>,
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
    /// Chunk × size, in the node's precision and in that of the nodes that take the values.
    values: Values,
}

/// Values in one or both precisions; the other is empty.
#[derive(Clone, Debug, Default)]
struct Values {
    doubles: Vec<f64>,
    singles: Vec<f32>,
}

/// Way in which a node is evaluated.
#[derive(Clone, Debug)]
enum Work {
    /// As the operation says, value by value.
    Plain,
    /// The readings, or those that were checked: they are not copied.
    Readings,
    /// Constants for all row-wires, which are repeated for each row of a chunk from the beginning.
    Shared(Vec<f64>),
    /// Constants of each row-wire, one after the other.
    OfRow(Values),
    /// Weights with biases, or points.
    Doubles(PerRow<Padded<f64>>),
    Singles(PerRow<Padded<f32>>),
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
        let works: Vec<Work> = program.nodes().iter().map(|node| Work::of(node, &program)).collect();
        // Nodes whose values are taken in double and in single precision.
        let mut taken_in = [vec![false; works.len()], vec![false; works.len()]];
        taken_in[0][program.output().index()] = true;
        for (node, work) in program.nodes().iter().zip(&works) {
            let taken = match (&node.operation, work) {
                (Operation::Affine { of, biases, .. }, Work::Placement(_)) => vec![*of, *biases],
                (Operation::Affine { of, .. } | Operation::SquaredDistances { of, .. }, _) => vec![*of],
                (Operation::Divide(_, divisor), Work::OfDifference(one, other)) => vec![*one, *other, *divisor],
                (operation, _) => operation.operands(),
            };
            let is_single = work.is_single(node) && !matches!(work, Work::OfDifference(..));
            let places = &mut taken_in[usize::from(is_single)];
            taken.iter().for_each(|id| places[id.index()] = true);
        }
        let [in_double, in_single] = taken_in;
        let is_taken = |place: usize| in_double[place] || in_single[place];
        let sizes = program.nodes().iter().enumerate();
        let widest = sizes
            .map(|(place, node)| if is_taken(place) { node.size } else { 0 })
            .max();
        let chunk = (CHUNK_VALUES / widest.unwrap_or(0).max(1)).clamp(1, CHUNK_ROWS);
        let prepared = |(place, (work, node)): (usize, (Work, &Node))| {
            // The last row of a table is written with its padding.
            let length = chunk * node.size + LANES;
            let is_single = work.is_single(node);
            let zeros = |is_needed: bool| if is_taken(place) && is_needed { length } else { 0 };
            let mut values = Values {
                doubles: vec![0.0; zeros(!matches!(work, Work::Readings) && (in_double[place] || !is_single))],
                singles: vec![0.0; zeros(in_single[place] || is_single)],
            };
            if let Work::Shared(constants) = &work {
                let repeated = Vec::from_iter(constants.iter().copied().cycle().take(chunk * node.size));
                convert(&repeated, &mut values.doubles, |value| value);
                convert(&repeated, &mut values.singles, |value| value as f32);
            }
            Prepared {
                work: if is_taken(place) { work } else { Work::Skipped },
                size: node.size,
                values,
            }
        };
        let nodes = Vec::from_iter(works.into_iter().zip(program.nodes()).enumerate().map(prepared));
        let is_step = |&place: &usize| !matches!(nodes[place].work, Work::Skipped | Work::Shared(_));
        let steps = (0..=program.output().index()).filter(is_step).collect();
        Self {
            program,
            nodes,
            steps,
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

    #[inline(always)]
    fn evaluate_chunk(&mut self, rows: &Rows<'_>, targets: &mut [f64]) -> Result<(), DecodeError> {
        let Self {
            program,
            nodes,
            steps,
            moment,
            ..
        } = self;
        let output = program.output().index();
        for &index in &*steps {
            let node = &program.nodes()[index];
            let (before, rest) = nodes.split_at_mut(index);
            let Prepared { work, size, values } = &mut rest[0];
            let size = *size;
            if work.is_single(node) {
                let is_computed = rows.compute::<f32>(node, work, before, &mut values.singles);
                assert!(is_computed, "the operation is one of single precision");
                convert(&values.singles, &mut values.doubles, f64::from);
                continue;
            }
            // The last values are written where they are wanted, unless they have padding.
            let has_padding = matches!(work, Work::Doubles(_));
            let results = if index == output && !has_padding {
                &mut *targets
            } else {
                &mut values.doubles[..]
            };
            let all = |id: &NodeId| rows.values::<f64>(&before[id.index()]);
            let by_row = |id: &NodeId| rows.by_row::<f64>(&before[id.index()]);
            let of_rows = rows.indices.iter().copied().enumerate();
            match (&node.operation, work) {
                (Operation::Readings, _) => convert(rows.readings, &mut values.singles, |value| value as f32),
                (_, Work::OfRow(constants)) => {
                    if !rows.is_run {
                        for (row, row_index) in of_rows {
                            let (to, from) = (row * size..(row + 1) * size, row_index * size..(row_index + 1) * size);
                            if !results.is_empty() {
                                results[to.clone()].copy_from_slice(&constants.doubles[from.clone()]);
                            }
                            if !values.singles.is_empty() {
                                values.singles[to].copy_from_slice(&constants.singles[from]);
                            }
                        }
                    }
                }
                (Operation::Valid { of, domain }, work) => {
                    let checked = all(of);
                    // Invalid readings are rare: one vectorised pass finds whether there is any.
                    if !kernel::are_valid(*domain, checked)
                        && let Some(place) = checked.iter().position(|&value| !domain.contains(value))
                    {
                        return Err(DecodeError {
                            row_index: place / size,
                            channel: place % size,
                            value: checked[place],
                        });
                    }
                    if matches!(work, Work::Readings) {
                        convert(checked, &mut values.singles, |value| value as f32);
                    } else {
                        results[..checked.len()].copy_from_slice(checked);
                    }
                }
                (Operation::Affine { of, biases, .. }, Work::Placement(placements)) => {
                    let (of, biases) = (by_row(of), all(biases));
                    results[..biases.len()].copy_from_slice(biases);
                    for (row, row_index) in of_rows {
                        placements
                            .at(row_index)
                            .apply(of(row), &mut results[row * size..(row + 1) * size]);
                    }
                }
                (Operation::Concatenate(parts), _) => {
                    let mut first = 0;
                    for part in parts {
                        let (part, of) = (before[part.index()].size, by_row(part));
                        for (row, _) in of_rows.clone() {
                            results[row * size + first..row * size + first + part].copy_from_slice(of(row));
                        }
                        first += part;
                    }
                }
                (Operation::Blend { logits, of }, Work::Blend(shares)) => {
                    let (logits, of) = (by_row(logits), by_row(of));
                    for (row, _) in of_rows {
                        kernel::blend(logits(row), of(row), shares, &mut results[row * size..(row + 1) * size]);
                    }
                }
                (Operation::History { of, .. }, Work::History(stream)) => {
                    let ((group, time_s), of) = (*moment, by_row(of));
                    for (row, row_wire) in of_rows {
                        let (past, _) = stream.step(Series { group, row_wire }, of(row), time_s);
                        results[row * size..(row + 1) * size].copy_from_slice(past);
                    }
                }
                (Operation::CountOutside { of, low, high }, _) => {
                    let [of, low, high] = [of, low, high].map(by_row);
                    for (row, _) in of_rows {
                        let limits = low(row).iter().zip(high(row));
                        let outside = limits
                            .zip(of(row))
                            .filter(|((low, high), value)| !(*low..=*high).contains(value));
                        results[row] = outside.count() as f64;
                    }
                }
                (_, work) => {
                    let is_computed = rows.compute::<f64>(node, work, before, results);
                    assert!(is_computed, "every operation is prepared as such");
                }
            }
            if !matches!(rest[0].work, Work::Readings | Work::OfRow(_)) {
                let Values { doubles, singles } = &mut rest[0].values;
                convert(doubles, singles, |value| value as f32);
            }
        }
        let last = &nodes[output];
        let is_elsewhere = matches!(
            last.work,
            Work::Readings | Work::Shared(_) | Work::OfRow(_) | Work::Doubles(_) | Work::Singles(_)
        );
        if is_elsewhere || last.work.is_single(program.node(program.output())) {
            targets.copy_from_slice(rows.values(last));
        }
        Ok(())
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
                let doubles = Vec::from_iter(tables.iter().flatten().map(rounded));
                if tables.len() == 1 {
                    return Self::Shared(doubles);
                }
                let singles = doubles.iter().map(|&value| value as f32).collect();
                Self::OfRow(Values { doubles, singles })
            }
            Operation::Affine { weights, biases, .. } => {
                let (weights, biases) = (tables(weights), tables(biases));
                let rows = weights.values().len().max(biases.values().len());
                let rows = || (0..rows).map(|row| (weights.at(row), biases.at(row)));
                let placements = rows().map(|(weights, biases)| Placement::new(weights, biases));
                match placements.collect() {
                    Some(placements) if node.precision == Precision::Double => {
                        Self::Placement(PerRow::each(placements))
                    }
                    _ if node.precision == Precision::Double => {
                        let stacked = rows().map(|(weights, biases)| Padded::of_affine(weights, biases));
                        Self::Doubles(PerRow::each(stacked.collect()))
                    }
                    _ => {
                        let stacked = rows().map(|(weights, biases)| Padded::of_affine(weights, biases));
                        Self::Singles(PerRow::each(stacked.collect()))
                    }
                }
            }
            Operation::SquaredDistances { points, .. } => match node.precision {
                Precision::Double => Self::Doubles(tables(points).map(Padded::of_points)),
                Precision::Single => Self::Singles(tables(points).map(Padded::of_points)),
            },
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

    /// True if the values of the node are computed in single precision.
    fn is_single(&self, node: &Node) -> bool {
        let is_plain = match node.operation {
            Operation::Subtract(..) | Operation::Divide(..) | Operation::Map(..) | Operation::Clip { .. } => true,
            _ => matches!(self, Self::Singles(_)),
        };
        is_plain && node.precision == Precision::Single
    }
}

/// Precision of values.
trait Width: Real {
    /// The values in this precision.
    fn held(values: &Values) -> &[Self];

    /// The readings, which are converted only to single precision.
    fn read<'a>(readings: &'a [f64], converted: &'a Values) -> &'a [Self];

    /// Weights or points in this precision, if the node has any.
    fn tables(work: &Work) -> Option<&PerRow<Padded<Self>>>;
}

impl Width for f64 {
    #[inline(always)]
    fn held(values: &Values) -> &[Self] {
        &values.doubles
    }

    #[inline(always)]
    fn read<'a>(readings: &'a [f64], _: &'a Values) -> &'a [Self] {
        readings
    }

    #[inline(always)]
    fn tables(work: &Work) -> Option<&PerRow<Padded<Self>>> {
        match work {
            Work::Doubles(tables) => Some(tables),
            _ => None,
        }
    }
}

impl Width for f32 {
    #[inline(always)]
    fn held(values: &Values) -> &[Self] {
        &values.singles
    }

    #[inline(always)]
    fn read<'a>(_: &'a [f64], converted: &'a Values) -> &'a [Self] {
        &converted.singles
    }

    #[inline(always)]
    fn tables(work: &Work) -> Option<&PerRow<Padded<Self>>> {
        match work {
            Work::Singles(tables) => Some(tables),
            _ => None,
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
    fn values<'a, T: Width>(&'a self, node: &'a Prepared) -> &'a [T] {
        let length = self.indices.len() * node.size;
        match &node.work {
            Work::Readings => &T::read(self.readings, &node.values)[..length],
            Work::OfRow(constants) if self.is_run => {
                let first = self.indices[0] * node.size;
                &T::held(constants)[first..first + length]
            }
            _ => &T::held(&node.values)[..length],
        }
    }

    /// Values of a row, by its place.
    #[inline(always)]
    fn by_row<'a, T: Width>(&'a self, node: &'a Prepared) -> impl Fn(usize) -> &'a [T] {
        let (size, values) = (node.size, self.values(node));
        move |row: usize| &values[row * size..(row + 1) * size]
    }

    /// Computes values in the precision `T`; returns `false` if the operation is one of double precision alone.
    #[inline(always)]
    fn compute<T: Width>(&self, node: &Node, work: &Work, before: &[Prepared], results: &mut [T]) -> bool {
        let all = |id: &NodeId| self.values::<T>(&before[id.index()]);
        let of_rows = self.indices.iter().copied().enumerate();
        match (&node.operation, work) {
            (Operation::Divide(_, divisor), Work::OfDifference(one, other)) => {
                let operands = [one, other, divisor].map(|id| self.values::<f64>(&before[id.index()]));
                kernel::subtract_and_divide(operands, results);
            }
            (Operation::Subtract(one, other), _) => {
                kernel::pairs(all(one), all(other), results, |one, other| one - other);
            }
            (Operation::Divide(one, other), _) => {
                kernel::pairs(all(one), all(other), results, |one, other| one / other);
            }
            (Operation::Map(function, of), _) => kernel::map(*function, all(of), results),
            (Operation::Clip { of, low, high }, _) => kernel::clip(all(of), [all(low), all(high)], results),
            (Operation::Affine { of, .. } | Operation::SquaredDistances { of, .. }, work) => {
                let Some(tables) = T::tables(work) else { return false };
                let of = self.by_row(&before[of.index()]);
                let is_affine = matches!(node.operation, Operation::Affine { .. });
                for (row, row_index) in of_rows {
                    let (table, results) = (tables.at(row_index), &mut results[row * node.size..]);
                    if is_affine {
                        table.affine(of(row), results);
                    } else {
                        table.squared_distances(of(row), results);
                    }
                }
            }
            _ => return false,
        }
        true
    }
}

/// Converts values for the nodes that take them in the other precision, if there are any.
#[inline(always)]
fn convert<T: Copy, U>(from: &[T], to: &mut [U], convert: impl Fn(T) -> U) {
    to.iter_mut().zip(from).for_each(|(to, &value)| *to = convert(value));
}
