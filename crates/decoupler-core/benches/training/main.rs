//! Speed of training: `cargo bench -p decoupler-core --bench training`, or one part of it with its name after `--`:
//! `epoch`, `dense`, `sizes`, `growth` or `methods`.
//!
//! Every figure is a median. Figures to be compared are measured in turns within one run, since a machine's speed
//! drifts; only ratios are comparable between runs.
#![expect(clippy::print_stdout, reason = "a benchmark's result is what it prints")]
#![allow(missing_docs)]

mod dense;
mod epoch;
mod exponent;
mod growth;
mod memory;
mod methods;
mod problem;
mod sizes;
mod timing;

fn main() {
    let parts: [(&str, fn()); 5] = [
        ("epoch", epoch::print),
        ("dense", dense::print),
        ("sizes", sizes::print),
        ("growth", growth::print),
        ("methods", methods::print),
    ];
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let Some(sizes) = memory::asked(&arguments) {
        memory::print_peak(sizes);
        return;
    }
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
