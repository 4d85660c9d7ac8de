//! Drawn samples: deformations within the stroke, readings with the requested noise.

use decoupler_core::{
    dataset::{Dataset, Seed},
    evaluation::{RunSets, RunSettings},
    glam::DVec3,
    machine::MemoryBudget,
    scene::Noise,
    sensor::SensorModel,
};

use crate::{
    judge::{Job, Verdict, refused, wrong},
    situations,
};

/// Largest of all resistances at rest.
fn largest_ohm(model: &SensorModel) -> f64 {
    let rest = vec![DVec3::ZERO; model.scale.nodes_per_row()];
    let rows = (0..model.scale.rows()).flat_map(|row| model.row_resistances(row, &rest).unwrap());
    rows.fold(0.0, f64::max)
}

fn judge(settings: &RunSettings) -> Vec<(String, Verdict)> {
    let RunSets { split, test, .. } = match RunSets::draw(
        settings,
        MemoryBudget::UNLIMITED,
        &decoupler_core::job::Job::UNINTERRUPTED,
    ) {
        Ok(drawn) => drawn,
        Err(error) => return vec![("drawn".to_owned(), refused(&error))],
    };
    let mut clean = *settings.simulation().unwrap();
    let noise = std::mem::take(&mut clean.scene.noise);
    let truth = clean.draw_test(settings.seed).unwrap();
    let mut cells = vec![
        ("training readings".to_owned(), judge_finite(&split.training)),
        ("test readings".to_owned(), judge_finite(&test)),
        ("deformations".to_owned(), judge_stroke(&test, settings)),
    ];
    if truth.targets() != test.targets() {
        cells.push(("targets".to_owned(), wrong("noise changed the targets")));
    }
    cells.push((
        "noise of the test set".to_owned(),
        judge_noise(&truth, &test, noise.in_test(), &settings.simulation().unwrap().sensor),
    ));
    cells
}

fn judge_finite(set: &Dataset) -> Verdict {
    if set.readings().iter().all(|&ohm| ohm > 0.0 && ohm.is_finite()) {
        Verdict::Right
    } else {
        wrong("a reading is not a resistance")
    }
}

fn judge_stroke(set: &Dataset, settings: &RunSettings) -> Verdict {
    let (height, stroke) = (
        settings.simulation().unwrap().sensor.geometry.height_mm,
        settings.simulation().unwrap().stroke_mm(),
    );
    let rounding = 1e-15 * height;
    let z = set.targets().into_iter().skip(2).step_by(3).copied();
    let within = height - stroke - rounding..=height + rounding;
    let mut values: Vec<f64> = z.collect();
    if let Some(z) = values.iter().find(|z| !within.contains(z)) {
        return wrong(format!("a node is at {z:e} mm, out of the stroke"));
    }
    values.sort_by(f64::total_cmp);
    values.dedup();
    // Coordinates that rounding makes equal cannot be distinguished.
    if values.len() == 1 && set.samples() > 10 && stroke > 1e-12 * height {
        return wrong("no node ever moves");
    }
    Verdict::Right
}

/// Checks the spread of the readings about the truth against the documented formula if the noise is small enough not to
/// be truncated; larger noise must give positive readings that are not a fixed fraction of the truth.
fn judge_noise(truth: &Dataset, noisy: &Dataset, noise: Noise, model: &SensorModel) -> Verdict {
    let pairs = || {
        truth
            .readings()
            .into_iter()
            .copied()
            .zip(noisy.readings().into_iter().copied())
    };
    if noise.is_none() {
        return if pairs().all(|(truth, reading)| truth == reading) {
            Verdict::Right
        } else {
            wrong("readings without noise differ from the truth")
        };
    }
    let floor = pairs()
        .filter(|(truth, reading)| (reading / truth / 1e-6 - 1.0).abs() < 1e-9)
        .count();
    if floor > 0 {
        let share = floor as f64 / pairs().count() as f64;
        return wrong(format!(
            "{:.0} % of the readings are a millionth of the truth, which reveals it",
            100.0 * share
        ));
    }
    if let Some(bits) = noise.converter_bits {
        let step = 2.0 * largest_ohm(model) / 2_f64.powi(i32::from(bits));
        let most = 2_f64.powi(i32::from(bits));
        let is_step = |reading: f64| {
            let steps = reading / step;
            (steps - steps.round()).abs() < 1e-6 && (0.5..=most + 0.5).contains(&steps)
        };
        return if pairs().all(|(_, reading)| is_step(reading)) {
            Verdict::Right
        } else {
            wrong("a reading is between two steps of the converter")
        };
    }
    let squares: f64 = pairs().map(|(truth, reading)| (reading - truth).powi(2)).sum();
    let expected: f64 = pairs()
        .map(|(truth, _)| {
            let own = 1.0 + noise.drift * noise.drift;
            (truth * noise.relative).powi(2) * own + (truth * noise.drift).powi(2) + noise.additive_ohm.powi(2)
        })
        .sum();
    let count = pairs().count() as f64;
    let typical = (expected / count).sqrt();
    let reading = pairs().map(|(truth, _)| truth).sum::<f64>() / count;
    // Drift is one value per snapshot; below rounding it cannot be checked, and above a third of a reading it is
    // truncated.
    let drawn = if noise.drift > 0.0 {
        truth.snapshots().len() as f64
    } else {
        count
    };
    let by_chance = 4.0 / (2.0 * drawn).sqrt();
    if typical < 1e-13 * reading || typical > 0.25 * reading {
        return Verdict::Right;
    }
    let ratio = (squares / expected).sqrt();
    if (ratio - 1.0).abs() < by_chance + 0.01 {
        Verdict::Right
    } else {
        wrong(format!("the noise is {ratio:.3} times the requested noise"))
    }
}

/// The same seed gives the same bits, a different seed different ones.
fn judge_seeds(settings: &RunSettings) -> Verdict {
    let draw = |seed: u64| {
        let mut settings = *settings;
        settings.seed = Seed(seed);
        settings.simulation().unwrap().draw_test(settings.seed)
    };
    match (draw(7), draw(7), draw(8)) {
        (Ok(one), Ok(same), Ok(other)) => {
            if one.readings() != same.readings() {
                wrong("the same seed gives different readings")
            } else if one.targets() == other.targets() && one.samples() > 10 {
                wrong("another seed gives the same deformations")
            } else {
                Verdict::Right
            }
        }
        (Err(error), ..) | (_, Err(error), _) | (.., Err(error)) => refused(&error),
    }
}

pub(crate) fn jobs() -> Vec<Job> {
    let job = |(sentence, settings)| Job::new(sentence, move || judge(&settings));
    let twice = |(sentence, settings)| Job::one(format!("{sentence}, drawn twice"), move || judge_seeds(&settings));
    let twice = situations::all().into_iter().step_by(5).map(twice);
    situations::all().into_iter().map(job).chain(twice).collect()
}
