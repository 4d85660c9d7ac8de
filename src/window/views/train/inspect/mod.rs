//! Reading errors: what the pointer lights up, the section through the surfaces, and the nodes in a bar of the histogram.

mod lighting;
mod section;

pub use lighting::{
    Lighting, TestPlace, bar_nodes_ui, drawn_nodes, lit_nodes, take_pointed, take_pointed_target, target_of_node,
    with_lights, with_lit_targets,
};
pub use section::{Along, SectionChoice, section_bar_ui, section_of};
