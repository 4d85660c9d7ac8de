//! The program in fixed point.

use std::fmt::Write;

use super::{header::Header, push_array, source::row_check};
use crate::export::bundle::fixed16::{
    CONDUCTANCE_BITS, FixedLayer, FixedProgram, FixedRow, LARGEST_INPUT, TangentTable,
};

/// Writes the source, which has no floating-point numbers.
pub(super) fn source(header: &Header<'_>, fixed: &FixedProgram) -> String {
    let (contents, upper) = (header.contents, header.upper());
    let (rows, channels) = (fixed.rows.len(), contents.channels());
    let mut text = format!("#include \"{}_decode.h\"\n\n", contents.name);
    let layers = fixed.rows[0].layers.len();
    let mut push = |kind: &str, name: &str, shape: &[usize], of: &dyn Fn(&FixedRow) -> Vec<String>| {
        let shape = [&[rows], shape].concat();
        push_array(&mut text, kind, name, &shape, fixed.rows.iter().flat_map(of));
    };
    push("int32_t", "centres", &[channels], &|row| texts(&row.centres));
    push("int32_t", "factors", &[channels], &|row| texts(&row.factors));
    push("uint8_t", "factor_shifts", &[channels], &|row| texts(&row.shifts));
    for (index, FixedLayer { inputs, biases, .. }) in fixed.rows[0].layers.iter().enumerate() {
        let name = |of: &str| format!("{of}_{}", index + 1);
        let long = |value: &i64| format!("INT64_C({value})");
        let sums = biases.len();
        push("int16_t", &name("weights"), &[sums, *inputs], &|row| {
            texts(&row.layers[index].weights)
        });
        push("int64_t", &name("biases"), &[sums], &|row| {
            row.layers[index].biases.iter().map(long).collect()
        });
        push("uint8_t", &name("sum_shifts"), &[sums], &|row| {
            texts(&row.layers[index].shifts)
        });
    }
    if contents.exported.outside.is_some() {
        let limits = |row: &FixedRow, pick: fn(&(i32, i32)) -> i32| texts(&Vec::from_iter(row.limits.iter().map(pick)));
        push("int32_t", "lowest", &[channels], &|row| limits(row, |limits| limits.0));
        push("int32_t", "highest", &[channels], &|row| limits(row, |limits| limits.1));
    }
    if layers > 1 {
        let TangentTable { values, error } = &fixed.tangent;
        let _ = writeln!(
            text,
            "/* tanh, in 2^-15: largest error with interpolation {error:.1e}. */"
        );
        push_array(&mut text, "int16_t", "tangents", &[values.len()], values);
    }
    text += &arithmetic(fixed, layers);
    text + &decode(header, fixed, &upper)
}

fn texts<T: ToString>(values: &[T]) -> Vec<String> {
    values.iter().map(T::to_string).collect()
}

/// Functions on integers.
fn arithmetic(fixed: &FixedProgram, layers: usize) -> String {
    let tangent = format!(
        "/* tanh of an argument in 2^-{fraction}, in 2^-15. */\n\
         static int32_t tangent(int32_t argument)\n{{\n    \
         const int32_t size = argument < 0 ? -argument : argument;\n    \
         const int32_t low = tangents[size >> {step}];\n    \
         const int32_t high = tangents[(size >> {step}) + 1];\n    \
         const int32_t value = low + (((high - low) * (size & {mask}) + {half}) >> {step});\n    \
         return argument < 0 ? -value : value;\n}}\n\n",
        fraction = TangentTable::FRACTION_BITS,
        step = TangentTable::STEP_BITS,
        mask = (1 << TangentTable::STEP_BITS) - 1,
        half = 1 << (TangentTable::STEP_BITS - 1),
    );
    let (about, change) = match fixed.is_relative {
        false => (
            "Difference between a reading and the centre of its channel",
            "(int64_t)reading - centre".to_owned(),
        ),
        true => (
            "Relative difference between a reading and the centre of its channel, in 2^-30",
            format!(
                "clamped(((int64_t)reading - centre) * (INT64_C(1) << {CONDUCTANCE_BITS}) / reading, INT64_C(1) << 31)"
            ),
        ),
    };
    format!(
        "/* value / 2^bits, rounded to the nearest. A negative number is not shifted, which C leaves open. */\n\
         static int64_t shifted(int64_t value, int bits)\n{{\n    \
         if (bits == 0) {{\n        return value;\n    }}\n    \
         value += INT64_C(1) << (bits - 1);\n    \
         return value >= 0 ? value >> bits : ~(~value >> bits);\n}}\n\n\
         static int64_t clamped(int64_t value, int64_t largest)\n{{\n    \
         return value > largest ? largest : value < -largest ? -largest : value;\n}}\n\n\
         {}/* {about}. */\nstatic int64_t changed(int32_t reading, int32_t centre)\n{{\n    return {change};\n}}\n\n",
        if layers > 1 { &tangent } else { "" }
    )
}

fn decode(header: &Header<'_>, fixed: &FixedProgram, upper: &str) -> String {
    let contents = header.contents;
    let readings = header.readings;
    let refusal = match contents.exported.are_positive() {
        true => format!("        if ({readings}[i] <= 0) {{\n            return {upper}_BAD_READING;\n        }}\n"),
        false => String::new(),
    };
    let network = match contents.takes_row() && fixed.rows.len() > 1 {
        true => String::new(),
        false => "    const int network = 0;\n".to_owned(),
    };
    // A row that only the limits depend on is still checked.
    let mut text = format!(
        "{signature}\n{{\n{check}{network}    int32_t values_1[{upper}_CHANNELS];\n    \
         for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n{refusal}        \
         values_1[i] = (int32_t)clamped(\n            \
         shifted(changed({readings}[i], centres[network][i]) * factors[network][i], factor_shifts[network][i]),\n            \
         {LARGEST_INPUT});\n    }}\n",
        signature = header.signature(),
        check = match fixed.rows.len() {
            1 => row_check(contents, upper).replace("    const int network = row - 1;\n", ""),
            _ => row_check(contents, upper),
        },
    );
    let layers = &fixed.rows[0].layers;
    for (index, FixedLayer { inputs, biases, .. }) in layers.iter().enumerate() {
        let (layer, sums, is_last) = (index + 1, biases.len(), index + 1 == layers.len());
        let clamped =
            |largest: &str| format!("(int32_t)clamped(shifted(sum, sum_shifts_{layer}[network][k]), {largest})");
        let (target, value) = match is_last {
            true => (format!("answer->{}[k]", header.outputs), clamped("INT32_MAX")),
            false => (
                format!("values_{}[k]", layer + 1),
                format!("tangent({})", clamped(&TangentTable::LARGEST.to_string())),
            ),
        };
        if !is_last {
            let _ = writeln!(text, "    int32_t values_{}[{sums}];", layer + 1);
        }
        let _ = write!(
            text,
            "    for (int k = 0; k < {sums}; ++k) {{\n        int64_t sum = biases_{layer}[network][k];\n        \
             for (int i = 0; i < {inputs}; ++i) {{\n            \
             sum += (int32_t)weights_{layer}[network][k][i] * values_{layer}[i];\n        }}\n        \
             {target} = {value};\n    }}\n"
        );
    }
    if contents.exported.outside.is_some() {
        let _ = write!(
            text,
            "    answer->readings_outside = 0;\n    for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n        \
             answer->readings_outside += {readings}[i] < lowest[network][i] || {readings}[i] > highest[network][i];\n    }}\n"
        );
    }
    text + &format!("    return {upper}_OK;\n}}\n")
}
