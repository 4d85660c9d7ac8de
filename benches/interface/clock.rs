//! Wall-clock time of frames, and processor time if the system reports it.

use std::time::Duration;

/// Time that this thread has spent on a processor (Linux). It is exact after a sleep only.
pub fn on_processor() -> Option<Duration> {
    let schedstat = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds = schedstat.split_whitespace().next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}

pub fn print_head() {
    println!("{:<60} {:>23} {:>13}", "ms per frame", "wall clock", "processor");
    println!("{:<60} {:>7} {:>7} {:>7} {:>13}", "", "p50", "p95", "max", "mean");
}

/// Prints the quantiles of the wall-clock times of frames, which include interruptions by other threads, and the mean
/// of their processor times, which do not.
pub fn print_row(name: &str, mut wall: Vec<Duration>, processor: Option<Duration>) {
    let frames = wall.len();
    wall.sort_unstable();
    let ms = |time: Duration| format!("{:.2}", 1e3 * time.as_secs_f64());
    let quantile = |share: f64| {
        let place = ((frames as f64 * share) as usize).min(frames.saturating_sub(1));
        wall.get(place).map_or_else(|| "–".to_owned(), |time| ms(*time))
    };
    let [p50, p95, max] = [0.5, 0.95, 1.0].map(quantile);
    let mean = processor.map_or_else(|| "–".to_owned(), |whole| ms(whole / frames.max(1) as u32));
    println!("{name:<60} {p50:>7} {p95:>7} {max:>7} {mean:>13}");
}
