use crate::window::{
    shared::Shared,
    test_view::{Positions, RecordedTest, TestView},
};
use decoupler_core::evaluation::NodeAddress;

/// Place of a value of the test set: its snapshot, and its node among those drawn. Of a recording the snapshot is a sample,
/// and a node a target: by its number on the surface through the targets, or by its own where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TestPlace {
    /// From 0.
    pub snapshot: usize,
    /// `None` for what is not drawn.
    pub node: Option<usize>,
}

impl TestPlace {
    /// Place of a node of an array.
    pub fn of_node(address: NodeAddress, test: &TestView) -> Self {
        Self {
            snapshot: address.snapshot,
            node: test.node(address),
        }
    }
}

/// Number among the nodes drawn of a target.
pub fn node_of_target(test: &RecordedTest, target: usize) -> Option<usize> {
    match &test.positions {
        Positions::Surface(through) => through.nodes().iter().position(|node| node.target == target),
        _ => Some(target),
    }
}

/// Target of a node drawn.
pub fn target_of_node(test: &RecordedTest, node: usize) -> Option<usize> {
    match &test.positions {
        Positions::Surface(through) => Some(through.nodes().get(node)?.target),
        _ => Some(node),
    }
}

/// Number of nodes that the pointer can light up.
pub fn drawn_nodes(shared: &Shared, of_frame: usize) -> usize {
    match shared.recorded_test() {
        Some(test) if !matches!(test.positions, Positions::Surface(_)) => test.set.outputs(),
        _ => of_frame,
    }
}
