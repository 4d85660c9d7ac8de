//! Decoders that solve the equations of the sensor.

mod newton;
mod polished;
mod row_search;
#[cfg(test)]
mod tests;

pub use newton::{NewtonDecoder, PosteriorDecoder};
pub use polished::PolishedDecoder;
