use std::{fs, path::Path};

use super::{
    c99::{self, Compiled, run_self_test},
    choice::{BundleFormat, BundlePrecision, ReadingRounding, Taking},
    exported_decoder::{ExportedDecoder, Metadata},
    fixed_point::{FixedNetworks, HiddenWidth, USUAL_BOUND},
    folder::{AtomicFolder, Draft, deviation, identifier},
    memory::ExportedMemory,
    portable::Portable,
    report::{BundleCheck, BundleError, BundleReport, VectorCounts, readme},
    vectors::{Deviation, Tolerance, Vectors, golden_csv},
    weights::{self, Arithmetic, Weights},
};
use crate::export::{
    DocumentError, NetworkFile, WriteError,
    unfinished::{UnfinishedFolder, folder_of},
};

/// Writes a decoder as a bundle at `path`: a folder, or for [`BundleFormat::Json`] a file. The files are read back and
/// compared with the decoder before they are moved into place.
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
    let mut exported = decoder.into();
    format.check_for(exported.kind(), precision)?;
    if format == BundleFormat::Json && exported.kind().is_network() {
        return export_network_file(&exported, path);
    }
    if format == BundleFormat::Json && fs::symlink_metadata(path).is_ok() {
        return Err(BundleError::Exists(path.to_owned()));
    }
    if let (Some(memory), Some(unsupported)) = (exported.memory(), unsupported(format, precision)) {
        return Err(BundleError::Memory(unsupported, memory.clone()));
    }
    let folder = AtomicFolder::create(path)?;
    let portable = Portable::of(&exported)?;
    let memory = exported.memory().cloned();
    let memory = memory
        .map(|memory| ExportedMemory::of(&memory, &mut exported, &portable))
        .transpose()?;
    let mut bundle = Bundle {
        name: identifier(path),
        format,
        precision,
        metadata: exported.metadata(&portable, precision),
        exported,
        memory,
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

/// Bundles in which a memory cannot be written: its state needs double precision.
fn unsupported(format: BundleFormat, precision: BundlePrecision) -> Option<&'static str> {
    match (format, precision) {
        (BundleFormat::Json, _) => Some("this decoder as JSON"),
        (_, BundlePrecision::Fixed16) => Some("fixed point"),
        (_, BundlePrecision::Single) => Some("single precision"),
        (_, BundlePrecision::Double) => None,
    }
}

/// Copies the network file.
fn export_network_file(exported: &ExportedDecoder<'_>, path: &Path) -> Result<BundleReport, BundleError> {
    if fs::symlink_metadata(path).is_ok() {
        return Err(BundleError::Exists(path.to_owned()));
    }
    let file = exported.file().ok_or(BundleError::NoFile)?;
    let trial = UnfinishedFolder::begin(folder_of(path)).map_err(|error| WriteError::io(path, error))?;
    let copy = trial.path().join("network.json");
    // The user does not know the name of the copy.
    let of_target = |error| match error {
        DocumentError::Write(WriteError::Io { source, .. }) | DocumentError::Read { source, .. } => {
            WriteError::io(path, source).into()
        }
        error => error,
    };
    file.save(&copy).map_err(of_target)?;
    let read = NetworkFile::load(&copy).map_err(of_target)?;
    if (&read.network, &read.settings) != (&file.network, &file.settings) {
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
    Ok(of_file(path, &portable, vec![check]))
}

/// Returns the report on a single file in double precision.
fn of_file(path: &Path, portable: &Portable, checks: Vec<BundleCheck>) -> BundleReport {
    let size = fs::metadata(path).map_or(0, |found| found.len());
    BundleReport {
        format: BundleFormat::Json,
        precision: BundlePrecision::Double,
        path: path.to_owned(),
        files: vec![(path.display().to_string(), size)],
        vectors: VectorCounts { verified: 0, golden: 0 },
        checks,
        limit: 0.0,
        rounding: None,
        output_range_mm: portable.output_range_mm(),
        program_deviation: 0.0,
        bounds: Vec::new(),
        remarks: Vec::new(),
    }
}

/// Returns single precision for all layers if it is accurate enough, otherwise double precision for as few of the first
/// layers as possible.
fn single_arithmetic(portable: &Portable, vectors: &Vectors) -> Arithmetic {
    /// Fraction of the limit that single precision may use in this evaluation; other programs sum in a different order.
    const PART: f64 = 0.2;
    /// The same fraction if the large products that nearly cancel are computed in double precision.
    const PART_BEHIND_WIDE_LAYERS: f64 = 0.5;
    let is_enough = |wide_layers: &usize| {
        let single = Weights::of(portable, Arithmetic::single(*wide_layers));
        let deviation = deviation(&single, vectors);
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

/// An unfinished bundle.
struct Bundle<'a> {
    exported: ExportedDecoder<'a>,
    memory: Option<ExportedMemory>,
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

    /// Records how much rounding the readings to single precision changes the outputs.
    ///
    /// # Errors
    /// The change is too large.
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
        let found = deviation(&weights, vectors).of_arithmetic;
        let tolerance = Tolerance::of(portable, arithmetic, &vectors.growth, found);
        self.remarks.extend(tolerance.remarks(arithmetic, portable));
        let limits = Deviation {
            total: tolerance.limit + vectors.rounding.worst(),
            of_arithmetic: tolerance.limit,
        };
        let mut draft = Draft {
            name: &self.name,
            folder: &self.folder,
            portable,
            weights: &weights,
            vectors,
            limits,
            metadata: &self.metadata,
            remarks: &mut self.remarks,
        };
        let mut checks = (self.format.writer().export)(&mut draft)?;
        if let Some(memory) = &self.memory {
            checks.extend(memory.export(self.format, &mut draft)?);
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
        let found = vectors.deviation(|vector| {
            let outputs = fixed.decode(vector.row, &vector.readings);
            // Readings that it cannot take were refused when they were drawn.
            outputs.map(|outputs| fixed.in_own_units(&outputs)).unwrap_or_default()
        });
        let mut checks = vec![BundleCheck::of("bit-exact fixed-point model", found)];
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
            Compiled::NoCompiler(reason) => remarks.push(format!("the C source was not compiled: {reason}")),
        }
        self.remarks.extend(remarks);
        let limits = Deviation {
            total: limit,
            of_arithmetic: limit,
        };
        self.finish(path, &vectors, checks, limits, Some(&fixed))
    }

    /// Checks the deviations, adds the files common to all bundles, and moves the folder into place.
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
        if self.format == BundleFormat::Json {
            self.folder.commit_only(weights::FILE)?;
            return Ok(BundleReport {
                files: of_file(path, portable, Vec::new()).files,
                ..report
            });
        }
        self.folder
            .write("golden.csv", golden_csv(portable, vectors.golden()))?;
        let mut metadata = self.metadata;
        let verified = serde_json::json!({
            "deviation": report.deviation(), "limit": report.limit, "remarks": report.remarks,
        });
        metadata.insert("verification".to_owned(), verified);
        let metadata = serde_json::to_string_pretty(&metadata)
            .map_err(|error| BundleError::read_back("metadata.json", error.to_string()))?;
        self.folder.write("metadata.json", metadata + "\n")?;
        let mut text = readme(&self.name, portable, fixed, &report);
        if let Some(memory) = &self.memory {
            text += &memory.call(self.format, &self.name);
        }
        self.folder.write("README.txt", text)?;
        report.files = self.folder.sizes()?;
        self.folder.commit()?;
        Ok(report)
    }
}
