//! What a decoupler is worth: axis errors as the paper defines them and beyond, the published figures, and a whole
//! run from settings to report.

mod errors;
pub mod experiments;
mod published;
mod reference;
mod row_networks;
mod run;
mod run_error;
mod settings;
mod spread;
mod starts;
mod table;

pub use errors::{Errors, NodeAddress};
pub use published::{PublishedErrors, published_errors};
pub use reference::reference_errors;
pub use row_networks::{RowTraining, train_row_networks};
pub use run::{Baselines, Run};
pub use run_error::RunError;
pub use settings::{CountError, MOST_STARTS, RunSettings};
pub use spread::Spread;
pub use starts::{StartRecord, best_start};
pub use table::{ErrorRow, error_rows};
