//! The program in fixed point.

use std::fmt::Write;

use super::{header::Header, push_array, source::row_check};
use crate::export::bundle::{
    exported_program::are_positive,
    fixed16::{CONDUCTANCE_BITS, FixedProgram, LARGEST_INPUT, TangentTable},
};

/// Writes the source, which has no floating-point numbers.
pub(super) fn source(header: &Header<'_>, fixed: &FixedProgram) -> String {
    let mut text = format!("#include \"{}_decode.h\"\n\n", header.contents.name);
    for table in &fixed.tables {
        let shape = [&[fixed.rows], &table.shape[..]].concat();
        let values = table.values.iter().map(|value| match table.kind {
            "int64_t" => format!("INT64_C({value})"),
            _ => value.to_string(),
        });
        push_array(&mut text, table.kind, &table.name, &shape, values);
    }
    let has_tangent = fixed.layers.len() > 1;
    if has_tangent {
        let TangentTable { values, error } = &fixed.tangent;
        let _ = writeln!(
            text,
            "/* tanh, in 2^-15: largest error with interpolation {error:.1e}. */"
        );
        push_array(&mut text, "int16_t", "tangents", &[values.len()], values);
    }
    text += &arithmetic(fixed, has_tangent);
    text + &decode(header, fixed)
}

/// Functions on integers.
fn arithmetic(fixed: &FixedProgram, has_tangent: bool) -> String {
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
        if has_tangent { &tangent } else { "" }
    )
}

fn decode(header: &Header<'_>, fixed: &FixedProgram) -> String {
    let (contents, readings, upper) = (header.contents, header.readings, header.upper());
    let refusal = match are_positive(&contents.exported.program) {
        true => format!("        if ({readings}[i] <= 0) {{\n            return {upper}_BAD_READING;\n        }}\n"),
        false => String::new(),
    };
    // A row that only the limits depend on is still checked.
    let is_of_row = fixed.rows > 1;
    let network = if is_of_row { "" } else { "    const int network = 0;\n" };
    let mut text = format!(
        "{signature}\n{{\n{check}{network}    int32_t values_1[{upper}_CHANNELS];\n    \
         for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n{refusal}        \
         values_1[i] = (int32_t)clamped(\n            \
         shifted(changed({readings}[i], centres[network][i]) * factors[network][i], factor_shifts[network][i]),\n            \
         {LARGEST_INPUT});\n    }}\n",
        signature = header.signature(),
        check = row_check(contents, &upper, is_of_row),
    );
    for (index, [inputs, sums]) in fixed.layers.iter().enumerate() {
        let (layer, is_last) = (index + 1, index + 1 == fixed.layers.len());
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
    text + &format!(
        "    answer->readings_outside = 0;\n    for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n        \
         answer->readings_outside += {readings}[i] < lowest[network][i] || {readings}[i] > highest[network][i];\n    }}\n    \
         return {upper}_OK;\n}}\n"
    )
}
