use std::{fmt, str::FromStr};

use decoupler_core::{
    dataset::Dataset,
    scene::{Deformation, Noise, NoiseSource},
    sensor::{ArrayScale, SensorError, SensorModel, short},
};
use glam::DVec3;
use rand::Rng;
use thiserror::Error;

/// A fault of the wires or of the electronics.
///
/// The readout drives one row-wire, grounds the others, and measures the current of each column-wire at virtual ground,
/// so that a reading depends only on the nodes between its two wires. Wires are connected at their first node. Beyond a
/// break a wire floats, and its nodes carry no current into an amplifier. Two touching column-wires share the measured
/// current equally: both read 2/(1/R + 1/R′).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// A row-wire is broken before node `before_node`, counted from 0; at its connector if this is 0.
    OpenRow {
        /// Row-wire, from 0.
        row: usize,
        /// First node that is cut off.
        before_node: usize,
    },
    /// A column-wire is broken before node `before_node`, counted from 0; at its connector if this is 0.
    OpenColumn {
        /// Column-wire, from 0.
        column: usize,
        /// First node that is cut off.
        before_node: usize,
    },
    /// Column-wires `column` and `column` + 1 touch.
    ShortedColumns {
        /// First of the two, from 0.
        column: usize,
    },
    /// The amplifier of a column-wire has a gain error: its readings are 1 + `relative` times the resistances.
    Gain {
        /// Column-wire, from 0.
        column: usize,
        /// Relative error of its readings, above −1.
        relative: f64,
    },
    /// The converter of a column-wire is stuck at an end of its range.
    Stuck {
        /// Column-wire, from 0.
        column: usize,
        /// End at which it is stuck.
        end: ConverterEnd,
    },
}

/// Invalid fault.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FaultError {
    /// Not the description of a fault.
    #[error(
        "'{0}' is not a fault: give open-row:ROW, open-column:COLUMN (both with @NODE for a break before that node), \
         short-columns:COLUMN-COLUMN, gain:COLUMN=REL, stuck:COLUMN=low or stuck:COLUMN=high"
    )]
    Text(String),
    /// The array, or the scene, has no such wire or node.
    #[error("there is no {0} {1}; give 1 to {2}")]
    Number(&'static str, usize, usize),
    /// The gain error is out of range.
    #[error("the gain error is {}: give a number above -1, other than 0 and at most 10", short(*.0))]
    Gain(f64),
    /// The scene does not read a row-wire of the fault.
    #[error("row {0} is not read in this scene; give a row that is, or read all rows")]
    NotRead(usize),
}

/// End of a converter's range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConverterEnd {
    /// Lowest step.
    Low,
    /// Full scale, as without current.
    High,
}

impl FromStr for Fault {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let unknown = || FaultError::Text(text.to_owned());
        let number = |text: &str| match text.parse::<usize>() {
            Ok(number @ 1..) => Ok(number - 1),
            _ => Err(unknown()),
        };
        let place = |text: &str| match text.split_once('@') {
            Some((wire, node)) => Ok((number(wire)?, number(node)?)),
            None => Ok((number(text)?, 0)),
        };
        let (kind, rest) = text.trim().split_once(':').ok_or_else(unknown)?;
        let value = || rest.split_once('=').ok_or_else(unknown);
        match kind {
            "open-row" => place(rest).map(|(row, before_node)| Self::OpenRow { row, before_node }),
            "open-column" => place(rest).map(|(column, before_node)| Self::OpenColumn { column, before_node }),
            "short-columns" => {
                let (first, second) = rest.split_once('-').ok_or_else(unknown)?;
                let (column, next) = (number(first)?, number(second)?);
                let short = (next == column + 1).then_some(Self::ShortedColumns { column });
                short.ok_or_else(unknown)
            }
            "gain" => {
                let (column, relative) = value()?;
                let relative: f64 = relative.parse().map_err(|_| unknown())?;
                if relative > -1.0 && relative <= 10.0 && relative != 0.0 {
                    number(column).map(|column| Self::Gain { column, relative })
                } else {
                    Err(FaultError::Gain(relative))
                }
            }
            "stuck" => {
                let (column, end) = value()?;
                let end = match end {
                    "low" => ConverterEnd::Low,
                    "high" => ConverterEnd::High,
                    _ => return Err(unknown()),
                };
                number(column).map(|column| Self::Stuck { column, end })
            }
            _ => Err(unknown()),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::OpenRow { row, before_node } => write!(f, "open-row:{}@{}", row + 1, before_node + 1),
            Self::OpenColumn { column, before_node } => write!(f, "open-column:{}@{}", column + 1, before_node + 1),
            Self::ShortedColumns { column } => write!(f, "short-columns:{}-{}", column + 1, column + 2),
            Self::Gain { column, relative } => write!(f, "gain:{}={relative}", column + 1),
            Self::Stuck { column, end } => {
                let end = match end {
                    ConverterEnd::Low => "low",
                    ConverterEnd::High => "high",
                };
                write!(f, "stuck:{}={end}", column + 1)
            }
        }
    }
}

impl Fault {
    /// Checks that an array has the wires and nodes of this fault, and that the row-wires are among those `read`.
    ///
    /// # Errors
    /// If a wire or node does not exist.
    pub fn check(self, scale: ArrayScale, read: &[usize]) -> Result<(), FaultError> {
        let wires_and_nodes = match self {
            Self::OpenRow { row, before_node } => [
                ("row-wire", row, scale.rows()),
                ("node on a row-wire", before_node, scale.nodes_per_row()),
            ],
            Self::OpenColumn { column, before_node } => [
                ("column-wire", column, scale.columns()),
                ("node on a column-wire", before_node, scale.nodes_per_column()),
            ],
            Self::ShortedColumns { column } => [("column-wire", column + 1, scale.columns()); 2],
            Self::Gain { column, .. } | Self::Stuck { column, .. } => [("column-wire", column, scale.columns()); 2],
        };
        if let Some((what, index, last)) = wires_and_nodes.into_iter().find(|(_, index, count)| index >= count) {
            return Err(FaultError::Number(what, index + 1, last));
        }
        match self {
            Self::OpenRow { row, .. } if !read.contains(&row) => Err(FaultError::NotRead(row + 1)),
            _ => Ok(()),
        }
    }
}

/// Effect of a fault on the resistances of an array before noise and on the readings after noise.
#[derive(Clone, Debug)]
pub struct FaultySensor {
    model: SensorModel,
    fault: Fault,
    /// Ends of the converter's range; without a converter in the scene, of a converter of 16 bits.
    range_ohm: (f64, f64),
}

impl FaultySensor {
    /// Prepares `fault` in an array with this noise. The converter reads up to twice the largest resistance at rest, like
    /// the converter of the noise.
    ///
    /// # Errors
    /// If the undeformed sensor has no resistance.
    pub fn new(model: &SensorModel, noise: Noise, fault: Fault) -> Result<Self, SensorError> {
        Ok(Self {
            model: *model,
            fault,
            range_ohm: noise.range_ohm(model)?,
        })
    }

    /// Replaces the readings of simulated snapshots by those of the faulty sensor with noise.
    ///
    /// # Errors
    /// If the undeformed sensor has no resistance.
    pub fn disturb(&self, set: &mut Dataset, noise: &Noise, rng: &mut impl Rng) -> Result<(), SensorError> {
        let source = noise.source(&self.model)?;
        let read = set.row_wires_read().map_or_else(Vec::new, <[usize]>::to_vec);
        let mut readings = set.readings().to_owned();
        let all = readings
            .as_slice_mut()
            .expect("a set has its readings in standard layout");
        for (snapshot, ohms) in all.chunks_exact_mut(set.row_count() * set.channels()).enumerate() {
            // Row-wires that are not read are at rest.
            let deformation = Deformation::from_fn(self.model.scale, |row, node| {
                let index = read.iter().position(|&other| other == row);
                index.map_or(DVec3::ZERO, |index| {
                    let coordinates_mm = &set.sample_targets(snapshot * read.len() + index)[3 * node..];
                    self.model.displacement_mm(row, node, DVec3::from_slice(coordinates_mm))
                })
            });
            self.disturb_snapshot((&read, &deformation), ohms, &source, rng);
        }
        *set = set.with_readings(readings);
        Ok(())
    }

    /// Applies the fault and the noise to the resistances of one snapshot (rows `read`, row by row), which belong to
    /// `deformation`: wires and amplifiers come before the noise, the converter after.
    pub fn disturb_snapshot(
        &self,
        (read, deformation): (&[usize], &Deformation),
        ohms: &mut [f64],
        noise: &NoiseSource,
        rng: &mut impl Rng,
    ) {
        self.before_noise(read, deformation, ohms);
        noise.disturb(ohms, rng);
        let columns = self.model.scale.columns();
        for (&row, ohms) in read.iter().zip(ohms.chunks_exact_mut(columns)) {
            let affected = match self.fault {
                Fault::OpenRow { row: open, .. } if open == row => 0..columns,
                Fault::OpenColumn { column, .. } | Fault::Gain { column, .. } | Fault::Stuck { column, .. } => {
                    column..column + 1
                }
                Fault::OpenRow { .. } | Fault::ShortedColumns { .. } => 0..0,
            };
            // Without current, or when it is stuck, the converter reads an end of its range without noise.
            let (lowest_ohm, full_scale_ohm) = self.range_ohm;
            let (from_ohm, to_ohm) = match self.fault {
                Fault::OpenRow { before_node: 0, .. } | Fault::OpenColumn { before_node: 0, .. } => {
                    (full_scale_ohm, full_scale_ohm)
                }
                Fault::Stuck {
                    end: ConverterEnd::High,
                    ..
                } => (full_scale_ohm, full_scale_ohm),
                Fault::Stuck {
                    end: ConverterEnd::Low, ..
                } => (lowest_ohm, lowest_ohm),
                _ => (0.0, full_scale_ohm),
            };
            ohms[affected]
                .iter_mut()
                .for_each(|ohm| *ohm = ohm.clamp(from_ohm, to_ohm));
        }
    }

    /// Applies faults of wires and amplifiers to the resistances of one snapshot (rows `read`, row by row), which belong
    /// to `deformation`.
    pub fn before_noise(&self, read: &[usize], deformation: &Deformation, resistances_ohm: &mut [f64]) {
        let (scale, geometry) = (self.model.scale, &self.model.geometry);
        // Eq. (2) over the nodes before a break. Without any node there is no current, and the converter reads its full scale.
        let near_ohm = |row: usize, nodes: usize, column: usize, electrodes: usize| {
            let positions_mm = deformation.row_positions_mm(&self.model, row).take(nodes);
            let sum: f64 = positions_mm
                .flat_map(|at_mm| {
                    let electrodes = (0..electrodes).map(move |electrode| geometry.column_node_mm(column, electrode));
                    electrodes.map(move |electrode_mm| at_mm.distance(electrode_mm).recip())
                })
                .sum();
            match sum > 0.0 {
                true => self.model.resistivity_ohm_per_mm / sum,
                false => self.range_ohm.1,
            }
        };
        for (&row, ohms) in read.iter().zip(resistances_ohm.chunks_exact_mut(scale.columns())) {
            match self.fault {
                Fault::OpenRow { row: open, before_node } if open == row => {
                    for (column, ohm) in ohms.iter_mut().enumerate() {
                        *ohm = near_ohm(row, before_node, column, scale.nodes_per_column());
                    }
                }
                Fault::OpenColumn { column, before_node } => {
                    ohms[column] = near_ohm(row, scale.nodes_per_row(), column, before_node);
                }
                Fault::ShortedColumns { column } => {
                    let shared = 2.0 / (1.0 / ohms[column] + 1.0 / ohms[column + 1]);
                    ohms[column..column + 2].fill(shared);
                }
                Fault::Gain { column, relative } => ohms[column] *= 1.0 + relative,
                Fault::OpenRow { .. } | Fault::Stuck { .. } => {}
            }
        }
    }
}
