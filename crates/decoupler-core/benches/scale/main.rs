//! Large arrays and many samples: `cargo bench -p decoupler-core --bench scale`, or one part of it with its name
//! after `--`: `arrays`, `growth` or `samples`.
//!
//! One thread; medians. Only ratios and exponents are comparable between machines.
#![expect(clippy::print_stdout, reason = "a benchmark's result is what it prints")]
#![allow(missing_docs, clippy::unwrap_used)]

mod array;
mod arrays;
#[path = "../training/exponent.rs"]
mod exponent;
mod growth;
#[path = "../arithmetic/row.rs"]
mod row_arithmetic;
mod samples;
#[path = "../training/timing.rs"]
mod timing;
#[path = "../arithmetic/untrained.rs"]
mod untrained;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let Some(count) = samples::asked(&arguments) {
        samples::print_peak(count);
        return;
    }
    let parts: [(&str, fn()); 3] = [
        ("arrays", arrays::print),
        ("growth", growth::print),
        ("samples", samples::print),
    ];
    // Arguments with two dashes come from cargo.
    let named: Vec<&String> = arguments.iter().filter(|name| !name.starts_with("--")).collect();
    for name in &named {
        assert!(parts.iter().any(|(part, _)| part == name), "there is no part {name}");
    }
    for (_, print) in parts
        .iter()
        .filter(|(part, _)| named.is_empty() || named.iter().any(|name| name == part))
    {
        print();
    }
}
