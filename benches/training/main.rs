//! How fast training is: `cargo bench --no-default-features --bench training`.
//!
//! Every figure is a median, and what is compared is measured in turns within the same run, since a machine's speed
//! drifts. Only ratios are worth remembering.
#![expect(clippy::print_stdout, reason = "a benchmark's result is what it prints")]
#![allow(missing_docs)]

mod dense;
mod epoch;
mod growth;
mod timing;

fn main() {
    epoch::print();
    dense::print();
    growth::print();
}
