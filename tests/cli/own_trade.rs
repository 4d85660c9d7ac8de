//! The trade-off of a recording in the terminal: all decoders are measured on the test samples; options of a simulated
//! sensor are refused.

use std::fs;

use decoupler_core::decoupling::DecoderKind;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use serde_json::Value;
use tempfile::TempDir;

use crate::calls::{has, json, number, success};

const DATA: &str = "--data skin.csv --inputs c1..c3 --targets c4,c5";

/// Three readings of a position and a force, neither of which is an affine function of the readings.
fn recording() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut rows = String::new();
    for _ in 0..200 {
        let (x, force): (f64, f64) = (rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0));
        rows += &format!(
            "{},{},{},{},{}\n",
            x + 0.6 * force * force,
            force - 0.5 * x * x,
            x * force,
            x,
            40.0 * force
        );
    }
    fs::write(folder.path().join("skin.csv"), rows).unwrap();
    folder
}

#[test]
fn each_decoder_has_its_errors_times_and_place_on_the_fronts() {
    let folder = recording();
    let arguments = format!(
        "trade {DATA} --hidden 2,6 --method br,lm --epochs 40 --split time --under-percent 0.0001 --under-us 1e9"
    );
    let report = json(&format!("{arguments} --json"), folder.path());
    assert_eq!(
        (&report["decoded"], &report["test_samples"]),
        (&"a sample".into(), &40.into())
    );
    let points = report["points"].as_array().unwrap();
    // Those with neither network nor sensor, and twice two networks in 64 and 32 bits.
    let is_alone = |kind: &&DecoderKind| !kind.needs_network() && !kind.needs_sensor();
    let alone = DecoderKind::ALL.iter().filter(is_alone).count();
    assert_eq!(points.len(), alone + 2 * 2 * 2);
    for point in points {
        let targets = point["targets"].as_array().unwrap();
        let mean = targets
            .iter()
            .map(|target| number(target, "percent_of_range"))
            .sum::<f64>()
            / 2.0;
        assert!(
            (number(point, "percent_of_range") - mean).abs() < 1e-12 * mean,
            "{point}"
        );
        assert!(
            number(point, "frame_us") > 0.0 && number(point, "training_s") >= 0.0,
            "{point}"
        );
        let is_network = point["decoder"] == "network";
        assert_eq!(
            (point["hidden"].is_u64(), point["method"].is_string()),
            (is_network, is_network)
        );
        // Levenberg-Marquardt holds out a fifth of the other samples.
        let held_out = if point["method"] == "lm" { 32 } else { 0 };
        assert_eq!(
            (&point["samples"], &point["validation_samples"]),
            (&(160 - held_out).into(), &held_out.into())
        );
        // Independent test of Pareto optimality.
        for (front, cost) in [("on_decoding_front", "frame_us"), ("on_training_front", "training_s")] {
            let of = |point: &Value| (number(point, cost), number(point, "percent_of_range"));
            let (own_cost, own_error) = of(point);
            let is_beaten = points
                .iter()
                .map(of)
                .any(|(cost, error)| cost <= own_cost && error <= own_error && (cost, error) != (own_cost, own_error));
            assert_eq!(point[front], !is_beaten, "{front} {point}");
        }
    }
    let error = |decoder: &str, hidden: Value| {
        let mut points = points
            .iter()
            .filter(|point| point["decoder"] == decoder && point["hidden"] == hidden);
        number(points.next().unwrap(), "percent_of_range")
    };
    let [mean, ridge, network] = [("mean", Value::Null), ("ridge", Value::Null), ("network", 6.into())]
        .map(|(decoder, hidden)| error(decoder, hidden));
    assert!(network < 0.5 * ridge && ridge < mean, "{network} {ridge} {mean}");
    assert_eq!(report["fastest_under"]["point"], Value::Null, "no decoder is so good");
    let best = report["most_accurate_under"]["point"].as_u64().unwrap() as usize;
    assert!(
        points
            .iter()
            .all(|point| number(point, "percent_of_range") >= number(&points[best], "percent_of_range"))
    );
}

#[test]
fn the_command_of_a_point_trains_its_network() {
    let folder = recording();
    let given = "--where c4<0.95 --split random --test-fraction 0.3";
    let arguments = format!(
        "trade {DATA} {given} --hidden 3 --method lm --epochs 30 --seed 7 --decoder network --recipe-out r.json"
    );
    let of_arguments = json(&format!("{arguments} --json"), folder.path());
    let of_recipe = "trade --recipe r.json --hidden 3 --method lm --epochs 30 --seed 7 --decoder network --json";
    let of_recipe = json(of_recipe, folder.path());
    for report in [&of_arguments, &of_recipe] {
        let warnings = report["warnings"].to_string();
        assert!(warnings.contains("random test samples are optimistic"), "{warnings}");
        let point = &report["points"][0];
        let command = point["command"].as_str().unwrap().strip_prefix("decoupler ").unwrap();
        // The shell removes the quotes.
        let trained = json(&format!("{} --json", command.replace('\'', "")), folder.path());
        let [of_train, of_point] = [&trained, point].map(|from| from["targets"][1]["rmse"].as_f64().unwrap());
        // The trade-off measures compiled networks, which round differently.
        assert!(
            (of_train / of_point - 1.0).abs() < 1e-9,
            "{command}: {of_train} {of_point}"
        );
        assert_eq!(trained["validation_samples"], point["validation_samples"]);
    }
}

#[test]
fn the_table_lists_the_errors_of_each_target_in_its_unit() {
    let folder = recording();
    let text = success(
        &format!("trade {DATA} --unit c4=mm --unit c5=N --hidden 2 --epochs 5 --decoder ridge,network --under-us 1e9"),
        folder.path(),
    );
    let expected = [
        "160 samples for training, 0 for validation, 40 for testing (split by time)",
        "Time to decode a sample",
        "% of range",
        "c4 (mm)",
        "c5 (N)",
        "Network f32, br, 2 hidden",
        "Most accurate under 1000000000 us: ",
    ];
    has(&text, &expected);
}
