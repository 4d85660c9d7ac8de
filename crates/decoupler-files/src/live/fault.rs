use std::{ops::Range, str::FromStr};

use decoupler_core::{
    dataset::Dataset,
    live::FaultyWire,
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
pub struct Fault {
    /// Faulty wire, or its amplifier or converter.
    pub wire: FaultyWire,
    /// Effect on its readings.
    pub effect: FaultEffect,
}

/// Effect of a [`Fault`] on the readings of its wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultEffect {
    /// Broken before this node, counted from 0; at its connector if this is 0.
    Open(usize),
    /// Column-wires touch.
    Shorted,
    /// The amplifier has this gain error, above −1: readings are 1 + error times the resistances.
    Gain(f64),
    /// The converter is stuck at this end of its range.
    Stuck(ConverterEnd),
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
    /// The array has no such wire or node: kind, number and largest number.
    #[error("there is no {0} {1}; give 1 to {2}")]
    Missing(String, usize, usize),
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
        let index = |text: &str| match text.parse::<usize>() {
            Ok(number @ 1..) => Ok(number - 1),
            _ => Err(unknown()),
        };
        let (kind, rest) = text.trim().split_once(':').ok_or_else(unknown)?;
        let separator = match kind {
            "short-columns" => '-',
            "gain" | "stuck" => '=',
            _ => '@',
        };
        let (wire, value) = match rest.split_once(separator) {
            Some((wire, value)) => (index(wire)?, Some(value)),
            None => (index(rest)?, None),
        };
        let column = FaultyWire::Column(wire);
        let (wire, effect) = match (kind, value) {
            ("open-row", node) => (FaultyWire::Row(wire), FaultEffect::Open(node.map_or(Ok(0), index)?)),
            ("open-column", node) => (column, FaultEffect::Open(node.map_or(Ok(0), index)?)),
            ("short-columns", Some(next)) if index(next)? == wire + 1 => {
                (FaultyWire::Columns(wire), FaultEffect::Shorted)
            }
            ("gain", Some(relative)) => match relative.parse().map_err(|_| unknown())? {
                relative if relative > -1.0 && relative <= 10.0 && relative != 0.0 => {
                    (column, FaultEffect::Gain(relative))
                }
                relative => return Err(FaultError::Gain(relative)),
            },
            ("stuck", Some("low")) => (column, FaultEffect::Stuck(ConverterEnd::Low)),
            ("stuck", Some("high")) => (column, FaultEffect::Stuck(ConverterEnd::High)),
            _ => return Err(unknown()),
        };
        Ok(Self { wire, effect })
    }
}

impl Fault {
    /// Checks that an array has the wires and nodes of this fault, and that the row-wires are among those `read`.
    ///
    /// # Errors
    /// If a wire or node does not exist.
    pub fn check(self, scale: ArrayScale, read: &[usize]) -> Result<(), FaultError> {
        let (kind, wire, wires, nodes) = match self.wire {
            FaultyWire::Row(row) => ("row-wire", row, scale.rows(), scale.nodes_per_row()),
            wire => (
                "column-wire",
                wire.columns().end - 1,
                scale.columns(),
                scale.nodes_per_column(),
            ),
        };
        match (self.wire, self.effect) {
            _ if wire >= wires => Err(FaultError::Missing(kind.to_owned(), wire + 1, wires)),
            (_, FaultEffect::Open(node)) if node >= nodes => {
                Err(FaultError::Missing(format!("node on a {kind}"), node + 1, nodes))
            }
            (FaultyWire::Row(row), _) if !read.contains(&row) => Err(FaultError::NotRead(row + 1)),
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
        // Without current, or when it is stuck, the converter reads an end of its range without noise.
        let (lowest_ohm, full_scale_ohm) = self.range_ohm;
        let (from_ohm, to_ohm) = match self.fault.effect {
            FaultEffect::Open(0) | FaultEffect::Stuck(ConverterEnd::High) => (full_scale_ohm, full_scale_ohm),
            FaultEffect::Stuck(ConverterEnd::Low) => (lowest_ohm, lowest_ohm),
            FaultEffect::Open(_) | FaultEffect::Gain(_) => (0.0, full_scale_ohm),
            FaultEffect::Shorted => (0.0, f64::INFINITY),
        };
        let columns = self.model.scale.columns();
        for (&row, ohms) in read.iter().zip(ohms.chunks_exact_mut(columns)) {
            let affected = &mut ohms[self.affected(row)];
            affected.iter_mut().for_each(|ohm| *ohm = ohm.clamp(from_ohm, to_ohm));
        }
    }

    /// Columns whose readings of a row the fault affects.
    fn affected(&self, row: usize) -> Range<usize> {
        match self.fault.wire {
            FaultyWire::Row(faulty) if faulty == row => 0..self.model.scale.columns(),
            wire => wire.columns(),
        }
    }

    /// Applies faults of wires and amplifiers to the resistances of one snapshot (rows `read`, row by row), which belong
    /// to `deformation`.
    pub fn before_noise(&self, read: &[usize], deformation: &Deformation, resistances_ohm: &mut [f64]) {
        let (scale, geometry) = (self.model.scale, &self.model.geometry);
        // Eq. (2) over the nodes before a break. Without any node there is no current, and the converter reads its full scale.
        let near_ohm = |row: usize, nodes: usize, column: usize, electrodes: usize| {
            let positions_mm = deformation.row_positions_mm(&self.model, row).take(nodes);
            let of_node = |at_mm: DVec3| {
                let electrodes_mm = (0..electrodes).map(move |electrode| geometry.column_node_mm(column, electrode));
                electrodes_mm.map(move |electrode_mm| at_mm.distance(electrode_mm).recip())
            };
            match positions_mm.flat_map(of_node).sum::<f64>() {
                sum if sum > 0.0 => self.model.resistivity_ohm_per_mm / sum,
                _ => self.range_ohm.1,
            }
        };
        for (&row, ohms) in read.iter().zip(resistances_ohm.chunks_exact_mut(scale.columns())) {
            let affected = self.affected(row);
            match self.fault.effect {
                FaultEffect::Open(before_node) => {
                    let (nodes, electrodes) = match self.fault.wire {
                        FaultyWire::Row(_) => (before_node, scale.nodes_per_column()),
                        _ => (scale.nodes_per_row(), before_node),
                    };
                    affected.for_each(|column| ohms[column] = near_ohm(row, nodes, column, electrodes));
                }
                FaultEffect::Shorted => {
                    let conductances = ohms[affected.clone()].iter().map(|ohm| ohm.recip());
                    let shared = affected.len() as f64 / conductances.sum::<f64>();
                    ohms[affected].fill(shared);
                }
                FaultEffect::Gain(relative) => ohms[affected].iter_mut().for_each(|ohm| *ohm *= 1.0 + relative),
                FaultEffect::Stuck(_) => {}
            }
        }
    }
}
