use std::{
    borrow::Cow,
    fmt,
    path::{Path, PathBuf},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::Sender,
    },
};

use decoupler_core::training::EpochRecord;
use decoupler_files::{
    export::{Table, TableForm, atomic_write, figures::PictureError, write_loss_curves},
    figure::Figure,
};

use super::Effect;
use crate::window::training_worker::{RunId, TrainedRun};

/// An item that a view can export in one form, or the reason why it is not available now.
pub struct Export<'a> {
    /// Part of the menu.
    pub group: ExportGroup,
    /// Name of the item: "Error table".
    pub name: String,
    /// Its form: "CSV".
    pub form: String,
    /// Description of the form in a sentence or two.
    pub description: &'static str,
    /// Request to the window, or the reason why the item is not available now.
    pub ask: Result<Ask<'a>, String>,
}

/// Makes the request to the window, which may copy the exported data.
pub type Ask<'a> = Box<dyn FnOnce() -> Effect + 'a>;

/// Parts of the Export menu.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ExportGroup {
    /// The network of a past epoch that is displayed.
    DisplayedNetwork(usize),
    /// The best network of a training, of this epoch.
    BestNetwork(usize),
    /// Networks for other programs.
    Network,
    /// The report of a run.
    Report,
    /// Pictures.
    Figures,
    /// Tables as files.
    Tables,
    /// Tables to the clipboard.
    Copies,
    /// Files from which this program continues.
    Training,
}

impl ExportGroup {
    /// Heading of the part.
    pub fn heading(self) -> Cow<'static, str> {
        let heading = match self {
            Self::DisplayedNetwork(epoch) => return format!("Displayed network, epoch {epoch}").into(),
            Self::BestNetwork(epoch) => return format!("Best network, epoch {epoch}").into(),
            Self::Network => "Network",
            Self::Report => "Report",
            Self::Figures => "Figures",
            Self::Tables => "Tables",
            Self::Copies => "Copy table as",
            Self::Training => "Training",
        };
        heading.into()
    }
}

/// Form of a picture on the clipboard.
const COPY: &str = "Copy";

impl<'a> Export<'a> {
    /// Sets `is_saved` once the user has saved the file, if it is a table.
    #[must_use]
    pub fn noting(self, is_saved: &Arc<AtomicBool>) -> Self {
        if self.group != ExportGroup::Tables {
            return self;
        }
        let is_saved = Arc::clone(is_saved);
        let ask = self.ask.map(|ask| -> Ask<'a> {
            Box::new(move || match ask() {
                Effect::ChooseFile(FileTask {
                    words,
                    suggestion,
                    purpose: Purpose::Save(contents),
                }) => Effect::ChooseFile(FileTask {
                    words,
                    suggestion,
                    purpose: Purpose::Save(contents.noting(is_saved)),
                }),
                effect => effect,
            })
        });
        Self { ask, ..self }
    }
}

impl Export<'_> {
    /// Returns the name of the action: "Export chart, SVG", "Copy error table as LaTeX".
    pub fn action(&self) -> String {
        if self.is_copy() {
            self.label()
        } else {
            format!("Export {}", self.label())
        }
    }

    /// Returns true for a copy to the clipboard.
    pub fn is_copy(&self) -> bool {
        self.group == ExportGroup::Copies || self.form == COPY
    }

    /// Returns the whole name: "Error table, CSV", "Copy error table as LaTeX".
    pub fn label(&self) -> String {
        match self.group {
            ExportGroup::Figures if self.form == COPY => format!("Copy {} as a picture", self.name.to_lowercase()),
            ExportGroup::Copies => format!("Copy {} as {}", self.name.to_lowercase(), self.form),
            _ => format!("{}, {}", self.name, self.form),
        }
    }
}

impl fmt::Debug for Export<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reason = self.ask.as_ref().err();
        f.debug_tuple("Export").field(&self.label()).field(&reason).finish()
    }
}

/// The picture as SVG and PNG files named after `stem`, and as a copy to the clipboard; `figure` returns it, or the reason
/// why there is none.
pub fn picture_exports<'a>(
    name: &str,
    stem: String,
    figure: Result<impl Fn() -> Figure + Clone + 'a, String>,
) -> impl Iterator<Item = Export<'a>> {
    let formats = [
        FileWords {
            kind: "picture as SVG",
            description: "The picture as shown, on a light background at publication size: lines and text, sharp at \
                          any size.",
            extensions: &["svg"],
        },
        FileWords {
            kind: "picture as PNG",
            description: "The picture as shown, on a light background at publication size: pixels at 300 dpi.",
            extensions: &["png"],
        },
    ];
    let name = name.to_owned();
    let copied = Export {
        group: ExportGroup::Figures,
        name: name.clone(),
        form: COPY.to_owned(),
        description: "Copies the picture as shown, on a light background: pixels at 300 dpi.",
        ask: figure.clone().map(|figure| -> Ask<'a> {
            let notice = format!("Copied the {} as a picture", name.to_lowercase());
            Box::new(move || Effect::CopyPicture {
                figure: Box::new(figure()),
                notice,
            })
        }),
    };
    let files = formats.into_iter().map(move |words| {
        let stem = stem.clone();
        Export {
            group: ExportGroup::Figures,
            name: name.clone(),
            form: words.extensions[0].to_uppercase(),
            description: words.description,
            ask: figure.clone().map(|figure| -> Ask<'a> {
                Box::new(move || {
                    let figure = figure();
                    let write = move |path: &Path| -> Result<(), PictureError> { figure.draw().save(path) };
                    Effect::ChooseFile(FileTask::save(words, &stem, Contents::new(write)))
                })
            }),
        }
    });
    files.chain([copied])
}

/// Copies of the table to the clipboard, in every form; `table` returns it, or the reason why there is none.
pub fn copy_exports<'a>(
    name: &str,
    table: Result<impl Fn() -> Table + Clone + 'a, String>,
) -> impl Iterator<Item = Export<'a>> {
    let name = name.to_owned();
    TableForm::ALL.into_iter().map(move |form| {
        let copied = format!("Copied the {} as {form}", name.to_lowercase());
        Export {
            group: ExportGroup::Copies,
            name: name.clone(),
            form: form.to_string(),
            description: match form {
                TableForm::Markdown => "Copies the table as Markdown, numbers with three significant digits.",
                TableForm::Latex => {
                    "Copies the table as LaTeX for the packages booktabs and siunitx, numbers with three significant \
                     digits, aligned at the decimal point."
                }
                TableForm::TabSeparated => {
                    "Copies the table with tabs between its columns, numbers with every digit: for spreadsheets."
                }
                TableForm::Json => {
                    "Copies the table as a JSON array with an object for each row, numbers with every digit."
                }
            },
            ask: table.clone().map(|table| -> Ask<'a> {
                Box::new(move || Effect::Copy {
                    text: table().text(form),
                    notice: copied,
                })
            }),
        }
    })
}

/// The displayed errors as a CSV file named after `stem`; `table` returns them, or the reason why there are none.
pub fn error_table_export<'a>(stem: String, table: Result<impl Fn() -> Table + 'a, String>) -> Export<'a> {
    let words = FileWords {
        kind: "error table",
        description: "The table of errors with every digit, as CSV.",
        extensions: &["csv"],
    };
    csv_export("Error table", words, stem, table)
}

/// The loss curves as a CSV file named after `stem`, or the reason why there are none.
pub fn loss_export<'a>(stem: String, history: Result<&'a [EpochRecord], String>) -> Export<'a> {
    let words = FileWords {
        kind: "loss curves",
        description: "Training, validation and test error of every epoch with every digit, as CSV.",
        extensions: &["csv"],
    };
    Export {
        group: ExportGroup::Tables,
        name: "Loss curves".to_owned(),
        form: "CSV".to_owned(),
        description: words.description,
        ask: history.map(|history| -> Ask<'a> {
            Box::new(move || {
                let history = history.to_vec();
                let contents =
                    Contents::new(move |path| atomic_write(path, |writer| write_loss_curves(&history, writer)));
                Effect::ChooseFile(FileTask::save(words, &stem, contents))
            })
        }),
    }
}

/// The table as a CSV file; `table` returns it, or the reason why there is none.
pub fn csv_export<'a>(
    name: &str,
    words: FileWords,
    stem: String,
    table: Result<impl Fn() -> Table + 'a, String>,
) -> Export<'a> {
    Export {
        group: ExportGroup::Tables,
        name: name.to_owned(),
        form: "CSV".to_owned(),
        description: words.description,
        ask: table.map(|table| -> Ask<'a> {
            Box::new(move || {
                let table = table();
                let contents = Contents::new(move |path| atomic_write(path, |writer| table.write_csv(writer)));
                Effect::ChooseFile(FileTask::save(words, &stem, contents))
            })
        }),
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

impl FileWords {
    /// Returns the name of the file with the default extension.
    pub fn file_name(&self, stem: &str) -> String {
        match self.extensions.first() {
            Some(extension) => format!("{stem}.{extension}"),
            None => stem.to_owned(),
        }
    }
}

/// Action on a file once its path is known.
#[derive(Clone, Debug)]
pub enum Purpose {
    /// Open the training saved in it.
    Open,
    /// Pass its path to the view that asked for it.
    Choose(Sender<PathBuf>),
    /// Write it about this training, which the worker owns.
    SaveTraining(RunId, ContentsOfRun),
    /// Write it.
    Save(Contents),
}

/// Contents of a file: a function that writes them and returns a message for the user, or the reason why it failed.
#[derive(Clone)]
pub struct Contents(Arc<Write>);

type Write = dyn Fn(&Path) -> Result<String, String> + Send + Sync;

impl Contents {
    /// The contents that `write` writes.
    pub fn new<X: ToString>(write: impl Fn(&Path) -> Result<(), X> + Send + Sync + 'static) -> Self {
        Self::with_message(move |path| {
            let saved = || format!("Saved {}", path.display());
            write(path).map(|()| saved()).map_err(|error| error.to_string())
        })
    }

    /// The contents that `write` writes; it returns the message for the user.
    pub fn with_message(write: impl Fn(&Path) -> Result<String, String> + Send + Sync + 'static) -> Self {
        Self(Arc::new(write))
    }

    /// Sets `is_saved` once the file is written.
    fn noting(self, is_saved: Arc<AtomicBool>) -> Self {
        Self::with_message(move |path| {
            let message = self.write(path)?;
            is_saved.store(true, Ordering::Relaxed);
            Ok(message)
        })
    }

    /// Writes the file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, path: &Path) -> Result<String, String> {
        (self.0)(path)
    }
}

impl fmt::Debug for Contents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Contents")
    }
}

/// Extracts the contents of a file from a training, or the reason why there are none.
#[derive(Clone)]
pub struct ContentsOfRun(Arc<Take>);

type Take = dyn Fn(&TrainedRun) -> Result<Contents, String> + Send + Sync;

impl ContentsOfRun {
    /// Contents of `run`.
    ///
    /// # Errors
    /// If it has none.
    pub fn take(&self, run: &TrainedRun) -> Result<Contents, String> {
        (self.0)(run)
    }
}

impl fmt::Debug for ContentsOfRun {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("ContentsOfRun")
    }
}

impl FileTask {
    /// The file of these contents, named after `stem`.
    pub fn save(words: FileWords, stem: &str, contents: Contents) -> Self {
        Self {
            words,
            suggestion: words.file_name(stem),
            purpose: Purpose::Save(contents),
        }
    }

    /// The file about the training `run`, named after `stem`. `take` runs on the worker's thread; the contents that it
    /// returns are written on another.
    pub fn save_run(
        words: FileWords,
        stem: &str,
        run: RunId,
        take: impl Fn(&TrainedRun) -> Result<Contents, String> + Send + Sync + 'static,
    ) -> Self {
        Self {
            words,
            suggestion: words.file_name(stem),
            purpose: Purpose::SaveTraining(run, ContentsOfRun(Arc::new(take))),
        }
    }

    /// Returns true if `other` asks for the same file.
    pub fn is_same_file(&self, other: &Self) -> bool {
        (self.words, &self.suggestion) == (other.words, &other.suggestion)
    }

    /// Returns true if the file is read, not written.
    pub fn is_read(&self) -> bool {
        matches!(self.purpose, Purpose::Open | Purpose::Choose(_))
    }

    /// Returns the verb for the action on the file.
    pub fn verb(&self) -> &'static str {
        if self.is_read() { "Open" } else { "Save" }
    }

    /// Returns the suggested path.
    pub fn suggested_path(&self) -> PathBuf {
        std::env::current_dir().unwrap_or_default().join(&self.suggestion)
    }
}
