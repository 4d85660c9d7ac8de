use std::path::Path;

use serde_json::json;

use super::{
    c99,
    choice::{BundleFormat, BundlePrecision},
    contents::Contents,
    exported_decoder::ExportedDecoder,
    exported_program::are_positive,
    fixed16::FixedProgram,
    folder::{AtomicFolder, identifier},
    golden::Golden,
    matlab, numpy, onnx,
    report::{BundleCheck, BundleError, BundleReport, readme},
};

/// Usual deviation of another program, relative to the range of a target: it sums in another order.
const DOUBLE: f64 = 1e-12;
const SINGLE: f64 = 1e-5;
/// Change by rounding readings to single precision above which there is no bundle.
const LARGEST_ROUNDING: f64 = 0.01;

/// Writes a decoder as a bundle at `path`, a folder.
///
/// # Errors
/// The format lacks the precision, the decoder cannot be written in it, `path` is taken or cannot be written, or the
/// bundle deviates from the decoder. Nothing is left behind.
pub fn export_bundle(
    decoder: impl Into<ExportedDecoder>,
    format: BundleFormat,
    precision: BundlePrecision,
    path: &Path,
) -> Result<BundleReport, BundleError> {
    let decoder: ExportedDecoder = decoder.into();
    format.check_for(decoder.kind(), precision)?;
    let mut folder = AtomicFolder::create(path)?;
    let mut contents = decoder.contents(&identifier(path), precision)?;
    let mut report = BundleReport {
        format,
        precision,
        path: path.to_owned(),
        files: Vec::new(),
        verified: 0,
        golden: 0,
        checks: Vec::new(),
        limit: 0.0,
        rounding: None,
        output_range_mm: contents.meaning.is_array.then(|| contents.scales[0]),
        bounds: Vec::new(),
        remarks: Vec::new(),
    };
    let mut fixed = None;
    match precision {
        BundlePrecision::Double => report.limit = in_double(&mut contents)?,
        BundlePrecision::Single => in_single(&mut contents, &mut report)?,
        BundlePrecision::Fixed16 => fixed = Some(in_fixed16(&mut contents, &mut report, &decoder)?),
    }
    (report.verified, report.golden) = (contents.golden.all().len(), contents.golden.printed().len());
    report.remarks.clone_from(&contents.notes);
    contents.metadata["verification"] =
        json!({ "limit": report.limit, "change_by_rounding_readings": report.rounding, "remarks": report.remarks });
    let usage = match format {
        BundleFormat::Onnx => onnx::print(&contents, &mut folder)?,
        BundleFormat::NumPy => numpy::print(&contents, &mut folder)?,
        BundleFormat::Matlab => matlab::print(&contents, &mut folder)?,
        BundleFormat::C99 => c99::print(&contents, fixed.as_ref(), &mut folder, &mut report)?,
    };
    folder.write("golden.csv", contents.golden.csv(&contents))?;
    folder.write("metadata.json", format!("{:#}\n", contents.metadata))?;
    folder.write("README.txt", readme(&contents, decoder.kind(), &usage, &report))?;
    report.files = folder.commit()?;
    Ok(report)
}

/// A reading as a program in double precision takes it.
pub(super) fn as_it_is(_channel: usize, reading: f64) -> f64 {
    reading
}

/// A reading as a program in single precision takes it.
pub(super) fn in_f32(_channel: usize, reading: f64) -> f64 {
    f64::from(reading as f32)
}

/// Deviation of the program in single precision with `wide` layers in double precision, from readings as it takes them.
fn deviation_in_single(contents: &Contents, wide: usize) -> Result<f64, BundleError> {
    let taken = contents.golden.all().iter().map(|row| row.rounded(in_f32)).collect();
    let of_taken = Golden::of(taken, 0, &contents.exported.program, contents.outputs())?;
    let single = contents.exported.in_single(wide).program;
    Ok(of_taken.deviation(&single, &contents.scales, as_it_is)?)
}

/// Double precision: the effect of rounding errors is measured by larger errors of the constants, in proportion. Returns the
/// limit.
fn in_double(contents: &mut Contents) -> Result<f64, BundleError> {
    /// Relative errors of constants, far above those of double precision and small enough for proportion.
    const ERROR: f64 = 1.0 / (1_u64 << 44) as f64;
    /// Factor for other orders of the sums, other functions, and errors that do not cancel.
    const SAFETY: f64 = 64.0;
    let beyond = "double precision: train again with other settings";
    check_constants(contents, f64::is_finite, beyond)?;
    let disturbed = contents.exported.disturbed(ERROR);
    let amplification = contents.golden.deviation(&disturbed, &contents.scales, as_it_is)? / ERROR;
    let limit = DOUBLE.max(SAFETY * 0.5 * f64::EPSILON * amplification);
    if limit > DOUBLE {
        contents.notes.push(format!(
            "this {} amplifies rounding errors about {amplification:.0e} times (relative to the range of its outputs), so two \
             programs that evaluate it may differ by up to {limit:.0e}; {} for one that amplifies less",
            contents.noun,
            contents.meaning.smaller_weights()
        ));
    }
    Ok(limit)
}

/// Single precision for all layers if it is accurate enough, otherwise double precision for as few of the first layers as
/// possible.
fn in_single(contents: &mut Contents, report: &mut BundleReport) -> Result<(), BundleError> {
    /// Part of the usual deviation that a single evaluation may use up.
    const PART: f64 = 0.2;
    /// Factor for other orders of the sums and other functions.
    const SAFETY: f64 = 8.0;
    let positive = are_positive(&contents.exported.program);
    for row in contents.golden.all() {
        let is_taken = |&reading: &f64| (reading as f32).is_finite() && (!positive || reading as f32 > 0.0);
        if let Some(channel) = row.readings.iter().position(|reading| !is_taken(reading)) {
            return Err(BundleError::Unsuitable(format!(
                "a reading of {:.1e} ({}) is beyond the range of the numbers in which the bundle takes it: choose precision f64",
                row.readings[channel], contents.meaning.inputs[channel].name
            )));
        }
    }
    let is_finite = |value: f64| (value as f32).is_finite();
    check_constants(contents, is_finite, "single precision: choose precision f64")?;
    let rounding = contents.golden.rounding(&contents.exported.program, &contents.scales)?;
    let change = contents.in_words(rounding);
    let cure = cure(contents);
    let unresolved = |change: &str| {
        BundleError::Unsuitable(format!(
            "single precision cannot resolve the readings: rounding them to it changes the answers by up to {change}; {cure}"
        ))
    };
    if rounding.is_nan() || rounding > LARGEST_ROUNDING {
        return Err(unresolved(&change));
    }
    if rounding > SINGLE {
        contents.notes.push(format!(
            "rounding the readings to single precision changes a {} by up to {change}; if that is too much, {cure}",
            contents.meaning.output(),
        ));
    }
    let layers = contents.exported.layers();
    let (mut wide, mut found) = (0, deviation_in_single(contents, 0)?);
    while (found.is_nan() || found >= PART * SINGLE) && wide < layers.len() {
        wide += 1;
        found = deviation_in_single(contents, wide)?;
    }
    if wide > 0 {
        contents.notes.push(format!(
            "the {} are computed in double precision, because their large products nearly cancel; the rest is in single precision",
            contents.names[layers[wide - 1]].replace('_', " ")
        ));
    }
    let arithmetic = SINGLE.max(SAFETY * found);
    if found.is_nan() || arithmetic > LARGEST_ROUNDING {
        return Err(unresolved(&contents.in_words(arithmetic)));
    }
    contents.exported = contents.exported.in_single(wide);
    let program = &contents.exported.program;
    (report.limit, report.rounding) = (arithmetic + rounding, Some(rounding));
    report.checks.push(BundleCheck {
        evaluator: "this program in single precision",
        deviation: contents.golden.deviation(program, &contents.scales, in_f32)?,
    });
    Ok(())
}

/// The program in fixed point, with its golden readings.
fn in_fixed16(
    contents: &mut Contents,
    report: &mut BundleReport,
    decoder: &ExportedDecoder,
) -> Result<FixedProgram, BundleError> {
    let limits = decoder.limits();
    let fixed = FixedProgram::of(contents, limits.as_ref())?;
    // The bound holds for these.
    limits.iter().for_each(|limits| contents.golden.retain_within(limits));
    report.limit = fixed.relative_bound(&contents.scales);
    report.bounds = contents.meaning.named(&fixed.bounds);
    if contents.exported.half_widths.take().is_some() {
        contents.notes.push("fixed16 has no prediction intervals".to_owned());
    }
    if report.limit > FixedProgram::USUAL_BOUND {
        contents.notes.push(format!(
            "the error is only known to be below {:.0} % of the range of the outputs; {} for a decoder that amplifies rounding \
             errors less",
            100.0 * report.limit,
            contents.meaning.smaller_weights()
        ));
    }
    Ok(fixed)
}

/// Advice for a bundle in single precision that changes too much by rounding readings to it.
fn cure(contents: &Contents) -> String {
    /// Fraction of a reading below which its range hides the change.
    const NARROW: f64 = 0.1;
    let is_narrow = |channel: usize| {
        let readings = || contents.golden.all().iter().map(|row| row.readings[channel]);
        let (low, high) = (readings().fold(f64::MAX, f64::min), readings().fold(f64::MIN, f64::max));
        high - low < NARROW * low.abs().max(high.abs())
    };
    let smaller = match !contents.meaning.is_array && (0..contents.channels()).any(is_narrow) {
        true => {
            "subtract a constant from each input before training, because the readings vary little in proportion to their size"
        }
        false => &format!("{} for one that amplifies less", contents.meaning.smaller_weights()),
    };
    format!("choose precision f64, or {smaller}")
}

/// Checks that all constants are finite; `beyond` names the precision and what to do if they are not.
fn check_constants(contents: &Contents, is_finite: impl Fn(f64) -> bool, beyond: &str) -> Result<(), BundleError> {
    if contents.constants().all(|constant| constant.values().all(&is_finite)) {
        return Ok(());
    }
    let message = format!("a constant of the decoder is beyond the range of {beyond}");
    Err(BundleError::Unsuitable(message))
}
