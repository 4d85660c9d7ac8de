//! The table of settings: each row names a setting, explains it, and gives access to its value. Options, fields, axes,
//! reports and checks are loops over these rows, so a new setting is one row.

mod method;
mod rows;
mod training;

pub use method::{
    AdaptiveSettings, ConjugateSettings, Damping, Method, MomentumSettings, RegularizationSettings, ResilientSettings,
};
pub use rows::{Field, Kind, Setting, SettingError, Value};
use training::METHOD;
pub use training::{EPOCHS, StoppingRules, TrainingSettings};
pub(crate) use training::{MIN_MU, STOPPING};
