//! Decoupling of flexible tactile sensor arrays.
//!
//! A tactile skin of conductive rubber is read through crossed row-wires and column-wires. Every reading is the
//! parallel connection of many electrode nodes; *decoupling* recovers the deformation of each node from the
//! row-column resistances. The modules tell that story in order, and each uses only the ones before it:
//!
//! | module | what it knows |
//! |---|---|
//! | [`sensor`] | array scale, geometry, the resistance model and its Jacobian, what readings can tell |
//! | [`scene`] | what happens to the sensor: rows, movement, loading, noise |
//! | [`dataset`] | samples (one row-wire each), drawn as whole snapshots; splits |
//! | [`network`] | the three-layer network, its start, its scaling, its file |
//! | [`training`] | methods, the stepped [`training::Trainer`], why it stopped |
//! | [`decoupling`] | resistances to deformation, every way we know |
//! | [`evaluation`] | axis errors, tables, a whole run from settings to report |
//! | [`surface`] | smooth surfaces through the nodes |
//! | [`export`] | files for other programs; `export::figures` draws (feature `figures`) |
//! | `cli` | the work in a terminal (feature `cli`) |
//! | `app` | the window (feature `gui`) |
//!
//! All features are on by default. The library alone, without argument parser, progress bars, renderer and window, is
//! `decoupler = { version = "0.1", default-features = false }`.

#[cfg(feature = "gui")]
pub mod app;
#[cfg(feature = "cli")]
pub mod cli;
pub mod dataset;
pub mod decoupling;
pub mod evaluation;
pub mod export;
pub mod network;
pub mod scene;
pub mod sensor;
pub mod surface;
pub mod training;

/// The crates whose types stand in public signatures: vectors in space (`glam::DVec3`) in [`sensor`], [`scene`],
/// [`dataset`] and [`export`]; arrays (`ndarray::Array2`) in [`dataset`], [`network`], [`decoupling`], [`evaluation`] and
/// [`export`]; generators of random numbers (`rand::Rng`) wherever something is drawn. Use these to have matching
/// versions.
pub use {glam, ndarray, rand};
