use super::{portable::Portable, vectors::Vector};
use decoupler_core::text::inert;

/// Writes the golden vectors as CSV: the row from 1 where it is an argument, readings, outputs.
pub(super) fn golden_csv(portable: &Portable, vectors: &[Vector]) -> String {
    let meaning = &portable.meaning;
    let row = portable.takes_row().then(|| "row".to_owned());
    let names = row.into_iter().chain(
        meaning
            .inputs()
            .into_iter()
            .chain(meaning.targets())
            .map(|channel| inert(&channel.name)),
    );
    // The names of users may have commas.
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut write = |fields: Vec<String>| writer.write_record(fields).expect("memory takes everything");
    write(names.collect());
    for vector in vectors {
        let row = portable.takes_row().then(|| (vector.row + 1).to_string());
        let numbers = vector.readings.iter().chain(&vector.answers).map(f64::to_string);
        write(row.into_iter().chain(numbers).collect());
    }
    let bytes = writer.into_inner().expect("memory takes everything");
    String::from_utf8_lossy(&bytes).into_owned()
}
