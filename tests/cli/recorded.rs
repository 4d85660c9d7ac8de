//! Analysis of a recording in the terminal.

use std::fs;

use decoupler_core::{dataset::SplitBy, evaluation::Intervals, job::Job};
use decoupler_files::export::NetworkFile;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};
use tempfile::TempDir;

use crate::{
    calls::{both, column, has, json, number, read, said, success, warnings, write},
    terminal::decoupler,
};

/// A folder with a recording, `r.csv`, of these columns.
fn written(header: &str, rows: impl Iterator<Item = String>) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let rows = rows.map(|row| row + "\n").collect::<String>();
    write(folder.path(), "r.csv", format!("{header}\n{rows}"));
    folder
}

/// 300 samples of four numbers in [-1, 1].
fn random(seed: u64) -> impl Iterator<Item = [f64; 4]> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..300).map(move |_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
}

/// A recording of four readings, where d repeats a and e is constant: they determine x, but not y, which is noise.
fn recording() -> TempDir {
    let row = |[a, b, noise, y]: [f64; 4]| format!("{a},{b},{},7,{},{y}", 3.0 - 2.0 * a, a + 0.3 * b + 0.05 * noise);
    written("a,b,d,e,x (mm),y", random(5).map(row))
}

const INSPECT: &str = "inspect --data r.csv --inputs a,b,d,e --targets x,y";

#[test]
fn each_target_is_judged_with_an_interval_and_compared_with_other_models_and_splits() {
    let folder = recording();
    let report = json(&format!("{INSPECT} --json"), folder.path());
    let [x, y] = [0, 1].map(|target| &report["targets"][target]);
    assert_eq!((&x["standing"], &x["unit"]), (&"determined".into(), &"mm".into()));
    // The readings do not explain 0.05²/3 of the variance of x, (1 + 0.3² + 0.05²)/3.
    assert!(
        (number(&x["r2"], "value") - (1.0 - 0.0025 / 1.0925)).abs() < 1e-3,
        "{x}"
    );
    for figure in ["r2", "r2_ridge", "r2_kernel"] {
        let [low, value, high] = ["low", "value", "high"].map(|name| number(&x[figure], name));
        assert!(low < value && value < high, "{figure}: {x}");
    }
    assert_eq!(x["split"]["by"], "time");
    has(x["split"]["sentence"].as_str().unwrap(), &["split by time"]);
    assert_eq!(y["standing"], "not determined");
    let sentence = y["sentence"].as_str().unwrap();
    assert!(
        sentence.starts_with("ridge and kernel ridge regression explain almost nothing of y (R² "),
        "{sentence}"
    );
    has(
        &report["warnings"].to_string(),
        &["d repeats a", "e is 7 in every sample"],
    );
    let text = success(INSPECT, folder.path());
    let sentences = [
        "The readings determine x (R² 0.99",
        "Ridge and kernel ridge regression explain almost nothing of y",
    ];
    has(&text, &sentences);
}

#[test]
fn answers_have_calibrated_intervals_and_drift_is_reported() {
    let folder = recording();
    let train = "train --data r.csv --inputs a,b --targets x,y --time t --hidden 2 --epochs 20 --json --out";
    // A time column, which decode keeps.
    let path = folder.path().join("r.csv");
    let text = fs::read_to_string(&path).unwrap();
    let timed = text.lines().enumerate().map(|(row, line)| match row {
        0 => format!("t (s),{line}\n"),
        _ => format!("{row},{line}\n"),
    });
    fs::write(&path, timed.collect::<String>()).unwrap();
    let report = json(&format!("{train} n.json"), folder.path());
    // 90 % of the noise of x is within 0.9 × 0.05; y is nothing but noise between -1 and 1.
    for (target, half_width) in [(0, 0.045), (1, 0.9)] {
        let interval = &report["targets"][target]["interval"];
        assert!(
            (number(interval, "half_width") / half_width - 1.0).abs() < 0.2,
            "{interval}"
        );
        let expected = [0, 1].map(|end| interval["expected"][end].as_f64().unwrap());
        assert!(
            (expected[0]..=expected[1]).contains(&number(interval, "share")),
            "{interval}"
        );
    }
    let without = json(&format!("{train} without.json --intervals never"), folder.path());
    assert_eq!(without["targets"][0].get("interval"), None);
    let decode = |input: &str| {
        let command = format!("decode --network n.json --data {input} --out {input}.out");
        let output = decoupler(&command, folder.path());
        let message = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{message}");
        let decoded = fs::read_to_string(folder.path().join(format!("{input}.out"))).unwrap();
        (decoded, message)
    };
    let (decoded, message) = decode("r.csv");
    let mut lines = decoded.lines();
    assert_eq!(
        lines.next(),
        Some("t (s),x (mm),x_half_width_90 (mm),y,y_half_width_90,readings_outside,targets_outside")
    );
    assert!(
        lines.next().unwrap().starts_with("1,") && !message.contains("recalibrate"),
        "{message}"
    );
    // An offset of a by three standard deviations.
    let shifted = text.lines().skip(1).zip(1..).map(|(line, row)| {
        let (a, rest) = line.split_once(',').unwrap();
        format!("{row},{},{rest}\n", a.parse::<f64>().unwrap() + 1.7)
    });
    let shifted = format!("t (s),a,b,d,e,x (mm),y\n{}", shifted.collect::<String>());
    write(folder.path(), "shifted.csv", shifted);
    const DRIFTED: &str = "no longer look like the training readings";
    let (_, message) = decode("shifted.csv");
    has(&message, &[DRIFTED, "lines 2 to "]);
    // Frozen from line 101 to line 200.
    let frozen = Vec::from_iter(fs::read_to_string(&path).unwrap().lines().map(str::to_owned));
    let lines = frozen.iter().zip(1..).map(|(line, number)| match number {
        101..=200 => format!("{number},{}", frozen[99].split_once(',').unwrap().1),
        _ => line.clone(),
    });
    write(folder.path(), "frozen.csv", lines.collect::<Vec<_>>().join("\n"));
    let (_, message) = decode("frozen.csv");
    let warning = message.lines().find(|line| line.contains(DRIFTED)).unwrap();
    let lines = warning
        .strip_prefix("warning: lines ")
        .unwrap()
        .split_once(':')
        .unwrap()
        .0;
    let (first, last) = lines.split_once(" to ").unwrap();
    let [first, last] = [first, last].map(|line| line.parse::<i32>().unwrap());
    assert!((first - 101).abs() <= 20 && (last - 200).abs() <= 20, "{message}");
    assert!(
        warning.contains("less than in training") && message.matches(DRIFTED).count() == 1,
        "{message}"
    );
    // A stream has the same answers and half-widths as the file, and the same warning.
    let follow = |input: &str| {
        both(
            &format!("decode --network n.json --follow --data {input}"),
            folder.path(),
        )
    };
    let (followed, message) = follow("r.csv");
    assert!(!message.contains(DRIFTED), "{message}");
    assert_eq!(followed.lines().count(), decoded.lines().count());
    for (followed, decoded) in followed.lines().zip(decoded.lines()).skip(1) {
        let numbers = |line: &str| Vec::from_iter(line.split(',').map(|cell| cell.parse::<f64>().unwrap()));
        let mut pairs = numbers(followed).into_iter().zip(numbers(decoded));
        assert!(
            pairs.all(|(one, other)| (one - other).abs() < 1e-9),
            "{followed} {decoded}"
        );
    }
    let (_, message) = follow("shifted.csv");
    assert!(message.contains(DRIFTED) && !message.contains("again"), "{message}");
    let (_, message) = follow("frozen.csv");
    has(&message, &[DRIFTED, "look like the training readings again"]);
    success("export --network n.json --format c99 --out bundle", folder.path());
    has(
        &read(folder.path(), "bundle/bundle_decode.h"),
        &["half_widths[BUNDLE_OUTPUTS]"],
    );
}

#[test]
fn readings_without_a_drift_monitor_give_the_reason() {
    let folder = recording();
    let path = folder.path();
    for (inputs, rows, reason) in [
        ("e", 300, "every input is constant in the training samples"),
        ("a,b", 40, "there are "),
    ] {
        let text = fs::read_to_string(path.join("r.csv")).unwrap();
        let lines = text.lines().take(1 + rows).map(|line| format!("{line}\n"));
        fs::write(path.join("some.csv"), lines.collect::<String>()).unwrap();
        let train = format!("train --data some.csv --inputs {inputs} --targets y --hidden 2 --epochs 5 --out n.json");
        for command in [
            &train,
            "decode --network n.json --data some.csv --out out.csv",
            "decode --network n.json --follow --data some.csv",
        ] {
            has(
                &said(command, path),
                &[&format!("Drift of the readings is not monitored: {reason}")],
            );
        }
    }
}

#[test]
fn a_choice_of_settings_gives_the_intervals() {
    let folder = recording();
    let train =
        "train --data r.csv --inputs a,b --targets x --hidden auto --budget 1 --json --out n.json --checkpoint c.json";
    let report = json(train, folder.path());
    // 90 % of the noise is within 0.9 × 0.05.
    let half_width = number(&report["targets"][0]["interval"], "half_width");
    assert!((half_width / 0.045 - 1.0).abs() < 0.2, "{half_width}");
    // The held-out answers of the choice were used: the networks of a cross-validation have a seed of their own.
    let file = NetworkFile::load(&folder.path().join("n.json")).unwrap();
    let sets = file
        .setup()
        .sets(folder.path(), &Job::UNINTERRUPTED, &mut |_| ())
        .unwrap();
    let (training, by) = (&sets.sets.split.training, SplitBy::Time);
    let by_cross_validation = Intervals::cross_validate(&file.settings, training, by, &Job::UNINTERRUPTED).unwrap();
    assert_ne!(file.intervals, Some(by_cross_validation));
    assert_eq!(
        file.intervals.as_ref().unwrap().targets[0].as_ref().unwrap().samples,
        training.samples()
    );
    // So they are when the finished training is resumed, but not when it continues with other settings.
    let resumed = |options: &str| {
        let command = format!("train --checkpoint c.json --resume --json --out again.json {options}");
        json(&command, folder.path());
        NetworkFile::load(&folder.path().join("again.json")).unwrap()
    };
    let again = resumed("");
    assert_eq!((again.intervals, again.network), (file.intervals.clone(), file.network));
    assert_ne!(resumed("--epochs 500").intervals, file.intervals);
}

#[test]
fn the_optimism_of_a_random_split_is_reported() {
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    // A target that drifts with time, so that it cannot be predicted beyond the training samples.
    let rows = (0..200).map(|frame| {
        let time = f64::from(frame) / 20.0;
        format!("{time},{}", (1.3 * time).sin() + 0.02 * rng.random_range(-1.0..1.0))
    });
    let folder = written("c1,c2", rows);
    let arguments = "train --data r.csv --inputs c1 --targets c2 --split random --hidden 6 --epochs 40 --json";
    for folds in ["", " --folds 4"] {
        let report = json(&format!("{arguments}{folds}"), folder.path());
        let words = ["a random split would report an RMSE of", "split is optimistic by"];
        has(&report["warnings"].to_string(), &words);
        let target = &report["targets"][0];
        assert!(
            target["r2_interval"][0].as_f64().unwrap() <= number(target, "r2"),
            "{target}"
        );
    }
}

/// Readings that follow the target with a play of ±0.5 in a range of 10: the best answer without memory is the reading, which
/// is 0.5 too low while the target rises and as much too high while it falls.
#[test]
fn the_hysteresis_of_decoded_values_is_reported() {
    let mut reading = 5.0_f64;
    let rows = (0..2000).map(|frame| {
        let target = 5.0 + 5.0 * (std::f64::consts::TAU * f64::from(frame) / 200.0).sin();
        reading = reading.clamp(target - 0.5, target + 0.5);
        format!("{reading},{target}")
    });
    let folder = written("c1,c2", rows);
    let arguments = "train --data r.csv --inputs c1 --targets c2 --split time --hidden 2 --epochs 30";
    let report = json(&format!("{arguments} --json"), folder.path());
    let found = &report["hysteresis"][0];
    assert!((9.0..13.0).contains(&number(found, "percent_of_range")), "{found}");
    for branch in ["loading", "unloading"] {
        assert!(
            (0.4..0.6).contains(&number(&found[branch], "rmse")),
            "{branch}: {found}"
        );
    }
    let rows = [
        "network, loading",
        "network, unloading",
        "hysteresis of the decoded values",
    ];
    has(&success(arguments, folder.path()), &rows);
    // Samples drawn at random have lost their order in time.
    let report = json(
        &format!("{arguments} --split random --json").replace("--split time ", ""),
        folder.path(),
    );
    assert!(report["hysteresis"][0].is_null(), "{report}");
}

/// Ten presses in random order, whose readings identify the press but do not determine the target, which differs between
/// presses.
fn presses() -> TempDir {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let presses: Vec<[f64; 3]> = (0..10)
        .map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
        .collect();
    let rows = (0..300).map(|_| {
        let press = rng.random_range(0..10);
        let [a, b, y] = presses[press].map(|value| value + 0.01 * rng.random_range(-1.0..1.0));
        format!("{press},{a},{b},{y}")
    });
    written("press,a,b,y", rows)
}

const PRESSES: &str = "--data r.csv --inputs a,b --targets y --group press";

#[test]
fn a_random_split_is_compared_with_groups_which_are_kept_together_if_there_are_any() {
    let folder = presses();
    let train = format!("train {PRESSES} --hidden 8 --json --epochs");
    for split in ["--split random", "--split random --folds 5"] {
        let said = warnings(&format!("{train} 60 {split}"), folder.path());
        has(&said, &["split by group", "split is optimistic by"]);
    }
    assert_eq!(json(&format!("{train} 5"), folder.path())["split"], "group");
    for split in ["random", "time", "group"] {
        let report = json(&format!("inspect {PRESSES} --split {split} --json"), folder.path());
        assert_eq!(report["split"], split);
        let compared = &report["targets"][0]["split"];
        assert_eq!(compared["by"], "group", "{compared}");
        assert!(number(compared, "random_rmse") < number(compared, "rmse"), "{compared}");
    }
}

/// A switch that predicts the state with 10 % flips, recorded without and with each row written twice: R² is (1 − 2·0.1)²
/// = 0.64.
#[test]
fn repeated_readings_keep_their_frequency() {
    let folder = tempfile::tempdir().unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let rows = |copies: usize, rng: &mut ChaCha8Rng| {
        let rows = (0..1000).map(|_| {
            let x = rng.random_bool(0.5);
            let y = x ^ rng.random_bool(0.1);
            format!("{},{}\n", u8::from(x), u8::from(y)).repeat(copies)
        });
        "x,y\n".to_owned() + &rows.collect::<String>()
    };
    for copies in [1, 2] {
        write(folder.path(), "r.csv", rows(copies, &mut rng));
        let report = json("inspect --data r.csv --inputs x --targets y --json", folder.path());
        let target = &report["targets"][0];
        let value = target["r2"]["value"].as_f64().unwrap();
        assert!((value - 0.64).abs() < 0.06, "{target}");
        assert_eq!(target["standing"], "determined", "{target}");
        let report = json(
            "train --data r.csv --inputs x --targets y --epochs 5 --hidden 2 --json",
            folder.path(),
        );
        let ridge = &report["baselines"]["ridge"][0];
        assert!(ridge["r2"].as_f64().unwrap() > 0.5, "{ridge}");
    }
}

/// A recording whose only press is in these of 1000 rows, of an exact force and two noisy readings.
fn one_press(press: std::ops::Range<usize>) -> TempDir {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let rows = (0..1000).map(|row| {
        let phase = (row as f64 - press.start as f64 + 0.5) / press.len() as f64;
        let force = if press.contains(&row) {
            5.0 * (std::f64::consts::PI * phase).sin()
        } else {
            0.0
        };
        let [a, b] = [0.3 * force, force.sqrt()].map(|value| value + rng.random_range(-0.03..0.03));
        format!("{a},{b},{force}")
    });
    written("a,b,force", rows)
}

#[test]
fn a_single_press_is_learnt_wherever_it_is_and_what_its_test_lacks_is_said() {
    for press in [0..100, 250..350, 450..550, 880..980] {
        let folder = one_press(press.clone());
        let train = "train --data r.csv --inputs a,b --targets force --json";
        let said = warnings(&format!("{train} --budget 1 --out n.json"), folder.path());
        let first = if press.start == 880 { 681 } else { press.start + 1 };
        let once = format!("force changes only once, in samples {first} to");
        has(&said, &["force: it is constant in the samples judged", &once]);
        let is_first = said.contains("the first part was held out for testing in its place");
        assert_eq!(is_first, press.start == 880, "{press:?}: {said}");
        // The press itself is learnt.
        success("decode --network n.json --data r.csv --out o.csv", folder.path());
        let force = column(&read(folder.path(), "o.csv"), "force")[press.start + 50];
        assert!((force - 5.0).abs() < 0.5, "{press:?}: {force}");
        let said = warnings(&format!("{train} --folds 5 --hidden 2 --epochs 10"), folder.path());
        has(&said, &["force changes only once"]);
    }
}

/// Three readings of which two determine the target y, at this offset.
fn with_offset(offset: f64) -> TempDir {
    let row = |[a, b, c, noise]: [f64; 4]| format!("{a},{b},{c},{}", offset + a - 0.5 * b + 0.2 * noise);
    written("a,b,c,y", random(12).map(row))
}

#[test]
fn a_large_offset_of_the_target_changes_no_error() {
    let [errors, of_offset] = [0.0, 1e14].map(|offset| {
        let folder = with_offset(offset);
        let report = json(
            "train --data r.csv --inputs a,b,c --targets y --budget 1 --json",
            folder.path(),
        );
        let tried = report["search"]["tried"].as_array().unwrap();
        let error = |model: &str| {
            let of_model = tried
                .iter()
                .filter(|tried| tried["model"] == model || tried["model"].is_object() && model == "network");
            of_model
                .map(|tried| number(tried, "error"))
                .fold(f64::INFINITY, f64::min)
        };
        [error("ridge"), error("network"), number(&report["targets"][0], "r2")]
    });
    for (found, expected) in of_offset.into_iter().zip(errors) {
        assert!((found / expected - 1.0).abs() < 0.05, "{of_offset:?} {errors:?}");
    }
    // Spread of the noise over that of y, (0.2² / (1 + 0.5² + 0.2²))^½.
    assert!((errors[0] / 0.176 - 1.0).abs() < 0.15, "{errors:?}");
    let output = decoupler(
        "train --data r.csv --inputs a,b,c --targets y --budget 1",
        with_offset(1e17).path(),
    );
    let message = String::from_utf8(output.stderr).unwrap();
    has(&message, &["every target is constant in the training set"]);
}

#[test]
fn a_reading_that_equals_the_target_is_named_as_a_possible_leak() {
    let row = |[a, b, noise, tiny]: [f64; 4]| {
        let y = a + 0.3 * b + 0.05 * noise;
        format!("{a},{b},{},{y}", y + 1e-6 * tiny)
    };
    let folder = written("a,b,leak,y", random(13).map(row));
    for command in [
        "train --data r.csv --inputs a,b,leak --targets y --hidden 2 --epochs 10 --json",
        "train --data r.csv --inputs a,b,leak --targets y --hidden 2 --epochs 10 --folds 3 --json",
        "inspect --data r.csv --inputs a,b,leak --targets y --json",
    ] {
        let report = json(command, folder.path());
        let warnings = report["warnings"].to_string();
        has(&warnings, &["leak equals the target y up to scale and offset"]);
        // An error of 1e-6 is certain to be small.
        let asks_for_more =
            warnings.contains("record longer") || report.to_string().contains("twice the samples would");
        assert!(!asks_for_more, "{report}");
    }
    let honest = "train --data r.csv --inputs a,b --targets y --hidden 2 --epochs 10 --json";
    assert!(!warnings(honest, folder.path()).contains("up to scale and offset"));
}

#[test]
fn a_training_on_few_rows_has_one_outcome() {
    let folder = tempfile::tempdir().unwrap();
    for rows in [1, 2, 3, 4, 5, 8] {
        let line = |row: u32| format!("{},{},{}\n", row, row * row % 5, 3 * row + 1);
        let text: String = (0..rows).map(line).collect();
        write(folder.path(), "few.csv", format!("a,b,y\n{text}"));
        for options in ["--split time", "--split random", "--split random --intervals always"] {
            let arguments =
                format!("train --data few.csv --inputs a,b --targets y --hidden 2 --epochs 3 {options} --json");
            let output = decoupler(&arguments, folder.path());
            let (printed, message) = (output.stdout, String::from_utf8(output.stderr).unwrap());
            let has_result = serde_json::from_slice::<serde_json::Value>(&printed).is_ok();
            let has_failed = message.lines().any(|line| line.starts_with("error: "));
            let outcome = (output.status.success(), has_result, printed.is_empty(), has_failed);
            assert!(
                outcome == (true, true, false, false) || outcome == (false, false, true, true),
                "{rows} rows, {options}: {outcome:?}, {message}"
            );
        }
    }
}
