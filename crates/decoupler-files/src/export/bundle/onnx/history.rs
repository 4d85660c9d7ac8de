//! The state of a history in a graph: whether it has started, the latest time, the latest readings (the newest first), and
//! the averages.

use decoupler_core::decoupling::Precision;

use super::Printer;

const DOUBLE: Precision = Precision::Double;

impl Printer<'_> {
    /// Adds the features of the readings `now` (1 × channels, double), and the next state.
    pub(super) fn add_history(&mut self, now: &str, name: &str) {
        let history = self.contents.history().expect("there is a history");
        let (builder, constants) = (&mut self.builder, &history.constants);
        let (kept, averages, channels) = (constants.longest_lag(), constants.averages.len(), constants.channels);
        let axis = builder.whole(&[1], &[0]);
        let [zero, usual] = [0.0, constants.interval_s].map(|value| builder.scalar(DOUBLE, value));
        let started = builder.rows("state", 0..1, &axis);
        let has_started = builder.op("Greater", &[&started, &zero]);
        let latest = builder.rows("state", 1..2, &axis);
        let elapsed = builder.op("Sub", &["time_s", &latest]);
        let steps_back = builder.op("Less", &[&elapsed, &zero]);
        let mut restarts = builder.op("Not", &[&has_started]);
        restarts = builder.op("Or", &[&restarts, &steps_back]);
        if history.pause_s.is_finite() {
            let longest = builder.scalar(DOUBLE, history.pause_s);
            let is_pause = builder.op("Greater", &[&elapsed, &longest]);
            restarts = builder.op("Or", &[&restarts, &is_pause]);
        }
        let is_unknown = builder.op("IsNaN", &[&elapsed]);
        let is_usual = builder.op("Or", &[&is_unknown, &restarts]);
        let elapsed = builder.op("Where", &[&is_usual, &usual, &elapsed]);
        let no_time = builder.op("IsNaN", &["time_s"]);
        let nan = builder.scalar(DOUBLE, f64::NAN);
        let before = builder.op("Where", &[&has_started, &latest, &nan]);
        let next_time = builder.op("Where", &[&no_time, &before, "time_s"]);
        // Each row of the past becomes the readings at a restart.
        let mut next_rows = Vec::new();
        let one = builder.scalar(DOUBLE, 1.0);
        let size = builder.whole(&[2], &[1, channels as i64]);
        next_rows.push(builder.op("Expand", &[&one, &size]));
        next_rows.push(next_time);
        let mut past = Vec::new();
        if kept > 0 {
            let of_state = builder.rows("state", 2..2 + kept, &axis);
            let of_state = builder.op("Where", &[&restarts, now, &of_state]);
            let lags: Vec<i64> = constants.lags.iter().map(|lag| *lag as i64 - 1).collect();
            let lags = builder.whole(&[lags.len()], &lags);
            past.push(builder.with("Gather", &[&of_state, &lags], &[("axis", 0)]));
            next_rows.push(now.to_owned());
            if kept > 1 {
                next_rows.push(builder.rows(&of_state, 0..kept - 1, &axis));
            }
        }
        if averages > 0 {
            let of_state = builder.rows("state", 2 + kept..2 + kept + averages, &axis);
            let of_state = builder.op("Where", &[&restarts, now, &of_state]);
            let (per_second, per_reading) = history.rates();
            let per_second = builder.numbers("per_second", DOUBLE, &[averages, 1], per_second.into_iter());
            let per_reading = builder.numbers("per_reading", DOUBLE, &[averages, 1], per_reading.into_iter());
            let exponent = builder.op("Mul", &[&elapsed, &per_second]);
            let exponent = builder.op("Add", &[&exponent, &per_reading]);
            // 1 − exp(−e) = 2t/(1 + t) with t = tanh(e/2), which loses no digits of small exponents.
            let (half, two) = (builder.scalar(DOUBLE, 0.5), builder.scalar(DOUBLE, 2.0));
            let halved = builder.op("Mul", &[&exponent, &half]);
            let tangent = builder.op("Tanh", &[&halved]);
            let doubled = builder.op("Mul", &[&two, &tangent]);
            let more = builder.op("Add", &[&one, &tangent]);
            let weights = builder.op("Div", &[&doubled, &more]);
            let apart = builder.op("Sub", &[now, &of_state]);
            let step = builder.op("Mul", &[&weights, &apart]);
            let next = builder.op("Add", &[&of_state, &step]);
            past.push(next.clone());
            next_rows.push(next);
        }
        let names = Vec::from_iter(past.iter().map(String::as_str));
        let mut past = builder.with("Concat", &names, &[("axis", 0)]);
        if constants.differences {
            past = builder.op("Sub", &[now, &past]);
        }
        let shape = builder.whole(&[2], &[1, -1]);
        let line = builder.op("Reshape", &[&past, &shape]);
        builder.named("Concat", &[now, &line], &[("axis", 1)], name);
        // The latest time fills every column.
        next_rows[1] = builder.op("Expand", &[&next_rows[1].clone(), &size]);
        let names = Vec::from_iter(next_rows.iter().map(String::as_str));
        self.next_state = Some(builder.with("Concat", &names, &[("axis", 0)]));
    }
}
