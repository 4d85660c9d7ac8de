//! Bundles as one C99 header and one source, with a self-test.

mod compiler;
mod fixed;
mod floating;
mod header;
mod iteration;
mod literal;
mod selftest;

use self::{
    fixed::readings,
    header::Header,
    selftest::{SelfTest, WholeNumbers},
};
use super::{
    choice::BundlePrecision,
    draft::{Call, Draft},
    error::BundleError,
    fixed_point::FixedNetworks,
    meaning::Meaning,
    portable::Portable,
    report::BundleCheck,
    vectors::{Deviation, Vector},
    weights::Weights,
};

pub(super) use self::compiler::{Compiled, run_self_test};

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

/// Writes the sources in floating point, compiles them where there is a compiler, and runs the self-test.
///
/// # Errors
/// They cannot be written, compiled or run.
pub(super) fn export(draft: &mut Draft<'_>) -> Result<Vec<BundleCheck>, BundleError> {
    let (portable, weights, golden) = (draft.portable, draft.weights, draft.vectors.golden());
    for (name, text) in write_floating(draft.name, portable, weights, golden, draft.limits, draft.remarks) {
        draft.write(&name, text)?;
    }
    let mut checks = vec![BundleCheck::of("model of the C source", draft.deviation_of(weights))];
    match run_self_test(draft.folder.path(), draft.name)? {
        Compiled::Ran { deviation } => checks.push(BundleCheck::of("C source, compiled and run", deviation)),
        Compiled::NoCompiler(why) => draft.remarks.push(format!("the C source was not compiled: {why}")),
    }
    Ok(checks)
}

/// How to call it, for the README.
pub(super) fn call(call: &Call<'_>) -> String {
    let portable = call.portable;
    let (name, takes_row, upper) = (call.name, portable.takes_row(), call.name.to_uppercase());
    let meaning = &portable.meaning;
    let (input, output) = (meaning.readings(), meaning.outputs());
    let row = if takes_row { "1, " } else { "" };
    let (reading, readings, coordinate, coordinates) = match (call.fixed, call.precision) {
        (Some(fixed), _) => (
            "int32_t",
            readings(portable, fixed),
            "int32_t",
            fixed::outputs(portable),
        ),
        (None, BundlePrecision::Single) => ("float", input, "float", output),
        (None, _) => ("double", input, "double", output),
    };
    let range = if portable.known_ranges().is_some() {
        format!(
            "\nint outside = {name}_is_out_of_range({row}{readings}); counts the readings beyond the range seen in \
             training."
        )
    } else {
        String::new()
    };
    let explained = if call.tells_unexplained() {
        format!(
            "\nWhere no deformation explains the readings to 1e-10, as with noise, it is {upper}_NOT_EXPLAINED and the\n\
             coordinates are the best found."
        )
    } else {
        String::new()
    };
    let library = if call.fixed.is_some() { "" } else { " -lm" };
    let units = match (call.fixed, meaning) {
        (Some(_), Meaning::Own { .. }) => format!(
            "\nReadings and targets are whole numbers of the units {upper}_READING_UNITS and {upper}_TARGET_UNITS \
             in the header:\nround(reading / unit) goes in, and unit * number comes out."
        ),
        _ => String::new(),
    };
    format!(
        "    #include \"{name}_decode.h\"\n    \
         {reading} {readings}[{upper}_CHANNELS];\n    \
         {coordinate} {coordinates}[{upper}_OUTPUTS];\n    \
         int status = {name}_decode({row}{readings}, {coordinates});\n\n\
         The status is {upper}_OK, or the reason why there is no answer. Compile {name}_decode.c with your program{libm}. The\n\
         self-test compares the golden vectors:\n\n    \
         cc -std=c99 -O2 {name}_decode.c {name}_selftest.c -lm -o selftest && ./selftest\n{units}{range}{explained}",
        libm = if library.is_empty() { "" } else { ", and link with -lm" },
    )
}
