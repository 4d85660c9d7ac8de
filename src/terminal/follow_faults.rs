use std::io::{Write, stderr};

use super::failure::Failure;
use decoupler_core::{
    dataset::SimulationError,
    evaluation::Simulation,
    live::{FaultEvent, FaultMonitor, LeftOutDecoder, ParsedLine},
    scene::Noise,
};

/// Looks for faults in the frames that lines make up, and reports them.
pub(super) struct Faults {
    watch: Option<Watch>,
    /// `true` once it was informed that lines do not say their row-wire.
    is_told: bool,
}

struct Watch {
    monitor: FaultMonitor,
    left_out: LeftOutDecoder,
    /// Latest readings of every row read: rows × M4.
    frame_ohm: Vec<f64>,
    /// Rows of which readings came since the last check.
    is_new: Vec<bool>,
    columns: usize,
}

impl Faults {
    pub(super) fn new(source: &Simulation, relative_noise: Option<f64>) -> Result<Self, Failure> {
        let (sensor, mut scene) = (&source.sensor, source.scene);
        if let Some(relative) = relative_noise {
            scene.noise = Noise::relative(relative);
            scene
                .check()
                .map_err(|error| Failure::Arguments(format!("--noise: {error}")))?;
        }
        let scale = sensor.scale;
        let reason = if scene.noise.in_test().is_none() {
            Some("the network was trained without noise to judge them by; give --noise REL")
        } else if !FaultMonitor::is_affordable(scale, &scene) {
            Some("the array is too large for it")
        } else {
            None
        };
        if let Some(reason) = reason {
            tell(&format!("faults of wires are not looked for: {reason}"));
            return Ok(Self {
                watch: None,
                is_told: true,
            });
        }
        let rows = scene.rows.read(scale.rows()).map_err(SimulationError::from)?;
        Ok(Self {
            watch: Some(Watch {
                monitor: FaultMonitor::new(sensor, &scene, &rows).map_err(Failure::Sensor)?,
                left_out: LeftOutDecoder::new(sensor, &scene, &rows).map_err(Failure::Sensor)?,
                frame_ohm: vec![0.0; rows.len() * scale.columns()],
                is_new: vec![false; rows.len()],
                columns: scale.columns(),
            }),
            is_told: false,
        })
    }

    /// Looks for nothing, where there is no model of the sensor.
    pub(super) fn none() -> Self {
        Self {
            watch: None,
            is_told: true,
        }
    }

    /// The decoder that leaves out the wires of a named fault, if there is one, with the latest readings of every row read.
    pub(super) fn left_out(&mut self) -> Option<(&mut LeftOutDecoder, &[f64])> {
        let watch = self.watch.as_mut()?;
        Some((&mut watch.left_out, &watch.frame_ohm))
    }

    /// Takes the readings of a line; returns `true` if all rows have come since the last check.
    pub(super) fn take(&mut self, line: u64, parsed: ParsedLine<'_>) -> bool {
        let Some(watch) = &mut self.watch else { return false };
        match parsed {
            ParsedLine::Row {
                row_index: Some(index),
                readings_ohm,
            } => {
                watch.frame_ohm[index * watch.columns..][..watch.columns].copy_from_slice(readings_ohm);
                watch.is_new[index] = true;
            }
            ParsedLine::Snapshot(readings_ohm) => {
                watch.frame_ohm.copy_from_slice(readings_ohm);
                watch.is_new.fill(true);
            }
            ParsedLine::Row { row_index: None, .. } if !self.is_told => {
                self.is_told = true;
                tell(&format!(
                    "line {line}: faults of wires are not looked for in lines that do not say their row-wire; name a \
                     column row, or send whole snapshots in one line"
                ));
            }
            ParsedLine::Row { .. } | ParsedLine::NoReadings => {}
        }
        watch.is_new.iter().all(|is_new| *is_new)
    }

    /// Checks the latest readings, and tells what they have made known.
    pub(super) fn check(&mut self, line: u64) {
        let Some(watch) = &mut self.watch else { return };
        watch.is_new.fill(false);
        match watch.monitor.check(&watch.frame_ohm) {
            Some(FaultEvent::Named(fault)) => {
                tell(&format!(
                    "line {line}: {fault}; left out from here on, by Gauss-Newton steps on the other readings"
                ));
            }
            Some(FaultEvent::Unexplained) => tell(&format!(
                "line {line}: the readings contradict Eq. (2), and no fault of a single wire explains them: the answers may \
                 be wrong; check the wiring, the geometry and the order of the rows"
            )),
            Some(FaultEvent::Recovered) => {
                tell(&format!(
                    "line {line}: the readings agree with Eq. (2) again; all wires are used"
                ));
            }
            None => {}
        }
        watch.left_out.leave_out(watch.monitor.named());
    }
}

fn tell(message: &str) {
    // There is no one to report to if this fails.
    let _ = writeln!(stderr(), "warning: {message}");
}
