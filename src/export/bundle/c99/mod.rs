//! Bundles as one C99 header and one source, with a self-test.

mod compiler;
mod fixed;
mod floating;
mod header;
mod iteration;
mod literal;
mod selftest;

use self::{
    header::Header,
    selftest::{SelfTest, WholeNumbers},
};
use super::{
    fixed_point::FixedNetworks,
    portable::Portable,
    vectors::{Deviation, Vector},
    weights::Weights,
};

pub(super) use self::{
    compiler::{Compiled, run_self_test},
    fixed::{outputs, readings},
};

/// Files of a bundle: names and contents.
pub(super) type Files = Vec<(String, String)>;

/// Writes header, source and self-test in floating point.
pub(super) fn write_floating(
    name: &str,
    portable: &Portable,
    weights: &Weights,
    vectors: &[Vector],
    limits: Deviation,
    notes: &[String],
) -> Files {
    let header = floating::header(name, portable, weights.arithmetic, notes);
    let self_test = SelfTest {
        header: &header,
        vectors,
        limits,
        whole: None,
    };
    files(&header, floating::source(&header, weights), self_test.text())
}

/// Writes header, source and self-test in whole numbers.
pub(super) fn write_fixed(
    name: &str,
    portable: &Portable,
    networks: &FixedNetworks,
    vectors: &[Vector],
    limit: f64,
) -> Files {
    let units = fixed::units(portable, networks);
    let definitions = fixed::unit_definitions(name, portable, networks);
    let header = fixed::header(name, portable, networks, [&units, &definitions]);
    let self_test = SelfTest {
        header: &header,
        vectors,
        limits: Deviation {
            total: limit,
            of_arithmetic: limit,
        },
        whole: Some(WholeNumbers {
            readings_per_one: (0..portable.channels)
                .map(|channel| networks.readings.per_one(channel))
                .collect(),
            units: networks.outputs.all().collect(),
            bits: vectors.iter().flat_map(|vector| bits_of(networks, vector)).collect(),
        }),
    };
    files(&header, fixed::source(&header, networks), self_test.text())
}

fn bits_of(networks: &FixedNetworks, vector: &Vector) -> Vec<i32> {
    networks.decode(vector.row, &vector.readings).unwrap_or_default()
}

fn files(header: &Header<'_>, source: String, self_test: String) -> Files {
    let name = header.name;
    vec![
        (format!("{name}_decode.h"), header.text()),
        (format!("{name}_decode.c"), source),
        (format!("{name}_selftest.c"), self_test),
    ]
}
