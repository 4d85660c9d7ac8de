//! What views show and the user can export, and the files that are written from it.

use std::{
    fmt,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::Sender,
    },
};

use decoupler_core::{
    decoupling::DecoderKind,
    evaluation::{DecoderReport, Run},
    job::Job,
    text::{Named, capitalised},
};
use decoupler_files::{
    export::{
        NetworkFile, Table, TableForm, atomic_write,
        bundle::{
            BundleDecoder, BundleError, BundleFormat, BundlePrecision, BundleReport, ExportedDecoder, export_bundle,
        },
        format_number,
        report::RunReport,
    },
    figure::Figure,
    import::{self, Recorded, Setup, SetupSets},
};

use super::{Effect, RunView};
use crate::{
    terminal::{decode::decode_file, output},
    window::training_worker::{PastNetworks, RunId, TrainedRun},
};

/// Something that a view shows and the user can export.
pub struct Shown<'a> {
    /// Line of the menu to which it belongs.
    pub line: ExportLine,
    /// Its name: "Error table".
    pub name: String,
    /// The thing itself, or the reason why it is not available now.
    pub item: Result<Item<'a>, String>,
    saved: Option<Arc<AtomicBool>>,
}

/// A thing to export.
pub enum Item<'a> {
    /// A trained network.
    Network(NetworkSource),
    /// The report of a run with these measured decoders.
    Report(NetworkSource, Vec<DecoderReport>),
    /// A picture, with the stem of its suggested name.
    Figure(String, Box<dyn Fn() -> Figure + 'a>),
    /// A table, with the stem of its suggested name.
    Table(String, Box<dyn Fn() -> Table + 'a>),
    /// A file of one form only.
    File(FileTask),
}

/// Lines of the Export menu.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportLine {
    /// Networks and other decoders for other programs.
    Network,
    /// Reports of runs.
    Report,
    /// Pictures.
    Figure,
    /// Tables and other files.
    Data,
}

impl ExportLine {
    /// In the order of the menu.
    pub const ALL: [Self; 4] = [Self::Network, Self::Report, Self::Figure, Self::Data];

    /// Returns its name in the menu, and what it exports.
    pub fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Network => (
                "Network",
                "The network or another decoder as a program for elsewhere, or as a file.",
            ),
            Self::Report => ("Report", Format::Html.words().description),
            Self::Figure => ("Figure", "A picture of this view, as a file or to the clipboard."),
            Self::Data => (
                "Data",
                "A table or another file of this view; tables also to the clipboard.",
            ),
        }
    }
}

impl<'a> Shown<'a> {
    fn new(line: ExportLine, name: impl Into<String>, item: Result<Item<'a>, String>) -> Self {
        Self {
            line,
            name: name.into(),
            item,
            saved: None,
        }
    }

    /// A network and the report of its run. `of` distinguishes it from other networks: "best, epoch 46".
    pub fn network(of: &str, source: Result<NetworkSource, String>, decoders: Vec<DecoderReport>) -> [Self; 2] {
        let report = source.clone().map(|source| Item::Report(source, decoders));
        [
            Self::new(ExportLine::Network, of, source.map(Item::Network)),
            Self::new(ExportLine::Report, of, report),
        ]
    }

    /// A picture, whose file is named after `stem`.
    pub fn figure(name: &str, stem: String, figure: Result<impl Fn() -> Figure + 'a, String>) -> Self {
        let item = figure.map(|figure| Item::Figure(stem, Box::new(figure)));
        Self::new(ExportLine::Figure, name, item)
    }

    /// A table, whose file is named after `stem`.
    pub fn table(name: &str, stem: String, table: Result<impl Fn() -> Table + 'a, String>) -> Self {
        let item = table.map(|table| Item::Table(stem, Box::new(table)));
        Self::new(ExportLine::Data, name, item)
    }

    /// A file of one form only.
    pub fn file(name: &str, task: Result<FileTask, String>) -> Self {
        Self::new(ExportLine::Data, name, task.map(Item::File))
    }

    /// Returns the name of its action: "Export figure: Surfaces…".
    pub fn action(&self) -> String {
        let (line, _) = self.line.words();
        format!("Export {}: {}…", line.to_lowercase(), self.name)
    }

    /// Returns the request to choose the form of its export.
    pub fn ask(&self) -> Effect {
        Effect::Export(Box::new(Exporting::new(self.line, &self.name)))
    }

    /// Sets `is_saved` once the table is saved as a file.
    #[must_use]
    pub fn noting(self, is_saved: &Arc<AtomicBool>) -> Self {
        Self {
            saved: Some(Arc::clone(is_saved)),
            ..self
        }
    }

    /// Returns the forms in which it is exported.
    pub fn formats(&self) -> Vec<Format> {
        match &self.item {
            Ok(Item::Network(_)) => {
                let bundles = BundleFormat::ALL.iter().map(|&format| Format::Bundle(format));
                bundles.chain([Format::NetworkFile]).collect()
            }
            Ok(Item::Report(..)) => vec![Format::Html],
            Ok(Item::Figure(..)) => vec![Format::Svg, Format::Png, Format::Picture],
            Ok(Item::Table(..)) => {
                let copies = TableForm::ALL.into_iter().map(Format::Copy);
                std::iter::once(Format::Csv).chain(copies).collect()
            }
            Ok(Item::File(task)) => vec![Format::Own(task.words)],
            Err(_) => Vec::new(),
        }
    }

    /// Returns the request to the window for this choice; `None` where there is nothing to export.
    pub fn export(&self, format: Format, decoder: BundleDecoder, precision: BundlePrecision) -> Option<Effect> {
        let name = self.name.to_lowercase();
        let task = match (self.item.as_ref().ok()?, format) {
            (Item::Network(source), Format::Bundle(format)) => source.bundle(decoder, format, precision),
            (Item::Network(source), _) => source.network_file(),
            (Item::Report(source, decoders), _) => source.report(decoders.clone()),
            (Item::Figure(_, figure), Format::Picture) => {
                let picture = ToCopy::Picture(Box::new(figure()));
                return Some(Effect::Copy(picture, format!("Copied the {name} as a picture")));
            }
            (Item::Figure(stem, figure), _) => {
                let figure = figure();
                FileTask::save(format.words(), stem, move |path| figure.draw().save(path))
            }
            (Item::Table(_, table), Format::Copy(form)) => {
                let text = ToCopy::Text(table().text(form));
                return Some(Effect::Copy(text, format!("Copied the {name} as {form}")));
            }
            (Item::Table(stem, table), _) => {
                let (table, saved) = (table(), self.saved.clone());
                FileTask::save(format.words(), stem, move |path| {
                    atomic_write(path, |writer| table.write_csv(writer))?;
                    if let Some(saved) = &saved {
                        saved.store(true, Ordering::Relaxed);
                    }
                    Ok::<_, decoupler_files::export::WriteError>(())
                })
            }
            (Item::File(task), _) => task.clone(),
        };
        Some(Effect::ChooseFile(task))
    }
}

/// Forms of exported things.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A decoder as a program.
    Bundle(BundleFormat),
    /// A network as a file of this program.
    NetworkFile,
    /// A report.
    Html,
    /// A picture of lines.
    Svg,
    /// A picture of pixels.
    Png,
    /// A picture on the clipboard.
    Picture,
    /// A table as a file.
    Csv,
    /// A table on the clipboard.
    Copy(TableForm),
    /// A file of one form only.
    Own(FileWords),
}

impl Format {
    /// Returns its name in a list.
    pub fn name(self) -> String {
        match self {
            Self::Bundle(format) => format.title().to_owned(),
            Self::NetworkFile => "Network file".to_owned(),
            Self::Picture => "Copy".to_owned(),
            Self::Copy(form) => format!("Copy as {form}"),
            Self::Html | Self::Svg | Self::Png | Self::Csv | Self::Own(_) => {
                let extensions = self.words().extensions;
                extensions.first().copied().unwrap_or("folder").to_uppercase()
            }
        }
    }

    /// Returns true for a copy to the clipboard.
    pub fn is_copy(self) -> bool {
        matches!(self, Self::Picture | Self::Copy(_))
    }

    /// Returns words for its file, or its description for a copy.
    pub fn words(self) -> FileWords {
        let (kind, description, extensions): (_, _, &[_]) = match self {
            Self::Bundle(format) => (format.title(), format.meaning(), &[]),
            Self::NetworkFile => (
                "network",
                "Layers, scaling, array, geometry, training record and errors, as JSON; the terminal commands decode and \
                 export read it.",
                &["json"],
            ),
            Self::Html => (
                "report",
                "Settings, errors, figures, remarks and the terminal command that repeats the run, in one file for any \
                 browser.",
                &["html"],
            ),
            Self::Svg => (
                "picture as SVG",
                "As shown, on a light background at publication size: lines and text, sharp at any size.",
                &["svg"],
            ),
            Self::Png => (
                "picture as PNG",
                "As shown, on a light background at publication size: pixels at 300 dpi.",
                &["png"],
            ),
            Self::Picture => ("picture", "As shown, on a light background: pixels at 300 dpi.", &[]),
            Self::Csv => ("table", "With every digit.", &["csv"]),
            Self::Copy(form) => (
                "table",
                match form {
                    TableForm::Markdown => "Numbers with three significant digits.",
                    TableForm::Latex => "For booktabs and siunitx: numbers with three significant digits.",
                    TableForm::TabSeparated => "Numbers with every digit, for spreadsheets.",
                    TableForm::Json => "An array with an object for each row, numbers with every digit.",
                },
                &[],
            ),
            Self::Own(words) => return words,
        };
        FileWords {
            kind,
            description,
            extensions,
        }
    }
}

/// Something to be copied.
#[derive(Clone, Debug)]
pub enum ToCopy {
    /// Text as it is.
    Text(String),
    /// A picture, still to be drawn.
    Picture(Box<Figure>),
}

/// An export that the user chooses in a dialog.
#[derive(Clone, Debug)]
pub struct Exporting {
    /// The line of the menu.
    pub line: ExportLine,
    /// Name of the thing; the first one of the line if there is none of this name.
    pub name: String,
    /// Its form; the first one if it has no such form.
    pub format: Option<Format>,
    /// The decoder that is exported with a network.
    pub decoder: BundleDecoder,
    /// Numbers with which an exported decoder computes.
    pub precision: BundlePrecision,
    /// A network that is not among the things that the view shows.
    pub given: Option<NetworkSource>,
}

impl Exporting {
    /// The export of the thing `name`.
    pub fn new(line: ExportLine, name: &str) -> Self {
        Self {
            line,
            name: name.to_owned(),
            format: None,
            decoder: BundleDecoder::Kind(DecoderKind::Network),
            precision: BundlePrecision::default(),
            given: None,
        }
    }

    /// The export of a decoder of this source.
    pub fn decoder(kind: DecoderKind, source: NetworkSource) -> Self {
        Self {
            decoder: BundleDecoder::Kind(kind),
            given: Some(source),
            ..Self::new(ExportLine::Network, "")
        }
    }
}

/// A file whose path the user is asked for. It holds the contents as they were at the request: later changes do not affect
/// it.
#[derive(Clone, Debug)]
pub struct FileTask {
    /// Words that describe the file.
    pub words: FileWords,
    /// Suggested name.
    pub suggestion: String,
    /// Task: reading or writing the file, with its contents.
    pub purpose: Purpose,
}

/// Words that describe a kind of file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileWords {
    /// Content in a word or two.
    pub kind: &'static str,
    /// Content in a sentence.
    pub description: &'static str,
    /// Allowed extensions without the dot, the default first. None for a folder.
    pub extensions: &'static [&'static str],
}

/// Action on a file once its path is known.
#[derive(Clone, Debug)]
pub enum Purpose {
    /// Pass its path to the view that asked for it.
    Choose(Sender<PathBuf>),
    /// Write it.
    Save(Contents),
    /// Decode it.
    Decode(Contents),
}

/// Contents of a file, which may be those of a training.
#[derive(Clone)]
pub struct Contents {
    /// The training that the worker owns and that they are taken from.
    pub run: Option<RunId>,
    take: Arc<Take>,
}

/// Writes a file at the path; returns a message for the user, or the reason why it failed.
pub type Write = Box<dyn FnOnce(&Path) -> Result<String, String> + Send>;

type Take = dyn Fn(Option<&TrainedRun>) -> Result<Write, String> + Send + Sync;

impl Contents {
    /// Takes what is to be written from the training, if they are of one. Writing it needs the training no longer.
    ///
    /// # Errors
    /// If there is nothing to be written.
    pub fn take(&self, trained: Option<&TrainedRun>) -> Result<Write, String> {
        (self.take)(trained)
    }
}

impl fmt::Debug for Contents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Contents")
    }
}

impl FileTask {
    /// A file named after `stem`. `take` is called with the training `run`, if there is one, on the worker's thread; what it
    /// returns writes the file on another.
    pub fn of_run(
        words: FileWords,
        stem: &str,
        run: Option<RunId>,
        take: impl Fn(Option<&TrainedRun>) -> Result<Write, String> + Send + Sync + 'static,
    ) -> Self {
        let suggestion = match words.extensions.first() {
            Some(extension) => format!("{stem}.{extension}"),
            None => stem.to_owned(),
        };
        let take = Arc::new(take);
        Self {
            words,
            suggestion,
            purpose: Purpose::Save(Contents { run, take }),
        }
    }

    /// A file named after `stem` that `write` writes.
    pub fn save<X: ToString>(
        words: FileWords,
        stem: &str,
        write: impl Fn(&Path) -> Result<(), X> + Send + Sync + 'static,
    ) -> Self {
        let write = Arc::new(write);
        Self::of_run(words, stem, None, move |_| {
            let write = Arc::clone(&write);
            Ok(saying_saved(move |path| write(path)))
        })
    }

    /// A file to be read, whose path is sent to `chosen`.
    pub fn choose(words: FileWords, suggestion: impl Into<String>, chosen: Sender<PathBuf>) -> Self {
        Self {
            words,
            suggestion: suggestion.into(),
            purpose: Purpose::Choose(chosen),
        }
    }

    /// Returns true if the file is read, not written.
    pub fn is_read(&self) -> bool {
        !matches!(self.purpose, Purpose::Save(_))
    }

    /// Returns the title of the question for its path.
    pub fn title(&self) -> String {
        let verb = if self.is_read() { "Open" } else { "Save" };
        format!("{verb} {}", self.words.kind)
    }

    /// Returns the suggested path: for a file to be written, one that is free.
    pub fn suggested_path(&self) -> PathBuf {
        let path = std::env::current_dir().unwrap_or_default().join(&self.suggestion);
        if self.is_read() { path } else { free_path(&path) }
    }
}

/// Writes a file and says where.
pub fn saying_saved<X: ToString>(write: impl FnOnce(&Path) -> Result<(), X> + Send + 'static) -> Write {
    Box::new(move |path| {
        write(path).map_err(|error| error.to_string())?;
        Ok(format!("Saved {}", path.display()))
    })
}

/// Returns the path, or if there is something already, the first with -2, -3, … before its extension that is free.
fn free_path(path: &Path) -> PathBuf {
    let is_free = |path: &PathBuf| match path.read_dir() {
        Ok(mut entries) => entries.next().is_none(),
        Err(_) => !path.exists(),
    };
    let text = |part: Option<&std::ffi::OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    let (stem, ending) = match path.extension() {
        Some(extension) if !path.is_dir() => (text(path.file_stem()), format!(".{}", extension.display())),
        _ => (text(path.file_name()), String::new()),
    };
    let numbered = (2..).map(|number| path.with_file_name(format!("{stem}-{number}{ending}")));
    let mut all = std::iter::once(path.to_owned()).chain(numbered);
    all.find(is_free).unwrap_or_else(|| path.to_owned())
}

/// Network or samples from which decoders are exported.
#[derive(Clone, Debug)]
pub enum NetworkSource {
    /// The network of the current training, which the worker owns.
    Training(RunId, Box<Setup>),
    /// The network of a past epoch of it.
    Past(RunId, Box<Setup>, usize, PastNetworks),
    /// The network of a kept run with this name.
    Kept(String, Arc<NetworkFile>),
    /// No network, but the samples of a setup, to which other decoders are fitted, and the origin of recorded ones.
    Samples(Box<Setup>, Option<Box<Recorded>>),
}

impl NetworkSource {
    /// The best network of `run`.
    pub fn of(run: &RunView) -> Self {
        match &run.kept {
            Some((name, file)) => Self::Kept(name.clone(), Arc::clone(file)),
            None => Self::Training(run.id, Box::new(run.setup.clone())),
        }
    }

    /// The task of decoding another file into a table next to it.
    pub fn decode(&self) -> FileTask {
        let task = self.task((DECODED, "readings"), |file, _| {
            Box::new(move |path| decoded(&file, path))
        });
        let Purpose::Save(contents) = task.purpose else {
            return task;
        };
        FileTask {
            suggestion: String::new(),
            purpose: Purpose::Decode(contents),
            ..task
        }
    }

    /// Returns the decoders that can be exported.
    pub fn decoders(&self) -> impl Iterator<Item = BundleDecoder> {
        let has_network = !matches!(self, Self::Samples(..));
        // The combination that was chosen is what the network of a file answers with.
        BundleDecoder::all()
            .filter(move |decoder| *decoder != BundleDecoder::Chosen && (has_network || !decoder.is_network()))
    }

    fn file_stem(&self, what: &str) -> String {
        match self {
            Self::Training(_, setup) | Self::Samples(setup, _) => file_stem(what, setup),
            Self::Past(_, setup, epoch, _) => format!("{}-epoch{epoch}", file_stem(what, setup)),
            Self::Kept(_, file) => file_stem(what, &file.setup()),
        }
    }

    /// The file about the network that `write` writes, with the run if it is the best of the current training.
    fn task(
        &self,
        (words, what): (FileWords, &str),
        write: impl Fn(Arc<NetworkFile>, Option<&Run>) -> Write + Send + Sync + 'static,
    ) -> FileTask {
        let run = match self {
            Self::Training(run, _) | Self::Past(run, ..) => Some(*run),
            Self::Kept(..) | Self::Samples(..) => None,
        };
        let source = self.clone();
        FileTask::of_run(words, &self.file_stem(what), run, move |trained| {
            match (&source, trained) {
                (Self::Training(..), Some(trained)) => {
                    let file = trained.network_file()?;
                    Ok(write(Arc::new(file), Some(&trained.run)))
                }
                (Self::Past(_, _, epoch, past), Some(trained)) => {
                    let (run, recorded) = (&trained.run, trained.recorded.as_ref());
                    let network = past.at(*epoch, &run.network());
                    let network = network.ok_or_else(|| format!("the network of epoch {epoch} is no longer kept"))?;
                    let file = NetworkFile::from_past(run, recorded, &network).map_err(|error| error.to_string())?;
                    Ok(write(Arc::new(file), None))
                }
                (Self::Kept(_, file), _) => Ok(write(Arc::clone(file), None)),
                _ => Err("there is no trained network: train one first".to_owned()),
            }
        })
    }

    fn network_file(&self) -> FileTask {
        self.task((Format::NetworkFile.words(), "network"), |file, _| {
            saying_saved(move |path| file.save(path))
        })
    }

    fn bundle(&self, decoder: BundleDecoder, format: BundleFormat, precision: BundlePrecision) -> FileTask {
        let what = if decoder.is_network() {
            format!("{format}-{precision}")
        } else {
            format!("{decoder}-{format}-{precision}")
        };
        let words = Format::Bundle(format).words();
        let write = move |exported: Result<ExportedDecoder, BundleError>, path: &Path| {
            let report = exported.and_then(|exported| export_bundle(exported, format, precision, &free_path(path)));
            report.map(|report| said_of(&report)).map_err(|error| error.to_string())
        };
        let Self::Samples(setup, recorded) = self else {
            return self.task((words, &what), move |file, _| {
                Box::new(move |path| {
                    let of_samples = || ExportedDecoder::of_run(&file, samples(&file.setup())?, decoder);
                    let of_file = decoder.is_network().then(|| Ok(ExportedDecoder::from(&*file)));
                    write(of_file.unwrap_or_else(of_samples), path)
                })
            });
        };
        let (setup, recorded) = (setup.clone(), recorded.clone());
        FileTask::of_run(words, &self.file_stem(&what), None, move |_| {
            let (setup, recorded) = (setup.clone(), recorded.clone());
            Ok(Box::new(move |path| {
                let exported = samples(&setup).and_then(|sets| {
                    sets.check_saved(recorded.as_deref())?;
                    ExportedDecoder::of_setup(&setup, sets, decoder)
                });
                write(exported, path)
            }))
        })
    }

    fn report(&self, decoders: Vec<DecoderReport>) -> FileTask {
        let name = match self {
            Self::Training(..) | Self::Samples(..) => None,
            Self::Past(_, _, epoch, _) => Some(format!("epoch {epoch}")),
            Self::Kept(name, _) => Some(name.clone()),
        };
        self.task((Format::Html.words(), "report"), move |file, run| {
            let defect = run.and_then(Run::defect);
            let test = run.map(|run| Arc::clone(run.test()));
            let (name, decoders) = (name.clone(), decoders.clone());
            saying_saved(move |path| {
                let test = match test {
                    Some(test) => test,
                    None => file.test_set().map_err(|error| error.to_string())?,
                };
                let report = RunReport {
                    name: name.as_deref(),
                    file: &file,
                    defect: defect.as_deref(),
                    decoders: &decoders,
                    test: &test,
                };
                report.save(path).map_err(|error| error.to_string())
            })
        })
    }
}

/// A file of readings for a network.
const DECODED: FileWords = FileWords {
    kind: "readings",
    description: "Decodes all samples of another file with the columns of the readings; a CSV file next to it gets the targets, with \
                  the times and groups of the file and the half-widths of the 90 % intervals.",
    extensions: &import::Format::EXTENSIONS,
};

/// Decodes the readings in a file into a table next to it, and says where and what to check.
fn decoded(file: &NetworkFile, path: &Path) -> Result<String, String> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let to = free_path(&path.with_file_name(format!("{stem}-decoded.csv")));
    output::begin();
    decode_file(file, path, &to).map_err(|failure| failure.to_string())?;
    let mut text = format!("Saved {}", to.display());
    for warning in &output::warnings() {
        text += &format!(". {}", capitalised(warning));
    }
    Ok(text)
}

/// Draws or reads the samples of a setup.
fn samples(setup: &Setup) -> Result<SetupSets, BundleError> {
    Ok(setup.sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ())?)
}

/// Returns a sentence about a bundle that was written.
fn said_of(report: &BundleReport) -> String {
    let limit = match report.output_range_mm {
        Some(range_mm) => format!("{} mm", format_number(report.limit * range_mm)),
        None => format!("{:.1e} of the range of a target", report.limit),
    };
    let mut text = format!(
        "{} written; answers of other programs agree within {limit}. Saved {}",
        report.format.title(),
        report.path.display()
    );
    for remark in &report.remarks {
        text += &format!(". Note: {remark}");
    }
    text
}

/// Returns a file name without extension that distinguishes runs: the contents, and the main settings of the run.
pub fn file_stem(what: &str, setup: &Setup) -> String {
    let source = setup.source_name().replace('×', "x");
    let settings = setup.settings();
    let (hidden, method) = (settings.hidden, settings.training.method.short_name());
    let starts = match settings.starts {
        1 => String::new(),
        starts => format!("-starts{starts}"),
    };
    format!("{what}-{source}-h{hidden}-{method}{starts}-seed{}", settings.seed)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_name_that_is_taken_is_followed_by_the_next_number() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        assert_eq!(free_path(&at("loss.csv")), at("loss.csv"));
        for name in ["loss.csv", "loss-2.csv", "net/file"] {
            fs::create_dir_all(at(name).parent().unwrap()).unwrap();
            fs::write(at(name), "").unwrap();
        }
        assert_eq!(free_path(&at("loss.csv")), at("loss-3.csv"));
        assert_eq!(free_path(&at("net")), at("net-2"));
        fs::create_dir(at("net-2")).unwrap();
        assert_eq!(free_path(&at("net")), at("net-2"), "an empty folder is free");
    }
}
