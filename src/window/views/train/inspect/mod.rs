//! Reading errors: what the pointer lights up, the section through the surfaces, and the nodes in a bar of the histogram.

mod bar_nodes;
mod lighting;
mod lights;
mod place;
mod section;

pub use bar_nodes::bar_nodes_ui;
pub use lighting::{lit_nodes, take_pointed, take_pointed_target, with_lights, with_lit_targets};
pub use lights::Lighting;
pub use place::{TestPlace, drawn_nodes, target_of_node};
pub use section::{Along, SectionChoice, section_bar_ui, section_of};
