//! What the Train view shows of the current training, for export.

use decoupler_core::{evaluation::DecoderReport, problem::Channel};
use decoupler_files::export::{Cell, Table, decoder_table, error_table, loss_table};

use super::{
    charts::{SURFACES, lower_chart, upper_chart},
    view::TrainView,
};
use crate::window::{
    shared::{
        FileTask, FileWords, NetworkSource, Phase, RunResult, RunView, Shared, Shown, SourceKind, file_stem,
        saying_saved,
    },
    training_worker::LOST,
};

/// A saved training that can be resumed.
pub const CHECKPOINT: FileWords = FileWords {
    kind: "checkpoint",
    description: "The training in its current state, paused or ended. Resumed here or in a terminal (train --checkpoint FILE \
                  --resume), it gives bit-identical results.",
    extensions: &["checkpoint"],
};

/// Task of saving the checkpoint of `run`.
pub(super) fn checkpoint_task(run: &RunView) -> FileTask {
    let stem = file_stem("training", &run.setup);
    FileTask::of_run(CHECKPOINT, &stem, Some(run.id), |run| {
        let file = run.ok_or(LOST)?.checkpoint_file()?;
        Ok(saying_saved(move |path| file.save(path)))
    })
}

/// Returns what the view shows of the current training.
pub(super) fn shown<'a>(view: &'a TrainView, shared: &'a Shared) -> Vec<Shown<'a>> {
    let trained = shared.shown_run().and_then(|run| Some((run, run.result.as_ref()?)));
    let trained = trained.ok_or_else(|| "Nothing is trained yet: press Train first.".to_owned());
    let run = trained.clone().map(|(run, _)| run);
    let stem = |what: &str| {
        let stem = run.as_ref().map(|run| file_stem(what, &run.setup));
        stem.unwrap_or_default()
    };
    let past = view.scrub.result().map(|past| past.epochs_run);
    let mut shown = networks(view, &trained, past);
    let upper = match shared.source {
        SourceKind::Array => &SURFACES,
        SourceKind::Recording => upper_chart(view, shared),
    };
    let lower = lower_chart(view, shared);
    for (name, chart) in [(upper.name, upper), ("Chart", lower)] {
        let figure = run.clone().and_then(|_| {
            let figure = chart.figure(view, shared);
            let figure = figure.ok_or("This chart has nothing to show yet.")?;
            Ok(move || figure.clone())
        });
        let stem = stem(&chart.name.to_lowercase().replace(' ', "-"));
        shown.push(Shown::figure(name, stem, figure));
    }
    let errors = trained.map(|(run, latest)| {
        let result = view.result(shared).unwrap_or(latest);
        move || error_table(&run.error_table(result))
    });
    let of_epoch = past.map(|epoch| format!("-epoch{epoch}")).unwrap_or_default();
    shown.push(Shown::table("Error table", stem("errors") + &of_epoch, errors));
    let predictions = run.clone().and_then(|run| {
        let result = view.result(shared).ok_or("Nothing is decoded yet.")?;
        Ok(move || predictions_table(run, result))
    });
    shown.push(Shown::table("Test predictions", stem("test") + &of_epoch, predictions));
    let losses = run.clone().map(|run| || loss_table(&run.history));
    shown.push(Shown::table("Loss curves", stem("loss"), losses));
    let decoders = run.clone().and_then(|run| {
        let reports = measured(view);
        if reports.is_empty() {
            return Err("No decoder is measured yet: unfold “More decoders”.".to_owned());
        }
        Ok(move || decoder_table(&run.problem, &reports, run.baselines.model_based.as_ref()))
    });
    shown.push(Shown::table("Decoder table", stem("decoders"), decoders));
    let standing = run.and_then(|run| match shared.phase {
        _ if run.kept.is_some() => Err("A run of the list has no checkpoint: train again.".to_owned()),
        Phase::Paused | Phase::Calibrating | Phase::Ended(_) => Ok(checkpoint_task(run)),
        _ => Err("A training under way cannot be saved: pause it first.".to_owned()),
    });
    shown.push(Shown::file("Checkpoint", standing));
    shown
}

/// Actual and decoded values of every test sample, with the half-widths of the 90 % intervals.
fn predictions_table(run: &RunView, result: &RunResult) -> Table {
    let (test, intervals) = (&run.test, result.intervals.as_ref());
    let titled = |target: &Channel, what: &str| Channel {
        name: format!("{}_{what}", target.name),
        ..target.clone()
    };
    let of_target = |target: &Channel| {
        let half_width = intervals.map(|_| titled(target, "half_width_90"));
        let columns = [titled(target, "actual"), titled(target, "decoded")];
        Vec::from_iter(columns.into_iter().chain(half_width).map(|channel| channel.title()))
    };
    let headings = run.problem.targets.iter().flat_map(of_target);
    let rows = (0..test.set.samples()).map(|sample| {
        let values = (0..test.set.outputs()).flat_map(|target| {
            let [actual, decoded] = [test.set.targets()[[sample, target]], result.answers[[sample, target]]];
            let half_width = intervals.map(|intervals| intervals.half_width(target, decoded));
            [Some(actual), Some(decoded)]
                .into_iter()
                .chain(half_width)
                .map(Cell::Number)
        });
        std::iter::once(Cell::from(test.timeline.name(sample)))
            .chain(values)
            .collect()
    });
    Table::of_headings(std::iter::once("sample".to_owned()).chain(headings), rows)
}

/// Returns the best network, and before it that of the `past` epoch while it is displayed.
fn networks<'a>(
    view: &TrainView,
    trained: &Result<(&RunView, &RunResult), String>,
    past: Option<usize>,
) -> Vec<Shown<'a>> {
    let (run, latest) = match trained {
        Ok(trained) => *trained,
        Err(reason) => return Shown::network("Best network", Err(reason.clone()), Vec::new()).into(),
    };
    let mut shown = Vec::new();
    if let Some(epoch) = past {
        let setup = Box::new(run.setup.clone());
        let source = NetworkSource::Past(run.id, setup, epoch, run.past.clone());
        let name = format!("Displayed network, epoch {epoch}");
        // The decoders were measured together with the best network.
        shown.extend(Shown::network(&name, Ok(source), Vec::new()));
    }
    let name = format!("Best network, epoch {}", latest.best_epoch);
    shown.extend(Shown::network(&name, Ok(NetworkSource::of(run)), measured(view)));
    shown
}

/// Reports of the decoders measured so far.
fn measured(view: &TrainView) -> Vec<DecoderReport> {
    let results = view.decoders.measured.iter().flatten();
    let reports = results.filter_map(|result| result.report.as_ref()?.as_ref().ok());
    reports.cloned().collect()
}
