//! Decoders that solve the equations of the sensor.

mod newton;
mod polished;
mod posterior;
mod row_search;
#[cfg(test)]
mod tests;

pub use newton::NewtonDecoder;
pub use polished::PolishedDecoder;
pub use posterior::PosteriorDecoder;
