//! Numerics of Decoupler: decoupling of flexible tactile sensor arrays.
//!
//! A tactile skin of conductive rubber is read through crossed row-wires and column-wires. Every reading is the
//! parallel connection of many electrode nodes; *decoupling* recovers the deformation of each node from the
//! row-column resistances. The modules are listed in order of dependency, each using only the ones before it:
//!
//! | module | contents |
//! |---|---|
//! | `numerics` | least squares, distributions, special functions, figures of samples |
//! | [`text`] | numbers, counts and names as text |
//! | [`job`] | work that can be cancelled |
//! | [`sensor`] | array scale, geometry, the resistance model and its Jacobian |
//! | [`identifiability`] | deformation patterns that the readings determine, and how well |
//! | [`machine`] | budget of memory, speed of the machine |
//! | [`scene`] | what happens to the sensor: rows, movement, loading, noise |
//! | [`dataset`] | samples with their row-wire and snapshot, simulated or recorded; frames, folds, splits |
//! | [`calibration`] | geometry and resistivity fitted to the readings of known deformations |
//! | [`network`] | the three-layer network, its initialisation and scaling |
//! | [`settings`] | the table of settings: name, help, range and access of each |
//! | [`training`] | methods, the stepped [`training::Trainer`], stop reasons |
//! | [`surface`] | smooth surfaces through the nodes |
//! | [`problem`] | names and units of readings and targets, and what else is known: positions, memory, sensor |
//! | [`decoupling`] | readings to deformation by every decoder, behind one trait |
//! | [`evaluation`] | errors, a whole run from settings to report, cross-validation, experiments |
//! | [`live`] | arithmetic on frames as they arrive: re-zero, drift, faults named from the residual |
//!
//! The crate has numbers only: no files, ports, sockets or environment variables, and no window. `decoupler-files` has live
//! sources, recordings, figures and exports, and the program `decoupler` the window and the commands. How much memory a run
//! may use is passed in as a [`machine::MemoryBudget`].
//!
//! # Glossary
//!
//! One term per concept, in the code, on screen and in print; the window explains further terms in tooltips.
//!
//! | word | meaning |
//! |---|---|
//! | row-wire, column-wire | a wire on top of the rubber, whose nodes move; a wire below it, at rest |
//! | node | an electrode on a wire |
//! | reading | the resistance between a row-wire and a column-wire in ohm, or one channel of another sensor |
//! | target | a number to be decoded: a coordinate of a node in millimetres, or a measured quantity |
//! | sample | the readings and targets of one row-wire at one moment; one row of a recording |
//! | snapshot | the samples of all row-wires at one moment, which share one deformation |
//! | frame | the readings of all row-wires at one moment, without targets: what a decoder in use receives |
//! | group | samples that a division into training and test set keeps together: a snapshot, a subject, a session |
//! | channel, output | column of the readings, column of the targets |
//! | unknown | displacement of a node along an axis that moves |
//! | residual | relative difference m/R − 1 between a reading and the model's resistance |
//! | decoder | whatever computes targets from readings; [`decoupling::DecoderKind`] lists them |
//! | run | a training with its settings, samples, networks and errors |
//!
//! A *row* is a row-wire in the numerics and a line of a table in files; a *line* is a line of text.
//!
//! # A tour
//!
//! A **sensor** is an array scale M1×M2_M3×M4 with a geometry. Eq. (2) of the paper gives its resistances:
//!
//! ```
//! use decoupler_core::{glam::DVec3, sensor::SensorModel};
//!
//! let sensor = SensorModel::new("10x6_3x18".parse()?);
//! let at_rest = vec![DVec3::ZERO; sensor.scale.nodes_per_row()];
//! let mut pressed = at_rest.clone();
//! pressed[2].z = 0.5; // The third node of a row-wire, half a millimetre down.
//! let row_wire = 0;
//! let before_ohm = sensor.row_resistances(row_wire, &at_rest)?;
//! let after_ohm = sensor.row_resistances(row_wire, &pressed)?;
//! assert_eq!(before_ohm.len(), 18); // One for each column-wire,
//! assert!(before_ohm.iter().zip(&after_ohm).all(|(before, after)| after < before)); // all lower.
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A **dataset** holds samples that know their row-wire and the snapshot they belong to: drawn in a scene, or built from
//! measured parts by [`dataset::Dataset::new`].
//!
//! ```
//! use decoupler_core::{dataset::{Dataset, Seed, Stream}, scene::{Noise, Scene}, sensor::SensorModel};
//!
//! let sensor = SensorModel::new("10x6_3x18".parse()?);
//! let scene = Scene { noise: Noise::relative(1e-3), ..Scene::default() };
//! let mut set = Dataset::simulate(&sensor, &scene, 200, &mut Seed(0).rng(Stream::Training))?;
//! set.disturb(&sensor, &scene.noise, &mut Seed(0).rng(Stream::TrainingNoise))?;
//! assert_eq!(set.readings().dim(), (200, 18)); // Ohms: samples × column-wires.
//! assert_eq!(set.targets().dim(), (200, 18)); // Millimetres: samples × (x, y, z of 6 nodes).
//! assert_eq!((set.row_wire(13), set.groups()[13]), (Some(3), 1));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A **training** is a value that is stepped one epoch at a time; pausing only means not calling `step`.
//!
//! ```
//! use decoupler_core::{dataset::Simulation, evaluation::{Run, RunSettings}, job::Job};
//!
//! let mut simulation = Simulation::default(); // The paper's main experiment,
//! simulation.sensor.scale = "10x6_3x18".parse()?; // on its smallest array,
//! let mut settings = RunSettings::from(simulation);
//! settings.training.stopping.epochs = 20; // cut short.
//! let mut run = Run::prepare(settings)?;
//! run.finish(&Job::UNINTERRUPTED)?;
//! let scores = run.scores().expect("the baselines are measured");
//! assert!(scores.network.percent() < scores.baselines.mean.percent());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Every way to **decode** is a [`decoupling::Decoder`] of single rows and of whole frames. Newton's method solves
//! Eq. (2) itself:
//!
//! ```
//! use decoupler_core::{
//!     dataset::{Seed, Simulation},
//!     decoupling::{Decoder, NewtonDecoder},
//!     scene::Rows,
//! };
//!
//! let mut source = Simulation::default();
//! source.sensor.scale = "10x6_3x18".parse()?;
//! source.scene.rows = Rows::Known;
//! let test = source.draw_test(Seed::default())?;
//! let frames = test.frames()?;
//! let rows = Vec::from_iter(0..test.row_count());
//! let mut newton = NewtonDecoder::new(&source.sensor, &source.scene, &rows)?;
//! let mut coordinates_mm = vec![0.0; rows.len() * newton.outputs()];
//! newton.decode(&frames[0], &mut coordinates_mm)?;
//! assert!((coordinates_mm[2] - test.targets()[[0, 2]]).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The programs in `examples/` continue from here: training with an error table, decoding frames, and measured pairs
//! of readings and targets without any geometry.

pub mod calibration;
pub mod dataset;
pub mod decoupling;
pub mod evaluation;
pub mod identifiability;
pub mod job;
pub mod live;
pub mod machine;
pub mod network;
mod numerics;
pub mod problem;
pub mod scene;
pub mod sensor;
pub mod settings;
pub mod surface;
pub mod text;
pub mod training;

/// Crates whose types are part of public signatures: vectors in space (`glam::DVec3`) in [`sensor`], [`scene`] and
/// [`dataset`]; arrays (`ndarray::Array2`) in [`dataset`], [`network`], [`decoupling`] and [`evaluation`]; generators of
/// random numbers (`rand::Rng`) wherever something is drawn. Use these to have matching versions.
pub use {glam, ndarray, rand};
