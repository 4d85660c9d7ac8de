//! Surfaces: constants, planes, units, gaps, on arrays from one node up.

use decoupler_core::surface::SurfaceMap;

use crate::judge::{Job, Verdict, refused, wrong};

const ROOM: &str = "surface";

/// Node positions along one axis.
fn axis(count: usize, first_mm: f64, pitch_mm: f64) -> Vec<f64> {
    (0..count).map(|index| first_mm + pitch_mm * index as f64).collect()
}

/// Judges the surface of `value` at the nodes against `value` itself at every grid point within them.
fn judge(x_mm: &[f64], y_mm: &[f64], value: impl Fn(f64, f64) -> f64, share: f64) -> Verdict {
    let map = match SurfaceMap::new(x_mm, y_mm) {
        Ok(map) => map,
        Err(error) => return refused(&error),
    };
    let nodes: Vec<f64> = x_mm
        .iter()
        .flat_map(|&x| y_mm.iter().map(move |&y| (x, y)))
        .map(|(x, y)| value(x, y))
        .collect();
    let largest = nodes.iter().map(|value| value.abs()).fold(0.0, f64::max);
    let surface = map.evaluate(&nodes);
    let grid = map.grid();
    let mut worst = 0.0_f64;
    for (ix, &x) in grid.x_mm().iter().enumerate() {
        for (iy, &y) in grid.y_mm().iter().enumerate().filter(|&(iy, _)| grid.is_inside(ix, iy)) {
            let error = (surface[grid.index(ix, iy)] - value(x, y)).abs();
            if error.is_nan() {
                return wrong("the surface has a point that is not a number");
            }
            worst = worst.max(error);
        }
    }
    if worst <= share * largest {
        Verdict::Right
    } else {
        wrong(format!(
            "within the nodes the surface is off by {:.1e} of its largest value",
            worst / largest
        ))
    }
}

/// The grid points nearest to each node have its value, to within the slope between neighbours.
fn judge_press(x_mm: &[f64], y_mm: &[f64]) -> Verdict {
    let map = match SurfaceMap::new(x_mm, y_mm) {
        Ok(map) => map,
        Err(error) => return refused(&error),
    };
    let (middle_x, middle_y) = (x_mm.len() / 2, y_mm.len() / 2);
    let nodes: Vec<f64> = (0..x_mm.len() * y_mm.len())
        .map(|node| {
            if node == middle_x * y_mm.len() + middle_y {
                4.0
            } else {
                5.0
            }
        })
        .collect();
    let surface = map.evaluate(&nodes);
    let grid = map.grid();
    let inside = (0..grid.x_mm().len()).flat_map(|ix| (0..grid.y_mm().len()).map(move |iy| (ix, iy)));
    let values = inside
        .filter(|&(ix, iy)| grid.is_inside(ix, iy))
        .map(|(ix, iy)| surface[grid.index(ix, iy)]);
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    // A spline overshoots a single step of 1 mm by a quarter of it at most.
    if low >= 3.7 && high <= 5.3 && low <= 4.3 {
        Verdict::Right
    } else {
        wrong(format!(
            "a press of one node by 1 mm at 5 mm is drawn from {low:.2} to {high:.2} mm"
        ))
    }
}

fn judge_gap(x_mm: &[f64], y_mm: &[f64], missing: f64) -> Verdict {
    let map = match SurfaceMap::new(x_mm, y_mm) {
        Ok(map) => map,
        Err(error) => return refused(&error),
    };
    let mut nodes = vec![5.0; x_mm.len() * y_mm.len()];
    nodes[0] = missing;
    let surface = map.evaluate(&nodes);
    let is_sound = |value: &f64| !value.is_finite() || (*value - 5.0).abs() < 1e-6;
    if surface.iter().all(is_sound) {
        Verdict::Right
    } else {
        wrong("next to a missing node the surface is neither level nor missing")
    }
}

pub(crate) fn jobs() -> Vec<Job> {
    let mut jobs = Vec::new();
    let arrays = [
        (1, 1),
        (1, 2),
        (1, 10),
        (2, 1),
        (10, 1),
        (2, 2),
        (2, 3),
        (3, 2),
        (3, 3),
        (2, 10),
        (10, 10),
        (32, 32),
        (40, 40),
    ];
    for (rows, nodes) in arrays {
        for (unit, origin) in [(1.0, 8.0), (1e-6, 0.0), (1e-3, 0.0), (1e3, 0.0), (1e6, 0.0), (1.0, 1e6)] {
            let (x_mm, y_mm) = (axis(rows, origin, unit), axis(nodes, -origin, 2.0 * unit));
            let on = format!("{rows}×{nodes}, pitch {unit:e} mm from {origin:e} mm");
            for level in [5.0, 1e-6, 1e6] {
                let (x_mm, y_mm) = (x_mm.clone(), y_mm.clone());
                let sentence = format!("{on}, level at {level:e} mm");
                jobs.push(Job::one(ROOM, "constants", sentence, move || {
                    judge(&x_mm, &y_mm, |_, _| level, 1e-9)
                }));
            }
            let plane = (x_mm.clone(), y_mm.clone());
            // Across a single row or column, the slope of a plane is undetermined.
            let slope_x = if rows > 1 { 0.3 / unit } else { 0.0 };
            let slope_y = if nodes > 1 { -0.1 / unit } else { 0.0 };
            let value = move |x: f64, y: f64| 5.0 + slope_x * (x - origin) + slope_y * (y + origin);
            let sentence = format!("{on}, a plane");
            // Coordinates themselves round at large origins.
            let share = 1e-9_f64.max(1e-14 * origin / unit);
            jobs.push(Job::one(ROOM, "planes", sentence, move || {
                judge(&plane.0, &plane.1, value, share)
            }));
            let press = (x_mm.clone(), y_mm.clone());
            let sentence = format!("{on}, one node pressed by 1 mm");
            jobs.push(Job::one(ROOM, "one node pressed", sentence, move || {
                judge_press(&press.0, &press.1)
            }));
            for missing in [f64::NAN, f64::INFINITY] {
                let gap = (x_mm.clone(), y_mm.clone());
                let sentence = format!("{on}, a node of {missing}");
                jobs.push(Job::one(ROOM, "missing nodes", sentence, move || {
                    judge_gap(&gap.0, &gap.1, missing)
                }));
            }
        }
    }
    let odd: [(&str, Vec<f64>, Vec<f64>); 6] = [
        ("no rows", vec![], vec![1.0]),
        ("two rows at one place", vec![1.0, 1.0], vec![1.0, 2.0]),
        ("rows 1e-300 mm apart", vec![0.0, 1e-300], vec![1.0, 2.0]),
        ("rows 1e300 mm apart", vec![0.0, 1e300], vec![1.0, 2.0]),
        ("a row at NaN", vec![f64::NAN, 1.0], vec![1.0, 2.0]),
        ("unsorted rows", vec![3.0, 1.0, 2.0], vec![1.0, 2.0]),
    ];
    for (sentence, x_mm, y_mm) in odd {
        jobs.push(Job::one(ROOM, "odd places", sentence, move || {
            judge(&x_mm, &y_mm, |_, _| 5.0, 1e-9)
        }));
    }
    jobs
}
