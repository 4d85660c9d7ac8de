//! Exports of networks and of reports, of the current training or of a kept run.
//!
//! Exports of single decoders, offered next to their errors.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use decoupler_core::{
    decoupling::{DecoderKind, Precision},
    evaluation::{DecoderReport, Run},
    job::Job,
    text::Named,
};
use decoupler_files::{
    export::{
        NetworkFile,
        bundle::{
            BundleDecoder, BundleError, BundleFormat, BundlePrecision, BundleReport, ExportedDecoder, export_bundle,
        },
        format_number,
        report::RunReport,
    },
    import::{Recorded, Setup, SetupSets},
};
use eframe::egui::{Button, Ui, WidgetInfo, accesskit::Role, containers::menu::MenuButton};

use super::{Ask, Contents, Effect, Export, ExportGroup, FileTask, FileWords};
use crate::window::training_worker::{PastNetworks, RunId, TrainedRun};

const NETWORK: BundleDecoder = BundleDecoder::Kind(DecoderKind::Network);

/// A trained network that can be exported.
#[derive(Clone, Debug)]
pub enum NetworkSource {
    /// Of the current training, which the worker owns.
    Training(RunId, Box<Setup>),
    /// Of a past epoch of the current training.
    Past(RunId, Box<Setup>, usize, PastNetworks),
    /// Of a kept run with this name.
    Kept(String, Arc<NetworkFile>),
}

impl NetworkSource {
    /// Returns the file with the `contents` made from the network and its record.
    pub(super) fn task(
        &self,
        words: FileWords,
        what: &str,
        contents: impl Fn(Arc<NetworkFile>, Option<&Run>) -> Contents + Send + Sync + 'static,
    ) -> FileTask {
        match self {
            Self::Training(run, setup) => {
                let take = move |trained: &TrainedRun| {
                    let file = trained.network_file()?;
                    Ok(contents(Arc::new(file), Some(&trained.run)))
                };
                FileTask::save_run(words, &file_stem(what, setup), *run, take)
            }
            Self::Past(run, setup, epoch, past) => {
                let (epoch, past) = (*epoch, past.clone());
                let take = move |trained: &TrainedRun| {
                    let (run, recorded) = (&trained.run, trained.recorded.as_ref());
                    let network = past.at(epoch, &run.network());
                    let network = network.ok_or_else(|| format!("the network of epoch {epoch} is no longer kept"))?;
                    let file = NetworkFile::from_past(run, recorded, &network).map_err(|error| error.to_string())?;
                    Ok(contents(Arc::new(file), None))
                };
                let stem = format!("{}-epoch{epoch}", file_stem(what, setup));
                FileTask::save_run(words, &stem, *run, take)
            }
            Self::Kept(_, file) => {
                let stem = file_stem(what, &file.setup());
                FileTask::save(words, &stem, contents(Arc::clone(file), None))
            }
        }
    }
}

/// The network in every form and the report of its run; `source` is the network, or the reason why there is none.
/// `prefix` comes before every name.
pub fn network_exports<'a>(
    prefix: &str,
    source: &Result<NetworkSource, String>,
    decoders: impl Fn() -> Vec<DecoderReport> + Clone + 'a,
) -> Vec<Export<'a>> {
    let ask = |task: Box<dyn FnOnce(NetworkSource) -> FileTask + 'a>| {
        source
            .clone()
            .map(|source| -> Ask<'a> { Box::new(move || Effect::ChooseFile(task(source))) })
    };
    let mut exports: Vec<Export<'a>> = bundles()
        .map(|(format, precision)| {
            let task = move |source| bundle_task(&source, format, precision);
            bundle_export(
                prefix,
                (format, precision),
                bundle_words(format, NETWORK),
                ask(Box::new(task)),
            )
        })
        .collect();
    exports.push(Export {
        group: ExportGroup::Network,
        name: format!("{prefix}Network file"),
        form: "JSON".to_owned(),
        description: NETWORK_FILE.description,
        ask: ask(Box::new(move |source: NetworkSource| {
            source.task(NETWORK_FILE, "network", |file, _| {
                Contents::new(move |path| file.save(path))
            })
        })),
    });
    exports.push(Export {
        group: ExportGroup::Report,
        name: format!("{prefix}Report"),
        form: "HTML".to_owned(),
        description: REPORT.description,
        ask: ask(Box::new(move |source| report_task(&source, decoders()))),
    });
    exports
}

/// Every form of a network with its precisions.
pub(super) fn bundles() -> impl Iterator<Item = (BundleFormat, BundlePrecision)> {
    BundleFormat::ALL.iter().flat_map(|&format| {
        let precisions = format.precisions().iter();
        precisions.map(move |&precision| (format, precision))
    })
}

fn bundle_export<'a>(
    prefix: &str,
    (format, precision): (BundleFormat, BundlePrecision),
    words: FileWords,
    ask: Result<Ask<'a>, String>,
) -> Export<'a> {
    Export {
        group: ExportGroup::Network,
        name: format!("{prefix}{}", format.title()),
        form: precision.to_string(),
        description: words.description,
        ask,
    }
}

/// The contents that `export` writes and verifies.
fn bundle_contents(export: impl Fn(&Path) -> Result<BundleReport, BundleError> + Send + Sync + 'static) -> Contents {
    Contents::with_message(move |path| {
        export(&free_folder(path))
            .map(|report| said_of(&report))
            .map_err(|error| error.to_string())
    })
}

/// The folder, or if there is one with files, the first of its name with -2, -3, … that is free: no folder is overwritten, and
/// a second export does not fail.
fn free_folder(path: &Path) -> PathBuf {
    let is_taken = |path: &Path| match path.read_dir() {
        Ok(mut entries) => entries.next().is_some(),
        Err(_) => path.exists(),
    };
    let name = path
        .file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let numbered = (2..).map(|number| path.with_file_name(format!("{name}-{number}")));
    let mut all = std::iter::once(path.to_owned()).chain(numbered);
    all.find(|path| !is_taken(path)).unwrap_or_else(|| path.to_owned())
}

/// Words for a network or another decoder in a format.
pub(super) fn bundle_words(format: BundleFormat, decoder: BundleDecoder) -> FileWords {
    let is_network = decoder.is_network();
    let (kind, description) = match (format, is_network) {
        (BundleFormat::Onnx, true) => (
            "network as ONNX",
            "A folder with the network as an ONNX graph (opset 13) and golden readings: readings in, targets out.",
        ),
        (BundleFormat::Onnx, false) => (
            "decoder as ONNX",
            "A folder with the decoder as an ONNX graph (opset 13) and golden readings: readings in, targets out.",
        ),
        (BundleFormat::C99, _) => (
            if is_network { "network as C99" } else { "decoder as C99" },
            "A folder with one header and one source in C99 and a self-test: readings in, targets out. fixed16 uses integer \
             arithmetic only, for microcontrollers.",
        ),
        (BundleFormat::Matlab, _) => (
            if is_network {
                "network for MATLAB and Octave"
            } else {
                "decoder for MATLAB and Octave"
            },
            "A folder with one function file for MATLAB and GNU Octave and golden readings: readings in, targets out.",
        ),
        (BundleFormat::NumPy, _) => (
            if is_network {
                "network for NumPy"
            } else {
                "decoder for NumPy"
            },
            "A folder with the weights as .npz, a short decode.py and golden readings: readings in, targets out.",
        ),
    };
    FileWords {
        kind,
        description,
        extensions: &[],
    }
}

const NETWORK_FILE: FileWords = FileWords {
    kind: "network",
    description: "Layers, scaling, array, geometry, training record and errors, as JSON; the terminal commands decode and \
                  export read it.",
    extensions: &["json"],
};

fn bundle_task(source: &NetworkSource, format: BundleFormat, precision: BundlePrecision) -> FileTask {
    let words = bundle_words(format, NETWORK);
    source.task(words, &format!("{format}-{precision}"), move |file, _| {
        bundle_contents(move |path| export_bundle(&*file, format, precision, path))
    })
}

/// Returns a sentence about a bundle that was written.
pub(super) fn said_of(report: &BundleReport) -> String {
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

const REPORT: FileWords = FileWords {
    kind: "report",
    description: "Settings, errors, figures, remarks and the terminal command that repeats the run, in one file for any \
                  browser.",
    extensions: &["html"],
};

fn report_task(source: &NetworkSource, decoders: Vec<DecoderReport>) -> FileTask {
    let name = match source {
        NetworkSource::Training(..) => None,
        NetworkSource::Past(_, _, epoch, _) => Some(format!("epoch {epoch}")),
        NetworkSource::Kept(name, _) => Some(name.clone()),
    };
    source.task(REPORT, "report", move |file, run| {
        let defect = run.and_then(Run::defect);
        let test = run.map(|run| Arc::clone(run.test()));
        let (name, decoders) = (name.clone(), decoders.clone());
        Contents::new(move |path: &Path| {
            let test = match &test {
                Some(test) => Arc::clone(test),
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

/// Samples and network that an exported decoder is made from.
#[derive(Clone, Debug)]
pub enum DecoderSource {
    /// Run with a trained network.
    Run(NetworkSource),
    /// Samples of a setup, to which a decoder without a network is fitted, and the origin of recorded ones.
    Samples(Box<Setup>, Option<Box<Recorded>>),
}

impl DecoderSource {
    fn task(&self, kind: DecoderKind, (format, precision): (BundleFormat, BundlePrecision)) -> FileTask {
        let decoder = BundleDecoder::Kind(kind);
        let words = bundle_words(format, decoder);
        let what = format!("{kind}-{format}-{precision}");
        let write = move |path: &Path, exported: Result<ExportedDecoder, BundleError>| {
            let report = exported.and_then(|exported| export_bundle(exported, format, precision, &free_folder(path)));
            report.map(|report| said_of(&report)).map_err(|error| error.to_string())
        };
        match self {
            Self::Run(source) => source.task(words, &what, move |file: Arc<NetworkFile>, _| {
                Contents::with_message(move |path| {
                    let exported = if decoder.is_network() {
                        Ok(ExportedDecoder::from(&*file))
                    } else {
                        samples(&file.setup()).and_then(|sets| ExportedDecoder::of_run(&file, sets, decoder))
                    };
                    write(path, exported)
                })
            }),
            Self::Samples(setup, recorded) => {
                let stem = file_stem(&what, setup);
                let (setup, recorded) = (setup.clone(), recorded.clone());
                let contents = Contents::with_message(move |path| {
                    let exported = samples(&setup).and_then(|sets| {
                        sets.check_saved(recorded.as_deref())?;
                        ExportedDecoder::of_setup(&setup, sets, decoder)
                    });
                    write(path, exported)
                });
                FileTask::save(words, &stem, contents)
            }
        }
    }
}

/// Draws or reads the samples of a setup.
fn samples(setup: &Setup) -> Result<SetupSets, BundleError> {
    Ok(setup.sets(Path::new(""), &Job::UNINTERRUPTED, &mut |_| ())?)
}

/// A button that opens the menu of formats in which a decoder can be exported; returns the file asked for.
pub fn decoder_export_ui(
    ui: &mut Ui,
    button: Button<'_>,
    kind: DecoderKind,
    source: &DecoderSource,
) -> Option<FileTask> {
    let mut asked = None;
    let (button, _) = MenuButton::from_button(button).ui(ui, |ui| asked = decoder_forms_ui(ui, kind, source));
    let name = format!("Export {}…", kind.name(Precision::Double));
    button.widget_info(|| WidgetInfo::labeled(Role::Button, true, &name));
    button.on_hover_text(name);
    asked
}

/// The formats in which a decoder can be exported, such as "C99, f32"; returns the file asked for.
pub fn decoder_forms_ui(ui: &mut Ui, kind: DecoderKind, source: &DecoderSource) -> Option<FileTask> {
    let decoder = BundleDecoder::Kind(kind);
    if let Err(refused) = decoder.check() {
        ui.label(refused.to_string());
        return None;
    }
    let mut asked = None;
    for form in bundles().filter(|(format, precision)| format.check_for(decoder, *precision).is_ok()) {
        let name = format!("{}, {}", form.0.title(), form.1);
        let button = ui.button(name).on_hover_text(bundle_words(form.0, decoder).description);
        if button.clicked() {
            asked = Some(source.task(kind, form));
        }
    }
    asked
}
