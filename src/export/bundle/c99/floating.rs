use super::{
    header::{Header, push_out_of_range},
    literal::{number, push_array, type_name},
};
use crate::{
    export::bundle::{
        meaning::Meaning,
        portable::Portable,
        weights::{Arithmetic, Digits, RoundedNetwork, Weights},
    },
    network::Quantity,
};

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
    let Arithmetic { hidden, rest } = weights.arithmetic;
    let (upper, rows) = (header.upper(), portable.networks.len());
    let mut text = format!(
        "#include \"{}_decode.h\"\n\n#include <float.h>\n#include <math.h>\n",
        header.name
    );
    text += &format!("\n#define HIDDEN {}\n\n", portable.hidden);
    if hidden != rest {
        text += "/* The sums of the hidden nodes are computed in double: their large products nearly cancel. */\n";
    }
    let mut array = |array: &str, digits: Digits, shape: &[(&str, usize)], of: fn(&RoundedNetwork) -> &Vec<f64>| {
        let brackets: String = shape.iter().map(|(size, _)| format!("[{size}]")).collect();
        let declaration = format!("static const {} {array}[{rows}]{brackets}", type_name(digits));
        let shape: Vec<usize> = std::iter::once(rows)
            .chain(shape.iter().map(|&(_, size)| size))
            .collect();
        let values = weights.networks.iter().flat_map(of).map(|&value| number(digits, value));
        push_array(&mut text, &declaration, &shape, values);
    };
    let (channels, outputs) = (format!("{upper}_CHANNELS"), format!("{upper}_OUTPUTS"));
    let channels = (channels.as_str(), portable.channels);
    let outputs = (outputs.as_str(), portable.outputs);
    let nodes = ("HIDDEN", portable.hidden);
    array(portable.meaning.centre(), hidden, &[channels], |network| {
        &network.centre
    });
    array("hidden_weights", hidden, &[channels, nodes], |network| {
        &network.hidden_weights
    });
    array("hidden_biases", hidden, &[nodes], |network| &network.hidden_biases);
    array("output_weights", rest, &[nodes, outputs], |network| {
        &network.output_weights
    });
    array("output_biases", rest, &[outputs], |network| &network.output_biases);
    push_decode(&mut text, header, weights.arithmetic);
    if let Some(ranges) = portable.ranges() {
        let limits = ranges.iter().flat_map(|range| range.limits.iter().copied());
        let limits = limits.map(|(low, high)| (number(rest, low), number(rest, high)));
        push_out_of_range(&mut text, header, limits);
    }
    text
}

fn push_decode(text: &mut String, header: &Header<'_>, Arithmetic { hidden, rest }: Arithmetic) {
    let (upper, quantity) = (header.upper(), header.portable.quantity);
    let (wide, plain) = (type_name(hidden), type_name(rest));
    let largest = if rest == Digits::Single { "FLT_MAX" } else { "DBL_MAX" };
    let (readings, coordinates) = (header.readings, header.coordinates);
    let is_invalid = match quantity {
        Quantity::Raw => format!("!({readings}[i] >= -{largest} && {readings}[i] <= {largest})"),
        _ => format!("!({readings}[i] > 0 && {readings}[i] <= {largest})"),
    };
    let suffix = |digits: Digits| if digits == Digits::Single { "f" } else { "" };
    let centre = format!("{}[network][i]", header.portable.meaning.centre());
    let change = match quantity {
        Quantity::Resistance | Quantity::Raw => format!("reading - {centre}"),
        Quantity::Conductance => format!("({centre} - reading) / reading"),
        Quantity::LogResistance => format!("log1p{}((reading - {centre}) / {centre})", suffix(hidden)),
    };
    let reading = if hidden == rest {
        format!("{readings}[i]")
    } else {
        format!("({wide}){readings}[i]")
    };
    let sum = if hidden == rest {
        "sums[j]".to_owned()
    } else {
        format!("({plain})sums[j]")
    };
    *text += &format!(
        "{signature}\n\
         {{\n    \
         {wide} sums[HIDDEN];\n\
         {network}    \
         for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n        \
         if ({is_invalid}) {{\n            \
         return {upper}_BAD_READING;\n        \
         }}\n    \
         }}\n    \
         for (int j = 0; j < HIDDEN; ++j) {{\n        \
         sums[j] = hidden_biases[network][j];\n    \
         }}\n    \
         for (int i = 0; i < {upper}_CHANNELS; ++i) {{\n        \
         const {wide} reading = {reading};\n        \
         const {wide} change = {change};\n        \
         for (int j = 0; j < HIDDEN; ++j) {{\n            \
         sums[j] += change * hidden_weights[network][i][j];\n        \
         }}\n    \
         }}\n    \
         for (int j = 0; j < HIDDEN; ++j) {{\n        \
         if (isnan(sums[j])) {{\n            \
         return {upper}_BAD_READING;\n        \
         }}\n    \
         }}\n    \
         for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n        \
         {coordinates}[k] = output_biases[network][k];\n    \
         }}\n    \
         for (int j = 0; j < HIDDEN; ++j) {{\n        \
         const {plain} activation = tanh{tanh}({sum});\n        \
         for (int k = 0; k < {upper}_OUTPUTS; ++k) {{\n            \
         {coordinates}[k] += activation * output_weights[network][j][k];\n        \
         }}\n    \
         }}\n    \
         return {upper}_OK;\n\
         }}\n\n",
        signature = header.decode_signature(),
        network = header.network_of_row(),
        tanh = suffix(rest),
    );
}
