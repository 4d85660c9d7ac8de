//! Helpers that several integration tests share.

pub(crate) mod rasterise;
