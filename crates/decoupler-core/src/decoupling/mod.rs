//! Decoupling: from readings to deformation (or other measured targets), by several methods. Each is a [`Decoder`] of
//! single rows and of whole frames.
//!
//! | decoder | how it decodes |
//! |---|---|
//! | [`ProgramDecoder`] | evaluates a [`Program`]: trained networks, and all decoders that are fitted to samples |
//! | [`NewtonDecoder`] | solves Eq. (2) by the [`Estimator`]: the Gauss-Newton method, with prior if the scene has noise; also in a few steps from the answer of another decoder |
//!
//! [`DecoderKind`] lists them with their names and meanings; [`DecoderSet`](crate::evaluation::DecoderSet) fits each. A
//! [`Program`] is the only forward pass outside training; exports print it for other languages. [`resistance_residual`]
//! measures how well an answer explains the readings, without ground truth.

mod affine_map;
mod decoder;
mod equations;
mod kind;
mod newton;
mod program;
mod radial_basis;
mod ridge;
mod standardised;
mod takagi_sugeno;

pub use decoder::{DecodeError, Decoder, SolvedRows, decode_set, resistance_residual};
pub(crate) use equations::GaussianPrior;
pub use equations::{Estimate, Estimator, LARGEST_ERROR, Solution};
pub use kind::{DecoderKind, Precision};
pub use newton::NewtonDecoder;
pub use program::{Builder, Combined, Domain, Function, Node, NodeId, Operation, Program, ProgramDecoder};
pub(crate) use radial_basis::KernelShape;
pub(crate) use ridge::Regression;
pub(crate) use standardised::ridge;
