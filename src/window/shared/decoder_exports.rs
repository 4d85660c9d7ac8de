//! Exports of single decoders, next to where their errors are shown.

use std::{path::Path, sync::Arc};

use eframe::egui::{Button, Ui, WidgetInfo, accesskit::Role, containers::menu::MenuButton};

use super::{
    Contents, FileTask, NetworkSource,
    network_exports::{bundle_name, bundle_words, bundles, file_stem, said_of},
};
use decoupler_core::decoupling::{DecoderKind, Precision};
use decoupler_files::{
    export::{
        NetworkFile,
        bundle::{BundleDecoder, BundleError, BundleFormat, BundlePrecision, ExportedDecoder, export_bundle},
    },
    import::{Recorded, Setup, SetupSets},
};

/// Samples and network from which an exported decoder is made.
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
        let what = match format {
            BundleFormat::Json => kind.to_string(),
            _ => format!("{kind}-{format}-{precision}"),
        };
        let write = move |path: &Path, exported: Result<ExportedDecoder<'_>, BundleError>| {
            let report = exported.and_then(|exported| export_bundle(exported, format, precision, path));
            report.map(|report| said_of(&report)).map_err(|error| error.to_string())
        };
        match self {
            Self::Run(source) => source.task(words, &what, move |file: Arc<NetworkFile>, _| {
                Contents::telling(move |path| {
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
                let contents = Contents::telling(move |path| {
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
    let sets = setup.sets(Path::new(""), &|| false, &mut |_| ())?;
    Ok(sets.expect("nothing cancels it"))
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
    let mut asked = None;
    for form in bundles().filter(|(format, precision)| format.check_for(decoder, *precision).is_ok()) {
        let name = match form {
            (BundleFormat::Json, _) => "JSON".to_owned(),
            (format, precision) => format!("{}, {precision}", bundle_name(format)),
        };
        let button = ui.button(name).on_hover_text(bundle_words(form.0, decoder).description);
        if button.clicked() {
            asked = Some(source.task(kind, form));
        }
    }
    asked
}
