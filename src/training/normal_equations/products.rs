use faer::{
    Accum, Mat, MatMut, MatRef, Par,
    linalg::matmul::{
        matmul,
        triangular::{self, BlockStructure},
    },
};

use crate::{
    network::{Mlp, Shape},
    training::{
        Evaluation, Examples,
        activations::{BlockNow, KeptActivations},
        elementwise::{multiply, multiply_into, tanh_slopes_into},
        examples::{BLOCK, column, column_mut},
        input_pairs::{InputPairs, PairsRoom},
        parallel::{add_product, for_each_part},
    },
};

/// Columns that are filled at a time, so that they stay in the cache.
const CHUNK: usize = 512;

/// How much of BᵀB is gathered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GramPart {
    /// All of it, packed: pairs of inputs × pairs of hidden nodes, pair (i, j ≤ i) at i(i+1)/2 + j. BᵀB is symmetric in
    /// both, so it is one product of pairs: (pairs of columns of A)ᵀ × (pairs of columns of D).
    All,
    /// The block of each hidden node with itself, the lower triangle: n1 × h·n1.
    NodeBlocks,
}

impl GramPart {
    /// Rows and columns of what is gathered.
    pub(super) fn size(self, shape: Shape) -> (usize, usize) {
        let (h, n1) = (shape.hidden, shape.inputs + 1);
        match self {
            Self::All => (n1 * (n1 + 1) / 2, h * (h + 1) / 2),
            Self::NodeBlocks => (n1, h * n1),
        }
    }
}

/// The products from which the equations are made, gathered from the samples.
pub(super) struct Products {
    input_pairs: Option<InputPairs>,
    /// One for each part of the samples; once gathered, the first has the sums of all.
    parts: Vec<(Sums, BlockRoom)>,
}

/// Sums over samples.
pub(super) struct Sums {
    shape: Shape,
    /// As much of BᵀB as [`GramPart`] says.
    pub(super) gram: Mat<f64>,
    /// C: h·n1 × (h+1), column by column without gaps, so that it is also n1 × h(h+1).
    c: Vec<f64>,
    /// H̃ᵀH̃.
    pub(super) g: Mat<f64>,
    /// Jwᵀe: n1 × h.
    pub(super) gradient_w: Mat<f64>,
    /// Jvᵀe: (h+1) × outputs.
    pub(super) gradient_v: Mat<f64>,
}

/// Room for one block of samples.
struct BlockRoom {
    input_pairs: Option<PairsRoom>,
    /// D: block × h.
    slopes: Mat<f64>,
    /// Some columns that enter a product: block × up to [`CHUNK`] or a little more.
    columns: Mat<f64>,
    /// Error at the hidden nodes' net input: block × h.
    delta: Mat<f64>,
}

impl BlockRoom {
    fn new(shape: Shape, input_pairs: Option<&InputPairs>) -> Self {
        let (h, n1) = (shape.hidden, shape.inputs + 1);
        Self {
            input_pairs: input_pairs.map(|pairs| pairs.room(n1)),
            slopes: Mat::zeros(BLOCK, h),
            columns: Mat::zeros(BLOCK, (h * (h + 1)).min(CHUNK + h).max(n1)),
            delta: Mat::zeros(BLOCK, h),
        }
    }
}

impl Products {
    /// Room for samples in so many `parts`.
    pub(super) fn new(shape: Shape, examples: &Examples, gram_part: GramPart, parts: usize) -> Self {
        let input_pairs = (gram_part == GramPart::All).then(|| InputPairs::new(examples));
        let part = |_| {
            let room = BlockRoom::new(shape, input_pairs.as_ref());
            (Sums::new(shape, gram_part), room)
        };
        Self {
            parts: (0..parts).map(part).collect(),
            input_pairs,
        }
    }

    /// About how many bytes each part of the samples takes.
    pub(super) fn bytes(shape: Shape, gram_part: GramPart) -> usize {
        let (h, n1) = (shape.hidden, shape.inputs + 1);
        let (rows, columns) = gram_part.size(shape);
        let pairs = if gram_part == GramPart::All { rows } else { 0 };
        let room = BLOCK * (CHUNK.min(h * h) + 3 * h + n1 + pairs);
        size_of::<f64>() * (rows * columns + shape.hidden_weights() * (h + 1) + room)
    }

    /// What was last gathered.
    pub(super) fn sums(&self) -> &Sums {
        &self.parts[0].0
    }

    /// Gathers all products at the weights of `mlp`, block by block of samples.
    pub(super) fn gather(&mut self, mlp: &Mlp, examples: &Examples, kept: &mut KeptActivations) -> Evaluation {
        let squares = kept.evaluate(mlp, examples);
        for_each_part(&mut self.parts, |(sums, _)| sums.clear());
        let input_pairs = self.input_pairs.as_ref();
        kept.for_each_block(mlp, examples, &mut self.parts, |(sums, room), now| {
            sums.add_second_order(now, input_pairs, room);
            sums.add_gradient(now, mlp, room);
        });
        if let [(sums, _), others @ ..] = self.parts.as_mut_slice() {
            others.iter().for_each(|(other, _)| sums.add(other));
        }
        let sums = self.sums();
        let length = sums.gradient_w.squared_norm_l2() + sums.gradient_v.squared_norm_l2();
        Evaluation {
            mse: squares / examples.errors(),
            gradient_norm: 2.0 * length.sqrt() / examples.errors(),
        }
    }
}

impl Sums {
    fn new(shape: Shape, gram_part: GramPart) -> Self {
        let (h, n1, h1) = (shape.hidden, shape.inputs + 1, shape.hidden + 1);
        let (rows, columns) = gram_part.size(shape);
        Self {
            shape,
            gram: Mat::zeros(rows, columns),
            c: vec![0.0; h * n1 * h1],
            g: Mat::zeros(h1, h1),
            gradient_w: Mat::zeros(n1, h),
            gradient_v: Mat::zeros(h1, shape.outputs),
        }
    }

    /// C: h·n1 × (h+1).
    pub(super) fn c(&self) -> MatRef<'_, f64> {
        let h1 = self.shape.hidden + 1;
        MatRef::from_column_major_slice(&self.c, self.shape.hidden_weights(), h1)
    }

    fn clear(&mut self) {
        self.c.fill(0.0);
        for sum in [&mut self.gram, &mut self.g, &mut self.gradient_w, &mut self.gradient_v] {
            sum.fill(0.0);
        }
    }

    /// Adds the sums of another part.
    fn add(&mut self, other: &Self) {
        self.c.iter_mut().zip(&other.c).for_each(|(sum, value)| *sum += value);
        self.gram += &other.gram;
        self.g += &other.g;
        self.gradient_w += &other.gradient_w;
        self.gradient_v += &other.gradient_v;
    }

    /// Adds a block to BᵀB, C and H̃ᵀH̃; leaves its slopes in their room.
    fn add_second_order(&mut self, now: &BlockNow<'_>, input_pairs: Option<&InputPairs>, room: &mut BlockRoom) {
        let h = self.shape.hidden;
        let (hidden, samples) = (now.hidden(), now.block.samples());
        let mut slopes = room.slopes.as_mut().subrows_mut(0, samples);
        for i in 0..h {
            tanh_slopes_into(column_mut(slopes.as_mut(), i), column(hidden, i));
        }
        let slopes = slopes.as_ref();
        let columns = room.columns.as_mut().subrows_mut(0, samples);
        match input_pairs.zip(room.input_pairs.as_mut()) {
            Some((pairs, room)) => self.add_all(pairs.of(now.number, now.block, room), slopes, columns),
            None => self.add_node_blocks(now.block.inputs.as_ref(), slopes, columns),
        }
        let columns = room.columns.as_mut().subrows_mut(0, samples);
        self.add_c(now.block.inputs.as_ref(), hidden, slopes, columns);
        add_product(self.g.as_mut(), hidden.transpose(), hidden, 1.0);
    }

    /// Adds to BᵀB by pairs Dᵢ∘Dⱼ.
    fn add_all(&mut self, input_pairs: MatRef<'_, f64>, slopes: MatRef<'_, f64>, mut columns: MatMut<'_, f64>) {
        let (mut first, mut filled) = (0, 0);
        for i in 0..slopes.ncols() {
            for j in 0..=i {
                multiply_into(
                    column_mut(columns.as_mut(), filled + j),
                    column(slopes, i),
                    column(slopes, j),
                );
            }
            filled += i + 1;
            if filled >= CHUNK || i + 1 == slopes.ncols() {
                let sum = self.gram.as_mut().subcols_mut(first, filled);
                add_product(sum, input_pairs, columns.as_ref().subcols(0, filled), 1.0);
                (first, filled) = (first + filled, 0);
            }
        }
    }

    /// Adds to the blocks AᵀDᵢ²A.
    fn add_node_blocks(&mut self, inputs: MatRef<'_, f64>, slopes: MatRef<'_, f64>, columns: MatMut<'_, f64>) {
        let n1 = inputs.ncols();
        let mut weighted = columns.subcols_mut(0, n1);
        for i in 0..slopes.ncols() {
            for a in 0..n1 {
                multiply_into(column_mut(weighted.as_mut(), a), column(slopes, i), column(inputs, a));
            }
            let (lower, full) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
            let sum = self.gram.as_mut().subcols_mut(i * n1, n1);
            let (left, right) = (weighted.as_ref().transpose(), weighted.as_ref());
            triangular::matmul(sum, lower, Accum::Add, left, full, right, full, 1.0, Par::Seq);
        }
    }

    /// Adds to C by columns Dᵢ∘H̃_q, column q·h + i.
    fn add_c(
        &mut self,
        inputs: MatRef<'_, f64>,
        hidden: MatRef<'_, f64>,
        slopes: MatRef<'_, f64>,
        mut columns: MatMut<'_, f64>,
    ) {
        let (h, h1, n1) = (self.shape.hidden, self.shape.hidden + 1, self.shape.inputs + 1);
        let (mut first, mut filled) = (0, 0);
        for q in 0..h1 {
            for i in 0..h {
                multiply_into(
                    column_mut(columns.as_mut(), filled + i),
                    column(slopes, i),
                    column(hidden, q),
                );
            }
            filled += h;
            if filled >= CHUNK || q == h {
                let c = MatMut::from_column_major_slice_mut(&mut self.c, n1, h * h1);
                let sum = c.subcols_mut(first, filled);
                add_product(sum, inputs.transpose(), columns.as_ref().subcols(0, filled), 1.0);
                (first, filled) = (first + filled, 0);
            }
        }
    }

    /// Adds a block to Jwᵀe and Jvᵀe; its slopes are still in their room.
    fn add_gradient(&mut self, now: &BlockNow<'_>, mlp: &Mlp, room: &mut BlockRoom) {
        let Shape { hidden: h, outputs, .. } = self.shape;
        let (hidden, errors, samples) = (now.hidden(), now.errors(), now.block.samples());
        let v = MatRef::from_row_major_slice(mlp.layers().1, h + 1, outputs);
        add_product(self.gradient_v.as_mut(), hidden.transpose(), errors, 1.0);
        let mut delta = room.delta.as_mut().subrows_mut(0, samples);
        let v_without_bias = v.subrows(0, h).transpose();
        matmul(delta.as_mut(), Accum::Replace, errors, v_without_bias, 1.0, Par::Seq);
        let slopes = room.slopes.as_ref().subrows(0, samples);
        for node in 0..h {
            multiply(column_mut(delta.as_mut(), node), column(slopes, node));
        }
        add_product(
            self.gradient_w.as_mut(),
            now.block.inputs.transpose(),
            delta.as_ref(),
            1.0,
        );
    }
}
