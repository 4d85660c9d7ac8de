//! Decoders in every situation, compared with the ground truth of the simulation.

use decoupler_core::{
    dataset::Dataset,
    decoupling::{DecoderKind, Precision, decode_set},
    evaluation::{DecoderReport, DecoderSet, Outlook, Run, RunSets, RunSettings, TestErrors},
    machine::MemoryBudget,
    ndarray::Array2,
    scene::{Loading, Rows},
};

use crate::{
    judge::{Job, Verdict, agree, flagged, refused, wrong},
    situations,
};

/// Returns the factor by which an error equal to the mean's may vary by chance, on a test set of this many nodes.
fn by_chance(nodes: usize) -> f64 {
    1.1 + 2.0 / (nodes as f64).sqrt()
}

/// Returns mean |decoded z − z|, computed independently.
fn z_mm(test: &Dataset, answers: &Array2<f64>) -> f64 {
    let pairs = answers
        .indexed_iter()
        .zip(test.targets())
        .filter(|(((_, channel), _), _)| channel % 3 == 2);
    let errors: Vec<f64> = pairs.map(|((_, answer), truth)| (answer - truth).abs()).collect();
    errors.iter().sum::<f64>() / errors.len() as f64
}

/// Maximum error, as a multiple of the mean's, that a warning about the scene explains: uninformative readings leave a
/// decoder near the mean, not far beyond it.
const EXPLAINED: f64 = 3.0;

/// Returns the program's remark on a decoder that explains an error of this many times the mean's, if there is one.
fn remark(report: &DecoderReport, times: f64, defect: Option<&str>, outlook: Option<&Outlook>) -> Option<String> {
    if let Some(remark) = report.remarks.first() {
        return Some(remark.to_string());
    }
    let of_network = defect.filter(|_| matches!(report.kind, DecoderKind::Network | DecoderKind::Polish));
    let of_scene = outlook
        .and_then(|outlook| outlook.warnings.first())
        .filter(|_| times <= EXPLAINED);
    of_network
        .map(ToString::to_string)
        .or_else(|| of_scene.map(ToString::to_string))
}

struct Measured {
    run: Run,
    set: DecoderSet,
    outlook: Option<Outlook>,
    defect: Option<String>,
    /// Error of always answering the mean of the training targets.
    mean_mm: f64,
}

fn measured(settings: &RunSettings) -> Result<Measured, Verdict> {
    let mut run = Run::prepare(*settings).map_err(|error| refused(&error))?;
    while run.step().is_none() {}
    let sets = RunSets::draw(
        settings,
        MemoryBudget::UNLIMITED,
        &decoupler_core::job::Job::UNINTERRUPTED,
    );
    let training = sets.map_err(|error| refused(&error))?.split.training;
    let set = DecoderSet::new(*settings, training.clone(), Some(run.network()));
    let mut answers = run.test().targets().to_owned();
    let shared = settings.simulation().unwrap().scene.rows == Rows::All;
    for sample in 0..run.test().samples() {
        let row = run.test().row_index(sample);
        let of_row = if shared { training.clone() } else { training.of_row(row) };
        let mean = of_row.targets().mean_axis(decoupler_core::ndarray::Axis(0)).unwrap();
        answers.row_mut(sample).assign(&mean);
    }
    Ok(Measured {
        mean_mm: z_mm(run.test(), &answers),
        defect: run.defect(),
        outlook: Outlook::of(settings.simulation().unwrap()).ok(),
        run,
        set,
    })
}

fn judge_decoder(seen: &Measured, settings: &RunSettings, kind: DecoderKind, precision: Precision) -> Verdict {
    let test = seen.run.test();
    let mut decoder = match seen.set.decoder(kind, precision) {
        Ok(Some(decoder)) => decoder,
        Ok(None) => return Verdict::Refused,
        Err(error) => return refused(&error),
    };
    let answers = match decode_set(&mut *decoder, test) {
        Ok(answers) => answers,
        Err(error) => return refused(&error),
    };
    let report = match seen.set.measure(kind, precision, test) {
        Ok(report) => report.expect("there is such a decoder"),
        Err(error) => return refused(&error),
    };
    let errors = *report.errors.nodes().expect("the targets are nodes");
    let found = z_mm(test, &answers);
    let times = found / seen.mean_mm;
    let remark = remark(&report, times, seen.defect.as_deref(), seen.outlook.as_ref());
    let or_flagged = |what: String| remark.as_ref().map_or_else(|| wrong(what), flagged);
    if !found.is_finite() || !errors.z_mm.is_finite() {
        return or_flagged(format!("{kind}: the error is {found}, without a reason"));
    }
    if !agree(found, errors.z_mm, 1e-9) {
        return wrong(format!(
            "{kind}: the error is {found:e} mm, the reported error is {:e} mm",
            errors.z_mm
        ));
    }
    if found > by_chance(answers.len() / 3) * seen.mean_mm {
        return or_flagged(format!(
            "{kind}: {times:.1e} times the error of the mean, without a remark"
        ));
    }
    let scene = settings.simulation().unwrap().scene;
    let is_exact = kind == DecoderKind::Newton && scene.noise.in_test().is_none() && scene.rows != Rows::All;
    let stroke_mm = settings.simulation().unwrap().stroke_mm();
    if is_exact && errors.worst_mm > 1e-4 * stroke_mm {
        let share = errors.worst_mm / stroke_mm;
        return or_flagged(format!(
            "{kind}: a row is off by {share:.1e} of the stroke without noise, without a remark"
        ));
    }
    Verdict::Right
}

/// The model-based row has the errors of Newton's method, and noise that hides everything leaves those of the prior.
fn judge_model_based(seen: &Measured, settings: &RunSettings) -> Verdict {
    let scene = settings.simulation().unwrap().scene;
    let baselines = seen.run.baselines().expect("they are measured");
    let Some(found) = baselines.model_based.as_ref().and_then(TestErrors::nodes) else {
        let note = baselines.model_based_note();
        return note.map_or_else(
            || wrong("there is no model-based row, and no reason"),
            |note| flagged(&note),
        );
    };
    let report = seen
        .set
        .measure(DecoderKind::Newton, Precision::Double, seen.run.test());
    let newton = report.ok().flatten().and_then(|report| report.errors.nodes().copied());
    if newton.as_ref() != Some(found) {
        return wrong(format!("the model-based errors are {found:?}, not {newton:?}"));
    }
    // Every node's depth is uniform, so the mean absolute error without readings is a quarter of the stroke.
    let (noise, stroke_mm) = (scene.noise, settings.simulation().unwrap().stroke_mm());
    let hides_all = noise.additive_ohm > 1e4 * situations::resistance_ohm(&settings.simulation().unwrap().sensor);
    let is_independent = scene.loading == Loading::RandomNodes;
    if hides_all && noise.in_test() == noise && is_independent && !(0.2..0.3).contains(&(found.z_mm / stroke_mm)) {
        return wrong(format!(
            "noise hides everything, and the model-based error is {:.2e} of the stroke, not 0.25",
            found.z_mm / stroke_mm
        ));
    }
    Verdict::Right
}

fn judge(settings: &RunSettings) -> Vec<(String, Verdict)> {
    let seen = match measured(settings) {
        Ok(seen) => seen,
        Err(verdict) => return vec![("prepared".to_owned(), verdict)],
    };
    let mut cells = Vec::new();
    for kind in DecoderKind::ALL {
        for &precision in kind.precisions() {
            let name = kind.name(precision).to_owned();
            cells.push((name, judge_decoder(&seen, settings, kind, precision)));
        }
    }
    cells.push(("model-based".to_owned(), judge_model_based(&seen, settings)));
    cells
}

pub(crate) fn jobs() -> Vec<Job> {
    let job = |(sentence, settings)| Job::new(sentence, move || judge(&settings));
    situations::all().into_iter().map(job).collect()
}
