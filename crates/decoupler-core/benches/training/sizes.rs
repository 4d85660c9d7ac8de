//! Time per epoch of every method at every size.

use decoupler_core::training::Method;

use crate::problem::Sizes;

pub(crate) fn print() {
    let sizes = [
        ("10×6", Sizes::array(6, 12, 1000)),
        ("10×8", Sizes::array(8, 12, 1000)),
        ("10×10", Sizes::array(10, 12, 1000)),
        ("10×32", Sizes::array(32, 12, 1000)),
        ("6 hidden", Sizes::array(10, 6, 1000)),
        ("24 hidden", Sizes::array(10, 24, 1000)),
        ("64 hidden", Sizes::array(10, 64, 1000)),
        ("100 samples", Sizes::array(10, 12, 100)),
        ("10 000", Sizes::array(10, 12, 10_000)),
        ("100 000", Sizes::array(10, 12, 100_000)),
    ];
    println!("\n## Epochs, milliseconds, one thread\n");
    println!("12 hidden nodes and 1000 samples; other values for 10×10.\n");
    println!("| method |{} |", sizes.map(|(name, _)| format!(" {name}")).join(" |"));
    println!("|---|{}", "---:|".repeat(sizes.len()));
    for method in Method::all() {
        let cells = sizes.map(|(_, sizes)| format!(" {:.3}", sizes.epoch_ms(method, 1, 9)));
        println!("| {method} |{} |", cells.join(" |"));
    }
    let lm = Method::default();
    println!("\n## Levenberg-Marquardt at its limits, milliseconds\n");
    println!("| | 1 thread | 2 threads |\n|---|---:|---:|");
    for (what, sizes, epochs) in [
        ("10×10, 12 hidden, 1000 samples", Sizes::array(10, 12, 1000), 15),
        ("10×10, 64 hidden, 1000 samples", Sizes::array(10, 64, 1000), 9),
        ("10×10, 12 hidden, 100 000 samples", Sizes::array(10, 12, 100_000), 5),
        ("10×32_5×96, 64 hidden, 2000 samples", Sizes::array(32, 64, 2000), 9),
        ("10×32_5×96, 256 hidden, 2000 samples", Sizes::array(32, 256, 2000), 3),
    ] {
        let [one, two] = [1, 2].map(|threads| sizes.epoch_ms(lm, threads, epochs));
        println!("| {what} | {one:.1} | {two:.1} |");
    }
}
