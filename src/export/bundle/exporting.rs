use std::{fs, path::Path};

use crate::export::{AtomicFile, WriteError};

use super::{
    c99::{self, Compiled, run_self_test},
    choice::{BundleFormat, BundlePrecision},
    error::BundleError,
    exported_decoder::{ExportedDecoder, ExportedNetwork, Metadata},
    fixed_point::{FixedNetworks, HiddenWidth, USUAL_BOUND},
    folder::AtomicFolder,
    golden::golden_csv,
    identifier::identifier,
    iteration::Iteration,
    json, matlab, numpy, onnx,
    portable::Portable,
    readme::readme,
    report::{BundleCheck, BundleReport, VectorCounts},
    taking::{ReadingRounding, Taking},
    tolerance::Tolerance,
    vectors::{Deviation, Vector, Vectors},
    weights::{Arithmetic, Weights},
};

/// Writes a decoder as a bundle at `path`: a folder, or for [`BundleFormat::Json`] a file. What was written is
/// read back and compared with the decoder before it is put in its place.
///
/// # Errors
/// The format lacks the precision, the decoder cannot be written in it, `path` is taken or cannot be written, or the
/// bundle deviates from the decoder. Nothing is left behind.
pub fn export_bundle<'a>(
    decoder: impl Into<ExportedDecoder<'a>>,
    format: BundleFormat,
    precision: BundlePrecision,
    path: &Path,
) -> Result<BundleReport, BundleError> {
    let exported = decoder.into();
    format.check_for(exported.kind(), precision)?;
    if format == BundleFormat::Json && exported.kind().is_network() {
        return export_network_file(&exported, path);
    }
    if format == BundleFormat::Json {
        return export_numbers(exported, path);
    }
    let folder = AtomicFolder::create(path)?;
    let portable = Portable::of(&exported)?;
    let mut bundle = Bundle {
        name: identifier(path),
        format,
        precision,
        metadata: exported.metadata(&portable, precision),
        exported,
        portable,
        folder,
        remarks: Vec::new(),
    };
    match precision {
        BundlePrecision::Fixed16 => bundle.export_fixed(path),
        BundlePrecision::Double => {
            let vectors = bundle.vectors(Taking::Double)?;
            bundle.export_floating(path, Arithmetic::DOUBLE, &vectors)
        }
        BundlePrecision::Single => {
            let vectors = bundle.vectors(Taking::Single)?;
            bundle.admit(&vectors)?;
            let arithmetic = single_arithmetic(&bundle.portable, &vectors);
            bundle.export_floating(path, arithmetic, &vectors)
        }
    }
}

/// Copies the network file.
fn export_network_file(exported: &ExportedDecoder<'_>, path: &Path) -> Result<BundleReport, BundleError> {
    if fs::symlink_metadata(path).is_ok() {
        return Err(BundleError::Exists(path.to_owned()));
    }
    let trial = tempfile::tempdir().map_err(|error| WriteError::io(path, error))?;
    let copy = trial.path().join("network.json");
    let file: ExportedNetwork<'_> = exported.file();
    file.save(&copy)?;
    if !file.is_saved_at(&copy)? {
        return Err(BundleError::ReadBack {
            file: path.display().to_string(),
            reason: "it is another network".to_owned(),
        });
    }
    file.save(path)?;
    let portable = Portable::of(exported)?;
    let check = BundleCheck {
        evaluator: "network file, read back",
        deviation: 0.0,
        of_arithmetic: 0.0,
    };
    Ok(of_file(path, &portable, check))
}

/// Writes the numbers of a decoder as one file.
fn export_numbers(mut exported: ExportedDecoder<'_>, path: &Path) -> Result<BundleReport, BundleError> {
    if fs::symlink_metadata(path).is_ok() {
        return Err(BundleError::Exists(path.to_owned()));
    }
    let portable = Portable::of(&exported)?;
    let metadata = exported.metadata(&portable, BundlePrecision::Double);
    let vectors = Vectors::of(&mut exported, &portable, Taking::Double)?;
    let weights = Weights::of(&portable, Arithmetic::DOUBLE);
    let text = json::write(&portable, &weights, &metadata, vectors.golden());
    let file = path.display().to_string();
    let read = json::read_weights(&text, &portable).map_err(|reason| read_back(&file, reason))?;
    let deviation = vectors.deviation(|vector| read.decode(vector.row, &vector.taken));
    let tolerance = Tolerance::of(&portable, Arithmetic::DOUBLE, &vectors.growth, deviation.of_arithmetic);
    let check = BundleCheck::of("JSON numbers, read back and evaluated", deviation);
    check.admit(Deviation {
        total: tolerance.limit,
        of_arithmetic: tolerance.limit,
    })?;
    let mut written = AtomicFile::create(path)?;
    let refused = |source| WriteError::io(path, source);
    std::io::Write::write_all(&mut written, text.as_bytes()).map_err(refused)?;
    written.commit()?;
    Ok(BundleReport {
        vectors: vectors.counts(),
        limit: tolerance.limit,
        program_deviation: vectors.program_deviation,
        remarks: tolerance.remarks(Arithmetic::DOUBLE, &portable),
        ..of_file(path, &portable, check)
    })
}

/// The report on a single file in double precision.
fn of_file(path: &Path, portable: &Portable, check: BundleCheck) -> BundleReport {
    let size = fs::metadata(path).map_or(0, |found| found.len());
    BundleReport {
        format: BundleFormat::Json,
        precision: BundlePrecision::Double,
        path: path.to_owned(),
        files: vec![(path.display().to_string(), size)],
        vectors: VectorCounts { verified: 0, golden: 0 },
        checks: vec![check],
        limit: 0.0,
        rounding: None,
        output_range_mm: portable.output_range_mm(),
        program_deviation: 0.0,
        bounds: Vec::new(),
        remarks: Vec::new(),
    }
}

/// Single precision throughout where that is enough, and otherwise as many first layers in double as it takes.
fn single_arithmetic(portable: &Portable, vectors: &Vectors) -> Arithmetic {
    /// Part of the limit that single precision may use in this evaluation: others add up in another order.
    const PART: f64 = 0.2;
    /// The part where the large products that nearly cancel are in double.
    const PART_BEHIND_WIDE_LAYERS: f64 = 0.5;
    let is_enough = |wide_layers: &usize| {
        let single = Weights::of(portable, Arithmetic::single(*wide_layers));
        let deviation = vectors.deviation(|vector| single.decode(vector.row, &vector.taken));
        let part = if *wide_layers == 0 {
            PART
        } else {
            PART_BEHIND_WIDE_LAYERS
        };
        deviation.of_arithmetic <= part * Tolerance::SINGLE
    };
    let layers = portable.layers().len();
    Arithmetic::single((0..layers).find(is_enough).unwrap_or(layers))
}

/// A bundle in the making.
struct Bundle<'a> {
    exported: ExportedDecoder<'a>,
    name: String,
    format: BundleFormat,
    precision: BundlePrecision,
    metadata: Metadata,
    portable: Portable,
    folder: AtomicFolder,
    /// Remarks for the user, with cause and cure.
    remarks: Vec<String>,
}

impl Bundle<'_> {
    fn vectors(&mut self, taking: Taking<'_>) -> Result<Vectors, BundleError> {
        Vectors::of(&mut self.exported, &self.portable, taking)
    }

    /// Notes what rounding the readings to single precision changes.
    ///
    /// # Errors
    /// It changes too much.
    fn admit(&mut self, vectors: &Vectors) -> Result<(), BundleError> {
        let (portable, rounding) = (&self.portable, vectors.rounding);
        let worst = rounding.worst();
        if worst.is_nan() || rounding.largest > ReadingRounding::LARGEST {
            return Err(BundleError::Unresolved {
                change: portable.in_words(rounding.largest),
                cure: vectors.cure(portable),
            });
        }
        let figures = serde_json::json!({ "largest": rounding.largest, "bound": rounding.bound });
        self.metadata.insert("change_by_rounding_readings".to_owned(), figures);
        if worst > Tolerance::SINGLE {
            self.remarks.push(format!(
                "rounding the readings to single precision changes a {output} by up to {largest} in the verification and by \
                 at most {bound}; if that is too much, {cure}",
                output = portable.meaning.output(),
                largest = portable.in_words(rounding.largest),
                bound = portable.in_words(rounding.worst()),
                cure = vectors.cure(portable),
            ));
        }
        Ok(())
    }

    fn export_floating(
        mut self,
        path: &Path,
        arithmetic: Arithmetic,
        vectors: &Vectors,
    ) -> Result<BundleReport, BundleError> {
        let portable = &self.portable;
        let weights = Weights::of(portable, arithmetic);
        let model = |weights: &Weights| vectors.deviation(|vector| answer(portable, weights, vector));
        let tolerance = match portable.equations {
            Some(_) => Tolerance::of_equations(),
            None => Tolerance::of(portable, arithmetic, &vectors.growth, model(&weights).of_arithmetic),
        };
        self.remarks.extend(tolerance.remarks(arithmetic, portable));
        if portable.equations.is_some() {
            let exact = "it takes the readings to be exact and magnifies noise in them many times; for readings with noise, \
                         take a decoder fitted to noisy samples";
            self.remarks.push(exact.to_owned());
        }
        let limits = Deviation {
            total: tolerance.limit + vectors.rounding.worst(),
            of_arithmetic: tolerance.limit,
        };
        let mut checks = Vec::new();
        let mut check = |evaluator, deviation| checks.push(BundleCheck::of(evaluator, deviation));
        match self.format {
            BundleFormat::Onnx => {
                let file = format!("{}.onnx", portable.decoder);
                self.folder
                    .write(&file, onnx::write(portable, &weights, &self.metadata, &self.remarks))?;
                let damaged = |reason| read_back(&file, reason);
                let graph = onnx::OnnxGraph::read(&self.read(&file)?).map_err(damaged)?;
                let answers = graph.decode(vectors.all()).map_err(damaged)?.answers;
                if answers.len() != vectors.all().len() {
                    return Err(read_back(&file, "it has another number of answers".to_owned()));
                }
                let mut answers = answers.into_iter();
                let deviation = vectors.deviation(|_| answers.next().unwrap_or_default());
                check("ONNX graph, read back and evaluated", deviation);
            }
            BundleFormat::NumPy => {
                let file = format!("{}.npz", portable.decoder);
                self.folder.write(&file, numpy::write_weights(portable, &weights))?;
                self.folder
                    .write("decode.py", numpy::write_program(portable, arithmetic))?;
                let read = numpy::read_weights(&self.read(&file)?, portable, arithmetic);
                let read = read.map_err(|reason| read_back(&file, reason))?;
                check("NumPy weights, read back and evaluated", model(&read));
            }
            BundleFormat::Matlab => {
                let (function, file) = (format!("{}_decode", self.name), format!("{}_decode.m", self.name));
                self.folder.write(&file, matlab::write(&function, portable, &weights))?;
                let text = String::from_utf8(self.read(&file)?).map_err(|error| read_back(&file, error.to_string()))?;
                let read = matlab::read_weights(&text, portable).map_err(|reason| read_back(&file, reason))?;
                check("MATLAB matrices, read back and evaluated", model(&read));
            }
            BundleFormat::C99 | BundleFormat::Json => {
                let notes = &self.remarks;
                let files = c99::write_floating(&self.name, portable, &weights, vectors.golden(), limits, notes);
                for (name, text) in files {
                    self.folder.write(&name, text)?;
                }
                check("model of the C source", model(&weights));
                match run_self_test(self.folder.path(), &self.name)? {
                    Compiled::Ran { deviation } => check("C source, compiled and run", deviation),
                    Compiled::NoCompiler(why) => self.remarks.push(format!("the C source was not compiled: {why}")),
                }
            }
        }
        self.finish(path, vectors, checks, limits, None)
    }

    fn export_fixed(mut self, path: &Path) -> Result<BundleReport, BundleError> {
        let fixed = FixedNetworks::of(&self.portable)?;
        // The bound holds for these.
        let vectors = self.vectors(Taking::Whole(&fixed))?.inside(&self.portable);
        let limit = fixed.relative_bound;
        let files = c99::write_fixed(&self.name, &self.portable, &fixed, vectors.golden(), limit);
        for (name, text) in files {
            self.folder.write(&name, text)?;
        }
        let deviation = vectors.deviation(|vector| {
            let outputs = fixed.decode(vector.row, &vector.readings);
            // Readings that it cannot take were refused when they were drawn.
            outputs.map(|outputs| fixed.in_own_units(&outputs)).unwrap_or_default()
        });
        let mut checks = vec![BundleCheck::of("bit-exact model in whole numbers", deviation)];
        let mut remarks = Vec::new();
        if fixed.hidden_width == HiddenWidth::TwentyFour {
            let remark = "the hidden weights have 24 bits, because their large products nearly cancel; the rest has 16";
            remarks.push(remark.to_owned());
        }
        if limit > USUAL_BOUND {
            remarks.push(format!(
                "the error is only known to be below {:.0} % of the range of the outputs; {} for a network that amplifies \
                 rounding errors less",
                100.0 * limit,
                self.portable.smaller_weights()
            ));
        }
        match run_self_test(self.folder.path(), &self.name)? {
            Compiled::Ran { deviation } => checks.push(BundleCheck::of(
                "C source, compiled and run, equal to the model bit for bit",
                deviation,
            )),
            Compiled::NoCompiler(why) => remarks.push(format!("the C source was not compiled: {why}")),
        }
        self.remarks.extend(remarks);
        let limits = Deviation {
            total: limit,
            of_arithmetic: limit,
        };
        self.finish(path, &vectors, checks, limits, Some(&fixed))
    }

    fn read(&self, name: &str) -> Result<Vec<u8>, BundleError> {
        fs::read(self.folder.path().join(name)).map_err(|error| read_back(name, error.to_string()))
    }

    /// Checks the deviations, adds the files that every bundle has, and puts the folder in its place.
    fn finish(
        self,
        path: &Path,
        vectors: &Vectors,
        checks: Vec<BundleCheck>,
        limits: Deviation,
        fixed: Option<&FixedNetworks>,
    ) -> Result<BundleReport, BundleError> {
        for check in &checks {
            check.admit(limits)?;
        }
        let portable = &self.portable;
        let mut report = BundleReport {
            format: self.format,
            precision: self.precision,
            path: path.to_owned(),
            files: Vec::new(),
            vectors: vectors.counts(),
            checks,
            limit: limits.total,
            rounding: (self.precision == BundlePrecision::Single).then_some(vectors.rounding),
            output_range_mm: portable.output_range_mm(),
            program_deviation: vectors.program_deviation,
            bounds: fixed.map_or_else(Vec::new, |fixed| portable.meaning.named(&fixed.bounds)),
            remarks: self.remarks,
        };
        self.folder
            .write("golden.csv", golden_csv(portable, vectors.golden()))?;
        let mut metadata = self.metadata;
        let verified = serde_json::json!({
            "deviation": report.deviation(), "limit": report.limit, "remarks": report.remarks,
        });
        metadata.insert("verification".to_owned(), verified);
        let metadata =
            serde_json::to_string_pretty(&metadata).map_err(|error| read_back("metadata.json", error.to_string()))?;
        self.folder.write("metadata.json", metadata + "\n")?;
        self.folder
            .write("README.txt", readme(&self.name, portable, fixed, &report))?;
        report.files = self.folder.sizes()?;
        self.folder.commit()?;
        Ok(report)
    }
}

/// Answer of a bundle with these numbers.
fn answer(portable: &Portable, weights: &Weights, vector: &Vector) -> Vec<f64> {
    match &portable.equations {
        None => weights.decode(vector.row, &vector.taken),
        Some(equations) => {
            let first = |map: usize| weights.decode(map, &vector.taken);
            Iteration::new(equations).decode(vector.row, &vector.taken, first)
        }
    }
}

fn read_back(file: &str, reason: String) -> BundleError {
    BundleError::ReadBack {
        file: file.to_owned(),
        reason,
    }
}
