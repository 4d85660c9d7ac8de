use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::{
    decode::FrameArguments,
    failure::Failure,
    output::{check_output, input, output, print, warn},
};
use decoupler_core::{
    calibration::{CalibratedParameter, Calibration},
    sensor::{ArrayScale, SensorModel},
    text::counted,
};
use decoupler_files::export::{SensorFile, format_number};

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
    #[arg(long, value_name = "FILE", value_parser = input)]
    sensor: Option<PathBuf>,
    #[command(flatten)]
    frames: FrameArguments,
    /// File for the calibrated sensor model
    #[arg(short, long, value_name = "FILE", value_parser = output)]
    out: Option<PathBuf>,
}

impl Calibrate {
    pub(super) fn run(self) -> Result<(), Failure> {
        if let Some(path) = &self.out {
            check_output("--out", path)?;
        }
        let nominal = match &self.sensor {
            Some(path) => SensorFile::load(path)?,
            None => SensorModel::new(self.array),
        };
        let frames = self.frames.read(&nominal, None)?;
        let calibration = Calibration::fit(&nominal, &frames)?;
        if let Some(path) = &self.out {
            SensorFile::save(&calibration.model, path)?;
        }
        calibration.warnings.iter().for_each(warn);
        let snapshots = frames.snapshots().len();
        let parameter = |fitted: &CalibratedParameter| {
            let parameter = fitted.parameter;
            json!({
                "name": parameter.to_string(),
                "unit": parameter.unit(),
                "nominal": fitted.nominal,
                "value": fitted.value,
                "half_width": fitted.half_width,
            })
        };
        let object = || {
            json!({
                "frames": snapshots,
                "readings": calibration.readings,
                "parameters": Vec::from_iter(calibration.parameters.iter().map(parameter)),
                "nominal_residual": calibration.nominal_residual,
                "residual": calibration.residual,
                "sensor": calibration.model,
            })
        };
        print(object, |out| {
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
