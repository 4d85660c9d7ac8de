//! Decoders that solve the equations of the sensor.

mod newton;
mod plain_first;
mod polished;
mod posterior;
mod row_search;
mod row_twins;
#[cfg(test)]
mod tests;

pub use newton::NewtonDecoder;
pub use polished::PolishedDecoder;
pub use posterior::PosteriorDecoder;
