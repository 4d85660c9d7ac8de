//! The views, one room each. None knows another.

pub mod compare;
pub mod experiments;
pub mod identifiability;
pub mod trade_off;
pub mod train;
