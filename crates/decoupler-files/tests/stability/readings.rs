//! Readings that no sensor gives: every decoder refuses them, or reports that they are outside its training range.

use decoupler_core::{
    decoupling::{Decoder, DecoderKind},
    evaluation::{DecoderSet, Run, RunSets},
    machine::MemoryBudget,
    scene::Noise,
};

use crate::{
    judge::{Job, Verdict, flagged, refused, wrong},
    situations,
};

const ROOM: &str = "reading";

/// Returns the program's remark on a row of readings, if there is one.
fn remark(run: &Run, readings_ohm: &[f64]) -> Option<String> {
    let network = run.network();
    let inputs = network.at(0).inputs();
    let range = inputs.range()?;
    let channel = range.outside(inputs.quantity(), readings_ohm).next()?;
    let (low, high) = range.limits(inputs.quantity(), channel);
    Some(format!(
        "reading {} is outside those of the training, {low:e} to {high:e}: train with such readings, or check the sensor",
        channel + 1
    ))
}

fn judge(noise: Noise, changed: impl Fn(f64) -> f64, is_all: bool) -> Vec<(String, Verdict)> {
    let mut settings = situations::ordinary();
    settings.simulation_mut().unwrap().scene.noise = noise;
    let mut run = Run::prepare(settings).unwrap();
    while run.step().is_none() {}
    let sets = RunSets::draw(
        &settings,
        MemoryBudget::UNLIMITED,
        &decoupler_core::job::Job::UNINTERRUPTED,
    )
    .unwrap();
    let set = DecoderSet::new(settings, sets.split.training, Some(run.network()));
    let mut readings = run.test().sample_readings(0).to_vec();
    let count = if is_all { readings.len() } else { 1 };
    readings[..count].iter_mut().for_each(|value| *value = changed(*value));
    let is_resistance = readings.iter().all(|&value| value > 0.0 && value.is_finite());
    let geometry = settings.simulation().unwrap().sensor.geometry;
    let mut cells = Vec::new();
    for kind in DecoderKind::ALL {
        for &precision in kind.precisions() {
            let mut decoder: Box<dyn Decoder> = set.decoder(kind, precision).unwrap().unwrap();
            let mut answer = vec![f64::NAN; decoder.outputs()];
            let verdict = match decoder.decode_row(0, &readings, &mut answer) {
                Err(error) => refused(&error),
                // Its answer does not depend on the readings.
                Ok(()) if kind == DecoderKind::Mean => Verdict::Right,
                Ok(()) if !is_resistance => wrong(format!("{kind} answers readings that are not resistances")),
                Ok(()) => match remark(&run, &readings) {
                    Some(remark) => flagged(&remark),
                    None => {
                        let z_mm = answer.iter().skip(2).step_by(3);
                        let is_plausible = z_mm.clone().all(|z| (0.0..=geometry.height_mm).contains(z));
                        let how = if is_plausible { "plausibly" } else { "beyond the sensor" };
                        wrong(format!(
                            "{kind} answers {how}, without a remark that no such reading was in its training"
                        ))
                    }
                },
            };
            cells.push((kind.name(precision).to_owned(), verdict));
        }
    }
    cells
}

pub(crate) fn jobs() -> Vec<Job> {
    let mut jobs = Vec::new();
    for (noise_name, noise) in [("no noise", Noise::default()), ("noise 1e-3", Noise::relative(1e-3))] {
        for (which, is_all) in [("one reading", false), ("all readings", true)] {
            for value in [0.0, -0.0, -1.0, -1e300, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                let sentence = format!("{which} of {value}, {noise_name}");
                jobs.push(Job::new(ROOM, "no resistance", sentence, move || {
                    judge(noise, |_| value, is_all)
                }));
            }
            for factor in [1e-305, 1e-150, 1e-12, 1e-3, 0.1, 10.0, 1e3, 1e12, 1e150, 1e300] {
                let sentence = format!("{which} times {factor:e}, {noise_name}");
                jobs.push(Job::new(ROOM, "far from the training", sentence, move || {
                    judge(noise, |ohm| factor * ohm, is_all)
                }));
            }
        }
    }
    jobs
}
