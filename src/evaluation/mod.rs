//! What a decoupler is worth: axis errors as the paper defines them and beyond, the published figures, and a whole
//! run from settings to report.

mod errors;
pub mod experiments;
mod node_spread;
mod published;
mod run;
mod run_error;
mod settings;
mod spread;
mod starts;
mod table;

pub use errors::{Errors, NodeAddress};
pub use node_spread::node_rms_mm;
pub use published::{PublishedErrors, published_errors};
pub use run::{Baselines, Run};
pub use run_error::RunError;
pub use settings::{CountError, MOST_STARTS, RunSettings};
pub use spread::Spread;
pub use starts::{StartRecord, best_start};
pub use table::{ErrorRow, error_rows};
