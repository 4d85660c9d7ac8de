use std::fmt::Write;

use super::{
    metadata::{coordinate_names, reading_names},
    portable::Portable,
    vectors::Vector,
};

/// Writes the golden vectors as CSV: the row-wire from 1 where it is an argument, readings in ohm, coordinates in mm.
pub(super) fn golden_csv(portable: &Portable, vectors: &[Vector]) -> String {
    let mut names = reading_names(portable);
    names.extend(coordinate_names(portable));
    if portable.takes_row() {
        names.insert(0, "row".to_owned());
    }
    let mut text = names.join(",") + "\n";
    for vector in vectors {
        let mut fields: Vec<String> = Vec::new();
        if portable.takes_row() {
            fields.push((vector.network + 1).to_string());
        }
        let numbers = vector.readings_ohm.iter().chain(&vector.coordinates_mm);
        fields.extend(numbers.map(f64::to_string));
        let _ = writeln!(text, "{}", fields.join(","));
    }
    text
}
