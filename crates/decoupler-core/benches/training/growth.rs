//! Scaling of the time and memory of an epoch with samples, hidden nodes and the array.

use decoupler_core::training::Method;

use crate::{exponent::exponent, memory::peak_mb, problem::Sizes};

pub(crate) fn print() {
    println!("\n## Scaling of Levenberg-Marquardt, one thread\n");
    println!("From 10×10, 12 hidden nodes, 1000 samples. Memory is the peak of a process, minus that of one");
    println!("with next to no work.\n");
    println!("| growing | sizes | milliseconds | exponent | megabytes | exponent |\n|---|---|---|---:|---|---:|");
    row("samples", &[1000, 10_000, 100_000], |samples| {
        Sizes::array(10, 12, samples)
    });
    row("hidden nodes", &[6, 12, 24, 48], |hidden| {
        Sizes::array(10, hidden, 1000)
    });
    row("nodes of a row-wire", &[6, 10, 16, 32], |nodes| {
        Sizes::array(nodes, 12, 1000)
    });
}

fn row(growing: &str, values: &[usize], sizes: impl Fn(usize) -> Sizes) {
    let with = |measure: &dyn Fn(Sizes) -> Option<f64>| -> Option<Vec<f64>> {
        values.iter().map(|&value| measure(sizes(value))).collect()
    };
    let list = |values: &[f64]| {
        values
            .iter()
            .map(|value| format!("{value:.1}"))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let cells = |measured: Option<Vec<f64>>| match measured {
        Some(measured) => format!("{} | {:.2}", list(&measured), exponent(values, &measured)),
        None => "not available | ".to_owned(),
    };
    let min_mb = peak_mb(Sizes::array(1, 1, 1));
    let times = with(&|sizes| Some(sizes.epoch_ms(Method::default(), 1, 9)));
    let memory = with(&|sizes| Some(peak_mb(sizes)? - min_mb?));
    let values = values.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    println!("| {growing} | {values} | {} | {} |", cells(times), cells(memory));
}
