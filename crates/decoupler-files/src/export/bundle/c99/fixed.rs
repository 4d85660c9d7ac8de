use super::{
    header::{Header, push_out_of_range},
    long, push_array,
};
use crate::export::bundle::{
    fixed_point::{CONDUCTANCE_BITS, FixedNetwork, FixedNetworks, HiddenWidth, LogTable, TangentTable, Units},
    meaning::Meaning,
    portable::Portable,
};
use decoupler_core::network::Quantity;

/// Declarations of the interface in fixed point.
pub(super) fn header<'a>(
    name: &'a str,
    portable: &'a Portable,
    networks: &FixedNetworks,
    [units, definitions]: [&'a str; 2],
) -> Header<'a> {
    Header {
        name,
        portable,
        reading: "int32_t",
        readings: readings(portable, networks),
        coordinate: "int32_t",
        coordinates: outputs(portable),
        units,
        definitions,
        notes: &[],
    }
}

/// Name of the readings, with their unit where they share one.
pub(super) fn readings(portable: &Portable, networks: &FixedNetworks) -> &'static str {
    match (&portable.meaning, networks.readings.first_decimals()) {
        (Meaning::Own { .. }, _) => portable.meaning.readings(),
        (Meaning::Array(_), 9) => "resistances_nanoohm",
        (Meaning::Array(_), 6) => "resistances_microohm",
        (Meaning::Array(_), 3) => "resistances_milliohm",
        (Meaning::Array(_), _) => "resistances_ohm",
    }
}

/// Name of the outputs, with their unit where they share one.
pub(super) fn outputs(portable: &Portable) -> &'static str {
    match portable.meaning {
        Meaning::Array(_) => "coordinates_nm",
        Meaning::Own { .. } => portable.meaning.outputs(),
    }
}

/// The sentences on units.
pub(super) fn units(portable: &Portable, networks: &FixedNetworks) -> String {
    let saturation = "All readings are decoded without overflow: numbers out of range saturate.";
    match portable.meaning {
        Meaning::Array(_) => format!(
            "Readings are integers in units of {:e} ohm, coordinates integers in\n   nanometres. {saturation}\n   Error \
             bound for readings that are not out of range: {:.4} mm.",
            networks.readings.unit(0),
            networks
                .bounds
                .iter()
                .fold(0.0_f64, |largest, &bound| largest.max(bound))
        ),
        Meaning::Own { .. } => {
            let bounds: Vec<String> = networks.bounds.iter().map(|bound| format!("{bound:.2e}")).collect();
            format!(
                "Readings and targets are integers in the units below.\n   {saturation}\n   Error bounds of the \
                 targets for readings that are not out of range: {}.",
                bounds.join(", ")
            )
        }
    }
}

/// Units of own data as initialisers of arrays; empty for an array, whose names contain the units.
pub(super) fn unit_definitions(name: &str, portable: &Portable, networks: &FixedNetworks) -> String {
    if let Meaning::Array(_) = portable.meaning {
        return String::new();
    }
    let define = |what: &str, units: &Units| {
        let units: Vec<String> = units.all().map(|unit| format!("{unit:e}")).collect();
        format!(
            "#define {}_{what}_UNITS {{ {} }}\n",
            name.to_uppercase(),
            units.join(", ")
        )
    };
    format!(
        "/* Units of the integers, in proportion to the units of the columns. */\n{}{}\n",
        define("READING", &networks.readings),
        define("TARGET", &networks.outputs)
    )
}

/// Writes the source.
pub(super) fn source(header: &Header<'_>, networks: &FixedNetworks) -> String {
    let (upper, rows) = (header.upper(), networks.networks.len());
    let mut text = format!(
        "#include \"{name}_decode.h\"\n\n#define HIDDEN {hidden}\n\n",
        name = header.name,
        hidden = networks.hidden
    );
    let sizes = [
        ("HIDDEN", networks.hidden),
        ("CHANNELS", header.portable.channels),
        ("OUTPUTS", header.portable.outputs),
    ];
    let mut array = |name: &str, kind: &str, shape: &[usize], of: &dyn Fn(&FixedNetwork) -> Vec<String>| {
        let bracket = |&axis: &usize| match sizes[axis].0 {
            "HIDDEN" => "[HIDDEN]".to_owned(),
            size => format!("[{upper}_{size}]"),
        };
        let brackets: String = shape.iter().map(bracket).collect();
        let shape: Vec<_> = std::iter::once(rows)
            .chain(shape.iter().map(|&axis| sizes[axis].1))
            .collect();
        let values = networks.networks.iter().flat_map(of);
        push_array(
            &mut text,
            &format!("static const {kind} {name}[{rows}]{brackets}"),
            &shape,
            values,
        );
    };
    array("centres", "int32_t", &[1], &|network| texts(&network.centres));
    array("factors", "int32_t", &[1], &|network| texts(&network.factors));
    array("factor_shifts", "uint8_t", &[1], &|network| {
        texts(&network.factor_shifts)
    });
    array("hidden_weights", hidden_type(networks), &[0, 1], &|network| {
        texts(&network.hidden_weights)
    });
    array("hidden_biases", "int64_t", &[0], &|network| {
        longs(&network.hidden_biases)
    });
    array("hidden_shifts", "uint8_t", &[0], &|network| {
        texts(&network.hidden_shifts)
    });
    array("output_weights", "int16_t", &[2, 0], &|network| {
        texts(&network.output_weights)
    });
    array("output_biases", "int64_t", &[2], &|network| {
        longs(&network.output_biases)
    });
    array("output_shifts", "uint8_t", &[2], &|network| {
        texts(&network.output_shifts)
    });
    let table = &networks.tangent.values;
    text += &format!(
        "/* tanh, in 2^-15: largest error with interpolation {:.1e}. */\n",
        networks.tangent.error()
    );
    push_array(
        &mut text,
        &format!("static const int16_t tangents[{}]", table.len()),
        &[table.len()],
        table,
    );
    if networks.quantity == Quantity::LogResistance {
        let table = &networks.logarithm.values;
        text += &format!(
            "/* ln(1 + i/256), in 2^-26: largest error of the logarithm {:.1e}. */\n",
            LogTable::ERROR
        );
        push_array(
            &mut text,
            &format!("static const int32_t logarithms[{}]", table.len()),
            &[table.len()],
            table,
        );
    }
    text += &arithmetic(networks.quantity);
    text += &decode(header, networks);
    let limits = networks
        .networks
        .iter()
        .flat_map(|network| network.limits.iter().copied());
    let limits = limits.map(|(low, high)| (low.to_string(), high.to_string()));
    push_out_of_range(&mut text, header, limits);
    text
}

/// Type of the hidden weights, and of their products.
fn hidden_type(networks: &FixedNetworks) -> &'static str {
    match networks.hidden_width {
        HiddenWidth::Sixteen => "int16_t",
        HiddenWidth::TwentyFour => "int32_t",
    }
}

fn texts<T: ToString>(values: &[T]) -> Vec<String> {
    values.iter().map(T::to_string).collect()
}

fn longs(values: &[i64]) -> Vec<String> {
    values.iter().map(|&value| long(value)).collect()
}

fn arithmetic(quantity: Quantity) -> String {
    let tangent = format!(
        "/* value / 2^bits, rounded to the nearest. A negative number is not shifted, which C leaves open. */\n\
         static int64_t shifted(int64_t value, int bits)\n{{\n    \
         if (bits == 0) {{\n        return value;\n    }}\n    \
         value += INT64_C(1) << (bits - 1);\n    \
         return value >= 0 ? value >> bits : ~(~value >> bits);\n}}\n\n\
         static int64_t clamped(int64_t value, int64_t largest)\n{{\n    \
         return value > largest ? largest : value < -largest ? -largest : value;\n}}\n\n\
         /* tanh of an argument in 2^-{fraction}, in 2^-15. */\n\
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
    let change = match quantity {
        Quantity::Resistance | Quantity::Raw => "    return (int64_t)reading - centre;\n".to_owned(),
        Quantity::Conductance => format!(
            "    return clamped(((int64_t)centre - reading) * (INT64_C(1) << {CONDUCTANCE_BITS}) / reading, \
             INT64_C(1) << 31);\n"
        ),
        Quantity::LogResistance => {
            let rest = 30 - LogTable::INDEX_BITS;
            format!(
                "    int exponent = 30;\n    int64_t normal, rest, quotient, square, cube;\n    \
                 while ((reading >> exponent) == 0) {{\n        --exponent;\n    }}\n    \
                 normal = (int64_t)reading << (30 - exponent);\n    \
                 rest = normal & {mask};\n    \
                 quotient = (rest << {quotient}) / (normal - rest);\n    \
                 square = (quotient * quotient) >> {quotient};\n    \
                 cube = (square * quotient) >> {quotient};\n    \
                 return ((exponent * INT64_C({ln_2}) + {half}) >> {bits}) + logarithms[((normal - rest) >> {rest}) - {entries}] +\n        \
                 ((quotient - square / 2 + cube / 3) >> {less}) - centre;\n",
                mask = (1 << rest) - 1,
                quotient = LogTable::QUOTIENT_BITS,
                ln_2 = LogTable::LN_2,
                half = 1 << (LogTable::LN_2_BITS - 1),
                bits = LogTable::LN_2_BITS,
                entries = 1 << LogTable::INDEX_BITS,
                less = LogTable::QUOTIENT_BITS - LogTable::FRACTION_BITS,
            )
        }
    };
    let about = match quantity {
        Quantity::Resistance | Quantity::Raw => "Difference between a reading and the centre of its channel",
        Quantity::Conductance => "Relative difference between the conductance and the centre of its channel, in 2^-30",
        Quantity::LogResistance => "Difference between the logarithm and the centre of its channel, in 2^-26",
    };
    format!("{tangent}/* {about}. */\nstatic int64_t changed(int32_t reading, int32_t centre)\n{{\n{change}}}\n\n")
}

fn decode(header: &Header<'_>, networks: &FixedNetworks) -> String {
    let width = networks.hidden_width;
    let product = match width {
        HiddenWidth::Sixteen => "int32_t",
        HiddenWidth::TwentyFour => "int64_t",
    };
    let (upper, readings) = (header.upper(), header.readings);
    let refusal = if networks.quantity == Quantity::Raw {
        String::new()
    } else {
        format!("        if ({readings}[i] <= 0) {{\n            return {upper}_BAD_READING;\n        }}\n")
    };
    format!(
        "{signature}\n{{\n    \
         int32_t changes[{upper}_CHANNELS];\n    \
         int32_t activations[HIDDEN];\n\
         {network}    \
         for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n\
         {refusal}        \
         changes[i] = (int32_t)clamped(\n            \
         shifted(changed({readings}[i], centres[network][i]) * factors[network][i], factor_shifts[network][i]),\n            \
         {largest_change});\n    }}\n    \
         for (int j = 0; j < HIDDEN; ++j) {{\n        \
         int64_t sum = hidden_biases[network][j];\n        \
         for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n            \
         sum += ({product})hidden_weights[network][j][i] * changes[i];\n        }}\n        \
         activations[j] = tangent((int32_t)clamped(shifted(sum, hidden_shifts[network][j]), {largest}));\n    }}\n    \
         for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n        \
         int64_t sum = output_biases[network][k];\n        \
         for (int j = 0; j < HIDDEN; ++j) {{\n            \
         sum += (int32_t)output_weights[network][k][j] * activations[j];\n        }}\n        \
         {outputs}[k] = (int32_t)clamped(shifted(sum, output_shifts[network][k]), INT32_MAX);\n    }}\n    \
         return {upper}_OK;\n}}\n\n",
        signature = header.decode_signature(),
        network = header.network_of_row(),
        largest_change = width.largest_change(),
        largest = TangentTable::LARGEST,
        outputs = header.coordinates,
    )
}
