use std::{io::Write, path::PathBuf};

use clap::Args;
use serde::Serialize;

use super::{
    decode::FrameArguments,
    failure::Failure,
    output::{print, print_object},
};
use decoupler_core::{
    calibration::{Calibration, SensorParameter},
    sensor::{ArrayScale, SensorModel},
    text::counted,
};
use decoupler_files::export::{SensorFile, check_writable, format_number};

/// Fit geometry and resistivity of a sensor to frames of known presses
///
/// A line of the file is a row-wire at one moment: its number (--row-wire), its resistances (--inputs), and the depths of
/// its nodes (--depths, or --targets for all coordinates); --group names the column of frames. Parameters that the frames
/// do not determine are listed and keep their nominal values; the others have simultaneous 95 % confidence intervals. Use
/// the file of --out with train --sensor, and then fine-tune the network on the frames.
#[derive(Args)]
pub(super) struct Calibrate {
    /// Array scale M1xM2_M3xM4, whose nominal geometry is the initial value: rows x nodes on each, nodes on each column x
    /// columns
    #[arg(long, value_name = "SCALE", default_value = "10x10_5x30", conflicts_with = "sensor")]
    array: ArrayScale,
    /// Nominal sensor model from a file written by --out, instead of --array
    #[arg(long, value_name = "FILE")]
    sensor: Option<PathBuf>,
    #[command(flatten)]
    frames: FrameArguments,
    /// File for the calibrated sensor model
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
}

/// The object printed by `calibrate --json`.
#[derive(Serialize)]
struct Report {
    frames: usize,
    readings: usize,
    parameters: Vec<Parameter>,
    /// Root mean square of the relative errors of the resistances.
    nominal_residual: f64,
    residual: f64,
    warnings: Vec<String>,
    sensor: SensorModel,
}

#[derive(Serialize)]
struct Parameter {
    name: SensorParameterName,
    unit: &'static str,
    nominal: f64,
    value: f64,
    /// Half-width of the interval; absent if the frames do not determine the parameter.
    half_width: Option<f64>,
}

/// A parameter, serialised by its name.
struct SensorParameterName(SensorParameter);

impl Serialize for SensorParameterName {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&self.0)
    }
}

impl Calibrate {
    pub(super) fn run(self) -> Result<(), Failure> {
        if let Some(path) = &self.out {
            check_writable(path)?;
        }
        let nominal = match &self.sensor {
            Some(path) => SensorFile::load(path)?,
            None => SensorModel::new(self.array),
        };
        let frames = self.frames.read(&nominal, None, self.json)?;
        let calibration = Calibration::fit(&nominal, &frames)?;
        if let Some(path) = &self.out {
            SensorFile::save(&calibration.model, path)?;
        }
        let snapshots = frames.snapshots().len();
        if self.json {
            return print_object(&Report::of(&calibration, snapshots));
        }
        print(|out| {
            writeln!(
                out,
                "{} of {} in {}",
                counted(calibration.readings, "reading"),
                counted(frames.samples(), "row-wire"),
                counted(snapshots, "frame")
            )?;
            for parameter in &calibration.parameters {
                writeln!(out, "  {parameter}")?;
            }
            writeln!(
                out,
                "Root mean square of the relative errors of the resistances: {} before, {} after",
                format_number(calibration.nominal_residual),
                format_number(calibration.residual)
            )?;
            for warning in &calibration.warnings {
                writeln!(out, "Warning: {warning}")?;
            }
            match &self.out {
                Some(path) => writeln!(
                    out,
                    "Written to '{}': train on it with --sensor, then continue on these frames with fine-tune",
                    path.display()
                ),
                None => Ok(()),
            }
        })
    }
}

impl Report {
    fn of(calibration: &Calibration, frames: usize) -> Self {
        let parameter = |fitted: &decoupler_core::calibration::CalibratedParameter| Parameter {
            name: SensorParameterName(fitted.parameter),
            unit: fitted.parameter.unit(),
            nominal: fitted.nominal,
            value: fitted.value,
            half_width: fitted.half_width,
        };
        Self {
            frames,
            readings: calibration.readings,
            parameters: calibration.parameters.iter().map(parameter).collect(),
            nominal_residual: calibration.nominal_residual,
            residual: calibration.residual,
            warnings: calibration.warnings.clone(),
            sensor: calibration.model,
        }
    }
}
