use super::{
    header::{Header, push_out_of_range},
    number, push_array, type_name,
};
use crate::export::bundle::{
    layers::Layer,
    meaning::Meaning,
    portable::Portable,
    weights::{Arithmetic, Digits, Weights, names},
};
use decoupler_core::network::Quantity;

/// Declarations of the interface in floating point.
pub(super) fn header<'a>(
    name: &'a str,
    portable: &'a Portable,
    arithmetic: Arithmetic,
    notes: &'a [String],
) -> Header<'a> {
    Header {
        name,
        portable,
        reading: type_name(arithmetic.rest),
        readings: portable.meaning.readings(),
        coordinate: type_name(arithmetic.rest),
        coordinates: portable.meaning.outputs(),
        units: match portable.meaning {
            Meaning::Array(_) => "Resistances are in ohm, coordinates in mm.",
            Meaning::Own { .. } => "",
        },
        definitions: "",
        notes,
    }
}

/// Writes the source.
pub(super) fn source(header: &Header<'_>, weights: &Weights) -> String {
    let portable = header.portable;
    let arithmetic = weights.arithmetic;
    let mut text = format!(
        "#include \"{}_decode.h\"\n\n#include <float.h>\n#include <math.h>\n\n",
        header.name
    );
    if arithmetic.wide_layers > 0 {
        text += "/* The first steps are computed in double: their large products nearly cancel. */\n";
    }
    for table in weights.tables(portable) {
        let shape = [&[weights.maps.len()], &table.shape[..]].concat();
        let sizes: String = shape.iter().map(|size| format!("[{size}]")).collect();
        let declaration = format!("static const {} {}{sizes}", type_name(table.digits), table.name);
        let values = table.values.iter().map(|&value| number(table.digits, value));
        push_array(&mut text, &declaration, &shape, values);
    }
    text += &layers(header, arithmetic);
    push_decode(&mut text, header, arithmetic.rest);
    if let Some(ranges) = portable.known_ranges() {
        let rest = arithmetic.rest;
        let limits = ranges.iter().flat_map(|range| range.limits.iter().copied());
        let limits = limits.map(|(low, high)| (number(rest, low), number(rest, high)));
        push_out_of_range(&mut text, header, limits);
    }
    text
}

/// The function that computes all layers of a map.
fn layers(header: &Header<'_>, arithmetic: Arithmetic) -> String {
    let (portable, upper) = (header.portable, header.upper());
    let (plain, wide) = (type_name(arithmetic.rest), type_name(arithmetic.of_layer(0)));
    let (readings, channels) = (header.readings, portable.channels);
    let centre = format!("{}[map][i]", portable.meaning.centre());
    let change = match portable.quantity {
        Quantity::Resistance | Quantity::Raw => format!("reading - {centre}"),
        Quantity::Conductance => format!("({centre} - reading) / reading"),
        Quantity::LogResistance => {
            format!(
                "log1p{}((reading - {centre}) / {centre})",
                suffix(arithmetic.of_layer(0))
            )
        }
    };
    let mut text = format!(
        "static void decode_by(int map, const {plain} {readings}[{upper}_CHANNELS], {plain} outputs[{upper}_OUTPUTS])\n\
         {{\n    \
         {wide} changes[{channels}];\n    \
         for (int i = 0; i < {channels}; ++i) {{\n        \
         const {wide} reading = {readings}[i];\n        \
         changes[i] = {change};\n    \
         }}\n"
    );
    let mut values = Values {
        name: "changes".to_owned(),
        count: channels,
        digits: arithmetic.of_layer(0),
    };
    for (index, (layer, names)) in portable.layers().iter().zip(names(portable.layers())).enumerate() {
        let digits = arithmetic.of_layer(index);
        let result = Values {
            name: format!("{}_values", names.result),
            count: layer.outputs(values.count),
            digits,
        };
        text += &format!("    {} {}[{}];\n", type_name(digits), result.name, result.count);
        text += &statements(layer, &names.tables, &values, &result);
        values = result;
    }
    text + &format!(
        "    for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n        \
         outputs[k] = {};\n    \
         }}\n\
         }}\n\n",
        values.at("k", arithmetic.rest)
    )
}

/// An array of values in the function.
struct Values {
    name: String,
    count: usize,
    digits: Digits,
}

impl Values {
    /// An element in these digits.
    fn at(&self, index: &str, digits: Digits) -> String {
        if self.digits == digits {
            format!("{}[{index}]", self.name)
        } else {
            format!("({}){}[{index}]", type_name(digits), self.name)
        }
    }
}

fn suffix(digits: Digits) -> &'static str {
    if digits == Digits::Single { "f" } else { "" }
}

/// Statements that compute the values of a layer.
fn statements<T>(layer: &Layer<T>, tables: &[String], inputs: &Values, result: &Values) -> String {
    let (digits, name, count) = (result.digits, &result.name, result.count);
    let (kind, f) = (type_name(digits), suffix(digits));
    match layer {
        Layer::Affine(_) => sums(tables, inputs, result),
        Layer::Tanh => format!(
            "    for (int j = 0; j < {count}; ++j) {{\n        \
             {name}[j] = tanh{f}({});\n    \
             }}\n",
            inputs.at("j", digits)
        ),
        Layer::Gaussians { .. } => format!(
            "    for (int j = 0; j < {count}; ++j) {{\n        \
             {kind} square = 0;\n        \
             for (int i = 0; i < {n}; ++i) {{\n            \
             const {kind} apart = {input} - {centres}[map][i][j];\n            \
             square += apart * apart;\n        \
             }}\n        \
             {name}[j] = exp{f}(-square);\n    \
             }}\n",
            n = inputs.count,
            input = inputs.at("i", digits),
            centres = tables[0],
        ),
    }
}

/// Statements for sums of weighted values and biases.
fn sums(tables: &[String], inputs: &Values, result: &Values) -> String {
    let (name, count) = (&result.name, result.count);
    format!(
        "    for (int j = 0; j < {count}; ++j) {{\n        \
         {name}[j] = {biases}[map][j];\n    \
         }}\n    \
         for (int i = 0; i < {n}; ++i) {{\n        \
         for (int j = 0; j < {count}; ++j) {{\n            \
         {name}[j] += {input} * {weights}[map][i][j];\n        \
         }}\n    \
         }}\n",
        n = inputs.count,
        input = inputs.at("i", result.digits),
        weights = tables[0],
        biases = tables[1],
    )
}

fn push_decode(text: &mut String, header: &Header<'_>, rest: Digits) {
    let (upper, quantity) = (header.upper(), header.portable.quantity);
    let plain = type_name(rest);
    let largest = if rest == Digits::Single { "FLT_MAX" } else { "DBL_MAX" };
    let (readings, coordinates) = (header.readings, header.coordinates);
    let is_invalid = match quantity {
        Quantity::Raw => format!("!({readings}[i] >= -{largest} && {readings}[i] <= {largest})"),
        _ => format!("!({readings}[i] > 0 && {readings}[i] <= {largest})"),
    };
    *text += &format!(
        "{signature}\n\
         {{\n    \
         {plain} outputs[{upper}_OUTPUTS];\n\
         {network}    \
         for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n        \
         if ({is_invalid}) {{\n            \
         return {upper}_BAD_READING;\n        \
         }}\n    \
         }}\n    \
         decode_by(network, {readings}, outputs);\n    \
         for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n        \
         if (!(outputs[k] >= -{largest} && outputs[k] <= {largest})) {{\n            \
         return {upper}_BAD_READING;\n        \
         }}\n    \
         }}\n    \
         for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n        \
         {coordinates}[k] = outputs[k];\n    \
         }}\n    \
         return {upper}_OK;\n\
         }}\n\n",
        signature = header.decode_signature(),
        network = header.network_of_row(),
    );
}
